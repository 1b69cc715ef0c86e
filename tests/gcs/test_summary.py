"""The summary's keys and values; what nobody knows is null."""

import json
import os
from dataclasses import replace

import pytest
from rich.console import Console

from gcs.errors import GroundError
from gcs.summary import FlightFacts, render, summarize, write_json
from gcs.team import TeamMonitor
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.team_messages import primitives_checksum

T0 = 1.5e9
FACTS = FlightFacts(
    scenario="lab",
    version="1.2.3",
    seed=7,
    mission_start_s=T0,
    mission_end_s=T0 + 60.0,
    cpu_cores=1.23456,
    cpu_s={"ground": 1.0, "bridge": 2.345},
    problems=(),
)
ISSUE_KEYS = ["targets", "discovered", "rmse_m", "entropy_nats", "time_to_discover_s", "vehicles", "cpu_cores"]
ISSUE_VEHICLE_KEYS = [
    "id",
    "setpoint_rate_hz",
    "setpoint_gap_max_s",
    "plans",
    "deadline_misses",
    "planning_time_p99_s",
    "peer_bytes_per_s",
    "landed",
    "disarmed",
    "min_separation_m",
]


@pytest.fixture
def team(scenario):
    return TeamMonitor(scenario)


def shown(summary):
    console = Console(width=100, record=True, file=open(os.devnull, "w"))  # noqa: SIM115, PTH123
    console.print(render(summary))
    console.file.close()
    return console.export_text()


def test_all_keys_are_there_and_the_unknown_is_null(team):
    summary = summarize(team, FACTS, T0 + 70.0)
    assert set(ISSUE_KEYS) <= set(summary)
    assert [vehicle["id"] for vehicle in summary["vehicles"]] == [1, 2, 3]
    for vehicle in summary["vehicles"]:
        assert set(ISSUE_VEHICLE_KEYS) <= set(vehicle)
        known = {"id": vehicle["id"], "landed": False}
        assert all(vehicle[key] is None for key in ISSUE_VEHICLE_KEYS if key not in known)
    assert (summary["targets"], summary["discovered"], summary["duration_s"]) == (5, 0, 60.0)
    assert (summary["rmse_m"], summary["entropy_nats"], summary["time_to_discover_s"]) == (None, None, {})
    assert summary["cpu_cores"] == 1.235
    json.dumps(summary, allow_nan=False)


def test_figures_reach_their_keys(team, scenario, heard, heartbeat, status):
    usec = round(T0 * 1e6)
    truth = mavlink.MAVLink_vehicle_truth_message(usec, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.7, 0.04, 10.0, 501, 2)
    checksum = primitives_checksum(scenario.primitive_set)
    plan = mavlink.MAVLink_arvi_plan_message(
        usec, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.125, 0.15, 1, 1, checksum, [0] * 64, 12, 0
    )
    belief = mavlink.MAVLink_target_belief_message(
        round((T0 + 4.5) * 1e6), [1.0] * 4, [1.0, 0.0, 1.0, *[0.0] * 7], 3, 1, 0
    )
    other = mavlink.MAVLink_target_truth_message(round(T0 * 1e6), 0.0, 0.0, 0.0, 0.0, 4)
    for armed, landed in ((True, mavlink.MAV_LANDED_STATE_IN_AIR), (False, mavlink.MAV_LANDED_STATE_ON_GROUND)):
        team.receive(heard(2, 1, heartbeat(armed=armed)), T0)
        team.receive(heard(2, 1, mavlink.MAVLink_extended_sys_state_message(0, landed)), T0)
    for time_s, sent, plans in ((T0, 0, 0), (T0 + 10.0, 12_000, 10)):
        message = status(time_s, state=FlightState.TRACK, peer_bytes_sent=sent, plans=plans, deadline_misses=1)
        team.receive(heard(2, 191, message), T0)
    for source, message in (((250, 1), truth), ((2, 191), plan), ((2, 191), belief), ((250, 1), other)):
        team.receive(heard(*source, message), T0)
    summary = summarize(team, FACTS, T0 + 70.0)
    assert summary["time_to_discover_s"] == {"3": 4.5, "4": None}
    vehicle = summary["vehicles"][1]
    assert {key: vehicle[key] for key in ISSUE_VEHICLE_KEYS} == {
        "id": 2,
        "setpoint_rate_hz": 50.0,
        "setpoint_gap_max_s": 0.04,
        "plans": 10,
        "deadline_misses": 1,
        "planning_time_p99_s": 0.125,
        "peer_bytes_per_s": 1200.0,
        "landed": True,
        "disarmed": True,
        "min_separation_m": 0.7,
    }
    text = shown(summary)
    for part in ("1 of 5", "3: 4.5", "50.0 Hz", "40 ms", "1200 B/s", "125 ms", "0.70 m", "never heard", "landed"):
        assert part in text


def test_a_team_that_never_took_off_shows_its_problems_alone(team):
    facts = replace(FACTS, mission_start_s=None, mission_end_s=None, problems=("the bridge ended: exit code 4",))
    assert shown(summarize(team, facts, T0)).split("\n")[0].strip() == "! the bridge ended: exit code 4"


def test_written_whole_or_not_at_all(tmp_path):
    path = tmp_path / "r.json"
    path.write_text("old")
    with pytest.raises(ValueError, match="JSON"):
        write_json({"rmse_m": float("nan")}, path)
    assert path.read_text() == "old"
    write_json({"rmse_m": None}, path)
    assert json.loads(path.read_text()) == {"rmse_m": None}
    assert list(tmp_path.iterdir()) == [path]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(GroundError, match=r"r\.json: the summary cannot be written"):
        write_json({}, tmp_path / "missing" / "r.json")
    (tmp_path / "r.json").mkdir()
    with pytest.raises(GroundError, match=r"r\.json: the summary cannot be written"):
        write_json({}, tmp_path / "r.json")
    assert [path.name for path in tmp_path.iterdir()] == ["r.json"]
