"""Simple polygons, given by their corners ``(north m, east m)``."""

from __future__ import annotations

import math
from collections.abc import Sequence

__all__ = [
    "Point",
    "contains",
    "edge_distance",
    "is_simple",
    "meets_segment",
    "nearest_on_segment",
    "outside_distance",
    "overlap",
]

Point = tuple[float, float]


def contains(corners: Sequence[Point], point: Point) -> bool:
    """Whether a point is inside, by the crossing number; the boundary may count either way."""
    north, east = point
    inside = False
    for (n0, e0), (n1, e1) in zip(corners, [*corners[1:], corners[0]], strict=True):
        if (e0 > east) != (e1 > east) and north < n0 + (n1 - n0) * (east - e0) / (e1 - e0):
            inside = not inside
    return inside


def is_simple(corners: Sequence[Point]) -> bool:
    """Whether the corners are at least three, all different, and no two edges that are not neighbours touch."""
    count = len(corners)
    if count < 3 or len(set(corners)) != count:
        return False
    edges = [(corners[i], corners[(i + 1) % count]) for i in range(count)]
    if count == 3:
        return _turn(*corners) != 0.0
    return not any(
        _touch(*edges[i], *edges[j]) for i in range(count) for j in range(i + 2, count) if (i, j) != (0, count - 1)
    )


def meets_segment(corners: Sequence[Point], start: Point, end: Point) -> bool:
    """Whether a segment has a point in a polygon or on its boundary."""
    return contains(corners, start) or any(
        _touch(start, end, first, second) for first, second in zip(corners, [*corners[1:], corners[0]], strict=True)
    )


def nearest_on_segment(start: Point, end: Point, point: Point) -> Point:
    """The point of a segment that is nearest to a point."""
    north, east = end[0] - start[0], end[1] - start[1]
    square = north * north + east * east
    along = ((point[0] - start[0]) * north + (point[1] - start[1]) * east) / square if square > 0.0 else 0.0
    along = min(max(along, 0.0), 1.0)
    return start[0] + along * north, start[1] + along * east


def edge_distance(corners: Sequence[Point], point: Point) -> float:
    """From a point to the nearest edge, m."""
    return min(
        math.dist(point, nearest_on_segment(corners[index - 1], corners[index], point)) for index in range(len(corners))
    )


def outside_distance(corners: Sequence[Point], point: Point) -> float:
    """How far a point is outside, m; 0 inside."""
    return 0.0 if contains(corners, point) else edge_distance(corners, point)


def overlap(first: Sequence[Point], second: Sequence[Point]) -> bool:
    """Whether two simple polygons have a point in common."""
    edges = zip(first, [*first[1:], first[0]], strict=True)
    return contains(first, second[0]) or any(meets_segment(second, start, end) for start, end in edges)


def _turn(a: Point, b: Point, c: Point) -> float:
    return (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])


def _on_segment(a: Point, b: Point, p: Point) -> bool:
    return min(a[0], b[0]) <= p[0] <= max(a[0], b[0]) and min(a[1], b[1]) <= p[1] <= max(a[1], b[1])


def _touch(a: Point, b: Point, c: Point, d: Point) -> bool:
    turns = (_turn(a, b, c), _turn(a, b, d), _turn(c, d, a), _turn(c, d, b))
    if (turns[0] > 0) != (turns[1] > 0) and (turns[2] > 0) != (turns[3] > 0) and 0.0 not in turns:
        return True
    ends = ((a, b, c, turns[0]), (a, b, d, turns[1]), (c, d, a, turns[2]), (c, d, b, turns[3]))
    return any(turn == 0.0 and _on_segment(first, second, end) for first, second, end, turn in ends)
