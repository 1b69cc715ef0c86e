"""Where peers are taken to be between their statuses, and what is said of it."""

import dataclasses
from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.flight.failsafes import Condition
from onboard.flight.setpoints import Setpoint
from onboard.flight.trajectory import PlanTrajectory
from onboard.geometry import Pose
from onboard.hearing import Hearing
from onboard.last_resort import LastResort
from onboard.messages import FlightState, PeerStatus
from onboard.planning.primitives import Primitive

LAB = load_scenario(Path("configs/lab.yaml"))
GUARD = LAB.flight.guard
KEEP_M = GUARD.separation_share * LAB.mission.separation_m
NOW = 1_800_000_000.0
HERE = (0.5, 1.0)
STATUS = PeerStatus(2, NOW, FlightState.TRACK, (2.0, 4.0, -1.0), 0.0, (1,), False, NOW)
NORTHWARD = PlanTrajectory(NOW - 1.0, Pose(1.0, 4.0, 0.0), [Primitive(1.0, 0.0)] * 12, 0.5)


def unit(*heard: PeerStatus) -> LastResort:
    hearing = Hearing()
    for status in heard:
        hearing.receive_status(status, None, -1.0, status.time_s)
    return LastResort(LAB, LAB.vehicle(1), hearing)


def setpoint(north: float, east: float) -> Setpoint:
    return Setpoint(north, east, 0.0, -1.0, 0.0, 0.0)


def test_a_peer_on_its_plan_is_extrapolated_along_it() -> None:
    resort = unit(STATUS)
    resort.receive_plan(2, NORTHWARD)
    (other,) = resort.obstructions(NOW + 0.4, HERE, -1.0)
    assert (other.north_m, other.east_m, other.distance_m) == pytest.approx((2.4, 4.0, KEEP_M))


def test_the_plan_that_is_flown_now_counts_not_the_next_one() -> None:
    resort = unit(STATUS)
    resort.receive_plan(2, NORTHWARD)
    resort.receive_plan(2, PlanTrajectory(NOW + 1.0, Pose(3.0, 4.0, 1.5), [Primitive(1.0, 3.0)] * 12, 0.5))
    (other,) = resort.obstructions(NOW + 0.4, HERE, -1.0)
    assert other.north_m == pytest.approx(2.4)


def test_a_peer_off_its_plan_is_anywhere_near_and_no_farther_than_the_limit() -> None:
    resort = unit(dataclasses.replace(STATUS, position=(2.0, 6.0, -1.0)))
    resort.receive_plan(2, NORTHWARD)
    for age_s, unsure_m in ((0.2, 0.2), (4.0, GUARD.drift_m)):
        (other,) = resort.obstructions(NOW + age_s, HERE, -1.0)
        assert (other.north_m, other.east_m) == (2.0, 6.0)
        assert other.distance_m == pytest.approx(KEEP_M + unsure_m)


@pytest.mark.parametrize(
    "status",
    [
        dataclasses.replace(STATUS, state=FlightState.LANDED),
        dataclasses.replace(STATUS, position=(2.0, 4.0, -1.0 - LAB.mission.layer_separation_m)),
        dataclasses.replace(STATUS, time_s=NOW - GUARD.silence_s - 0.1),
    ],
    ids=["on the ground", "on another layer", "silent for long"],
)
def test_who_is_not_in_the_way_is_not_kept_off(status: PeerStatus) -> None:
    assert unit(status).obstructions(NOW, HERE, -1.0) == []


def test_a_peer_that_fell_silent_is_still_kept_off_for_a_while() -> None:
    assert len(unit(STATUS).obstructions(NOW + GUARD.silence_s - 0.1, HERE, -1.0)) == 1


def test_what_it_bends_a_setpoint_for_is_seen_while_it_does() -> None:
    resort, here = unit(STATUS), Pose(1.2, 4.0, 0.0)
    assert resort.filter(setpoint(1.0, 0.0), NOW, here, -1.0).velocity_north_m_s < 0.5
    assert resort.near
    assert set(resort.dangers) == {Condition.TEAMMATE_NEAR}
    resort.filter(setpoint(1.0, 0.0), NOW, Pose(3.9, 1.0, 0.0), -1.0)
    assert set(resort.dangers) == {Condition.FENCE_NEAR}
    assert not resort.near
    resort.filter(setpoint(0.0, 0.0), NOW, here, -1.0)
    assert resort.dangers == {}


def test_without_a_position_nothing_is_changed_and_no_danger_is_told() -> None:
    wanted, resort = setpoint(1.0, 0.0), unit(STATUS)
    resort.filter(wanted, NOW, Pose(1.2, 4.0, 0.0), -1.0)
    assert resort.dangers
    assert resort.filter(wanted, NOW, None, -1.0) is wanted
    assert resort.dangers == {}
