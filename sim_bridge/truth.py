"""What is true in the simulated world: values that its sensors, its radio and its referees look at."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.geometry import Pose

__all__ = ["TargetTruth", "VehicleTruth"]


@dataclass(frozen=True, slots=True)
class VehicleTruth:
    """A vehicle's true state in the mission frame.

    Attributes:
        vehicle_id: MAVLink system id.
        north_m: North, m.
        east_m: East, m.
        down_m: Down, m; the ground is at 0.
        velocity_north_m_s: Velocity north, m/s.
        velocity_east_m_s: Velocity east, m/s.
        velocity_down_m_s: Velocity down, m/s.
        yaw_rad: Heading, clockwise from north, rad.
    """

    vehicle_id: int
    north_m: float
    east_m: float
    down_m: float
    velocity_north_m_s: float
    velocity_east_m_s: float
    velocity_down_m_s: float
    yaw_rad: float

    @property
    def position(self) -> tuple[float, float, float]:
        """``(north m, east m, down m)``."""
        return (self.north_m, self.east_m, self.down_m)

    @property
    def pose(self) -> Pose:
        """Where it is and looks in the plane."""
        return Pose(self.north_m, self.east_m, self.yaw_rad)


@dataclass(frozen=True, slots=True)
class TargetTruth:
    """A target's true state in the mission frame.

    Attributes:
        target_id: Which target, from 1.
        north_m: North, m.
        east_m: East, m.
        velocity_north_m_s: Velocity north, m/s.
        velocity_east_m_s: Velocity east, m/s.
        yaw_rad: Heading, clockwise from north, rad.
    """

    target_id: int
    north_m: float
    east_m: float
    velocity_north_m_s: float
    velocity_east_m_s: float
    yaw_rad: float
