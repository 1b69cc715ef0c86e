"""The targets: differential-drive robots that wander between random waypoints and never touch anything.

They stand in for the paper's Scarab robots, with a top speed of 1.4 m/s and the sudden changes of velocity that
collision avoidance brings. How they avoid walls and each other: ``avoidance.py``.
"""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from onboard.config.simulation import GroundRobotsConfig
from onboard.geometry import wrap_angle
from sim_bridge.arena import Arena
from sim_bridge.avoidance import HORIZON_S, Neighbour, choose_velocity, paths_touch
from sim_bridge.differential_drive import DriveLimits, arc, braked, stopping_path, window
from sim_bridge.errors import BridgeError
from sim_bridge.truth import TargetTruth

__all__ = ["CLEARANCE_M", "GroundRobots"]

CLEARANCE_M = 0.05
"""Robots keep this much more than contact from each other and from walls: room for arcs that were taken for chords."""

_MAX_PERIOD_S = 0.05
_HEADING_GAIN_PER_S = 4.0
_ARRIVAL_M = 0.25
_PATIENCE_S = 2.0
_PROGRESS_M = 0.05
_WALL_LOOKAHEAD_M = 0.3
_PLACES_TRIED = 200


@dataclass(slots=True)
class _Robot:
    """One robot at the start of a control period."""

    north_m: float
    east_m: float
    yaw_rad: float
    wheels: tuple[float, float]
    speed_m_s: float
    yaw_rate_rad_s: float
    path: tuple[tuple[float, float], ...]
    goal: tuple[float, float]
    cruise_m_s: float
    nearest_m: float
    patience_s: float

    @property
    def velocity(self) -> tuple[float, float]:
        return self.speed_m_s * math.cos(self.yaw_rad), self.speed_m_s * math.sin(self.yaw_rad)


class GroundRobots:
    """All robots of a scenario; their ids are 1..count.

    Robots choose in the order of their ids at the start of each control period, each seeing what those before it have
    chosen. Every robot is at all times committed to a path on which it can stop, and all these paths keep clear of
    each other, so nobody ever touches (see ``avoidance.py``). Who gets no nearer to its waypoint for two seconds draws
    another, which ends every stand-off.
    """

    def __init__(self, config: GroundRobotsConfig, arena: Arena, rng: np.random.Generator) -> None:
        """Place the robots, at rest, and let them choose their first motion.

        Raises:
            BridgeError: A configured start is too near to a wall or to another one, or the robots do not fit in.
        """
        self._config = config
        self._arena = arena
        self._rng = rng
        period_s = min(_MAX_PERIOD_S, config.radius_m / config.max_speed_m_s)
        self._limits = DriveLimits(
            period_s=period_s,
            half_track_m=config.radius_m,
            max_wheel_speed_m_s=config.max_speed_m_s,
            max_yaw_rate_rad_s=config.max_yaw_rate_rad_s,
            max_change_m_s=config.max_acceleration_m_s2 * period_s,
        )
        self._wall_reach_m = config.radius_m + CLEARANCE_M
        self._reach_m = 2.0 * config.radius_m + CLEARANCE_M
        self._attention_m = self._reach_m + 2.0 * config.cruise_speed_m_s[1] * HORIZON_S
        self._phase_s = 0.0
        self._robots = [self._place(start) for start in self._starts()]
        self._control()

    def advance(self, duration_s: float) -> None:
        """Let time pass, s."""
        self._phase_s += duration_s
        while self._phase_s >= self._limits.period_s - 1e-9:
            self._phase_s -= self._limits.period_s
            for robot in self._robots:
                robot.north_m, robot.east_m, robot.yaw_rad = self._moved(robot, self._limits.period_s)
                robot.yaw_rad = wrap_angle(robot.yaw_rad)
                robot.path = robot.path[1:] or robot.path
            self._control()

    def truth(self) -> list[TargetTruth]:
        """Where the robots are now."""
        result = []
        for target_id, robot in enumerate(self._robots, start=1):
            north_m, east_m, yaw_rad = self._moved(robot, self._phase_s)
            speed = robot.speed_m_s
            result.append(
                TargetTruth(
                    target_id=target_id,
                    north_m=north_m,
                    east_m=east_m,
                    velocity_north_m_s=speed * math.cos(yaw_rad),
                    velocity_east_m_s=speed * math.sin(yaw_rad),
                    yaw_rad=wrap_angle(yaw_rad),
                )
            )
        return result

    @staticmethod
    def _moved(robot: _Robot, duration_s: float) -> tuple[float, float, float]:
        return arc(robot.north_m, robot.east_m, robot.yaw_rad, robot.speed_m_s, robot.yaw_rate_rad_s, duration_s)

    def _control(self) -> None:
        """Choose the wheel speeds of the control period that begins."""
        cells = self._cells()
        for robot in self._robots:
            self._pursue(robot)
            near = self._near(robot, cells)
            desired = self._steer(robot, near)
            for wheels in window(robot.wheels, desired, self._limits):
                path = stopping_path(robot.north_m, robot.east_m, robot.yaw_rad, wheels, self._limits)
                if self._is_admissible(path, near):
                    break
            else:
                # The rest of the path that it is already committed to: nobody has come into its way since.
                wheels = braked(robot.wheels, self._limits.max_change_m_s)
                path = stopping_path(robot.north_m, robot.east_m, robot.yaw_rad, wheels, self._limits)
            robot.wheels, robot.path = wheels, path
            robot.speed_m_s, robot.yaw_rate_rad_s = self._limits.motion(wheels)

    def _pursue(self, robot: _Robot) -> None:
        """Draw the next leg on arrival, or when patience ends."""
        distance = math.dist((robot.north_m, robot.east_m), robot.goal)
        if distance < robot.nearest_m - _PROGRESS_M:
            robot.nearest_m, robot.patience_s = distance, _PATIENCE_S
        else:
            robot.patience_s -= self._limits.period_s
        if distance < _ARRIVAL_M or robot.patience_s <= 0.0:
            self._draw_leg(robot)

    def _draw_leg(self, robot: _Robot) -> None:
        here = (robot.north_m, robot.east_m)
        for _ in range(_PLACES_TRIED):
            goal = self._arena.random_place(self._rng, self._wall_reach_m + CLEARANCE_M)
            if self._arena.is_free_line(here, goal, self._wall_reach_m):
                break  # in a corner that sees nothing of the arena, the last place has to do
        robot.goal = goal
        robot.cruise_m_s = float(self._rng.uniform(*self._config.cruise_speed_m_s))
        robot.nearest_m, robot.patience_s = math.dist(here, goal), _PATIENCE_S

    def _steer(self, robot: _Robot, near: list[_Robot]) -> tuple[float, float]:
        """The wheel speeds that the robot would like to have, whatever it can reach in one period."""
        to_goal = (robot.goal[0] - robot.north_m, robot.goal[1] - robot.east_m)
        distance = math.hypot(*to_goal)
        wanted = (0.0, 0.0)
        if distance > 0.0:
            wanted = (robot.cruise_m_s * to_goal[0] / distance, robot.cruise_m_s * to_goal[1] / distance)
        if near:
            neighbours: list[Neighbour] = [
                (other.north_m - robot.north_m, other.east_m - robot.east_m, *other.velocity) for other in near
            ]
            wanted = choose_velocity(wanted, robot.velocity, neighbours, self._reach_m, self._walls_near(robot))
        speed = math.hypot(*wanted)
        if speed == 0.0:
            return 0.0, 0.0
        error_rad = wrap_angle(math.atan2(wanted[1], wanted[0]) - robot.yaw_rad)
        return self._limits.wheels(speed * max(0.0, math.cos(error_rad)), _HEADING_GAIN_PER_S * error_rad)

    def _walls_near(self, robot: _Robot) -> list[tuple[float, float]]:
        """Unit vectors towards the walls that are near."""
        return self._arena.directions_to_walls(robot.north_m, robot.east_m, self._wall_reach_m + _WALL_LOOKAHEAD_M)

    def _is_admissible(self, path: tuple[tuple[float, float], ...], near: list[_Robot]) -> bool:
        """Whether a robot may commit itself to a stopping path."""
        start, own_travel = path[0], self._travel(path)
        if self._arena.wall_distance(*start) < self._wall_reach_m + own_travel and any(
            self._arena.wall_distance(*point) < self._wall_reach_m for point in path[1:]
        ):
            return False
        return not any(
            paths_touch(path, other.path, self._reach_m)
            for other in near
            if math.dist(start, other.path[0]) < self._reach_m + own_travel + self._travel(other.path)
        )

    def _travel(self, path: tuple[tuple[float, float], ...]) -> float:
        """The longest that a stopping path of so many periods can be, m: in its k-th last, at most k changes fast."""
        periods = len(path) - 1
        return self._limits.max_change_m_s * self._limits.period_s * 0.5 * periods * (periods + 1)

    def _cells(self) -> dict[tuple[int, int], list[_Robot]]:
        """Robots by square cells as wide as anybody looks."""
        cells: dict[tuple[int, int], list[_Robot]] = defaultdict(list)
        for robot in self._robots:
            cells[self._cell(robot)].append(robot)
        return cells

    def _cell(self, robot: _Robot) -> tuple[int, int]:
        return math.floor(robot.north_m / self._attention_m), math.floor(robot.east_m / self._attention_m)

    def _near(self, robot: _Robot, cells: dict[tuple[int, int], list[_Robot]]) -> list[_Robot]:
        """The robots that are near enough to matter."""
        north, east = self._cell(robot)
        return [
            other
            for i in (north - 1, north, north + 1)
            for j in (east - 1, east, east + 1)
            for other in cells.get((i, j), ())
            if other is not robot
            and math.hypot(other.north_m - robot.north_m, other.east_m - robot.east_m) < self._attention_m
        ]

    def _starts(self) -> list[tuple[float, float]]:
        config = self._config
        if config.starts is not None:
            for index, start in enumerate(config.starts):
                key = f"simulation.ground_robots.starts[{index}] = {list(start)}"
                if not self._arena.holds(*start, self._wall_reach_m):
                    raise BridgeError(f"{key}: not inside mission.fence, {self._wall_reach_m:.2f} m from every wall")
                for other in config.starts[:index]:
                    if math.dist(start, other) < self._reach_m:
                        raise BridgeError(f"{key}: less than {self._reach_m:.2f} m from another robot's start")
            return list(config.starts)
        starts: list[tuple[float, float]] = []
        for _ in range(_PLACES_TRIED * config.count):
            if len(starts) == config.count:
                break
            place = self._arena.random_place(self._rng, self._wall_reach_m)
            if all(math.dist(place, other) >= self._reach_m for other in starts):
                starts.append(place)
        if len(starts) < config.count:
            raise BridgeError(
                f"simulation.ground_robots: {config.count} robots of radius_m = {config.radius_m} do not fit into "
                "mission.fence; fewer or smaller ones do"
            )
        return starts

    def _place(self, start: tuple[float, float]) -> _Robot:
        robot = _Robot(
            north_m=start[0],
            east_m=start[1],
            yaw_rad=float(self._rng.uniform(-math.pi, math.pi)),
            wheels=(0.0, 0.0),
            speed_m_s=0.0,
            yaw_rate_rad_s=0.0,
            path=(start,),
            goal=start,
            cruise_m_s=0.0,
            nearest_m=0.0,
            patience_s=0.0,
        )
        self._draw_leg(robot)
        return robot
