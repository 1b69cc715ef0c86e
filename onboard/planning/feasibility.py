"""Where the robot may be: mission fence with braking room, static obstacles, separation from teammates.

A robot that cannot hover can always circle as tightly as its primitives allow. So a pose is feasible for the fence when
one of its two tightest circles lies inside: whatever comes, the robot has somewhere to go. From a feasible pose the
search therefore never runs into a dead end at the fence. Between two poses the arc itself must not cross the fence
either, for it bulges beyond its chord.

A start outside (tracking error, a gust, a fence that was moved) is not refused. Such a pose has a *violation* in
metres, and from it only poses that do not increase the violation are feasible.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.planning.jit import inlined_kernel, kernel
from onboard.planning.problem import Problem

__all__ = ["PackedBounds", "pack_bounds", "step_penalty_m", "violation_m"]

_TOLERANCE_M = 1e-9
_NO_CIRCLE = -1.0


class PackedBounds(NamedTuple):
    """The bounds as the kernels want them.

    Attributes:
        constrained: Whether there is any bound at all.
        fence: (K, 2) corners, north m, east m; K = 0 for none.
        right_radius_m: Radius of the tightest circle to the right, m; 0 if the robot can stop, −1 if there is none.
        left_radius_m: The same to the left.
        blocked: (rows, columns) True where an obstacle is; (0, 0) for none.
        clear_cells: (rows, columns) distance to the nearest blocked cell, in cells, the larger of both directions.
        origin_north_m: South-west corner of the grid, m.
        origin_east_m: The same, m.
        cell_m: Side of a cell, m.
        teammates: (N, T, 2) positions, north m, east m, of those to keep clear of.
        separations_m: (N,) how clear, m.
        reach_m: How far the robot can get from a pose in one step and the circle after it, m.
        step_s: τ, s.
    """

    constrained: bool
    fence: NDArray[np.float64]
    right_radius_m: float
    left_radius_m: float
    blocked: NDArray[np.bool_]
    clear_cells: NDArray[np.int32]
    origin_north_m: float
    origin_east_m: float
    cell_m: float
    teammates: NDArray[np.float64]
    separations_m: NDArray[np.float64]
    reach_m: float
    step_s: float


def pack_bounds(problem: Problem) -> PackedBounds:
    """The bounds of a problem as the kernels want them.

    Raises:
        ValueError: If the fence has fewer than three corners.
    """
    fence = np.zeros((0, 2)) if problem.fence is None else np.ascontiguousarray(problem.fence, dtype=np.float64)
    if problem.fence is not None and (fence.ndim != 2 or fence.shape[0] < 3 or fence.shape[1] != 2):
        raise ValueError(f"fence: shape (K >= 3, 2) is needed, got {fence.shape}")
    right_m, left_m = _tightest_circles_m(problem)
    apart = [teammate for teammate in problem.teammates if teammate.separation_m > 0.0]
    obstacles = problem.obstacles
    blocked = np.zeros((0, 0), dtype=np.bool_)
    if obstacles is not None:
        blocked = np.ascontiguousarray(obstacles.blocked, dtype=np.bool_)
    arc_m = problem.step_s * max(abs(primitive.speed_m_s) for primitive in problem.primitives)
    return PackedBounds(
        constrained=bool(fence.size or blocked.any() or apart),
        fence=fence,
        right_radius_m=right_m,
        left_radius_m=left_m,
        blocked=blocked,
        clear_cells=_clear_cells(blocked),
        origin_north_m=0.0 if obstacles is None else float(obstacles.origin_north_m),
        origin_east_m=0.0 if obstacles is None else float(obstacles.origin_east_m),
        cell_m=1.0 if obstacles is None else float(obstacles.cell_m),
        teammates=np.array([teammate.poses[:, :2] for teammate in apart]).reshape(-1, problem.horizon, 2),
        separations_m=np.array([teammate.separation_m for teammate in apart], dtype=np.float64),
        reach_m=arc_m + 2.0 * max(right_m, left_m, 0.0),
        step_s=float(problem.step_s),
    )


def _tightest_circles_m(problem: Problem) -> tuple[float, float]:
    """Radii to the right and to the left; 0 where the robot can stop or turn on the spot, −1 where it cannot turn."""
    if any(primitive.speed_m_s == 0.0 for primitive in problem.primitives):
        return 0.0, 0.0
    turning = [primitive for primitive in problem.primitives if primitive.yaw_rate_rad_s != 0.0]
    # A circle of negative speed and yaw rate ω has its centre where forward motion with −ω has it.
    radii = [primitive.speed_m_s / primitive.yaw_rate_rad_s for primitive in turning]
    if not radii:
        return 0.0, 0.0
    right = min((radius for radius in radii if radius > 0.0), default=_NO_CIRCLE)
    left = min((-radius for radius in radii if radius < 0.0), default=_NO_CIRCLE)
    return right, left


def _clear_cells(blocked: NDArray[np.bool_]) -> NDArray[np.int32]:
    """Chessboard distance to the nearest blocked cell, by growing the blocked area a cell at a time."""
    distance = np.zeros(blocked.shape, dtype=np.int32)
    if not blocked.any():
        return distance
    grown = blocked.copy()
    while not grown.all():
        distance[~grown] += 1
        for axis in (0, 1):
            wider = grown.copy()
            ahead, behind = (slice(1, None), slice(None, -1)) if axis == 0 else (np.s_[:, 1:], np.s_[:, :-1])
            wider[ahead] |= grown[behind]
            wider[behind] |= grown[ahead]
            grown = wider
    return distance


@kernel
def _clearance_m(fence: NDArray[np.float64], north: float, east: float) -> float:
    """Distance to the fence, m: positive inside, negative outside."""
    inside = False
    nearest = np.inf
    previous = fence.shape[0] - 1
    for corner in range(fence.shape[0]):
        an, ae = fence[previous, 0] - north, fence[previous, 1] - east
        bn, be = fence[corner, 0] - north, fence[corner, 1] - east
        if (ae > 0.0) != (be > 0.0) and an + (bn - an) * ae / (ae - be) > 0.0:
            inside = not inside
        dn, de = bn - an, be - ae
        length = dn * dn + de * de
        share = 0.0
        if length > 0.0:
            share = min(max(-(an * dn + ae * de) / length, 0.0), 1.0)
        pn, pe = an + share * dn, ae + share * de
        nearest = min(nearest, pn * pn + pe * pe)
        previous = corner
    distance = math.sqrt(nearest)
    return distance if inside else -distance


@kernel
def _is_blocked(bounds: PackedBounds, north: float, east: float) -> bool:
    row = math.floor((north - bounds.origin_north_m) / bounds.cell_m)
    column = math.floor((east - bounds.origin_east_m) / bounds.cell_m)
    if row < 0 or column < 0 or row >= bounds.blocked.shape[0] or column >= bounds.blocked.shape[1]:
        return False
    return bool(bounds.blocked[int(row), int(column)])


@kernel
def violation_m(bounds: PackedBounds, north: float, east: float, cosine: float, sine: float) -> float:
    """How far a pose is from being feasible for fence and obstacles, m; 0 if it is.

    For the fence, by how much the better of the two tightest circles sticks out; in an obstacle, one cell more.
    """
    violation = 0.0
    if bounds.fence.shape[0] > 0:
        right, left = bounds.right_radius_m, bounds.left_radius_m
        violation = np.inf
        if right >= 0.0:
            violation = right - _clearance_m(bounds.fence, north - right * sine, east + right * cosine)
        if left >= 0.0:
            violation = min(violation, left - _clearance_m(bounds.fence, north + left * sine, east - left * cosine))
        violation = violation if violation > _TOLERANCE_M else 0.0
    if _is_blocked(bounds, north, east):
        violation += bounds.cell_m
    return violation


@inlined_kernel
def _is_far_from_all(bounds: PackedBounds, north: float, east: float) -> bool:
    """Whether nothing static is within one step's reach, so that no child needs to be looked at."""
    if bounds.fence.shape[0] > 0 and _clearance_m(bounds.fence, north, east) <= bounds.reach_m:
        return False
    rows, columns = bounds.blocked.shape
    if rows == 0:
        return True
    row = math.floor((north - bounds.origin_north_m) / bounds.cell_m)
    column = math.floor((east - bounds.origin_east_m) / bounds.cell_m)
    if row < 0 or column < 0 or row >= rows or column >= columns:
        return False
    # A point is at least (distance − 1) whole cells away from a blocked one.
    return bool((bounds.clear_cells[int(row), int(column)] - 1) * bounds.cell_m > bounds.reach_m)


@inlined_kernel
def _crosses_fence(
    fence: NDArray[np.float64], north: float, east: float, cosine: float, sine: float,
    speed: float, yaw_rate: float, duration_s: float,
) -> bool:  # fmt: skip
    """Whether the arc of a primitive meets an edge of the fence, exactly."""
    if speed == 0.0:
        return False
    straight = abs(yaw_rate * duration_s) < 1e-9
    radius, centre_n, centre_e = 0.0, 0.0, 0.0
    if not straight:
        radius = speed / yaw_rate  # signed: the centre is to the right for a positive one
        centre_n, centre_e = north - radius * sine, east + radius * cosine
    dn, de = speed * duration_s * cosine, speed * duration_s * sine
    previous = fence.shape[0] - 1
    for corner in range(fence.shape[0]):
        an, ae = fence[previous, 0], fence[previous, 1]
        en, ee = fence[corner, 0] - an, fence[corner, 1] - ae
        previous = corner
        if straight:
            across = dn * ee - de * en
            if across != 0.0:
                on_path = ((an - north) * ee - (ae - east) * en) / across
                on_edge = ((an - north) * de - (ae - east) * dn) / across
                if 0.0 < on_path <= 1.0 and 0.0 <= on_edge <= 1.0:
                    return True
            continue
        fn, fe = an - centre_n, ae - centre_e
        a = en * en + ee * ee
        half_b = fn * en + fe * ee
        discriminant = half_b * half_b - a * (fn * fn + fe * fe - radius * radius)
        if a == 0.0 or discriminant <= 0.0:
            continue
        root = math.sqrt(discriminant)
        for sign in (-1.0, 1.0):
            share = (-half_b + sign * root) / a
            if share < 0.0 or share > 1.0:
                continue
            # Angle swept from the start of the arc to the crossing.
            sn, se = north - centre_n, east - centre_e
            pn, pe = fn + share * en, fe + share * ee
            swept = math.atan2(sn * pe - se * pn, sn * pn + se * pe)
            if yaw_rate < 0.0:
                swept = -swept
            if swept < 0.0:
                swept += 2.0 * math.pi
            if swept <= abs(yaw_rate) * duration_s:
                return True
    return False


@inlined_kernel
def _crosses_obstacle(
    bounds: PackedBounds, north: float, east: float, cosine: float, sine: float,
    speed: float, yaw_rate: float, duration_s: float,
) -> bool:  # fmt: skip
    """Whether the arc enters a blocked cell; looked at every eighth of a cell."""
    pieces = math.ceil(8.0 * abs(speed) * duration_s / bounds.cell_m)
    for piece in range(1, pieces):
        time_s = duration_s * piece / pieces
        half = 0.5 * yaw_rate * time_s
        chord = speed * time_s * (math.sin(half) / half if abs(half) > 1e-9 else 1.0)
        ahead, right = chord * math.cos(half), chord * math.sin(half)
        if _is_blocked(bounds, north + cosine * ahead - sine * right, east + sine * ahead + cosine * right):
            return True
    return False


@inlined_kernel
def _arc_is_clear(
    bounds: PackedBounds, north: float, east: float, cosine: float, sine: float,
    speed: float, yaw_rate: float, duration_s: float,
) -> bool:  # fmt: skip
    """Whether the way between two poses, an arc of a primitive from the first, keeps to fence and obstacles."""
    if bounds.fence.shape[0] > 0 and _crosses_fence(
        bounds.fence, north, east, cosine, sine, speed, yaw_rate, duration_s
    ):
        return False
    return not (
        bounds.blocked.shape[0] > 0
        and _crosses_obstacle(bounds, north, east, cosine, sine, speed, yaw_rate, duration_s)
    )


@kernel
def _keeps_separation(bounds: PackedBounds, step: int, north: float, east: float) -> bool:
    """Whether a position at step 1..T keeps clear of all teammates' planned positions at that step."""
    for mate in range(bounds.separations_m.shape[0]):
        dn = bounds.teammates[mate, step - 1, 0] - north
        de = bounds.teammates[mate, step - 1, 1] - east
        if dn * dn + de * de < bounds.separations_m[mate] * bounds.separations_m[mate]:
            return False
    return True


@kernel
def step_penalty_m(
    bounds: PackedBounds, step: int, north: float, east: float, cosine: float, sine: float, dn: float, de: float,
    turn_cosine: float, turn_sine: float, speed: float, yaw_rate: float,
) -> float:  # fmt: skip
    """Judge one step of a robot: the violation of the pose it leads to (m), ∞ if it must not be made.

    Args:
        bounds: The bounds.
        step: Which step, 1..T.
        north: Of the pose before, m.
        east: Of the pose before, m.
        cosine: Of the yaw before.
        sine: Of the yaw before.
        dn: Displacement to the north, m.
        de: Displacement to the east, m.
        turn_cosine: Of the change of yaw.
        turn_sine: Of the change of yaw.
        speed: ν, m/s.
        yaw_rate: ω, rad/s.
    """
    if not _keeps_separation(bounds, step, north + dn, east + de):
        return np.inf
    if _is_far_from_all(bounds, north, east):
        return 0.0
    before = violation_m(bounds, north, east, cosine, sine)
    after = violation_m(
        bounds, north + dn, east + de,
        cosine * turn_cosine - sine * turn_sine, sine * turn_cosine + cosine * turn_sine,
    )  # fmt: skip
    if after > before + _TOLERANCE_M:
        return np.inf
    if before == 0.0 and not _arc_is_clear(bounds, north, east, cosine, sine, speed, yaw_rate, bounds.step_s):
        return np.inf
    return after
