"""Samples, trails and events over time: bounded, streamed without gaps or doubles, searchable."""

import math

import pytest

from gcs.dashboard.history import ROWS, EventLog, FlightHistory
from gcs.dashboard.view import MapBounds
from gcs.team import Event

T0 = 1.5e9


@pytest.fixture
def history(scenario):
    return FlightHistory([1, 2, 3], MapBounds(scenario))


def test_two_samples_a_second_with_units_of_the_axes(history, fake_team):
    for tick in range(50):
        history.add(fake_team.monitor.state(T0 + 0.1 * tick))
    columns = history.columns()
    assert history.serial == len(columns["time"]) == 10
    assert (columns["planning_2"][-1], columns["budget"][-1]) == pytest.approx((120.0, 150.0))
    assert (columns["cost_1"][-1], columns["bound_1"][-1]) == (-12.5, -14.0)
    assert columns["found"][-1] == 2.0
    assert columns["age_3"][-1] == pytest.approx(4.5)


def test_a_reader_gets_each_sample_once(history, fake_team):
    seen, serial = [], 0
    for half in range(20):
        history.add(fake_team.monitor.state(T0 + 0.5 * half))
        if half % 3 == 0:
            seen += history.columns(serial)["time"]
            serial = history.serial
    seen += history.columns(serial)["time"]
    assert seen == [T0 + 0.5 * half for half in range(20)]
    assert history.columns(history.serial)["time"] == []


def test_memory_is_bounded(history, fake_team):
    for half in range(ROWS + 50):
        history.add(fake_team.monitor.state(T0 + 0.5 * half))
    assert len(history.columns()["time"]) == ROWS
    assert len(history.columns(since=0)["time"]) == ROWS
    assert len(history.trails()["xs"][0]) == 40, "20 s"


def test_unknown_figures_are_gaps_and_absurd_places_leave_no_trail(history, scenario, make_team):
    team = make_team(scenario)
    history.add(team.monitor.state(T0))
    team.places[1] = (1e9, 1e9)
    team.speak(T0 + 1.0)
    history.add(team.monitor.state(T0 + 1.0))
    assert math.isnan(history.columns()["cost_1"][0])
    assert [len(xs) for xs in history.trails()["xs"]] == [0, 1, 1]


def test_events_are_found_by_words_and_severity_newest_first():
    log = EventLog()
    for i in range(3000):
        log.add(Event(T0 + i, i % 8, f"vehicle {i % 3}", f"Battery low {i}"))
    assert log.serial == 3000
    found = log.find("LOW vehicle", severity=3, limit=5)
    assert len(found) == 5
    assert found[0].time_s > found[1].time_s
    assert all(event.severity <= 3 for event in found)
    assert [event.time_s for event in log.find("low 2777")] == [T0 + 2777]
    assert len(log.find(limit=10_000)) == 2000
    assert log.find("unheard of") == []
