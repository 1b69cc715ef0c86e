"""Whether a vehicle may begin to fly, or be taken up again in the air, and what is missing until then."""

from __future__ import annotations

import math

from onboard.flight.autopilot import AutopilotLink
from onboard.flight.states import IDLE
from onboard.flight.watch import FlightWatch
from onboard.messages import FlightState

__all__ = ["Readiness"]

LACK_PATIENCE_S = 3.0
"""What is missing for longer is told."""

_BUSY = {
    FlightState.LAND: "the vehicle is landing",
    FlightState.RELEASED: "somebody else has the vehicle",
}


class Readiness:
    """Asks one vehicle's autopilot.

    Args:
        link: The autopilot.
        watch: Knows its battery.
    """

    def __init__(self, link: AutopilotLink, watch: FlightWatch) -> None:
        self._link = link
        self._watch = watch
        self._lack = ("", -math.inf)

    def ready(self, time_s: float) -> bool:
        """Whether the autopilot lacks nothing."""
        return not self._link.lacks(time_s)

    def news(self, time_s: float) -> str | None:
        """What has been missing for a while and was not told yet, in words; called at every tick of waiting."""
        lack = self._link.lacks(time_s)
        known, since_s = self._lack
        if lack != known:
            self._lack = (lack, time_s)
        elif lack and time_s - since_s > LACK_PATIENCE_S:
            self._lack = (lack, math.inf)
            return lack
        return None

    def start_hindrance(self, state: FlightState, time_s: float) -> str:
        """Why a flight may not begin in a state, in words; empty if it may."""
        if state in _BUSY:
            return _BUSY[state]
        if self._link.heard.in_the_air and not self._ours:
            return f"somebody else flies the vehicle, in {self._link.mode_name}"
        if lack := self._link.lacks(time_s):
            return f"the autopilot is not ready: {lack}"
        return self._watch.battery_refusal

    def may_rejoin(self, state: FlightState, time_s: float) -> bool:
        """Whether an idle process finds its vehicle in the air: in the guided mode or a failsafe that a stream ends."""
        known = self._link.alive(time_s) and self._link.has_position(time_s)
        return state in IDLE and known and self._link.heard.in_the_air and self._ours

    @property
    def _ours(self) -> bool:
        """Whether whoever is in the air follows this stack's setpoints, or would if they came."""
        heard, behaviour = self._link.heard, self._link.behaviour
        return heard.mode == behaviour.guided_mode or (heard.failsafe and behaviour.returns_from_failsafe)
