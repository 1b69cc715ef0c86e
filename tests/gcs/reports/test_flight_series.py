"""What is read out of a recording is what was known in flight."""

import json
import math
import shutil

import pytest

from gcs.recording.reader import open_recording
from gcs.recording.tlog import read_tlog, stamped
from gcs.reports.figures import FIGURES, draw_all
from gcs.reports.flight_series import read_series
from gcs.reports.report import write_report
from onboard.messages import FlightState


@pytest.fixture(scope="module")
def series(flown):
    return read_series(open_recording(flown.folder))


def test_the_series_are_those_of_the_states_that_were_shown(series, flown):
    assert series.summary == flown.summary
    assert series.zero_s == flown.summary["mission_start_s"]
    assert series.landing_s == pytest.approx(flown.summary["duration_s"], abs=0.01)
    live = {round(state.time_s - series.zero_s, 1): state for state in flown.states}
    compared = 0
    for i, time_s in enumerate(series.times_s):
        state = live.get(round(time_s, 1))
        if state is None or not -5.0 < time_s < series.landing_s:
            continue
        compared += 1
        assert series.discovered[i] == pytest.approx(state.discovered, abs=1)
        for vehicle in state.vehicles:
            # 1 m/s, a position every 0.2 s, and up to 0.05 s between the two moments.
            assert series.vehicles[vehicle.id].north_m[i] == pytest.approx(vehicle.north_m, abs=0.3)
    assert compared >= 20
    lengths = {len(column) for column in (series.times_s, series.rmse_m, series.entropy_nats, series.discovered)}
    lengths |= {len(column) for column in series.target_entropy_nats.values()}
    lengths |= {len(vehicle.states) for vehicle in series.vehicles.values()}
    assert lengths == {len(series.times_s)}


def test_plans_and_states_tell_the_flight(series, flown):
    for vehicle in flown.summary["vehicles"]:
        flight = series.vehicles[vehicle["id"]]
        # The first plans are made on the ground's watch; every plan is of an epoch of its own.
        assert len(flight.plans) == vehicle["plans"]
        assert all(after.time_s > before.time_s for before, after in zip(flight.plans, flight.plans[1:], strict=False))
        order = [FlightState.STANDBY, FlightState.TAKEOFF, FlightState.TRACK, FlightState.RETURN, FlightState.LANDED]
        firsts = [flight.states.index(state) for state in order]
        assert firsts == sorted(firsts)
    assert {target.id for target in series.final.targets} == {1, 2, 3, 4, 5}


def test_a_flight_without_end_has_figures_of_its_own_and_says_so(flown, tmp_path):
    for path in flown.folder.glob("*"):
        if path.name not in ("summary.json", "flight.json"):
            shutil.copy(path, tmp_path)
    series = read_series(open_recording(tmp_path))
    assert "has left no summary" in series.summary["problems"][0]
    for key in ("rmse_m", "entropy_nats", "discovered", "time_to_discover_s", "vehicles"):
        assert series.summary[key] == flown.summary[key], key
    assert not math.isnan(series.summary["duration_s"])
    (tmp_path / "flight.json").write_text('{"software": 3}')
    (tmp_path / "summary.json").write_text('{"vehicles": 3}')
    series = read_series(open_recording(tmp_path))
    assert "a summary that cannot be used" in series.summary["problems"][0]
    earlier = {
        **flown.summary,
        "vehicles": [{"id": vehicle["id"], "plans": 7} for vehicle in flown.summary["vehicles"]],
    }
    del earlier["entropy_nats"]
    (tmp_path / "summary.json").write_text(json.dumps(earlier))
    series = read_series(open_recording(tmp_path))
    assert series.summary["problems"] == []
    assert series.summary["entropy_nats"] == flown.summary["entropy_nats"]
    assert series.summary["vehicles"] == [{**vehicle, "plans": 7} for vehicle in flown.summary["vehicles"]]
    write_report(series, tmp_path / "report.html")


def test_a_flight_that_ended_before_its_mission_has_no_mission_time(flown, tmp_path):
    end_usec = 1e6 * (flown.summary["mission_start_s"] - 2.0)
    shutil.copy(flown.folder / "scenario.yaml", tmp_path)
    for path in flown.folder.glob("*.tlog"):
        records = [stamped(time_usec, frame) for time_usec, frame in read_tlog(path) if time_usec < end_usec]
        (tmp_path / path.name).write_bytes(b"".join(records))
    series = read_series(open_recording(tmp_path))
    assert series.started
    assert series.times_s[-1] < 0.0
    assert series.summary["duration_s"] is None
    assert draw_all(series).keys() == FIGURES.keys()
