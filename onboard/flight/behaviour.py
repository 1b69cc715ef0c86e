"""What differs between autopilots, behind one interface; ``px4.py`` and ``ardupilot.py`` are the two there are."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from onboard.flight.requirements import Needs, Requirement
from onboard.flight.setpoints import Response, Setpoint
from onboard.flight.telemetry import Telemetry
from onboard.protocol import dialect as mavlink

__all__ = ["Behaviour", "LaunchStep", "Request", "arm_request", "mode_request", "setpoint_message"]


@dataclass(frozen=True, slots=True)
class Request:
    """A COMMAND_LONG without its addressee.

    Attributes:
        command: MAV_CMD.
        parameters: The first of its seven; the others are 0.
    """

    command: int
    parameters: tuple[float, ...]


@dataclass(frozen=True, slots=True)
class LaunchStep:
    """One command on the way into the air.

    Attributes:
        name: For the operator.
        request: What is asked for.
        lacks: What it still waits for, in words; empty when it may be asked for.
        shown: Whether the telemetry shows that it is done; a step that never shows is done once it is accepted.
    """

    name: str
    request: Request
    lacks: Callable[[Telemetry], str]
    shown: Callable[[Telemetry], bool]


class Behaviour(Protocol):
    """How one family of autopilots is flown by a companion.

    Attributes:
        name: For the operator.
        autopilot: MAV_AUTOPILOT in its heartbeat.
        guided_mode: HEARTBEAT.custom_mode in which it follows setpoints.
        land_mode: That in which it lands by itself.
        rates_hz: Message id → rate that is asked for.
        data_streams: Message id → MAV_DATA_STREAM that carries it, for releases that refuse SET_MESSAGE_INTERVAL.
        streams_before_takeoff: Whether it wants setpoints before it is in the air, and climbs by them; else it takes
            off by itself and setpoints during the climb would end it.
        type_mask: POSITION_TARGET_TYPEMASK bits of what it is not to follow in a setpoint.
        response: How a quadrotor that it flies answers setpoints, as measured.
        integers_bytewise: Whether integer parameters travel bytewise in their float field.
        returns_from_failsafe: Whether it takes up the guided mode by itself when the reason of a failsafe is over.
    """

    @property
    def name(self) -> str: ...  # noqa: D102
    @property
    def autopilot(self) -> int: ...  # noqa: D102
    @property
    def guided_mode(self) -> int: ...  # noqa: D102
    @property
    def land_mode(self) -> int: ...  # noqa: D102
    @property
    def rates_hz(self) -> Mapping[int, float]: ...  # noqa: D102
    @property
    def data_streams(self) -> Mapping[int, int]: ...  # noqa: D102
    @property
    def streams_before_takeoff(self) -> bool: ...  # noqa: D102
    @property
    def type_mask(self) -> int: ...  # noqa: D102
    @property
    def response(self) -> Response: ...  # noqa: D102
    @property
    def integers_bytewise(self) -> bool: ...  # noqa: D102
    @property
    def returns_from_failsafe(self) -> bool: ...  # noqa: D102

    def mode_name(self, custom_mode: int) -> str:
        """A mode in words."""
        ...

    def needs_pilot(self, custom_mode: int) -> bool:
        """Whether this mode, as a failsafe, waits for somebody's sticks."""
        ...

    def lacks(self, telemetry: Telemetry) -> str:
        """What it lacks to be started, in words; empty when it is ready."""
        ...

    def requirements(self, needs: Needs) -> tuple[Requirement, ...]:
        """What its parameters must be for a plan."""
        ...

    def mode(self, custom_mode: int) -> Request:
        """Ask for a mode."""
        ...

    def launch(self, climb_m: float) -> tuple[LaunchStep, ...]:
        """The commands from standing to climbing, in order.

        Args:
            climb_m: From where it stands to the height at which it is to fly, m.
        """
        ...


def setpoint_message(
    setpoint: Setpoint, type_mask: int, boot_ms: int, system_id: int, component: int
) -> mavlink.MAVLink_set_position_target_local_ned_message:
    """A setpoint in MAV_FRAME_LOCAL_NED (https://mavlink.io/en/messages/common.html#SET_POSITION_TARGET_LOCAL_NED).

    What the type mask ignores is sent as 0: ArduPilot crashes on a NaN, even there.
    """

    def followed(ignored: int, value: float) -> float:
        return 0.0 if type_mask & ignored else value

    return mavlink.MAVLink_set_position_target_local_ned_message(
        boot_ms,
        system_id,
        component,
        mavlink.MAV_FRAME_LOCAL_NED,
        type_mask,
        0.0,
        0.0,
        followed(mavlink.POSITION_TARGET_TYPEMASK_Z_IGNORE, setpoint.down_m),
        setpoint.velocity_north_m_s,
        setpoint.velocity_east_m_s,
        followed(mavlink.POSITION_TARGET_TYPEMASK_VZ_IGNORE, setpoint.velocity_down_m_s),
        followed(mavlink.POSITION_TARGET_TYPEMASK_AX_IGNORE, setpoint.acceleration_north_m_s2),
        followed(mavlink.POSITION_TARGET_TYPEMASK_AY_IGNORE, setpoint.acceleration_east_m_s2),
        0.0,
        setpoint.yaw_rad,
        setpoint.yaw_rate_rad_s,
    )


def mode_request(main: int, sub: int = 0) -> Request:
    """MAV_CMD_DO_SET_MODE."""
    return Request(mavlink.MAV_CMD_DO_SET_MODE, (mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED, main, sub))


def arm_request() -> Request:
    """MAV_CMD_COMPONENT_ARM_DISARM: arm, with all checks."""
    return Request(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, (1.0,))
