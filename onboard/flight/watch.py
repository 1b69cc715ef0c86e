"""What one vehicle's autopilot gives reason to worry about: the ladder's conditions, as they are seen now."""

from __future__ import annotations

import math

from onboard.config.flight import FlightConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.custody import Custody, Holder
from onboard.flight.failsafes import Condition
from onboard.flight.launch import HEARTBEAT_LAG_S

__all__ = ["FLIGHT", "FlightWatch"]

TALKS_S = 0.5
"""An autopilot of which anything was heard within this time talks."""

FLIGHT = frozenset(
    {
        Condition.LANDING_ORDERED,
        Condition.PROCESS_ENDS,
        Condition.TAKEN_OVER,
        Condition.ARMING_REFUSED,
        Condition.NOT_LAUNCHED,
        Condition.LAYER_NOT_REACHED,
        Condition.AUTOPILOT_FAILSAFE,
        Condition.FAILSAFE_LASTS,
        Condition.POSITION_STALE,
        Condition.POSITION_LOST,
        Condition.POSITION_UNAIDED,
        Condition.POSITION_FROZEN,
        Condition.POSITION_JUMPS,
        Condition.PLANNER_LATE,
        Condition.PLANNER_CRASHED,
        Condition.PLANNER_HANGS,
        Condition.NO_FEASIBLE_PLAN,
        Condition.PLAN_FLOWN_OUT,
        Condition.FENCE_NEAR,
        Condition.OBSTACLE_NEAR,
        Condition.TEAMMATE_NEAR,
        Condition.PEER_LOST,
        Condition.PARTITION,
    }
)
"""Conditions that end, without a word, when the vehicle is no longer flown."""

_BATTERY = (Condition.BATTERY_LOW, Condition.BATTERY_CRITICAL, Condition.BATTERY_EMPTY)
_UNTRUSTED = frozenset(
    {
        Condition.POSITION_STALE,
        Condition.POSITION_LOST,
        Condition.POSITION_UNAIDED,
        Condition.POSITION_FROZEN,
        Condition.POSITION_JUMPS,
    }
)


class FlightWatch:
    """Watches one autopilot.

    Args:
        link: The autopilot, heard.
        config: Thresholds.

    Attributes:
        holder: Who has the vehicle, as of the last look.
        blind: Whether the position must not be relied on, as of the last look.
    """

    def __init__(self, link: AutopilotLink, config: FlightConfig) -> None:
        self._link = link
        self._battery = config.battery
        self._custody = Custody(link)
        self._launched_s = math.inf
        self.holder = Holder.WE
        self.blind = False

    def begin(self, launched_s: float = math.inf) -> None:
        """A flight begins; who has the vehicle shows some time after ``launched_s``, UNIX time."""
        self._custody = Custody(self._link)
        self.holder = Holder.WE
        self.blind = False
        self._launched_s = launched_s

    @property
    def battery_refusal(self) -> str:
        """Why the battery does not let a flight begin; empty if it does."""
        percent = self._link.heard.battery_percent
        worn = percent is not None and percent <= 100.0 * self._battery.critical
        return f"the battery is at {percent} %" if worn else ""

    def seen(self, time_s: float, *, flown: bool) -> dict[Condition, str]:
        """What gives reason to worry at a UNIX time, with details in words.

        Args:
            time_s: UNIX time, s.
            flown: Whether this stack flies the vehicle in the air.
        """
        link = self._link
        alive = link.alive(time_s)
        found: dict[Condition, str] = {}
        if not alive and link.heard.autopilot is not None:
            found[Condition.AUTOPILOT_LOST] = ""
        if link.heard.armed:
            found |= self._worn(link.heard.battery_percent)
        if flown:
            found |= self._position(time_s)
        self.blind = not _UNTRUSTED.isdisjoint(found)
        if flown and alive and time_s - self._launched_s >= HEARTBEAT_LAG_S:
            found |= self._custodian(time_s)
        return found

    def _worn(self, percent: int | None) -> dict[Condition, str]:
        levels = (self._battery.low, self._battery.critical, self._battery.empty)
        if percent is None:
            return {}
        return {
            condition: f"{percent} %"
            for condition, level in zip(_BATTERY, levels, strict=True)
            if percent <= 100.0 * level
        }

    def _position(self, time_s: float) -> dict[Condition, str]:
        link = self._link
        found: dict[Condition, str] = {}
        if not link.has_position(time_s):
            found[Condition.POSITION_STALE] = ""
            if time_s - link.heard.message_s <= TALKS_S:
                found[Condition.POSITION_LOST] = ""
        if link.heard.unaided:
            found[Condition.POSITION_UNAIDED] = ""
        velocity = link.motion.velocity_m_s
        if link.motion.frozen and velocity is not None:
            found[Condition.POSITION_FROZEN] = f"the vehicle moves at {math.hypot(*velocity):.1f} m/s"
        elif link.motion.jumped_m > 0.0:
            found[Condition.POSITION_JUMPS] = f"{link.motion.jumped_m:.1f} m"
        return found

    def _custodian(self, time_s: float) -> dict[Condition, str]:
        verdict = self._custody.judge(self._link.behaviour.guided_mode, time_s)
        self.holder = verdict.holder
        match verdict.holder:
            case Holder.WE:
                return {}
            case Holder.AUTOPILOT:
                return {Condition.AUTOPILOT_FAILSAFE: verdict.reason}
            case Holder.NOBODY | Holder.LANDING:
                return {Condition.FAILSAFE_LASTS: verdict.reason}
            case Holder.ANOTHER:
                return {Condition.TAKEN_OVER: verdict.reason}
