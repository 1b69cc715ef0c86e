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
        if lack := self._link.lacks(time_s):
            return f"the autopilot is not ready: {lack}"
        return self._watch.battery_refusal

    def may_rejoin(self, state: FlightState, time_s: float) -> bool:
        """Whether an idle process finds its vehicle in the air: in the guided mode or a failsafe that a stream ends."""
        link, heard = self._link, self._link.heard
        flies = link.alive(time_s) and heard.armed and heard.on_ground is False and link.has_position(time_s)
        ours = heard.mode == link.behaviour.guided_mode or (heard.failsafe and link.behaviour.returns_from_failsafe)
        return state in IDLE and flies and ours
