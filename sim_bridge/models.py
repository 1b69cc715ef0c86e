"""What the bridge needs of a simulated vehicle and of its autopilot, whoever they are."""

from __future__ import annotations

from typing import Protocol

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import LinkName

__all__ = ["AutopilotModel", "SetpointStatistics", "VehicleModel"]


class VehicleModel(Protocol):
    """What the world reads of a vehicle's dynamics; frame NED, SI units."""

    north_m: float
    east_m: float
    down_m: float
    velocity_north_m_s: float
    velocity_east_m_s: float
    velocity_down_m_s: float
    yaw_rad: float
    on_ground: bool


class SetpointStatistics(Protocol):
    """What an autopilot counts of the setpoints that it receives while armed and offboard."""

    setpoints: int
    setpoint_gap_max_s: float
    setpoint_time_s: float


class AutopilotModel(Protocol):
    """What the bridge needs of a simulated autopilot, which moves its vehicle on."""

    @property
    def statistics(self) -> SetpointStatistics:
        """Setpoint accounting."""

    def receive(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        """Take a message from the link ``onboard`` or ``gcs``."""

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture."""

    def drain_battery(self, remaining: float) -> None:
        """Leave so much charge, 0 to 1, in its battery."""

    def step(self, time_s: float, dt_s: float) -> None:
        """Move on by ``dt_s`` to ``time_s``."""

    def outbox(self) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """Take out the messages to send, each with its link."""
