"""What teammates say: whose word counts, at what time it was so, and what of it is refused."""

import math
from pathlib import Path

import pytest

from onboard.clock_watch import ClockWatch
from onboard.config import load_scenario
from onboard.counts import Counts
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.machine import FlightMachine
from onboard.hearing import Hearing
from onboard.last_resort import LastResort
from onboard.messages import FlightState
from onboard.mission import Mission
from onboard.peer_inbox import PeerInbox
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.team_messages import MessageError, primitives_checksum
from onboard.whereabouts import Whereabouts

SCENARIO = load_scenario(Path("configs/lab.yaml"))
NOW = 1_800_000_000.0
UNKNOWN = [255] * 32


def heard(message: mavlink.MAVLink_message, sender: tuple[int, int] = (2, 191)) -> mavlink.MAVLink_message:
    (arrived,) = Codec(99, 1).decode(Codec(*sender).encode(message))
    return arrived


def status(time_s: float) -> mavlink.MAVLink_planner_status_message:
    counts = [0] * 7
    return mavlink.MAVLink_planner_status_message(
        round(time_s * 1e6), round(NOW * 1e6), 1.0, 4.0, -1.7, 0.0, math.nan, math.nan, 0.0, *counts,
        neighbours=[0] * 32, state=FlightState.TRACK, group_size=1, group_order=0, targets=0, landmarks=0, over_home=0,
        neighbour_loss=UNKNOWN, velocity_north=1.0, velocity_east=0.0, adrift=0,
    )  # fmt: skip


def plan(step: int) -> mavlink.MAVLink_arvi_plan_message:
    checksum = primitives_checksum(SCENARIO.primitive_set)
    usec = round((NOW + 0.5 * step) * 1e6)
    return mavlink.MAVLink_arvi_plan_message(
        usec, 1.0, 4.0, 0.0, *[0.0] * 6, 0, 0, checksum, [0] * 64, 6, mavlink.ARVI_PLAN_FLAGS_FEASIBLE
    )


class Robot:
    """Vehicle 1 on a mission, with whatever a teammate's messages change."""

    def __init__(self) -> None:
        vehicle = SCENARIO.vehicle(1)
        link = AutopilotLink(1, timeout_s=4.5)
        self.clocks = ClockWatch(1, NOW)
        self.hearing = Hearing()
        self.last_resort = LastResort(SCENARIO, vehicle, self.hearing)
        self.inbox = PeerInbox(SCENARIO, vehicle, self.clocks, self.hearing, self.last_resort, link, Whereabouts(link))
        machine = FlightMachine(SCENARIO.flight, vehicle, link)
        self.mission = Mission(SCENARIO, vehicle, NOW, machine, Counts())

    def hear(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        self.inbox.receive(heard(message), self.mission, time_s)

    def learn_lead(self, lead_s: float) -> None:
        """One exchange of TIMESYNC shows how far teammate 2's clock is ahead."""
        asked = self.clocks.request(1, NOW)
        assert asked is not None
        answer = mavlink.MAVLink_timesync_message(round((NOW + lead_s) * 1e9), asked.ts1)
        self.clocks.receive_peer(heard(answer), NOW)


def test_only_onboard_processes_of_teammates_are_heard_and_what_is_lost_of_them_is_known() -> None:
    robot = Robot()
    senders = [(1, 191), (2, 1), (77, 191), (2, 191), (3, 191)]
    assert [robot.inbox.hears(heard(status(NOW), sender), NOW) for sender in senders] == [False] * 3 + [True] * 2
    talks = Codec(2, 191)
    for number in range(5):
        (message,) = Codec(99, 1).decode(talks.encode(status(NOW)))
        assert number in (0, 3) or robot.inbox.hears(message, NOW)
    loss = robot.inbox.loss(NOW)
    assert set(loss) == {2, 3}
    assert loss[2] == pytest.approx(1 / 5), "of 0 (twice) to 4, number 3 is missing"


def test_a_status_of_another_minute_is_refused_and_who_spoke_was_heard_all_the_same() -> None:
    robot = Robot()
    for age_s in (-3600.0, -61.0, 61.0, 1e6):
        with pytest.raises(MessageError, match="vehicle 2 speaks of a time"):
            robot.hear(status(NOW - age_s), NOW)
    assert robot.mission.agent.team.neighbours(NOW) == ()
    assert robot.hearing.statuses == []
    assert robot.hearing.within(0.1, NOW) == [2]
    robot.hear(status(NOW - 5.0), NOW)
    assert robot.mission.agent.team.neighbours(NOW) == (2,)


def test_a_status_counts_at_its_time_by_the_own_clock() -> None:
    robot = Robot()
    assert robot.inbox.status(heard(status(NOW - 0.1)), NOW).time_s == pytest.approx(NOW - 0.1, abs=1e-6)
    assert robot.inbox.status(heard(status(NOW - 2.5)), NOW).time_s == NOW, "no radio takes so long: its clock is off"
    robot.learn_lead(5.0)
    assert robot.inbox.status(heard(status(NOW + 4.9)), NOW).time_s == pytest.approx(NOW - 0.1, abs=1e-6)


def test_a_plan_that_is_flown_at_another_time_is_refused() -> None:
    robot = Robot()
    robot.hear(status(NOW), NOW)
    robot.hear(plan(0), NOW)
    (ahead,) = robot.last_resort.obstructions(NOW + 0.4, (1.0, 7.0), -1.7)
    assert ahead.north_m > 1.2, "where its plan has brought it, not where it was"
    with pytest.raises(MessageError, match="vehicle 2 speaks of a time"):
        robot.hear(plan(200), NOW)
    robot.learn_lead(-0.3)
    with pytest.raises(MessageError, match="its clock is wrong"):
        robot.hear(plan(2), NOW)


def test_lost_is_only_who_belongs_to_the_team() -> None:
    robot = Robot()
    for vehicle in (1, 77, 3):
        robot.hear(mavlink.MAVLink_teammate_lost_message(1.5, 1.0, 2.0, -1.0, 2.0, 2.0, 0.5, vehicle), NOW)
    assert [lost.peer for lost in robot.last_resort.lost(NOW)] == [3]
