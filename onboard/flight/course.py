"""What one vehicle flies: the trajectory now, the one that follows it, and the height on the way to its layer."""

from __future__ import annotations

import math

from onboard.config.flight import FlightConfig
from onboard.config.vehicle_types import VehicleTypeConfig
from onboard.flight.setpoints import HeightReference, Response, Setpoint, SetpointTracker
from onboard.flight.trajectory import Followed, Trajectory
from onboard.geometry import Pose

__all__ = ["Course"]

STOPS_S = 0.4
"""How long a vehicle flies on with its velocity, in effect, when it stops."""


class Course:
    """Changes from one trajectory to the next, and makes setpoints of them.

    Args:
        config: Gains, speeds.
        limits: Of the vehicle's type.
        layer_m: Height at which it is to fly, m.

    Attributes:
        trajectory: What is flown now; None while nothing has been commanded.
        height: The height that is asked for.
    """

    def __init__(self, config: FlightConfig, limits: VehicleTypeConfig | None, layer_m: float) -> None:
        self.trajectory: Trajectory | None = None
        self.height = HeightReference(0.0)
        self._config = config
        self._layer_m = layer_m
        self._tracker = SetpointTracker(config, limits)
        self._next: tuple[float, Trajectory, float] | None = None
        self._flown_from_s = math.inf
        self._flown_until_s = math.inf

    def begin(self, trajectory: Trajectory | None, down_m: float) -> None:
        """A flight begins, at a height (NED, m)."""
        self.trajectory = trajectory
        self.height = HeightReference(down_m)
        self.forget_plans()

    def take(self, trajectory: Trajectory, start_s: float, end_s: float) -> None:
        """A trajectory follows at ``start_s``; it ends at ``end_s`` unless another one follows it."""
        self._next = (start_s, trajectory, end_s)

    def switch(self) -> None:
        """Fly what follows."""
        if self._next is not None:
            self._flown_from_s, self.trajectory, self._flown_until_s = self._next
            self._next = None

    def drop_next(self) -> None:
        """Nothing follows."""
        self._next = None

    def forget_plans(self) -> None:
        """Nothing follows, and what is flown has no end."""
        self._next, self._flown_until_s = None, math.inf

    def next_due(self, time_s: float) -> bool:
        """Whether it is time to switch."""
        return self._next is not None and time_s >= self._next[0]

    def flown_out(self, time_s: float) -> bool:
        """Whether the plan that is flown is at its end, and none follows."""
        return self._next is None and time_s >= self._flown_until_s

    def age_s(self, time_s: float) -> float:
        """Since the plan that is flown began, s."""
        return time_s - self._flown_from_s

    def pose(self, time_s: float) -> Pose | None:
        """Where the vehicle should be now; None while nothing has been commanded."""
        return self.trajectory.reference(time_s).pose if self.trajectory is not None else None

    def pose_ahead(self, time_s: float) -> Pose | None:
        """Where it should be now or soon, by what is flown and what follows it."""
        if self._next is not None and time_s >= self._next[0]:
            return self._next[1].reference(time_s).pose
        return self.pose(time_s)

    def rest(self, time_s: float) -> Pose | None:
        """Where the vehicle is at rest when it stops now: it has a way to go, and another one would be behind it."""
        if self.trajectory is None:
            return None
        now = self.trajectory.reference(time_s)
        return Pose(
            now.pose.north_m + STOPS_S * now.velocity_north_m_s,
            now.pose.east_m + STOPS_S * now.velocity_east_m_s,
            now.pose.yaw_rad,
        )

    def move_height(self, elapsed_s: float) -> None:
        """The height that is asked for goes on towards the layer for a while, s."""
        if elapsed_s <= 0.0:
            return
        step = self._config.climb_m_s * elapsed_s
        move = min(max(-self._layer_m - self.height.down_m, -step), step)
        self.height = HeightReference(self.height.down_m + move, move / elapsed_s)

    def setpoint(
        self,
        time_s: float,
        measured: Pose | None,
        measured_down_m: float | None,
        response: Response,
        *,
        with_next: bool,
    ) -> Setpoint | None:
        """The setpoint at a UNIX time; None while nothing has been commanded.

        Args:
            time_s: UNIX time, s.
            measured: Where the autopilot says that it is; without it there is no horizontal correction.
            measured_down_m: Its height, NED, m; without it there is no vertical correction.
            response: How the vehicle answers.
            with_next: Whether what follows is looked ahead to.
        """
        trajectory = self.trajectory
        if trajectory is None:
            return None
        if with_next and self._next is not None:
            trajectory = Followed(trajectory, self._next[1], self._next[0])
        return self._tracker.setpoint(trajectory, time_s, self.height, measured, measured_down_m, response)
