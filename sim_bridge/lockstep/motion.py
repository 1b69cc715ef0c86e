"""How a robot of the lock-step world gets from one step to the next."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from onboard.config.flight import FlightConfig
from onboard.config.simulation import VehicleDynamicsConfig
from onboard.flight.setpoints import HeightReference, Response, SetpointTracker
from onboard.flight.trajectory import HOVER, Hold, PlanTrajectory, Trajectory
from onboard.geometry import Pose, wrap_angle
from onboard.planning.primitives import Primitive, advance
from sim_bridge.vehicle.dynamics import Vehicle, VelocityCommand

__all__ = ["IdealMotion", "Motion", "SecondOrderMotion"]

_YAW_GAIN_PER_S = 2.8
"""Of the heading hold around the yaw rate: PX4's MC_YAW_P."""


class Motion(Protocol):
    """A robot's body."""

    @property
    def pose(self) -> Pose:
        """Where it is."""
        ...

    def fly(self, time_s: float, start: Pose, primitives: Sequence[Primitive]) -> None:
        """Take up a plan that starts now, at ``start``."""
        ...

    def advance(self, time_s: float, duration_s: float) -> None:
        """Let time pass, from ``time_s`` on, s."""
        ...


class IdealMotion:
    """Eq. (12) exactly: each primitive is held for one step, and the robot is where its plan says."""

    def __init__(self, pose: Pose) -> None:
        self._pose = pose
        self._primitives: list[Primitive] = []

    @property
    def pose(self) -> Pose:
        """Where it is."""
        return self._pose

    def fly(self, time_s: float, start: Pose, primitives: Sequence[Primitive]) -> None:
        """Take up a plan."""
        self._primitives = list(primitives)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Hold the next primitive for this time; after the last one, stop."""
        self._pose = advance(self._pose, self._primitives.pop(0) if self._primitives else HOVER, duration_s)


class SecondOrderMotion:
    """The simulated vehicle behind the setpoints of the flight stack: it lags, overshoots and is blown about.

    Args:
        pose: Start, at rest in the air.
        height_m: Above the ground.
        dynamics: The vehicle's response.
        flight: Gains and rate of the setpoints.
        step_s: τ, how long a primitive is held, s.
        rng: Source of the gusts.
    """

    def __init__(
        self,
        pose: Pose,
        height_m: float,
        dynamics: VehicleDynamicsConfig,
        flight: FlightConfig,
        step_s: float,
        rng: np.random.Generator,
    ) -> None:
        self._vehicle = Vehicle(dynamics, (pose.north_m, pose.east_m, 0.0), pose.yaw_rad, rng)
        self._vehicle.on_ground = False
        self._vehicle.down_m = -height_m
        self._height = HeightReference(-height_m)
        self._tracker = SetpointTracker(flight)
        self._tick_s = 1.0 / flight.setpoint_rate_hz
        self._step_s = step_s
        self._trajectory: Trajectory = Hold(pose)

    @property
    def pose(self) -> Pose:
        """Where it is."""
        return Pose(self._vehicle.north_m, self._vehicle.east_m, self._vehicle.yaw_rad)

    def fly(self, time_s: float, start: Pose, primitives: Sequence[Primitive]) -> None:
        """Take up a plan."""
        self._trajectory = PlanTrajectory(time_s, start, primitives, self._step_s)

    def advance(self, time_s: float, duration_s: float) -> None:
        """Follow the trajectory at the setpoint rate."""
        ticks = max(1, round(duration_s / self._tick_s))
        dt_s = duration_s / ticks
        for tick in range(ticks):
            setpoint = self._tracker.setpoint(
                self._trajectory, time_s + tick * dt_s, self._height, self.pose, self._vehicle.down_m, Response()
            )
            turn = _YAW_GAIN_PER_S * wrap_angle(setpoint.yaw_rad - self._vehicle.yaw_rad)
            self._vehicle.step(
                dt_s,
                VelocityCommand(
                    setpoint.velocity_north_m_s,
                    setpoint.velocity_east_m_s,
                    setpoint.velocity_down_m_s,
                    setpoint.yaw_rate_rad_s + turn,
                    motors_on=True,
                ),
            )
