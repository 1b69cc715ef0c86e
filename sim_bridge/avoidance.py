"""How ground robots keep out of each other's way: reciprocal velocity obstacles, sampled, above braking commitments.

Two layers, both in velocity space:

1. *Steering.* Among sampled velocities the one with the smallest ``w/t + ‖v_wanted − v‖`` is chosen, where t is the
   time to contact if the other robots share the effort equally (van den Berg, Lin, Manocha: Reciprocal velocity
   obstacles for real-time multi-agent navigation, ICRA 2008, sec. V). It makes robots pass each other; it guarantees
   nothing.
2. *Commitment.* A control is admitted only if the robot can brake to a stop after it without touching a wall (Fox,
   Burgard, Thrun: The dynamic window approach, 1997) or any other robot's current commitment, which is that robot's
   own braking path, compared at equal times. Braking on stays possible for everybody: passive safety by induction
   (Macek, Vasquez-Govea, Fraichard, Siegwart: Towards safe vehicle navigation in dynamic urban scenarios, 2009).
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

__all__ = ["Neighbour", "choose_velocity", "paths_touch", "time_to_contact"]

Point = tuple[float, float]
Neighbour = tuple[float, float, float, float]
"""Relative north, east (m) and own velocity north, east (m/s) of another robot."""

HORIZON_S = 2.5
"""Contacts later than this do not matter to the steering."""

_AVERSION_M = 0.5
"""w: a contact one second away is as bad as deviating by this much per second."""

_TURNS_RAD = tuple(math.radians(a) for a in (0, 15, -15, 30, -30, 50, -50, 75, -75, 105, -105, 140, -140, 180))
_SPEED_SHARES = (1.0, 0.5)


def time_to_contact(north_m: float, east_m: float, closing_n: float, closing_e: float, reach_m: float) -> float:
    """When two discs touch that approach evenly, s; 0 if they overlap and still approach, ∞ if they never touch.

    Args:
        north_m: Position of the other relative to this one, m.
        east_m: The same, east.
        closing_n: Velocity of this one relative to the other, m/s.
        closing_e: The same, east.
        reach_m: Sum of the radii, m.
    """
    approach = north_m * closing_n + east_m * closing_e
    if approach <= 0.0:
        return math.inf
    gap = north_m * north_m + east_m * east_m - reach_m * reach_m
    if gap <= 0.0:
        return 0.0
    square = closing_n * closing_n + closing_e * closing_e
    discriminant = approach * approach - square * gap
    return gap / (approach + math.sqrt(discriminant)) if discriminant >= 0.0 else math.inf


def choose_velocity(
    wanted: Point,
    own: Point,
    neighbours: Sequence[Neighbour],
    reach_m: float,
    blocked: Iterable[Point] = (),
) -> Point:
    """The sampled velocity with the smallest ``w/t + ‖v_wanted − v‖``.

    Ties go to the clockwise side, so that robots that meet head-on both pass on their right.

    Args:
        wanted: Velocity straight to the goal (north, east), m/s.
        own: Velocity now, m/s.
        neighbours: The other robots near by.
        reach_m: Distance of two centres at contact, m.
        blocked: Unit vectors towards walls that are near: velocities into them are left out.
    """
    speed, heading = math.hypot(*wanted), math.atan2(wanted[1], wanted[0])
    walls = tuple(blocked)
    best, best_cost = (0.0, 0.0), _cost((0.0, 0.0), wanted, own, neighbours, reach_m, math.inf)
    for turn in _TURNS_RAD:
        unit = (math.cos(heading + turn), math.sin(heading + turn))
        if any(unit[0] * wall[0] + unit[1] * wall[1] > 0.1 for wall in walls):
            continue
        for share in _SPEED_SHARES:
            velocity = (share * speed * unit[0], share * speed * unit[1])
            cost = _cost(velocity, wanted, own, neighbours, reach_m, best_cost)
            if cost < best_cost - 1e-9:
                best, best_cost = velocity, cost
    return best


def _cost(
    velocity: Point, wanted: Point, own: Point, neighbours: Sequence[Neighbour], reach_m: float, enough: float
) -> float:
    deviation = math.hypot(velocity[0] - wanted[0], velocity[1] - wanted[1])
    if deviation >= enough:
        return deviation
    soonest = HORIZON_S
    for north_m, east_m, their_n, their_e in neighbours:
        # The reciprocal velocity: both take half of the avoiding.
        closing_n, closing_e = 2.0 * velocity[0] - own[0] - their_n, 2.0 * velocity[1] - own[1] - their_e
        soonest = min(soonest, time_to_contact(north_m, east_m, closing_n, closing_e, reach_m))
    if soonest >= HORIZON_S:
        return deviation
    return deviation + _AVERSION_M * (1.0 / max(soonest, 0.01) - 1.0 / HORIZON_S)


def paths_touch(first: Sequence[Point], second: Sequence[Point], reach_m: float) -> bool:
    """Whether two robots come within a distance if each follows its points, one per period, straight between them.

    Whoever arrives at its last point stays there.
    """
    square = reach_m * reach_m
    last_first, last_second = len(first) - 1, len(second) - 1
    n0, e0 = first[0][0] - second[0][0], first[0][1] - second[0][1]
    if n0 * n0 + e0 * e0 < square:
        return True
    for k in range(1, max(last_first, last_second) + 1):
        a, b = first[min(k, last_first)], second[min(k, last_second)]
        n1, e1 = a[0] - b[0], a[1] - b[1]
        dn, de = n1 - n0, e1 - e0
        length = dn * dn + de * de
        # Nearest point to the origin on the segment of relative positions.
        along = 0.0 if length == 0.0 else max(0.0, min(1.0, -(n0 * dn + e0 * de) / length))
        n, e = n0 + along * dn, e0 + along * de
        if n * n + e * e < square:
            return True
        n0, e0 = n1, e1
    return False
