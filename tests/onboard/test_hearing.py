"""How far one hears, and from how far away somebody was heard last."""

import dataclasses
import math

from onboard.geometry import Pose
from onboard.hearing import FRESH_S, Hearing
from onboard.messages import FlightState, PeerStatus

NOW = 1_800_000_000.0
STATUS = PeerStatus(2, NOW, FlightState.TRACK, (3.0, 4.0, -2.0), 0.0, (1,), False, NOW)
HERE = Pose(0.0, 0.0, 0.0)


def test_reach_is_the_longest_distance_ever_heard_over_by_a_word_that_is_fresh() -> None:
    hearing = Hearing()
    hearing.receive_status(STATUS, HERE, -2.0, NOW)
    assert hearing.reach_m == hearing.peers[2].apart_m == 5.0
    near = dataclasses.replace(STATUS, position=(0.0, 0.0, -1.0), time_s=NOW + 1.0)
    hearing.receive_status(near, HERE, -2.0, NOW + 1.0)
    assert (hearing.reach_m, hearing.peers[2].apart_m) == (5.0, 1.0)
    late = dataclasses.replace(STATUS, position=(30.0, 40.0, -2.0), time_s=NOW + 1.0)
    hearing.receive_status(late, HERE, -2.0, NOW + 1.0 + FRESH_S)
    assert (hearing.reach_m, hearing.peers[2].apart_m) == (5.0, 50.0), "where it was, whatever that says of the radio"


def test_without_its_own_place_a_robot_learns_when_but_not_from_how_far() -> None:
    hearing = Hearing()
    hearing.receive_status(STATUS, None, 0.0, NOW)
    assert hearing.reach_m == 0.0
    assert math.isinf(hearing.peers[2].apart_m)
    assert hearing.statuses == [STATUS]


def test_anything_that_arrives_ends_a_silence_and_only_another_place_is_a_move() -> None:
    hearing = Hearing()
    hearing.receive(3, NOW - 9.0)
    hearing.receive_status(STATUS, HERE, 0.0, NOW)
    hearing.receive_status(dataclasses.replace(STATUS, time_s=NOW + 2.0), HERE, 0.0, NOW + 2.0)
    hearing.receive(2, NOW + 4.0)
    assert (hearing.peers[2].heard_s, hearing.peers[2].moved_s) == (NOW + 4.0, NOW)
    assert hearing.within(3.0, NOW + 7.0) == [2]
    assert hearing.within(20.0, NOW + 7.0) == [2, 3]
    assert hearing.statuses[0].time_s == NOW + 2.0
