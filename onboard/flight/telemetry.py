"""What an autopilot says of itself: mode, arming, health, position and yaw in its own local frame.

HEARTBEAT, SYS_STATUS, EXTENDED_SYS_STATE, LOCAL_POSITION_NED, ATTITUDE
(https://mavlink.io/en/messages/common.html) mean the same with PX4 and ArduPilot; how a number is judged is in
``px4.py`` and ``ardupilot.py``.
"""

from __future__ import annotations

import math

from onboard.protocol import dialect as mavlink

__all__ = ["Telemetry"]

_PREARM_BIT: int = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_VISION_BIT: int = mavlink.MAV_SYS_STATUS_SENSOR_VISION_POSITION
_AIDED_BIT: int = mavlink.ESTIMATOR_PRED_POS_HORIZ_REL
"""PX4 sets it while something measures where it is (EKF2, isHorizontalAidingActive): it goes soon after the last pose,
while POS_HORIZ_REL and _ABS stay for the five seconds that PX4 trusts its inertial sensors."""
_POSITION_TIMEOUT_S = 0.5
_REBOOT_MS = 1000
"""A boot time this much below the last one is another boot's; UDP reorders by less."""
_WRAP_MS = 1 << 31
_ON_GROUND = {mavlink.MAV_STATE_STANDBY: True, mavlink.MAV_STATE_ACTIVE: False}


class Telemetry:
    """What was heard of one autopilot since it booted.

    Attributes:
        autopilot: MAV_AUTOPILOT; None before the first heartbeat.
        mode: HEARTBEAT.custom_mode; None before the first.
        armed: From the last heartbeat.
        failsafe: Whether the last heartbeat said MAV_STATE_CRITICAL or _EMERGENCY.
        heartbeat_s: UNIX time of the last heartbeat.
        on_ground: From EXTENDED_SYS_STATE; None before the first. Of an old ArduPilot, which does not send it,
            from HEARTBEAT: it is in standby where it has landed and active in the air, whether armed or not.
        prearm_ok: SYS_STATUS's pre-arm health bit.
        unhealthy: Names of the enabled sensors that SYS_STATUS calls unhealthy.
        battery_percent: 0..100; None if unknown.
        unaided: Whether the estimate of the position runs on inertial sensors alone: ESTIMATOR_STATUS's flags (PX4), or
            a vision position that is enabled and unhealthy in SYS_STATUS (ArduPilot).
        message_s: UNIX time of the last message.
        local_position: North m, east m, down m in the autopilot's local frame; None before the first.
        local_velocity: North m/s, east m/s with it.
        yaw_rad: Heading; None before the first.
    """

    def __init__(self) -> None:
        self.autopilot: int | None = None
        self.mode: int | None = None
        self.armed = False
        self.failsafe = False
        self.heartbeat_s = -math.inf
        self.on_ground: bool | None = None
        self.prearm_ok = False
        self.unhealthy: tuple[str, ...] = ()
        self.battery_percent: int | None = None
        self.message_s = -math.inf
        self._estimator_unaided = self._vision_unhealthy = False
        self.local_position: tuple[float, float, float] | None = None
        self.local_velocity = (0.0, 0.0)
        self.yaw_rad: float | None = None
        self._position_s = -math.inf
        self._boot_ms: int | None = None
        self._tells_landing = False

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message of this autopilot that arrived at a UNIX time."""
        self.message_s = time_s
        match message:
            case mavlink.MAVLink_heartbeat_message():
                self.heartbeat_s = time_s
                self.autopilot = message.autopilot
                if message.custom_mode != self.mode:
                    self.prearm_ok = False  # what SYS_STATUS said was about the mode before
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self.failsafe = message.system_status in (mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY)
                if message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA and not self._tells_landing:
                    self.on_ground = _ON_GROUND.get(message.system_status, self.on_ground)
            case mavlink.MAVLink_local_position_ned_message():
                if all(math.isfinite(value) for value in (message.x, message.y, message.z)):
                    self.local_position = (message.x, message.y, message.z)
                    if math.isfinite(message.vx) and math.isfinite(message.vy):
                        self.local_velocity = (message.vx, message.vy)
                    self._position_s = time_s
            case mavlink.MAVLink_attitude_message():
                if math.isfinite(message.yaw):
                    self.yaw_rad = message.yaw
            case mavlink.MAVLink_sys_status_message():
                self.prearm_ok = bool(message.onboard_control_sensors_health & _PREARM_BIT)
                self.unhealthy = _sensor_names(
                    message.onboard_control_sensors_enabled & ~message.onboard_control_sensors_health & ~_PREARM_BIT
                )
                self._vision_unhealthy = bool(
                    message.onboard_control_sensors_enabled & ~message.onboard_control_sensors_health & _VISION_BIT
                )
                self.battery_percent = message.battery_remaining if message.battery_remaining >= 0 else None
            case mavlink.MAVLink_estimator_status_message():
                self._estimator_unaided = not message.flags & _AIDED_BIT
            case mavlink.MAVLink_extended_sys_state_message():
                self._tells_landing = True
                self.on_ground = message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND

    @property
    def in_the_air(self) -> bool:
        """Whether it is armed, and known to have left the ground."""
        return self.armed and self.on_ground is False

    @property
    def stands(self) -> bool:
        """Whether it is disarmed, and known to be on the ground."""
        return self.on_ground is True and not self.armed

    @property
    def unaided(self) -> bool:
        """Whether the estimate of the position runs on inertial sensors alone."""
        return self._estimator_unaided or self._vision_unhealthy

    def rebooted(self, message: mavlink.MAVLink_message) -> bool:
        """Whether this message's ``time_boot_ms`` has run back: the autopilot booted anew since the last one."""
        boot_ms: int | None = getattr(message, "time_boot_ms", None)
        if boot_ms is None:
            return False
        back = 0 if self._boot_ms is None else self._boot_ms - boot_ms
        if back <= 0 or back >= _REBOOT_MS:
            self._boot_ms = boot_ms
        return _REBOOT_MS <= back < _WRAP_MS

    def has_position(self, time_s: float) -> bool:
        """Whether position and yaw are known and recent."""
        return time_s - self._position_s <= _POSITION_TIMEOUT_S and self.yaw_rad is not None


def _sensor_names(bits: int) -> tuple[str, ...]:
    """MAV_SYS_STATUS_SENSOR bits in words."""
    names = []
    for bit in range(32):
        if bits >> bit & 1:
            entry = mavlink.enums["MAV_SYS_STATUS_SENSOR"].get(1 << bit)
            name = entry.name if entry is not None else f"sensor bit {bit}"
            names.append(name.removeprefix("MAV_SYS_STATUS_").removeprefix("SENSOR_").lower().replace("_", " "))
    return tuple(names)
