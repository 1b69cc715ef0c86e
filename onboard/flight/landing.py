"""The autopilot's own landing: asked for until it is taken, and watched until the vehicle is down."""

from __future__ import annotations

import math

from onboard.flight.autopilot import AutopilotLink
from onboard.flight.custody import Holder
from onboard.flight.failsafes import Condition
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandOutcome

__all__ = ["Landing"]

COMMAND_RETRY_S = 1.0


class Landing:
    """Lands one vehicle where it is.

    Args:
        link: The autopilot.

    Attributes:
        taken: Whether the autopilot has taken it over, so that it needs no stream any more.
    """

    def __init__(self, link: AutopilotLink) -> None:
        self.taken = False
        self._link = link
        self._shown = False
        self._asked_s = -math.inf

    def begin(self, *, standing: bool) -> None:
        """Land; who still stands needs no stream until then."""
        self.taken = standing
        self._shown = False
        self._asked_s = -math.inf

    def down(self, time_s: float, holder: Holder) -> bool:
        """Whether it is down; asks for the landing mode unless that shows or the autopilot's own failsafe has it."""
        heard, behaviour = self._link.heard, self._link.behaviour
        if heard.stands:
            return True
        if heard.mode == behaviour.land_mode:
            self.taken = self._shown = True
        recently = 0.0 <= time_s - self._asked_s < COMMAND_RETRY_S  # by a clock that may be set back
        asked = self._link.busy(mavlink.MAV_CMD_DO_SET_MODE) or recently
        if heard.mode != behaviour.land_mode and not asked and holder is not Holder.AUTOPILOT:
            self._asked_s = time_s
            self._link.ask(behaviour.mode(behaviour.land_mode), time_s)
        return False

    def accepted(self, outcome: CommandOutcome) -> None:
        """The autopilot does what was asked for."""
        if outcome.command == mavlink.MAV_CMD_DO_SET_MODE:
            self.taken = True

    def seen(self) -> dict[Condition, str]:
        """Who has taken over a vehicle that was landing."""
        heard = self._link.heard
        other = heard.mode != self._link.behaviour.land_mode and heard.armed and not heard.failsafe
        return {Condition.TAKEN_OVER: f"mode {self._link.mode_name}"} if self._shown and other else {}
