"""Where an action of the failsafe ladder leads from each flight state."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from onboard.flight.failsafes import Action
from onboard.flight.states import AIRBORNE, UNDER_WAY
from onboard.messages import FlightState

__all__ = ["following"]

_S = FlightState

_LEADS: Mapping[Action, Mapping[FlightState, FlightState]] = MappingProxyType(
    {
        Action.WAIT: {_S.TRACK: _S.HOLD},
        Action.HOLD: {_S.TRACK: _S.HOLD},
        Action.RETURN: {_S.ARM: _S.LAND, _S.TAKEOFF: _S.RETURN, _S.HOLD: _S.RETURN, _S.TRACK: _S.RETURN},
        Action.STOP: {_S.TRACK: _S.HOLD, _S.RETURN: _S.HOLD},
        Action.LAND: dict.fromkeys(UNDER_WAY, _S.LAND),
        Action.GIVE_UP: {_S.ARM: _S.STANDBY},
        Action.LET_GO: dict.fromkeys(AIRBORNE, _S.RELEASED),
    }
)
"""Who climbs goes on to do so while it hovers; who is left out has nothing to do."""


def following(action: Action | None, state: FlightState) -> FlightState | None:
    """The state to go to, if any."""
    return None if action is None else _LEADS.get(action, {}).get(state)
