"""A lawnmower sweep: back and forth over a share of the area, again and again, blind to what is seen."""

from __future__ import annotations

import math

from onboard.geometry import Pose, wrap_angle
from onboard.planning.baselines.rollout import rollout
from onboard.planning.plan import Budget, Plan
from onboard.planning.pluggable import PlannerSetup, plan_of
from onboard.planning.primitives import advance
from onboard.planning.problem import Problem

__all__ = ["Lawnmower"]

Point = tuple[float, float]


class Lawnmower:
    """Each robot sweeps a strip of the fence's bounding box, lanes apart by what the sensor sees to both sides.

    The area is cut from west to east into one strip for each robot, in the order of their system ids. After the last
    lane the robot goes back over the same lanes.
    """

    def __init__(self, setup: PlannerSetup) -> None:
        """Option ``overlap``: share of a lane's width that neighbouring lanes have in common, 0.2 unless given."""
        overlap = float(setup.options.get("overlap", 0.2))
        if not 0.0 <= overlap < 1.0:
            raise ValueError(f"overlap: {overlap} is not in [0, 1)")
        sensor = setup.scenario.sensor.build()
        side_m = sensor.max_range_m * math.sin(min(0.5 * sensor.fov_rad, 0.5 * math.pi))
        fence = setup.scenario.mission.fence
        ids = sorted(vehicle.id for vehicle in setup.scenario.vehicles)
        self._waypoints = _lanes(fence, ids.index(setup.vehicle_id), len(ids), 2.0 * side_m * (1.0 - overlap))
        self._reach_m = 0.0
        self._at = 0
        self._progress: list[tuple[Pose, int]] = []

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """Along the lanes, T steps further."""
        step_m = max(primitive.speed_m_s for primitive in problem.primitives) * problem.step_s
        self._reach_m = max(step_m, 0.5)
        if self._progress:  # how far along the last plan the robot has come
            self._at = min(self._progress, key=lambda entry: entry[0].distance_m(problem.pose))[1]
        self._progress = [(problem.pose, self._at)]
        controls = rollout(problem, lambda pose, step: self._towards(problem, pose, step))
        return plan_of(problem, controls)

    def _towards(self, problem: Problem, pose: Pose, step: int) -> list[int]:
        """Primitives by how near they bring the robot to its waypoint, and how well they point at it."""
        del self._progress[step + 1 :]
        at = self._progress[-1][1]
        if math.dist((pose.north_m, pose.east_m), self._waypoints[at % len(self._waypoints)]) < self._reach_m:
            at += 1
        self._progress.append((pose, at))
        north, east = self._waypoints[at % len(self._waypoints)]

        def score(control: int) -> float:
            after = advance(pose, problem.primitives[control], problem.step_s)
            off = wrap_angle(math.atan2(east - after.east_m, north - after.north_m) - after.yaw_rad)
            return math.hypot(north - after.north_m, east - after.east_m) + abs(off) * problem.step_s

        return sorted(range(len(problem.primitives)), key=score)


def _lanes(fence: tuple[Point, ...], rank: int, robots: int, spacing_m: float) -> list[Point]:
    """Waypoints north m, east m: up and down the lanes of one strip, and back."""
    (south, west), (north, east) = (tuple(pick(axis) for axis in zip(*fence, strict=True)) for pick in (min, max))
    width = (east - west) / robots
    count = max(1, math.ceil(width / spacing_m))
    margin = min(0.5 * spacing_m, 0.25 * (north - south))
    there: list[Point] = []
    for lane in range(count):
        lane_east = west + rank * width + (lane + 0.5) * width / count
        ends = [(south + margin, lane_east), (north - margin, lane_east)]
        there += ends if lane % 2 == 0 else ends[::-1]
    return there + there[-2:0:-1]
