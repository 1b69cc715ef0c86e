"""Where a vehicle lands when its home is taken."""

import dataclasses
import math
from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.config.polygon import contains
from onboard.landing_place import LandingPlace
from onboard.messages import FlightState, PeerStatus
from onboard.strays import Stray

LAB = load_scenario(Path("configs/lab.yaml"))
CLEAR_M = LAB.flight.guard.separation_share * LAB.mission.separation_m
HOME = LAB.vehicle(1).home
LYING = PeerStatus(2, None, FlightState.WAIT, (HOME[0] + 0.3, HOME[1], 0.0), 0.0, (), True, 0.0)
STRAY = Stray(2, (HOME[0] - 0.5, HOME[1]), (HOME[0] + 1.0, HOME[1]), 0.6, -1.7, sinks=False)


def place(heard: list[PeerStatus], strays: list[Stray]) -> tuple[float, float] | None:
    return LandingPlace(LAB, LAB.vehicle(1)).instead_of(HOME, heard, strays)


@pytest.mark.parametrize(
    "status",
    [
        dataclasses.replace(LYING, position=(*LAB.vehicle(2).home, 0.0)),
        dataclasses.replace(LYING, state=FlightState.TRACK),
        dataclasses.replace(LYING, state=FlightState.RETURN, over_home=False),
    ],
    ids=["stands at its own home", "flies over", "on its way home"],
)
def test_home_is_where_it_lands_unless_somebody_is_there(status: PeerStatus) -> None:
    assert place([status], []) is None


def test_it_lands_beside_who_lies_at_its_home_clear_of_all_homes_and_inside_the_fence() -> None:
    found = place([LYING], [])
    assert found is not None
    assert math.dist(found, LYING.position[:2]) >= CLEAR_M
    assert math.dist(found, HOME) <= CLEAR_M
    assert contains(LAB.mission.fence, found)
    assert all(math.dist(found, LAB.vehicle(mate).home) >= CLEAR_M for mate in (2, 3))
    assert place([dataclasses.replace(LYING, position=(HOME[0], HOME[1] - CLEAR_M, 0.0))], []) is None


def test_it_keeps_clear_of_the_whole_way_that_a_stray_may_have_flown() -> None:
    found = place([], [STRAY])
    assert found is not None
    assert math.dist(found, STRAY.nearest(found)) >= CLEAR_M + STRAY.unsure_m


def test_where_no_place_is_free_it_stays_with_home() -> None:
    everywhere = dataclasses.replace(STRAY, unsure_m=20.0)
    assert place([], [everywhere]) is None
