"""Teammates that nobody flies: who counts as one, where it may be, and for how long it is kept off."""

import dataclasses
import math
from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from onboard.flight.trajectory import PlanTrajectory
from onboard.geometry import Pose
from onboard.hearing import Hearing
from onboard.last_resort import LastResort
from onboard.messages import FlightState, LostTeammate, PeerStatus
from onboard.planning.primitives import Primitive
from onboard.strays import FLIES_ON_S, SILENT_S

LAB = load_scenario(Path("configs/lab.yaml"))
GUARD = LAB.flight.guard
KEEP_M = GUARD.separation_share * LAB.mission.separation_m
NOW = 1_800_000_000.0
BELOW_M = -1.0
STATUS = PeerStatus(2, NOW, FlightState.TRACK, (2.0, 4.0, -1.7), 0.0, (1,), False, NOW, (1.0, 0.0))
NORTHWARD = PlanTrajectory(NOW - 1.0, Pose(1.0, 4.0, 0.0), [Primitive(1.0, 0.0)] * 12, 0.5)


def last_heard(status: PeerStatus, far_m: float = 3.0, scenario: Scenario = LAB) -> tuple[LastResort, Hearing]:
    """A last resort that has heard this peer from as far as that before, and then this status."""
    hearing = Hearing()
    resort = LastResort(scenario, scenario.vehicle(1), hearing)
    then = Pose(status.position[0], status.position[1] + far_m, 0.0)
    hearing.receive_status(dataclasses.replace(status, time_s=NOW - 1.0), then, -1.7, NOW - 1.0)
    resort.receive_plan(2, NORTHWARD)
    hearing.receive_status(status, then, -1.7, NOW)
    return resort, hearing


def test_who_falls_silent_nearby_is_kept_off_in_all_layers_on_the_way_that_it_may_fly_on() -> None:
    (resort, _), here = last_heard(STATUS), (2.4, 3.0)
    assert resort.obstructions(NOW + SILENT_S - 0.1, here, BELOW_M) == []
    (other,) = resort.obstructions(NOW + SILENT_S + 0.1, here, BELOW_M)
    assert (other.north_m, other.east_m) == pytest.approx((2.4, 4.0)), "the nearest point of its way"
    assert other.distance_m == pytest.approx(KEEP_M + GUARD.drift_m)
    assert not other.keeps_off
    assert not resort.may_descend((2.4, 3.0))
    assert resort.may_descend((2.4, 2.0))
    beyond = (4.0, 4.0)
    (end,) = resort.obstructions(NOW + 8.0, beyond, BELOW_M)
    assert (end.north_m, end.east_m) == pytest.approx((2.0 + FLIES_ON_S, 4.0))
    assert resort.obstructions(NOW + GUARD.stray_s + 0.1, here, BELOW_M) == []
    assert [stray.peer for stray in resort.lying] == [2], "where it fell silent"


def test_who_is_heard_again_is_no_stray() -> None:
    (resort, hearing), here = last_heard(STATUS), (2.4, 3.0)
    assert resort.obstructions(NOW + 1.4, here, BELOW_M)
    hearing.receive(2, NOW + 1.5)
    assert resort.obstructions(NOW + 1.6, here, BELOW_M) == []
    assert resort.lying == []


@pytest.mark.parametrize(
    ("status", "far_m", "here"),
    [
        (STATUS, 3.0, (2.0, 1.4)),
        (STATUS, 1.0, (2.0, 3.5)),
        (dataclasses.replace(STATUS, state=FlightState.LANDED, position=(2.0, 4.0, 0.0)), 3.0, (2.0, 3.5)),
    ],
    ids=["may be out of range by now", "never heard from so far", "on the ground"],
)
def test_whose_silence_means_nothing_is_no_stray(status: PeerStatus, far_m: float, here: tuple[float, float]) -> None:
    resort, _ = last_heard(status, far_m)
    assert resort.obstructions(NOW + SILENT_S + 0.1, here, BELOW_M) == []


@pytest.mark.parametrize(
    "state", [FlightState.TRACK, FlightState.RELEASED, FlightState.WAIT], ids=["failed safe", "let go", "started anew"]
)
def test_who_says_that_nobody_flies_it_is_kept_off_in_all_layers_while_its_place_is_measured(
    state: FlightState,
) -> None:
    status = dataclasses.replace(STATUS, state=state, adrift=True)
    resort, hearing = last_heard(status)
    for time_s in (NOW + 0.1, NOW + 5.0):
        hearing.receive(2, time_s)
        assert len(resort.obstructions(time_s, (2.0, 2.0), BELOW_M)) == 1
    frozen_s = NOW + GUARD.stray_s + 0.1
    hearing.receive(2, frozen_s)
    hearing.receive_status(dataclasses.replace(status, time_s=frozen_s), None, BELOW_M, frozen_s)
    assert resort.obstructions(frozen_s, (2.0, 2.0), BELOW_M) == []
    assert [stray.peer for stray in resort.lying] == [2], "and nobody lands where it was"
    measured = dataclasses.replace(status, position=(2.0, 4.01, -1.2), time_s=frozen_s)
    hearing.receive_status(measured, None, BELOW_M, frozen_s)
    assert len(resort.obstructions(frozen_s, (2.0, 2.0), BELOW_M)) == 1
    down = dataclasses.replace(measured, state=FlightState.LANDED, adrift=False)
    hearing.receive_status(down, None, BELOW_M, frozen_s)
    assert resort.obstructions(frozen_s, (2.0, 2.0), BELOW_M) == []


def test_one_that_is_adrift_is_taken_to_be_farther_off_the_longer_it_may_be_blind() -> None:
    adrift = dataclasses.replace(STATUS, adrift=True)
    resort, hearing = last_heard(adrift)
    unsure_m = []
    for later_s in (0.0, 3.0, 30.0):
        hearing.receive_status(dataclasses.replace(adrift, time_s=NOW + later_s), None, BELOW_M, NOW + later_s)
        (stray,) = resort.lying
        unsure_m.append(stray.unsure_m)
    assert unsure_m == pytest.approx([GUARD.drift_m + off_m for off_m in (0.1, 0.4, 0.5)])
    set_back = dataclasses.replace(adrift, time_s=NOW - 30.0)  # a clock, its own or ours
    hearing.receive_status(set_back, None, BELOW_M, NOW - 30.0)
    assert [stray.unsure_m for stray in resort.lying] == pytest.approx([GUARD.drift_m]), "no nearer than at first"
    well = dataclasses.replace(adrift, adrift=False, time_s=NOW + 31.0)
    hearing.receive_status(well, None, BELOW_M, NOW + 31.0)
    assert resort.lying == []


def test_who_lands_is_kept_off_by_those_below_only() -> None:
    status = dataclasses.replace(STATUS, state=FlightState.LAND, velocity=(0.0, 0.0))
    resort, _ = last_heard(status)
    assert len(resort.obstructions(NOW, (2.0, 2.0), BELOW_M)) == 1
    assert resort.obstructions(NOW, (2.0, 2.0), -2.4) == []


@pytest.mark.parametrize(("autopilot", "lead_s"), [("px4", 0.08), ("ardupilot", 0.42)])
def test_a_turn_is_flown_on_straight_from_where_its_last_setpoint_leads(autopilot: str, lead_s: float) -> None:
    """Setpoints are sent ahead by what an autopilot takes to follow them, as measured."""
    mates = tuple(mate.model_copy(update={"autopilot": autopilot}) for mate in LAB.vehicles)
    resort, hearing = last_heard(STATUS, scenario=LAB.model_copy(update={"vehicles": mates}))
    turning = PlanTrajectory(NOW - 0.5, Pose(1.5, 4.0, 0.0), [Primitive(1.0, 0.0), *[Primitive(1.0, 1.0)] * 11], 0.5)
    resort.receive_plan(2, turning)
    hearing.receive(2, NOW + 0.5)
    resort.obstructions(NOW + 0.5 + SILENT_S + 0.1, (2.4, 3.0), BELOW_M)
    (stray,) = resort.strays
    for later_s in (0.0, 0.25, 0.5):  # it falls silent somewhere before its next word
        last = turning.reference(NOW + 0.5 + lead_s + later_s)
        ahead_s = FLIES_ON_S - later_s
        end = (
            last.pose.north_m + ahead_s * last.velocity_north_m_s,
            last.pose.east_m + ahead_s * last.velocity_east_m_s,
        )
        assert math.dist(stray.nearest(end), end) <= stray.unsure_m
    assert stray.unsure_m < 0.8, "and not everywhere"


def test_those_who_did_not_hear_a_teammate_are_told_where_it_fell_silent() -> None:
    (witness, _), here = last_heard(STATUS), (2.4, 3.0)
    witness.obstructions(NOW + SILENT_S + 0.1, here, BELOW_M)
    (lost,) = witness.lost(NOW + 5.0)
    assert (lost.peer, lost.silence_s) == (2, pytest.approx(5.0))
    hearing = Hearing()
    far_off = LastResort(LAB, LAB.vehicle(3), hearing)
    far_off.receive_lost(lost, NOW + 5.1)
    (other,) = far_off.obstructions(NOW + 5.2, here, BELOW_M)
    assert (other.north_m, other.east_m) == pytest.approx((2.4, 4.0))
    assert not far_off.may_descend((2.4, 3.5))
    (again,) = far_off.lost(NOW + 6.0)
    assert again.silence_s == pytest.approx(5.9), "told on, and no fresher for that"
    assert far_off.obstructions(NOW + GUARD.stray_s + 0.2, here, BELOW_M) == []
    assert [stray.peer for stray in far_off.lying] == [2]
    hearing.receive(2, NOW + 30.0)
    assert far_off.lying == []
    assert far_off.lost(NOW + 30.0) == []


def test_what_is_told_of_a_teammate_that_was_heard_later_is_not_believed() -> None:
    resort, hearing = last_heard(STATUS)
    lost = LostTeammate(2, 3.0, (0.5, 0.5), (0.5, 0.5), 0.2, -1.0)
    hearing.receive(2, NOW + 1.0)
    resort.receive_lost(lost, NOW + 3.5)
    assert resort.lying == []
    resort.receive_lost(dataclasses.replace(lost, silence_s=1.0), NOW + 3.5)
    assert [stray.begin for stray in resort.lying] == [(0.5, 0.5)], "its last witness knows best"
    resort.receive_lost(dataclasses.replace(lost, silence_s=1.6, begin=(1.0, 1.0)), NOW + 3.5)
    assert [stray.begin for stray in resort.lying] == [(0.5, 0.5)]


def test_who_falls_silent_on_its_way_home_is_foreseen_around_obstacles() -> None:
    wall = ((2.0, 1.5), (2.2, 1.5), (2.2, 6.5), (2.0, 6.5))
    walled = LAB.model_copy(update={"mission": LAB.mission.model_copy(update={"obstacles": (wall,)})})
    returns = dataclasses.replace(STATUS, state=FlightState.RETURN, position=(2.8, 3.0, -1.7), velocity=(0.0, 0.0))
    ends = []
    for scenario in (LAB, walled):
        resort, _ = last_heard(returns, scenario=scenario)
        assert resort.obstructions(NOW + SILENT_S + 0.1, (2.8, 2.5), BELOW_M)
        (stray,) = resort.strays
        ends.append(stray.end)
    home = LAB.vehicle(2).home
    assert (ends[0][0] - 2.8) / (ends[0][1] - 3.0) == pytest.approx((home[0] - 2.8) / (home[1] - 3.0))
    assert ends[1][0] < 2.8
    assert ends[1][1] < 3.0, "towards the wall's nearer end"
