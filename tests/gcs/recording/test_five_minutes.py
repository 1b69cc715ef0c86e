"""Five minutes of the lab, in virtual time, through the real ground station and recorder: what plain readers find in
the recording, what a replay and a report show, is what the live summary says.
"""

import json
import math
import time
from collections import Counter

import pytest
from mcap.reader import make_reader
from pymavlink import mavutil

from gcs import summary
from gcs.recording.reader import open_recording
from gcs.recording.recorder import MCAP_NAME
from gcs.recording.replay import Replay
from gcs.reports.flight_series import read_series
from gcs.reports.report import write_report
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

REPORT_CPU_S = 20.0


def read_with_pymavlink(path):
    """Messages counted by sender and id; when targets were first told; the last of each. Our dialect reads fields."""
    log = mavutil.mavlink_connection(str(path))
    codec, counts, first_s, last = Codec(255, 190), Counter(), {}, {}
    while (message := log.recv_match()) is not None:
        assert message.get_type() != "BAD_DATA", path.name
        (ours,) = codec.decode(bytes(message.get_msgbuf()))
        key = (ours.get_srcSystem(), ours.get_srcComponent(), ours.get_msgId())
        counts[key] += 1
        last[key] = ours
        if ours.get_msgId() == mavlink.MAVLINK_MSG_ID_TARGET_BELIEF:
            first_s.setdefault(ours.target_id, message._timestamp)
    log.close()
    return counts, first_s, last


def test_pymavlink_finds_every_frame_and_the_summarys_figures(flown_for_five_minutes):
    flown = flown_for_five_minutes
    live, counts, last, found_s = flown.summary, Counter(), {}, {}
    for path in flown.folder.glob("*.tlog"):
        of_link, first_s, of_last = read_with_pymavlink(path)
        counts += of_link
        last |= of_last
        for target, time_s in first_s.items():
            found_s[target] = min(time_s, found_s.get(target, math.inf))
    assert counts.total() == flown.frames > 250_000
    duration_s = flown.states[-1].time_s - flown.states[0].time_s
    assert duration_s > live["duration_s"] >= 300.0
    for vehicle in live["vehicles"]:
        id_ = vehicle["id"]
        status = last[id_, 191, mavlink.MAVLINK_MSG_ID_PLANNER_STATUS]
        assert (status.plans, status.deadline_misses) == (vehicle["plans"], vehicle["deadline_misses"])
        assert counts[id_, 191, mavlink.MAVLINK_MSG_ID_ARVI_PLAN] == vehicle["plans"] > 290
        assert counts[id_, 1, mavlink.MAVLINK_MSG_ID_HEARTBEAT] == pytest.approx(duration_s, abs=3.0)
        heartbeat = last[id_, 1, mavlink.MAVLINK_MSG_ID_HEARTBEAT]
        assert bool(heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED) is not vehicle["disarmed"]
        landed = last[id_, 1, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE].landed_state
        assert (landed == mavlink.MAV_LANDED_STATE_ON_GROUND) is vehicle["landed"]
    assert len(found_s) == live["discovered"]
    for target, time_s in found_s.items():
        # Told once it was detected and fused, within a step of it.
        assert time_s - live["mission_start_s"] - live["time_to_discover_s"][str(target)] == pytest.approx(0.3, abs=0.3)


def test_the_plain_mcap_reader_finds_the_summarys_figures(flown_for_five_minutes):
    flown = flown_for_five_minutes
    live, counts, last = flown.summary, Counter(), {}
    with (flown.folder / MCAP_NAME).open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        told = reader.get_summary().statistics
        for _, channel, message in reader.iter_messages():
            counts[channel.topic] += 1
            last[channel.topic] = json.loads(message.data)
    assert counts.total() == told.message_count
    assert (told.message_end_time - told.message_start_time) * 1e-9 > 300.0
    moments = len(flown.states) / 2
    assert counts["/tf"] == pytest.approx(moments, rel=0.01)
    assert counts["/team"] == counts["/estimates"] == pytest.approx(moments / 2, rel=0.02)
    assert counts["/events"] == len(flown.events)
    team = last["/team"]
    assert (team["discovered"], team["target_count"]) == (live["discovered"], live["targets"])
    assert team["rmse_mean_m"] == pytest.approx(live["rmse_m"], abs=1e-3)
    assert team["entropy_mean_nats"] == pytest.approx(live["entropy_nats"], abs=1e-3)
    for vehicle in live["vehicles"]:
        numbers = last[f"/vehicle_{vehicle['id']}"]
        assert (numbers["plans"], numbers["deadline_misses"]) == (vehicle["plans"], vehicle["deadline_misses"])
        assert numbers["armed"] is not vehicle["disarmed"]


def test_it_replays_to_the_live_summary_and_is_reported_in_time(flown_for_five_minutes, tmp_path):
    flown = flown_for_five_minutes
    recording = open_recording(flown.folder)
    replay = Replay(recording)
    replay.go(replay.ticks)
    facts = summary.FlightFacts(
        scenario="lab", version="test", seed=3, mission_start_s=replay.state().mission_start_s,
        mission_end_s=recording.landing_since_s, cpu_cores=None, cpu_s={}, problems=(),
    )  # fmt: skip
    assert summary.summarize(replay.monitor, facts, replay.time_of(replay.ticks)) == flown.summary
    began_s = time.process_time()
    write_report(read_series(open_recording(flown.folder)), tmp_path / "report.html")
    assert time.process_time() - began_s < REPORT_CPU_S
    assert f"{flown.summary['rmse_m']:.2f} m" in (tmp_path / "report.html").read_text(encoding="utf-8")
