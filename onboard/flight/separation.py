"""The last resort below the planner: a velocity that stays off teammates and obstacles, and inside the fence.

Every danger bounds how fast the vehicle may approach it, by the distance that stopping takes; among the velocities that
keep all bounds, the one nearest to what is wanted is flown. Far from danger that is what is wanted, so the filter hands
back without a step. It is no planner: it may stop a vehicle where a plan would go around.

A bound is a half-plane n·v ≤ b of velocities, as in the linear constraints of van den Berg, Guy, Lin, Manocha:
Reciprocal n-body collision avoidance, 2011; with b = v(gap), the speed from which reaction and braking need the gap:
gap = v·t + v²/(2a).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

from onboard.config.guard import GuardConfig
from onboard.config.polygon import Point, contains, nearest_on_segment
from onboard.flight.setpoints import Setpoint

__all__ = ["Bound", "Guard", "Obstruction", "approach_speed_m_s", "nearest_velocity"]

_TOLERANCE_M_S = 1e-9


@dataclass(frozen=True, slots=True)
class Bound:
    """A limit on the velocity in one direction.

    Attributes:
        north: Unit vector towards the danger.
        east: The same, east.
        speed_m_s: Greatest speed in that direction; negative where the vehicle must retreat.
    """

    north: float
    east: float
    speed_m_s: float

    def excess(self, velocity: Point) -> float:
        """By how much a velocity breaks the bound, m/s; not positive where it keeps it."""
        return self.north * velocity[0] + self.east * velocity[1] - self.speed_m_s


@dataclass(frozen=True, slots=True)
class Obstruction:
    """Somebody to keep off.

    Attributes:
        north_m: Where, mission frame.
        east_m: The same, east.
        distance_m: That is to be kept between the centres, the uncertainty of its place included.
        keeps_off: Whether it keeps off this vehicle, too; else all of the gap is to be left to it.
    """

    north_m: float
    east_m: float
    distance_m: float
    keeps_off: bool = True


def approach_speed_m_s(gap_m: float, config: GuardConfig, delay_s: float = 0.0) -> float:
    """The fastest speed from which the vehicle stops within a gap, m/s; negative (a retreat) in a negative one.

    Args:
        gap_m: To where it must have stopped.
        config: Braking and reaction.
        delay_s: Added to the reaction.
    """
    if gap_m <= 0.0:
        return max(config.retreat_gain_per_s * gap_m, -config.retreat_m_s)
    lag = config.brake_m_s2 * (config.reaction_s + delay_s)
    return math.sqrt(lag * lag + 2.0 * config.brake_m_s2 * gap_m) - lag


def nearest_velocity(wanted: Point, bounds: Sequence[Bound]) -> Point:
    """The velocity nearest to the wanted one that keeps all bounds; where none does, the one that breaks them least.

    With bounds that contradict each other, those that ask for a retreat ask for less and less, down to a standstill.

    Args:
        wanted: North, east, m/s.
        bounds: Any number.
    """
    for relaxed in (0.0, 0.5, 1.0):
        eased = [
            bound if bound.speed_m_s >= 0.0 else replace(bound, speed_m_s=(1.0 - relaxed) * bound.speed_m_s)
            for bound in bounds
        ]
        best = min(
            (velocity for velocity in _candidates(wanted, eased) if _keeps(velocity, eased)),
            key=lambda velocity: math.dist(velocity, wanted),
            default=None,
        )
        if best is not None:
            return best
    return 0.0, 0.0


def _candidates(wanted: Point, bounds: Sequence[Bound]) -> list[Point]:
    """Where the optimum of the quadratic programme can be: free, on one line, or where two meet."""
    if _keeps(wanted, bounds):
        return [wanted]
    found = []
    for bound in bounds:
        excess = bound.excess(wanted)
        if excess > 0.0:
            found.append((wanted[0] - excess * bound.north, wanted[1] - excess * bound.east))
    for a, b in combinations(bounds, 2):
        determinant = a.north * b.east - a.east * b.north
        if abs(determinant) > 1e-9:
            found.append(
                (
                    (a.speed_m_s * b.east - b.speed_m_s * a.east) / determinant,
                    (b.speed_m_s * a.north - a.speed_m_s * b.north) / determinant,
                )
            )
    return found


def _keeps(velocity: Point, bounds: Sequence[Bound]) -> bool:
    return all(bound.excess(velocity) <= _TOLERANCE_M_S for bound in bounds)


class Guard:
    """Filters one vehicle's setpoints.

    Args:
        config: Braking, reaction, margins.
        fence: Corners (north m, east m) of the mission area.
        obstacles: The same of what stands in it.
        clearance_m: That plans keep from obstacles.
    """

    def __init__(
        self,
        config: GuardConfig,
        fence: Sequence[Point],
        obstacles: Sequence[Sequence[Point]] = (),
        clearance_m: float = 0.0,
    ) -> None:
        self._config = config
        self._fence = tuple(fence)
        self._obstacles = [(tuple(corners), _box(corners)) for corners in obstacles]
        self._keep_m = max(clearance_m - config.fence_margin_m, 0.0)

    def filter(
        self, setpoint: Setpoint, place: Point, obstructions: Sequence[Obstruction], *, obstacles: bool = True
    ) -> Setpoint:
        """The setpoint, with a velocity that keeps off; the same object where it does already.

        Args:
            setpoint: What is wanted.
            place: Where the vehicle is, mission frame, m.
            obstructions: Whom to keep off, on its layer.
            obstacles: Whether obstacles are kept off, too.
        """
        wanted = (setpoint.velocity_north_m_s, setpoint.velocity_east_m_s)
        bounds = [*self._fence_bounds(place), *self._peer_bounds(place, obstructions)]
        if obstacles:
            bounds += self._obstacle_bounds(place, math.hypot(*wanted))
        if _keeps(wanted, bounds):
            return setpoint
        return setpoint.at_velocity(*nearest_velocity(wanted, bounds))

    def _peer_bounds(self, place: Point, obstructions: Sequence[Obstruction]) -> list[Bound]:
        """Each of two vehicles that approach each other gets half of the gap between them."""
        bounds = []
        delay_s = self._config.peer_delay_s
        for other in obstructions:
            north, east = other.north_m - place[0], other.east_m - place[1]
            apart = math.hypot(north, east)
            if apart < 1e-6:
                continue  # no direction is better than another
            gap = (0.5 if other.keeps_off else 1.0) * (apart - other.distance_m)
            bounds.append(Bound(north / apart, east / apart, approach_speed_m_s(gap, self._config, delay_s)))
        return bounds

    def _fence_bounds(self, place: Point) -> list[Bound]:
        """One for each edge; outside, only the nearest one, which calls back in."""
        margin = self._config.fence_margin_m
        to_edges = _to_edges(self._fence, place)
        if not contains(self._fence, place):
            north, east = min(to_edges, key=_length)
            apart = math.hypot(north, east)
            if apart < 1e-6:
                return []
            return [Bound(-north / apart, -east / apart, approach_speed_m_s(margin - apart, self._config))]
        return self._towards(to_edges, margin)

    def _obstacle_bounds(self, place: Point, speed_m_s: float) -> list[Bound]:
        """One for each edge of what is near enough for this speed; inside, only the nearest one, which calls out."""
        speed_m_s = max(speed_m_s, self._config.retreat_m_s)
        bounds = []
        for corners, ((north0, east0), (north1, east1)) in self._obstacles:
            away = (max(north0 - place[0], place[0] - north1, 0.0), max(east0 - place[1], place[1] - east1, 0.0))
            if approach_speed_m_s(_length(away) - self._keep_m, self._config) >= speed_m_s:
                continue
            to_edges = _to_edges(corners, place)
            if not contains(corners, place):
                bounds += self._towards(to_edges, -self._keep_m)
                continue
            north, east = min(to_edges, key=_length)
            deep = math.hypot(north, east)
            if deep >= 1e-6:
                back = approach_speed_m_s(-deep - self._keep_m, self._config)
                bounds.append(Bound(-north / deep, -east / deep, back))
        return bounds

    def _towards(self, to_edges: Sequence[Point], margin_m: float) -> list[Bound]:
        """How fast edges may be approached that lie there, relative to the vehicle, with a margin beyond them."""
        bounds = []
        for north, east in to_edges:
            apart = math.hypot(north, east)
            if apart >= 1e-6:
                speed = approach_speed_m_s(apart + margin_m, self._config)
                bounds.append(Bound(north / apart, east / apart, speed))
        return bounds


def _to_edges(corners: Sequence[Point], place: Point) -> list[Point]:
    """From a place to the nearest point of each edge."""
    nearest = [nearest_on_segment(corners[index - 1], corners[index], place) for index in range(len(corners))]
    return [(north - place[0], east - place[1]) for north, east in nearest]


def _box(corners: Sequence[Point]) -> tuple[Point, Point]:
    """Southwest and northeast corner of what surrounds a polygon."""
    norths, easts = zip(*corners, strict=True)
    return (min(norths), min(easts)), (max(norths), max(easts))


def _length(vector: Point) -> float:
    return math.hypot(*vector)
