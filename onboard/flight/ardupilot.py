"""ArduPilot Copter, flown in GUIDED (https://ardupilot.org/dev/docs/copter-commands-in-guided-mode.html).

It arms in GUIDED once its pre-arm checks pass and takes off by itself; any setpoint on the way up would end the
takeoff. One ignored axis drops its whole group of axes, so height is held through the vertical velocity.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from onboard.flight.ardupilot_requirements import ardupilot_requirements
from onboard.flight.behaviour import LaunchStep, Request, arm_request, mode_request
from onboard.flight.requirements import Needs, Requirement
from onboard.flight.setpoints import Response
from onboard.flight.telemetry import Telemetry
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode

__all__ = ["ArduPilot"]


class ArduPilot:
    """Behaviour of ArduPilot Copter; attributes as in :class:`onboard.flight.behaviour.Behaviour`."""

    name = "ArduPilot"
    autopilot: int = mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
    guided_mode: int = CopterMode.GUIDED
    land_mode: int = CopterMode.LAND
    streams_before_takeoff = False
    type_mask: int = (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    )
    """vx, vy, vz, yaw and, as feed-forward, yaw rate."""
    response = Response(velocity_delay_s=0.42, yaw_delay_s=0.25, position_gain_per_s=2.0, max_correction_m_s=1.0)
    integers_bytewise = False
    returns_from_failsafe = False
    rates_hz: Mapping[int, float] = MappingProxyType(
        {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        }
    )
    data_streams: Mapping[int, int] = MappingProxyType(
        {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: mavlink.MAV_DATA_STREAM_POSITION,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: mavlink.MAV_DATA_STREAM_EXTRA1,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: mavlink.MAV_DATA_STREAM_EXTENDED_STATUS,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: mavlink.MAV_DATA_STREAM_EXTRA3,
        }
    )

    def mode_name(self, custom_mode: int) -> str:
        """A mode in words."""
        return CopterMode.name_of(custom_mode)

    def needs_pilot(self, custom_mode: int) -> bool:
        """Its failsafes land, return or brake; none waits for sticks."""
        return False

    def lacks(self, telemetry: Telemetry) -> str:
        """The health bit speaks of the active mode; that of GUIDED, which asks for more, is waited for in `launch`."""
        return _prearm(telemetry)

    def requirements(self, needs: Needs) -> tuple[Requirement, ...]:
        """What its parameters must be for a plan."""
        return ardupilot_requirements(needs)

    def mode(self, custom_mode: int) -> Request:
        """Ask for a mode."""
        return mode_request(custom_mode)

    def launch(self, climb_m: float) -> tuple[LaunchStep, ...]:
        """GUIDED, its pre-arm checks, arming, takeoff."""
        takeoff = Request(mavlink.MAV_CMD_NAV_TAKEOFF, (0.0, 0.0, 0.0, 0.0, 0.0, 0.0, climb_m))
        return (
            LaunchStep("GUIDED", self.mode(CopterMode.GUIDED), _nothing, lambda heard: heard.mode == CopterMode.GUIDED),
            LaunchStep("arming", arm_request(), _guided, lambda heard: heard.armed),
            LaunchStep("takeoff", takeoff, _nothing, lambda _: False),
        )


def _nothing(_: Telemetry) -> str:
    return ""


def _guided(telemetry: Telemetry) -> str:
    return _prearm(telemetry) if telemetry.mode == CopterMode.GUIDED else "GUIDED does not show yet"


def _prearm(telemetry: Telemetry) -> str:
    return "" if telemetry.prearm_ok else "its pre-arm checks fail"
