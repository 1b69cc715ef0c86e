"""Arming, modes and failsafes (PX4's commander, measured on 1.15)."""

from __future__ import annotations

import math
from collections.abc import Callable

from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.px4.events import EventLog
from sim_bridge.autopilot.px4.modes import Health, can_arm, can_run, prevents_arming

__all__ = ["Commander"]

CHECK_INTERVAL_S = 0.1
"""The stream of setpoints is looked at ten times a second."""

_BY_COMMAND, _BY_LANDING, _BY_PREFLIGHT_TIMEOUT, _BY_FAILSAFE = 4, 6, 7, 14
"""PX4's reasons for disarming, as its events tell them."""

_DISARM_ACTION = 7
_LOSS_ACTIONS = {
    0: Px4Mode.POSCTL,
    1: Px4Mode.ALTCTL,
    2: Px4Mode.MANUAL,
    3: Px4Mode.RTL,
    4: Px4Mode.LAND,
    5: Px4Mode.LOITER,
    6: Px4Mode.LAND,
}
"""COM_OBL_RC_ACT; termination (6) ends in a landing here."""


class Commander:
    """The state of the vehicle as a whole.

    Args:
        parameters: Delays and failsafe actions.
        say: Called with what the ground should read: MAV_SEVERITY and text.

        events: Where events go.

    Attributes:
        armed: Whether the motors run.
        intended: The mode that was asked for.
        mode: The mode that is active; another one than intended during a failsafe.
        failsafe: Whether a failsafe is active.
    """

    def __init__(self, parameters: ParameterStore, say: Callable[[int, str], None], events: EventLog) -> None:
        self._parameters = parameters
        self._events = events
        self._say = say
        self._mode_after_disarming = Px4Mode.LOITER
        self._armed_s = -math.inf
        self._landed_s: float | None = -math.inf
        self._has_flown = False
        self._next_check_s = -math.inf
        self.armed = False
        self.intended = Px4Mode.LOITER
        self.mode = Px4Mode.LOITER
        self.failsafe = False

    def request_mode(self, mode: Px4Mode, health: Health) -> bool:
        """Change the mode; in the air only to one that can run."""
        if self.armed and not can_run(mode, health):
            self._say(mavlink.MAV_SEVERITY_CRITICAL, f"Switching to {mode.name} is currently not available")
            return False
        self._intend(mode)
        return True

    def ready(self, health: Health) -> bool:
        """SYS_STATUS's prearm bit: whether the active mode can run, and be armed in if it is not yet."""
        return can_run(self.mode, health) if self.armed else can_arm(self.mode, health)

    def arm(self, time_s: float, health: Health, *, force: bool) -> bool:
        """Arm; True if that is done or was already."""
        if self.armed:
            return True
        if not force and not can_arm(self.mode, health):
            self._say(mavlink.MAV_SEVERITY_CRITICAL, "Arming denied: Resolve system health failures first")
            return False
        self.armed = True
        self._armed_s = time_s
        self._landed_s = time_s
        self._has_flown = False
        self._say(mavlink.MAV_SEVERITY_INFO, "Armed by external command")
        self._events.armed()
        return True

    def disarm(self, *, landed: bool, force: bool) -> bool:
        """Disarm; True if that is done or was already. Refused in the air unless forced."""
        if not self.armed:
            return True
        if not landed and not force:
            self._say(mavlink.MAV_SEVERITY_CRITICAL, "Disarming denied! Not landed")
            return False
        self._disarm("Disarmed by external command", _BY_COMMAND)
        return True

    def finish_takeoff(self) -> None:
        """TAKEOFF has reached its height: hold there."""
        self._intend(Px4Mode.LOITER)

    def step(self, time_s: float, health: Callable[[], Health], *, landed: bool) -> None:
        """Check failsafes and disarm a vehicle that has nothing to do; ``health`` is asked when it is needed."""
        if landed and self._landed_s is None:
            self._landed_s = time_s
            self._say(mavlink.MAV_SEVERITY_INFO, "Landing detected")
        elif not landed and self._landed_s is not None:
            self._landed_s = None
            self._has_flown = True
            self._say(mavlink.MAV_SEVERITY_INFO, "Takeoff detected")
            self._events.took_off()
        if self.armed and self._landed_s is not None:
            self._disarm_when_idle(time_s)
        if time_s >= self._next_check_s:
            self._next_check_s = time_s + CHECK_INTERVAL_S
            self._check(health())

    def _intend(self, mode: Px4Mode) -> None:
        self.intended = mode
        self.mode = mode
        self.failsafe = False
        if not prevents_arming(mode):
            self._mode_after_disarming = mode

    def _check(self, health: Health) -> None:
        if not self.armed or can_run(self.intended, health):
            self.mode = self.intended
            self.failsafe = False
            return
        fallback = self._fallback(health)
        if not self.failsafe:
            self._events.failsafe(self.intended, fallback)
        if fallback is None:
            self._disarm("Disarmed by failsafe", _BY_FAILSAFE)
            return
        if not self.failsafe:
            self._say(mavlink.MAV_SEVERITY_CRITICAL, "Failsafe activated")
        self.failsafe = True
        self.mode = fallback

    def _fallback(self, health: Health) -> Px4Mode | None:
        """What replaces a mode that cannot run; None disarms.

        OFFBOARD without a position counts as a lost stream, so COM_OBL_RC_ACT decides there, too. The automatic modes
        fall back on RTL, LAND and at last DESCEND, which needs no position and shows as LAND.
        """
        if self.intended is not Px4Mode.OFFBOARD:
            return Px4Mode.LAND
        action = self._parameters["COM_OBL_RC_ACT"]
        if action == _DISARM_ACTION:
            return None
        mode = _LOSS_ACTIONS.get(int(action), Px4Mode.POSCTL)
        if mode is Px4Mode.POSCTL and not health.local_position:
            return Px4Mode.ALTCTL
        if mode in (Px4Mode.RTL, Px4Mode.LOITER) and not can_run(mode, health):
            return Px4Mode.LAND
        return mode

    def _disarm_when_idle(self, time_s: float) -> None:
        landed_s = self._landed_s if self._landed_s is not None else time_s
        if self._has_flown:
            delay_s = self._parameters["COM_DISARM_LAND"]
            if delay_s > 0.0 and time_s - landed_s >= delay_s:
                self._disarm("Disarmed by landing", _BY_LANDING)
        else:
            delay_s = self._parameters["COM_DISARM_PRFLT"]
            if delay_s > 0.0 and time_s - self._armed_s >= delay_s:
                self._disarm("Disarmed by auto preflight disarming", _BY_PREFLIGHT_TIMEOUT)

    def _disarm(self, text: str, reason: int) -> None:
        self.armed = False
        self._events.disarmed(reason)
        self._intend(self._mode_after_disarming)
        self._say(mavlink.MAV_SEVERITY_INFO, text)
