"""Where a vehicle lands when somebody lies at its home, or may: the free place nearest to it."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence

from onboard.config.polygon import Point, contains, edge_distance
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.flight.states import PLANNING
from onboard.messages import FlightState, PeerStatus
from onboard.strays import Stray

__all__ = ["LandingPlace"]

EDGE_M = 0.3
"""Kept from the fence."""
RING_M = 0.2
FARTHEST_M = 4.0
_DIRECTIONS = 16

_ELSEWHERE_SOON = (FlightState.TAKEOFF, *PLANNING)


class LandingPlace:
    """Looks for a place that is free of those who lie on the ground, come down, or land at their homes.

    Args:
        scenario: The mission area, separations, homes.
        vehicle: This robot.
    """

    def __init__(self, scenario: Scenario, vehicle: VehicleConfig) -> None:
        self._mission = scenario.mission
        self._clear_m = scenario.flight.guard.separation_share * scenario.mission.separation_m
        self._homes = {mate.id: mate.home for mate in scenario.vehicles if mate.id != vehicle.id}

    def instead_of(self, home: Point, heard: Iterable[PeerStatus], strays: Sequence[Stray]) -> Point | None:
        """Where to land instead; None where home is free, or nothing near is freer.

        Args:
            home: Where this robot would land, north m, east m.
            heard: The last status of each peer.
            strays: Those whose place is not sure.
        """
        down = [
            (status.position[0], status.position[1])
            for status in heard
            if status.state not in _ELSEWHERE_SOON and not (status.state is FlightState.RETURN and not status.over_home)
        ]
        if self._free(home, down, strays):
            return None
        for place in _rings(home):
            if not self._inside(place) or not self._free(place, [*down, *self._homes.values()], strays):
                continue
            return place
        return None

    def _free(self, place: Point, taken: Iterable[Point], strays: Iterable[Stray]) -> bool:
        if any(math.dist(place, other) < self._clear_m for other in taken):
            return False
        return all(math.dist(place, stray.nearest(place)) >= self._clear_m + stray.unsure_m for stray in strays)

    def _inside(self, place: Point) -> bool:
        mission = self._mission
        return (
            contains(mission.fence, place)
            and edge_distance(mission.fence, place) >= EDGE_M
            and not any(
                contains(obstacle, place) or edge_distance(obstacle, place) < mission.obstacle_clearance_m
                for obstacle in mission.obstacles
            )
        )


def _rings(centre: Point) -> Iterator[Point]:
    """Places around another, the nearest first."""
    for ring in range(1, round(FARTHEST_M / RING_M) + 1):
        for direction in range(_DIRECTIONS):
            angle = 2.0 * math.pi * direction / _DIRECTIONS
            yield centre[0] + ring * RING_M * math.cos(angle), centre[1] + ring * RING_M * math.sin(angle)
