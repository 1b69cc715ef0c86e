"""Whose silence is told, when, and whose is not."""

import dataclasses

import pytest

from onboard.company import GROUND_SILENCE_S, PEER_SILENCE_S, WELL_WITHIN, silences
from onboard.flight.failsafes import RULES, Condition
from onboard.geometry import Pose
from onboard.hearing import Hearing
from onboard.messages import FlightState, PeerStatus

NOW = 1_800_000_000.0
HERE = Pose(0.0, 0.0, 0.0)
DOWN_M = -1.7
REACH_M = 3.0
SOON_S = 0.02
LOST, ALONE, GROUND = Condition.PEER_LOST, Condition.PARTITION, Condition.GROUND_LOST


def status(peer: int, away_m: float, time_s: float, state: FlightState = FlightState.TRACK) -> PeerStatus:
    return PeerStatus(peer, NOW, state, (away_m, 0.0, DOWN_M), 0.0, (1,), False, time_s)


def heard(*peers: PeerStatus) -> Hearing:
    """Peer 9 landed after it had shown how far one hears; these were heard after that."""
    hearing = Hearing()
    landed = status(9, REACH_M, NOW - 60.0, FlightState.LANDED)
    for word in (landed, *peers):
        hearing.receive_status(word, HERE, DOWN_M, word.time_s)
    return hearing


def test_a_peer_that_falls_silent_well_within_reach_is_missed_after_its_time_and_no_more_when_it_returns() -> None:
    hearing = heard(status(2, 1.0, NOW), status(3, 1.0, NOW + 2.0))
    assert silences(hearing, NOW + PEER_SILENCE_S, flown=True) == {}
    assert silences(hearing, NOW + PEER_SILENCE_S + SOON_S, flown=True) == {LOST: "vehicle 2"}
    assert RULES[LOST].noticed_s > PEER_SILENCE_S, "the table promises it by then"
    hearing.receive(2, NOW + 4.0)
    assert silences(hearing, NOW + 4.0, flown=True) == {}, "anything that it says will do"


@pytest.mark.parametrize(
    "last",
    [
        status(2, WELL_WITHIN * REACH_M + 0.1, NOW),
        status(2, 1.0, NOW, FlightState.LANDED),
        status(2, 1.0, NOW, FlightState.RELEASED),
    ],
    ids=["far off", "on the ground", "let go"],
)
def test_who_may_have_flown_off_or_does_not_fly_is_not_missed(last: PeerStatus) -> None:
    assert silences(heard(last), NOW + 60.0, flown=True) == {}


def test_who_was_heard_from_an_unknown_distance_is_not_missed() -> None:
    hearing = heard()
    hearing.receive_status(status(2, 1.0, NOW), None, DOWN_M, NOW)
    assert silences(hearing, NOW + 60.0, flown=True) == {}


def test_all_silent_and_one_of_them_missed_is_a_partition() -> None:
    near, far = status(2, 1.0, NOW), status(3, REACH_M, NOW)
    both = heard(near, far)
    assert silences(both, NOW + 4.0, flown=True) == {LOST: "vehicle 2", ALONE: ""}
    both.receive(3, NOW + 4.0)
    assert silences(both, NOW + 4.0, flown=True) == {LOST: "vehicle 2"}
    assert silences(heard(far, dataclasses.replace(far, sender=2)), NOW + 4.0, flown=True) == {}, "they may be far off"
    assert ALONE not in silences(heard(near), NOW + 4.0, flown=True), "of two, one that is lost is told once"


def test_who_does_not_fly_misses_no_peer_but_the_ground_station() -> None:
    hearing = heard(status(2, 1.0, NOW), status(3, 1.0, NOW))
    assert silences(hearing, NOW + 60.0, flown=False) == {}, "a ground station that was never heard is not missed"
    hearing.receive_ground(NOW)
    assert silences(hearing, NOW + GROUND_SILENCE_S, flown=False) == {}
    assert silences(hearing, NOW + GROUND_SILENCE_S + SOON_S, flown=False) == {GROUND: ""}
    hearing.receive_ground(NOW + 7.0)
    assert silences(hearing, NOW + 7.0, flown=False) == {}
