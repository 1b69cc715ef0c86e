"""The shortest way between two places of the mission area: around obstacles, and around what juts into the fence.

A visibility graph (de Berg et al., Computational Geometry, chapter 15) over the corners of what is in the way, widened
by the clearance. Only what crosses the way found so far is taken into it, until nothing does: what was left out could
not have made it shorter.
"""

from __future__ import annotations

import heapq
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.config.mission import MissionConfig
from onboard.config.polygon import Point, contains, nearest_on_segment

__all__ = ["Ways"]

_INNER = 0.9
"""Ways keep off by the clearance; what counts as too near is a little less, so that a way along a corner is free."""

_FENCE_CLEARANCE_M = 0.1
_MITRE = 0.2
"""How far the widened corner of a spike goes: at most to 3.2 clearances."""


@dataclass(frozen=True, slots=True)
class _Barrier:
    """What may be in the way.

    Attributes:
        corners: Outline that no way crosses.
        nodes: Corners around which a way may lead.
    """

    corners: tuple[Point, ...]
    nodes: tuple[Point, ...]


class Ways:
    """Finds ways in one mission area.

    Args:
        mission: Fence, obstacles, and the clearance from these. Where the fence is not convex, what juts into it is
            an obstacle, too.
    """

    def __init__(self, mission: MissionConfig) -> None:
        self._fence = mission.fence
        clearance_m = max(mission.obstacle_clearance_m, _FENCE_CLEARANCE_M)
        self._barriers = [
            *(_widened(obstacle, clearance_m) for obstacle in mission.obstacles),
            *(_widened(pocket, _FENCE_CLEARANCE_M) for pocket in _pockets(mission.fence)),
        ]
        self._edges = _edges(self._barriers)
        self._owners = np.repeat(np.arange(len(self._barriers)), [len(b.corners) for b in self._barriers])

    def between(self, start: Point, end: Point) -> list[Point] | None:
        """Corners of the shortest way, ends included; None where no way leads there.

        A start or an end that is nearer to something than allowed is left, or reached, straight by the nearest edge.
        """
        if not self._barriers:
            return [start, end]
        leaving, reaching = self._freed(start), self._freed(end)
        found = self._around(leaving[-1], reaching[-1])
        if found is None:
            return None
        return [*leaving[:-1], *found, *reversed(reaching[:-1])]

    def _freed(self, place: Point) -> list[Point]:
        """A place, and after it the nearest one outside of whatever it is too near to."""
        for barrier in self._barriers:
            if contains(barrier.corners, place):
                edges = zip(barrier.nodes, [*barrier.nodes[1:], barrier.nodes[0]], strict=True)
                outside = min((nearest_on_segment(*edge, place) for edge in edges), key=lambda p: math.dist(p, place))
                return [place, outside]
        return [place]

    def _around(self, start: Point, end: Point) -> list[Point] | None:
        involved: list[int] = []
        while True:
            way = self._shortest(start, end, [self._barriers[index] for index in involved])
            if way is None:
                return None
            places = np.array(way)
            crossed = _crossings(places[:-1], places[1:], self._edges).any(axis=0)
            new = [int(index) for index in np.unique(self._owners[crossed]) if index not in involved]
            if not new:
                return way
            involved += new

    def _shortest(self, start: Point, end: Point, barriers: Sequence[_Barrier]) -> list[Point] | None:
        """The shortest way that crosses none of these; None if there is none: A* (Hart, Nilsson, Raphael 1968)."""
        around = [node for barrier in barriers for node in barrier.nodes if self._is_free(node, barriers)]
        nodes = [start, end, *around]
        places, edges = np.array(nodes), _edges(barriers)
        to_end = np.linalg.norm(places - places[1], axis=1)
        best, before = {0: 0.0}, dict[int, int]()
        queue, done = [(float(to_end[0]), 0)], set[int]()
        while queue:
            _, node = heapq.heappop(queue)
            if node == 1:
                return _backwards(nodes, before)
            if node in done:
                continue
            done.add(node)
            visible = ~_crossings(np.broadcast_to(places[node], places.shape), places, edges).any(axis=1)
            lengths = best[node] + np.linalg.norm(places - places[node], axis=1)
            for there in map(int, np.flatnonzero(visible)):
                if lengths[there] < best.get(there, math.inf):
                    best[there], before[there] = float(lengths[there]), node
                    heapq.heappush(queue, (float(lengths[there] + to_end[there]), there))
        return None

    def _is_free(self, node: Point, barriers: Sequence[_Barrier]) -> bool:
        return contains(self._fence, node) and not any(contains(other.corners, node) for other in barriers)


def _backwards(nodes: Sequence[Point], before: Mapping[int, int]) -> list[Point]:
    """From node 1, the end, to node 0, and that the other way round."""
    way = [1]
    while way[-1] != 0:
        way.append(before[way[-1]])
    return [nodes[index] for index in reversed(way)]


def _edges(barriers: Iterable[_Barrier]) -> NDArray[np.float64]:
    """Edges of barriers, one after the other: (E, 2, 2), m."""
    edges = [(b.corners[index - 1], b.corners[index]) for b in barriers for index in range(len(b.corners))]
    return np.array(edges).reshape(-1, 2, 2)


def _crossings(starts: NDArray[np.float64], ends: NDArray[np.float64], edges: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Which segments cross which edges: (S, E). Who passes a corner crosses one of its edges, or both, or touches it.

    Args:
        starts: (S, 2), m.
        ends: (S, 2), m.
        edges: (E, 2, 2), m.
    """
    first, second = edges[None, :, 0], edges[None, :, 1]
    starts, ends = starts[:, None], ends[:, None]
    apart = _is_left(first, second, starts) != _is_left(first, second, ends)
    return np.asarray(apart & (_is_left(starts, ends, first) != _is_left(starts, ends, second)))


def _is_left(a: NDArray[np.float64], b: NDArray[np.float64], c: NDArray[np.float64]) -> NDArray[np.bool_]:
    along, to = b - a, c - a
    return np.asarray(along[..., 0] * to[..., 1] - along[..., 1] * to[..., 0] >= 0.0)


def _widened(corners: Sequence[Point], clearance_m: float) -> _Barrier:
    return _Barrier(_offset(corners, _INNER * clearance_m), _offset(corners, clearance_m))


def _offset(corners: Sequence[Point], distance_m: float) -> tuple[Point, ...]:
    """A simple polygon widened by a distance, its corners mitred."""
    count = len(corners)
    area = sum(corners[i - 1][0] * corners[i][1] - corners[i - 1][1] * corners[i][0] for i in range(count))
    outward = 1.0 if area > 0.0 else -1.0
    normals = []
    for index in range(count):
        (n0, e0), (n1, e1) = corners[index - 1], corners[index]
        length = math.hypot(n1 - n0, e1 - e0)
        normals.append((outward * (e1 - e0) / length, -outward * (n1 - n0) / length))
    widened = []
    for index, (north, east) in enumerate(corners):
        (an, ae), (bn, be) = normals[index], normals[(index + 1) % count]
        share = distance_m / max(1.0 + an * bn + ae * be, _MITRE)
        widened.append((north + share * (an + bn), east + share * (ae + be)))
    return tuple(widened)


def _pockets(fence: Sequence[Point]) -> list[tuple[Point, ...]]:
    """What the convex hull of a fence has more than the fence: polygons."""
    hull = _hull(fence)
    at = [i for i, corner in enumerate(fence) if corner in hull]
    found = []
    for first, last in zip(at, [*at[1:], at[0] + len(fence)], strict=True):
        if last - first > 1:
            found.append(tuple(fence[i % len(fence)] for i in range(first, last + 1)))
    return found


def _hull(corners: Sequence[Point]) -> set[Point]:
    """Corners of the convex hull (Andrew's monotone chain)."""
    hull: set[Point] = set()
    for ordered in (sorted(corners), sorted(corners, reverse=True)):
        chain: list[Point] = []
        for corner in ordered:
            while len(chain) > 1 and _turns_right(chain[-2], chain[-1], corner):
                chain.pop()
            chain.append(corner)
        hull.update(chain)
    return hull


def _turns_right(a: Point, b: Point, c: Point) -> bool:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) <= 0.0
