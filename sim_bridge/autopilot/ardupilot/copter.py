"""Armed or not, mode, landed or not, failsafes: the state of a Copter as a whole."""

from __future__ import annotations

import math
from collections.abc import Callable

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.arming import Readiness, arming_failures, prearm_failures
from sim_bridge.autopilot.ardupilot.modes import is_known, needs_position
from sim_bridge.autopilot.core.parameters import ParameterStore

__all__ = ["Copter"]

LANDED_AFTER_S = 1.6
"""So long the vehicle stands on the ground before it counts as landed."""

DISARMED_AFTER_S = 2.08
"""And so long before LAND disarms it: both from the recorded landings."""

EKF_FAILSAFE_S = 1.2
"""From the loss of the position until the failsafe acts on it."""

PREARM_TEXT_PERIOD_S = 30.0

_LANDING_MODES = frozenset({CopterMode.LAND, CopterMode.RTL, CopterMode.SMART_RTL, CopterMode.AUTO_RTL})
_GCS_FAILSAFE_MODES = {
    1: CopterMode.RTL,
    3: CopterMode.SMART_RTL,
    4: CopterMode.SMART_RTL,
    5: CopterMode.LAND,
    7: CopterMode.BRAKE,
}
"""FS_GCS_ENABLE; what is not listed returns."""


class Copter:
    """The commander.

    Args:
        parameters: DISARM_DELAY, FS_EKF_ACTION, FS_GCS_ENABLE, FS_GCS_TIMEOUT.
        say: Called with what it says: MAV_SEVERITY and text.
        readiness: Asked for the state of the arming checks.
        on_mode: Called after a change of the mode.

    Attributes:
        armed: Whether the motors run.
        armed_s: When it was armed, s.
        mode: The flight mode.
        landed: What the land detector says.
        ready: Whether it may be armed: SYS_STATUS's health bit.
        ekf_failsafe: Whether the loss of the position has been acted on.
        gcs_failsafe: Whether the loss of the ground station has.
    """

    def __init__(
        self,
        parameters: ParameterStore,
        say: Callable[[int, str], None],
        readiness: Callable[[], Readiness],
        on_mode: Callable[[], None],
    ) -> None:
        self._parameters = parameters
        self._say = say
        self._readiness = readiness
        self._on_mode = on_mode
        self._touched_s: float | None = -math.inf
        self._lost_s: float | None = None
        self._gcs_s: float | None = None
        self._next_check_s = -math.inf
        self._next_prearm_s: float | None = None
        self.armed = False
        self.armed_s = -math.inf
        self.mode = CopterMode.STABILIZE
        self.landed = True
        self.ready = False
        self.ekf_failsafe = False
        self.gcs_failsafe = False

    @property
    def failsafe(self) -> bool:
        """Whether a failsafe is active."""
        return self.ekf_failsafe or self.gcs_failsafe

    def request_mode(self, custom_mode: int) -> bool:
        """Change the mode; armed only to one that can run."""
        if not is_known(custom_mode):
            self._say(mavlink.MAV_SEVERITY_WARNING, f"No such mode {custom_mode}")
            return False
        mode = CopterMode(custom_mode)
        if self.armed and needs_position(mode) and not self._readiness().position:
            self._say(mavlink.MAV_SEVERITY_WARNING, f"Mode change to {mode.name} failed: requires position")
            return False
        if self.armed and not self.landed and mode is CopterMode.AUTO:
            # There is no mission to fly.
            self._say(mavlink.MAV_SEVERITY_WARNING, "Mode change to AUTO failed: init failed")
            return False
        self._change(mode)
        return True

    def arm(self, time_s: float, *, force: bool) -> bool:
        """Arm; True if that is done or was already."""
        if self.armed:
            return True
        failures = arming_failures(self.mode, self._readiness(), force=force)
        for failure in failures:
            self._say(mavlink.MAV_SEVERITY_CRITICAL, f"Arm: {failure}")
        if failures:
            return False
        self.armed = True
        self.armed_s = time_s
        self._touched_s = time_s
        self._say(mavlink.MAV_SEVERITY_INFO, "Arming motors")
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm; True if that is done or was already. Refused in the air unless forced."""
        if not self.armed:
            return True
        if not self.landed and not force:
            return False
        self.armed = False
        self._say(mavlink.MAV_SEVERITY_INFO, "Disarming motors")
        return True

    def hear_ground_station(self, time_s: float) -> None:
        """A heartbeat of the ground station (MAV_GCS_SYSID) has arrived."""
        self._gcs_s = time_s
        if self.gcs_failsafe:
            self.gcs_failsafe = False
            self._say(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe Cleared")

    def step(self, time_s: float, *, on_ground: bool, lifts_off: bool, position: bool) -> None:
        """Follow the ground contact, and act on what has failed.

        Args:
            time_s: Now, s.
            on_ground: Whether the vehicle stands.
            lifts_off: Whether a takeoff makes it leave the ground.
            position: Whether there is an estimate of the position.
        """
        if not on_ground or lifts_off:
            self._touched_s = None
            # Only a takeoff ends being landed; one that is disarmed counts as landed, wherever it is.
            self.landed = not self.armed or (self.landed and not lifts_off)
        elif self._touched_s is None:
            self._touched_s = time_s
        elif not self.armed or time_s - self._touched_s >= LANDED_AFTER_S:
            self.landed = True
        if self.armed and self._touched_s is not None:
            self._disarm_when_idle(time_s, self._touched_s)
        self._watch_position(time_s, position)
        if time_s >= self._next_check_s:
            self._next_check_s = time_s + 0.1
            self._watch_ground_station(time_s)
            self._check_before_arming(time_s)

    def _change(self, mode: CopterMode) -> None:
        changed = mode is not self.mode
        self.mode = mode
        if changed:
            self._on_mode()

    def _disarm_when_idle(self, time_s: float, touched_s: float) -> None:
        if self.mode in _LANDING_MODES and touched_s > self.armed_s:
            if time_s - touched_s >= DISARMED_AFTER_S:
                self.disarm(force=True)
            return
        delay_s = self._parameters["DISARM_DELAY"]
        if 0 < delay_s <= time_s - max(touched_s, self.armed_s):
            self.disarm(force=True)

    def _watch_position(self, time_s: float, position: bool) -> None:
        if position or not self.armed:
            self._lost_s = None
            self.ekf_failsafe = False
            return
        if self._lost_s is None:
            self._lost_s = time_s
        if self.ekf_failsafe or time_s - self._lost_s < EKF_FAILSAFE_S or not needs_position(self.mode):
            return
        if self._parameters["FS_EKF_ACTION"] == 0:
            return
        self.ekf_failsafe = True
        self._say(mavlink.MAV_SEVERITY_CRITICAL, "EKF Failsafe: changed to LAND Mode")
        self._change(CopterMode.LAND)

    def _watch_ground_station(self, time_s: float) -> None:
        action = self._parameters["FS_GCS_ENABLE"]
        if self.gcs_failsafe or action == 0 or not self.armed or self._gcs_s is None:
            return
        if time_s - self._gcs_s < self._parameters["FS_GCS_TIMEOUT"]:
            return
        self.gcs_failsafe = True
        self._say(mavlink.MAV_SEVERITY_WARNING, "GCS Failsafe")
        mode = _GCS_FAILSAFE_MODES.get(int(action), CopterMode.RTL)
        if self.landed:
            self.disarm(force=True)
        elif needs_position(mode) and not self._readiness().position:
            self._change(CopterMode.LAND)
        else:
            self._change(mode)

    def _check_before_arming(self, time_s: float) -> None:
        """SYS_STATUS tells how the checks stand; every half minute the text does, too."""
        if self.armed:
            self.ready = True
            return
        failures = prearm_failures(self.mode, self._readiness())
        self.ready = not failures
        if self._next_prearm_s is None:
            self._next_prearm_s = time_s + PREARM_TEXT_PERIOD_S
        elif time_s >= self._next_prearm_s:
            self._next_prearm_s = time_s + PREARM_TEXT_PERIOD_S
            for failure in failures:
                self._say(mavlink.MAV_SEVERITY_CRITICAL, f"PreArm: {failure}")
