"""The companion's side of an autopilot link (PX4), without sockets: what it hears, and what it asks for.

Commands: https://mavlink.io/en/services/command.html; OFFBOARD: https://docs.px4.io/main/en/flight_modes/offboard.html.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.flight.pose_history import ClockOffset, PoseHistory
from onboard.flight.setpoints import Setpoint
from onboard.geometry import Pose
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandClient, CommandOutcome
from onboard.protocol.px4_modes import Px4Mode

__all__ = ["AutopilotLink", "AutopilotText"]

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
_PREARM_BIT = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_POSITION_TIMEOUT_S = 0.5


@dataclass(frozen=True, slots=True)
class AutopilotText:
    """A STATUSTEXT of the autopilot.

    Attributes:
        severity: MAV_SEVERITY.
        text: What it said.
    """

    severity: int
    text: str


class AutopilotLink:
    """What is known of one autopilot, and the commands under way to it.

    Args:
        system_id: The vehicle's system id.
        timeout_s: Silence of the heartbeat after which the autopilot counts as lost, s.

    Attributes:
        poses: Position and yaw of the last seconds, by UNIX time.
        commands: Commands under way.
        mode: HEARTBEAT.custom_mode; None before the first.
        armed: From the last heartbeat.
        failsafe: Whether the last heartbeat said MAV_STATE_CRITICAL or _EMERGENCY.
        on_ground: From EXTENDED_SYS_STATE; None before the first.
        prearm_ok: SYS_STATUS's pre-arm health bit.
        battery_percent: 0..100; None if unknown.
        position: North m, east m, down m; None before the first.
    """

    def __init__(self, system_id: int, timeout_s: float) -> None:
        self.poses = PoseHistory()
        self.commands = CommandClient()
        self.mode: int | None = None
        self.armed = False
        self.failsafe = False
        self.on_ground: bool | None = None
        self.prearm_ok = False
        self.battery_percent: int | None = None
        self.position: tuple[float, float, float] | None = None
        self._yaw_rad: float | None = None
        self._system_id = system_id
        self._timeout_s = timeout_s
        self._heartbeat_s = -math.inf
        self._position_s = -math.inf
        self._clock = ClockOffset()
        self._out: list[mavlink.MAVLink_message] = []
        self._texts: list[AutopilotText] = []
        self._outcomes: list[CommandOutcome] = []

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message that arrived at a UNIX time; those of other systems and components are not for us."""
        if message.get_srcSystem() != self._system_id or message.get_srcComponent() != COMPONENT:
            return
        match message:
            case mavlink.MAVLink_heartbeat_message():
                self._heartbeat_s = time_s
                self.mode = message.custom_mode
                self.armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
                self.failsafe = message.system_status in (mavlink.MAV_STATE_CRITICAL, mavlink.MAV_STATE_EMERGENCY)
            case mavlink.MAVLink_local_position_ned_message():
                if all(math.isfinite(value) for value in (message.x, message.y, message.z)):
                    self.position = (message.x, message.y, message.z)
                    self._position_s = time_s
                    self.poses.add_position(self._clock.unix(message.time_boot_ms, time_s), message.x, message.y)
            case mavlink.MAVLink_attitude_message():
                if math.isfinite(message.yaw):
                    self._yaw_rad = message.yaw
                    self.poses.add_yaw(self._clock.unix(message.time_boot_ms, time_s), message.yaw)
            case mavlink.MAVLink_sys_status_message():
                self.prearm_ok = bool(message.onboard_control_sensors_health & _PREARM_BIT)
                self.battery_percent = message.battery_remaining if message.battery_remaining >= 0 else None
            case mavlink.MAVLink_extended_sys_state_message():
                self.on_ground = message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
            case mavlink.MAVLink_statustext_message():
                self._texts.append(AutopilotText(message.severity, message.text))
            case mavlink.MAVLink_command_ack_message():
                outcome = self.commands.receive(message, time_s)
                if outcome is not None:
                    self._outcomes.append(outcome)
            case mavlink.MAVLink_timesync_message() if message.tc1 == 0:
                self._out.append(mavlink.MAVLink_timesync_message(round(time_s * 1e9), message.ts1))

    def heard(self, time_s: float) -> bool:
        """Whether its heartbeat is recent."""
        return time_s - self._heartbeat_s <= self._timeout_s

    def has_position(self, time_s: float) -> bool:
        """Whether its position estimate is recent."""
        return time_s - self._position_s <= _POSITION_TIMEOUT_S and self._yaw_rad is not None

    def pose(self) -> Pose | None:
        """The latest position and yaw; None before both were heard."""
        if self.position is None or self._yaw_rad is None:
            return None
        return Pose(self.position[0], self.position[1], self._yaw_rad)

    def stream(self, setpoint: Setpoint, time_s: float, boot_s: float) -> None:
        """Send a setpoint."""
        boot_ms = round((time_s - boot_s) * 1e3)
        self._out.append(setpoint.message(boot_ms, self._system_id, COMPONENT))

    def set_mode(self, mode: Px4Mode, time_s: float) -> None:
        """Ask for a mode (MAV_CMD_DO_SET_MODE)."""
        self._command(
            mavlink.MAV_CMD_DO_SET_MODE, time_s, mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, mode.main, mode.sub
        )

    def arm(self, time_s: float) -> None:
        """Ask to arm (MAV_CMD_COMPONENT_ARM_DISARM)."""
        self._command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, time_s, 1.0)

    def busy(self, command: int) -> bool:
        """Whether this MAV_CMD waits for its acknowledgement."""
        return self.commands.pending(command, (self._system_id, COMPONENT))

    def poll(self, time_s: float) -> list[mavlink.MAVLink_message]:
        """What to send now."""
        due, timed_out = self.commands.poll(time_s)
        self._outcomes += timed_out
        out, self._out = [*self._out, *due], []
        return out

    def texts(self) -> list[AutopilotText]:
        """What the autopilot said since the last call."""
        texts, self._texts = self._texts, []
        return texts

    def outcomes(self) -> list[CommandOutcome]:
        """Commands that ended since the last call."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def _command(self, command: int, time_s: float, *parameters: float) -> None:
        filled = [*parameters, *[0.0] * (7 - len(parameters))]
        self.commands.request(
            mavlink.MAVLink_command_long_message(self._system_id, COMPONENT, command, 0, *filled), time_s
        )
