"""Whose is the vehicle? Judged from mode, arming and failsafe of each heartbeat while we fly it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from onboard.flight.autopilot import AutopilotLink

__all__ = ["Custody", "Holder", "Verdict"]

FAILSAFE_PATIENCE_S = 2.0
"""How long a failsafe that lands, or waits for sticks, may last and still be flown on from: its reason may pass.

After that our stream stops: it would take the vehicle up again from anywhere on its way down.
"""


class Holder(Enum):
    """Who has the vehicle."""

    WE = "we"
    """It follows us."""
    AUTOPILOT = "autopilot"
    """In a failsafe from which it comes back by itself while our stream goes on."""
    NOBODY = "nobody"
    """In a failsafe that lands, or waits for a pilot who did not come: it should be landed."""
    LANDING = "landing"
    """In a failsafe that lands, or has landed, and does not come back."""
    ANOTHER = "another"
    """Somebody else: any command of ours would fight theirs."""


@dataclass(frozen=True, slots=True)
class Verdict:
    """Who has the vehicle, and why.

    Attributes:
        holder: Who.
        reason: In words, for all but WE.
    """

    holder: Holder
    reason: str = ""


class Custody:
    """Remembers since when a failsafe lasts, and how often the autopilot has booted.

    Args:
        link: The autopilot, heard.
    """

    def __init__(self, link: AutopilotLink) -> None:
        self._link = link
        self._boots = link.boots
        self._failsafe_s = math.inf

    def judge(self, mode: int, time_s: float) -> Verdict:
        """Who has the vehicle.

        Args:
            mode: HEARTBEAT.custom_mode that we asked for.
            time_s: UNIX time, s.
        """
        link = self._link
        if link.boots != self._boots:
            return Verdict(Holder.ANOTHER, "the autopilot rebooted")
        if not link.heard.armed:
            if self._failsafe_s < math.inf:
                return Verdict(Holder.LANDING, "autopilot failsafe: it has disarmed")
            return Verdict(Holder.ANOTHER, "disarmed")
        if link.heard.mode == mode:
            self._failsafe_s = math.inf
            return Verdict(Holder.WE)
        if not link.heard.failsafe:
            return Verdict(Holder.ANOTHER, f"mode {link.mode_name}")
        return self._in_failsafe(time_s)

    def _in_failsafe(self, time_s: float) -> Verdict:
        link, behaviour = self._link, self._link.behaviour
        mode = link.heard.mode
        if behaviour.returns_from_failsafe:
            self._failsafe_s = min(self._failsafe_s, time_s)
            final = mode is not None and (behaviour.needs_pilot(mode) or mode == behaviour.land_mode)
            waited = final and time_s - self._failsafe_s > FAILSAFE_PATIENCE_S
            holder = Holder.NOBODY if waited else Holder.AUTOPILOT
        else:
            holder = Holder.LANDING if mode == behaviour.land_mode else Holder.ANOTHER
        ends = "; landing here" if holder in (Holder.NOBODY, Holder.LANDING) else ""
        return Verdict(holder, f"autopilot failsafe: {link.mode_name}{ends}")
