"""The area that ground robots drive in: a fence and obstacles, seen from the middle of a disc-shaped robot."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from onboard.config.polygon import contains
from sim_bridge.errors import BridgeError

__all__ = ["Arena"]

_ATTEMPTS = 10_000


class Arena:
    """The inside of a simple polygon without those in it, with distances to walls in plain floats.

    It is asked thousands of times a second.

    Args:
        fence: Corners north m, east m; its edges are walls.
        obstacles: Corners of each; their edges are walls too.
    """

    def __init__(
        self, fence: Sequence[tuple[float, float]], obstacles: Sequence[Sequence[tuple[float, float]]] = ()
    ) -> None:
        self._fence = tuple(fence)
        self._obstacles = tuple(tuple(obstacle) for obstacle in obstacles)
        self._walls: list[tuple[float, float, float, float, float]] = []
        for corners in (self._fence, *self._obstacles):
            for (n0, e0), (n1, e1) in zip(corners, [*corners[1:], corners[0]], strict=True):
                dn, de = n1 - n0, e1 - e0
                self._walls.append((n0, e0, dn, de, 1.0 / (dn * dn + de * de)))
        norths, easts = [n for n, _ in fence], [e for _, e in fence]
        self._low, self._high = (min(norths), min(easts)), (max(norths), max(easts))

    def wall_distance(self, north_m: float, east_m: float) -> float:
        """Distance of a point to the nearest wall, m."""
        nearest = math.inf
        for wall in self._walls:
            toward_n, toward_e = self._to_wall(wall, north_m, east_m)
            square = toward_n * toward_n + toward_e * toward_e
            nearest = min(nearest, square)
        return math.sqrt(nearest)

    def directions_to_walls(self, north_m: float, east_m: float, within_m: float) -> list[tuple[float, float]]:
        """Unit vectors (north, east) from a point towards the nearest point of each wall within a distance."""
        return [
            (toward_n / distance, toward_e / distance)
            for toward_n, toward_e in (self._to_wall(wall, north_m, east_m) for wall in self._walls)
            if 0.0 < (distance := math.hypot(toward_n, toward_e)) < within_m
        ]

    def holds(self, north_m: float, east_m: float, clearance_m: float) -> bool:
        """Whether a point is inside, in no obstacle, and at least this far from every wall."""
        place = (north_m, east_m)
        return (
            contains(self._fence, place)
            and not any(contains(obstacle, place) for obstacle in self._obstacles)
            and self.wall_distance(north_m, east_m) >= clearance_m
        )

    def is_free_line(self, start: tuple[float, float], end: tuple[float, float], clearance_m: float) -> bool:
        """Whether a disc can go straight from one point inside to another; probed every half clearance."""
        pieces = max(1, math.ceil(math.dist(start, end) / (0.5 * clearance_m)))
        return all(
            self.wall_distance(
                start[0] + (end[0] - start[0]) * k / pieces,
                start[1] + (end[1] - start[1]) * k / pieces,
            )
            >= 0.9 * clearance_m
            for k in range(1, pieces + 1)
        )

    def random_place(self, rng: np.random.Generator, clearance_m: float) -> tuple[float, float]:
        """A place uniform over the points that are this far from every wall.

        Raises:
            BridgeError: There is no such place, or none was found.
        """
        for _ in range(_ATTEMPTS):
            north_m, east_m = rng.uniform(self._low, self._high).tolist()
            if self.holds(north_m, east_m, clearance_m):
                return north_m, east_m
        raise BridgeError(
            f"mission.fence: found no place that is {clearance_m:.2f} m from every wall; the ground robots "
            "(simulation.ground_robots.radius_m) need a wider area"
        )

    @staticmethod
    def _to_wall(wall: tuple[float, float, float, float, float], north_m: float, east_m: float) -> tuple[float, float]:
        """From a point to the nearest point of a wall."""
        n0, e0, dn, de, inverse_square = wall
        rn, re = north_m - n0, east_m - e0
        along = max(0.0, min((rn * dn + re * de) * inverse_square, 1.0))
        return along * dn - rn, along * de - re
