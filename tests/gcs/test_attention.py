"""What a late, sleeping or deaf ground station knows of its own lateness."""

import pytest

from gcs.attention import Attention, Hole, Listening
from onboard.protocol import dialect as mavlink

T0 = 1.5e9


class Reader:
    """Looks ten times a second, as a station does; ``lag_s`` behind what arrives."""

    def __init__(self) -> None:
        self.attention = Attention()
        self.now_s = T0
        self.steady_s = 100.0
        self.texts: list[str] = []

    def look(self, lag_s: float = 0.0, after_s: float = 0.1) -> Hole | None:
        self.now_s += after_s
        self.steady_s += after_s
        hole = self.attention.look(self.now_s, self.steady_s)
        if lag_s:
            self.attention.read_to(self.now_s - lag_s)
        else:
            self.attention.caught_up(self.now_s)
        self.texts += [text for _, text in self.attention.notices()]
        return hole

    def keep_up(self, duration_s: float) -> None:
        for _ in range(round(10 * duration_s)):
            self.look()


@pytest.fixture
def reader() -> Reader:
    reader = Reader()
    reader.keep_up(1.0)
    return reader


def test_who_keeps_up_says_nothing(reader: Reader) -> None:
    reader.keep_up(5.0)
    assert reader.attention.behind_s is None
    assert reader.texts == []


def test_a_lag_that_grows_is_told_once_and_its_end_after_two_calm_seconds(reader: Reader) -> None:
    for tenths in range(50):
        reader.look(lag_s=0.1 * tenths + 0.05)
    assert reader.attention.behind_s == pytest.approx(5.0, abs=0.2)
    assert reader.texts == ["ground station is 2 s behind: what it shows is old"]
    for _ in range(3):  # once below the limit is not yet caught up: the same lag comes again
        reader.look(after_s=1.5)
        reader.keep_up(1.0)
    assert len(reader.texts) == 1
    reader.keep_up(3.0)
    assert reader.attention.behind_s is None
    assert reader.texts[1:] == ["ground station has caught up; it was up to 6 s behind"]


def test_a_station_that_stood_still_tells_how_long(reader: Reader) -> None:
    assert reader.look(after_s=10.0) is None, "it was stopped, the computer was not: what arrived waits for it"
    assert reader.attention.behind_s == pytest.approx(10.0, abs=0.2)
    reader.keep_up(5.0)
    assert reader.texts == [
        "ground station is 10 s behind: what it shows is old",
        "ground station has caught up; it was up to 10 s behind",
    ]


@pytest.mark.parametrize(
    ("jump_s", "words"), [(3600.0, "slept, or its clock was set ahead, by 3600 s"), (-60.0, "had its clock set back")]
)
def test_a_computer_that_slept_has_a_hole_and_is_not_behind(reader: Reader, jump_s: float, words: str) -> None:
    reader.now_s += jump_s
    hole = reader.look()
    assert hole is not None
    assert hole.until_s == reader.now_s
    assert hole.until_s - hole.since_s == pytest.approx(jump_s)
    reader.keep_up(3.0)
    assert reader.attention.behind_s is None
    (text,) = reader.texts
    assert words in text


def test_what_found_no_room_is_counted_told_and_a_hole(reader: Reader) -> None:
    attention, heard_until_s = reader.attention, reader.attention.heard_until_s
    hole = attention.missed(300, T0 + 60.0)
    assert (hole.since_s, hole.until_s) == (heard_until_s, T0 + 60.0)
    attention.missed(20, T0 + 60.1)
    text = "320 datagrams were lost before the ground station read them, for its recording, too"
    assert attention.notices() == [(mavlink.MAV_SEVERITY_WARNING, text)]


def test_only_who_stays_behind_leaves_out_what_is_old(reader: Reader) -> None:
    """A station that stood still draws all that waited; one without time draws one second in five, and what is new."""
    reader.look(after_s=10.0)
    old = [reader.now_s - age_s for age_s in (9.0, 8.0, 7.0, 6.0, 5.0)]
    assert all(map(reader.attention.worth_drawing, old))
    for _ in range(30):
        reader.look(lag_s=8.0)
    old = [reader.now_s - age_s for age_s in (9.0, 8.0, 7.0, 6.0, 5.0)]
    assert sum(map(reader.attention.worth_drawing, old)) == 1
    assert reader.attention.worth_drawing(reader.now_s - 2.9)
    reader.keep_up(5.0)
    assert reader.texts[-1].endswith("and 4 messages were too old to be drawn")


def test_holes_are_no_silence() -> None:
    listening = Listening()
    assert listening.duration_s(T0, T0 + 9.0) == 9.0
    listening.add(Hole(T0 + 1.0, T0 + 3.0))
    listening.add(Hole(T0 + 3.0, T0 + 4.0))
    listening.add(Hole(T0 + 6.0, T0 + 7.0))
    assert [listening.duration_s(T0, T0 + s) for s in (1.0, 2.0, 5.0, 9.0)] == [1.0, 1.0, 2.0, 5.0]
    listening.add(Hole(T0 + 8.0, T0 + 2.0))  # the clock was set back
    assert listening.duration_s(T0, T0 + 9.0) <= 9.0


def test_a_joined_station_that_says_nothing_is_late_and_its_silence_nobody_elses(reader: Reader) -> None:
    attention = reader.attention
    attention.relayed = True
    attention.read_to(reader.now_s)
    last_s = reader.now_s
    for _ in range(100):
        reader.look()
    assert attention.heard_until_s == last_s + 2.5
    assert attention.behind_s == pytest.approx(7.5, abs=0.2)
    assert reader.texts == ["ground station is 2 s behind: what it shows is old"]
    assert attention.read_to(reader.now_s) == Hole(last_s + 2.5, reader.now_s)
    assert attention.read_to(reader.now_s + 1.0) is None
