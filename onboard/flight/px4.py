"""PX4, flown in OFFBOARD (https://docs.px4.io/main/en/flight_modes/offboard.html).

It wants a stream of setpoints before OFFBOARD, arms in OFFBOARD and climbs by the setpoints' height. It holds that
height by itself, next to a horizontal velocity.
"""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from onboard.flight.behaviour import LaunchStep, Request, arm_request, mode_request
from onboard.flight.px4_requirements import px4_requirements
from onboard.flight.requirements import Needs, Requirement
from onboard.flight.setpoints import Response
from onboard.flight.telemetry import Telemetry
from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode

__all__ = ["Px4"]

_NEEDS_STICKS = frozenset({Px4Mode.MANUAL, Px4Mode.ALTCTL, Px4Mode.POSCTL, Px4Mode.ACRO, Px4Mode.STABILIZED})


class Px4:
    """Behaviour of PX4; attributes as in :class:`onboard.flight.behaviour.Behaviour`."""

    name = "PX4"
    autopilot: int = mavlink.MAV_AUTOPILOT_PX4
    guided_mode: int = Px4Mode.OFFBOARD
    land_mode: int = Px4Mode.LAND
    streams_before_takeoff = True
    type_mask: int = (
        mavlink.POSITION_TARGET_TYPEMASK_X_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_Y_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE
        | mavlink.POSITION_TARGET_TYPEMASK_AZ_IGNORE
    )
    """vx, vy, z, yaw and, as feed-forward, ax, ay, yaw rate."""
    response = Response(
        velocity_delay_s=0.08,
        yaw_delay_s=0.4,
        max_yaw_acceleration_rad_s2=3.0,
        position_gain_per_s=2.0,
        max_correction_m_s=1.0,
    )
    integers_bytewise = True
    returns_from_failsafe = True
    rates_hz: Mapping[int, float] = MappingProxyType(
        {
            mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 50.0,
            mavlink.MAVLINK_MSG_ID_ATTITUDE: 50.0,
            mavlink.MAVLINK_MSG_ID_SYS_STATUS: 2.0,
            mavlink.MAVLINK_MSG_ID_ESTIMATOR_STATUS: 5.0,
            mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
            mavlink.MAVLINK_MSG_ID_SYSTEM_TIME: 1.0,
        }
    )
    data_streams: Mapping[int, int] = MappingProxyType({})

    def mode_name(self, custom_mode: int) -> str:
        """A mode in words."""
        return Px4Mode.name_of(custom_mode)

    def needs_pilot(self, custom_mode: int) -> bool:
        """Whether this mode, as a failsafe, waits for somebody's sticks."""
        return custom_mode in _NEEDS_STICKS

    def lacks(self, telemetry: Telemetry) -> str:
        """The health bit speaks of the mode that is active.

        OFFBOARD needs no more than the mode that PX4 starts in. Where OFFBOARD is active itself, as after a flight, the
        bit is off because nobody streams yet, and tells nothing; arming will.
        """
        ready = telemetry.prearm_ok or telemetry.mode == Px4Mode.OFFBOARD
        return "" if ready else "its pre-arm checks fail"

    def requirements(self, needs: Needs) -> tuple[Requirement, ...]:
        """What its parameters must be for a plan."""
        return px4_requirements(needs)

    def mode(self, custom_mode: int) -> Request:
        """Ask for a mode: main and sub mode apart."""
        mode = Px4Mode(custom_mode)
        return mode_request(mode.main, mode.sub)

    def launch(self, climb_m: float) -> tuple[LaunchStep, ...]:
        """OFFBOARD, then arming; the climb is the stream's."""
        return (
            LaunchStep("OFFBOARD", self.mode(Px4Mode.OFFBOARD), _nothing, lambda heard: heard.mode == Px4Mode.OFFBOARD),
            LaunchStep("arming", arm_request(), _nothing, lambda heard: heard.armed),
        )


def _nothing(_: Telemetry) -> str:
    return ""
