"""Recordings are what ground stations read: opened by pymavlink's own reader, which nobody here wrote."""

import contextlib
import io
import os
import struct
import subprocess
import sys
import threading
import time
from pathlib import Path

import pytest
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.records import Message
from mcap.stream_reader import StreamReader
from pymavlink import mavutil

from gcs.recording.mcap_log import read_mcap
from gcs.recording.recorder import Recorder
from gcs.recording.tlog import read_tlog
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

T0_USEC = 1_500_000_000_123_456


def heartbeat_frames(count):
    codec = Codec(1, 1)
    return [codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 81, i, 4, 3)) for i in range(count)]


def read_with_pymavlink(path, monkeypatch):
    monkeypatch.setenv("MAVLINK20", "1")
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(path))
    messages = []
    while (message := log.recv_match()) is not None:
        messages.append(message)
    log.close()
    return messages


def test_pymavlink_reads_one_file_per_link(tmp_path, monkeypatch):
    recorder = Recorder(tmp_path)
    frames = heartbeat_frames(500)
    for i, frame in enumerate(frames):
        recorder.write(f"vehicle{i % 2 + 1}_autopilot", T0_USEC + 1000 * i, frame)
        if i % 100 == 0:
            recorder.flush()
    recorder.close()
    assert sorted(path.name for path in tmp_path.iterdir()) == ["vehicle1_autopilot.tlog", "vehicle2_autopilot.tlog"]
    messages = read_with_pymavlink(tmp_path / "vehicle2_autopilot.tlog", monkeypatch)
    assert [message.custom_mode for message in messages] == list(range(1, 500, 2))
    assert messages[0]._timestamp == pytest.approx((T0_USEC + 1000) * 1e-6, abs=1e-6)
    assert (recorder.frames, recorder.dropped, recorder.take_warnings()) == (500, 0, [])


def test_layout_is_big_endian_microseconds_then_the_frame(tmp_path):
    recorder = Recorder(tmp_path)
    recorder.write("bridge", T0_USEC, b"frame")
    recorder.close()
    assert (tmp_path / "bridge.tlog").read_bytes() == struct.pack(">Q", T0_USEC) + b"frame"


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
def test_a_full_disk_ends_the_recording_with_one_warning(tmp_path):
    (tmp_path / "bridge.tlog").symlink_to("/dev/full")
    recorder = Recorder(tmp_path)
    recorder.write("bridge", T0_USEC, b"frame")
    recorder.close()
    (warning,) = recorder.take_warnings()
    assert "recording has stopped" in warning
    assert "No space left" in warning
    recorder.write("bridge", T0_USEC, b"frame")
    assert recorder.dropped == 1
    assert recorder.take_warnings() == []


def test_a_disk_that_does_not_keep_up_costs_frames_not_memory_or_time(tmp_path):
    os.mkfifo(tmp_path / "bridge.tlog")  # opening it for writing blocks until somebody reads
    recorder = Recorder(tmp_path, queue_items=2)
    for i in range(5):
        recorder.write("bridge", T0_USEC + i, b"frame")
        recorder.flush()
    assert recorder.dropped >= 2
    (warning,) = recorder.take_warnings()
    assert "frames or moments are not in the recording" in warning
    received = []

    def read():
        received.append((tmp_path / "bridge.tlog").read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    recorder.close()
    reader.join(5.0)
    assert len(received[0]) == (5 - recorder.dropped) * (8 + len(b"frame"))


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="no /dev/full here")
@pytest.mark.parametrize("full", ["flight.mcap", "bridge.tlog"])
def test_whichever_file_finds_the_disk_full_all_stops_with_one_warning(full, flown, tmp_path):
    (tmp_path / full).symlink_to("/dev/full")
    recorder = Recorder(tmp_path, flown.scenario)
    for i, state in enumerate(flown.states[:100]):
        recorder.write("bridge", round(state.time_s * 1e6), heartbeat_frames(1)[0])
        recorder.show(state, "flying", None)
        if i % 10 == 0:
            recorder.flush()
    recorder.close()
    (warning,) = recorder.take_warnings()
    assert full in warning
    assert "No space left" in warning
    assert "the flight goes on" in warning
    assert recorder.take_warnings() == []


def test_a_disk_with_room_for_a_part_of_a_write_keeps_that_part(flown, tmp_path, monkeypatch):
    """As on a file system that fills up: a write takes what there is room for, the next one fails."""
    room = [20_000]

    class FillingUp(io.FileIO):
        def write(self, data):
            if room[0] == 0:
                raise OSError(28, "No space left on device")
            count = super().write(data[: room[0]])
            room[0] -= count
            return count

    monkeypatch.setattr(Path, "open", lambda path, mode="r", **_: FillingUp(path, mode.replace("b", "")))
    recorder = Recorder(tmp_path, flown.scenario)
    for state in flown.states[:200]:
        recorder.write("bridge", round(state.time_s * 1e6), heartbeat_frames(1)[0])
        recorder.show(state, "flying", None)
        recorder.flush()
        wait_for(recorder)
    recorder.close()
    monkeypatch.undo()
    (warning,) = recorder.take_warnings()
    assert "No space left on device" in warning
    assert sum(path.stat().st_size for path in tmp_path.iterdir()) == 20_000
    assert len(list(read_tlog(tmp_path / "bridge.tlog"))) > 1
    assert len(list(read_mcap(tmp_path / "flight.mcap"))) > 1


def test_at_its_limit_the_recording_stops_complete(flown, tmp_path):
    recorder = Recorder(tmp_path, flown.scenario, limit_bytes=60_000)
    for state in flown.states:
        recorder.write("bridge", round(state.time_s * 1e6), heartbeat_frames(1)[0])
        recorder.show(state, "flying", None)
        recorder.flush()
        wait_for(recorder)
    recorder.close()
    (warning,) = recorder.take_warnings()
    assert "limit of 0.06 MB (--record-limit)" in warning
    size = sum(path.stat().st_size for path in tmp_path.iterdir())
    assert 60_000 <= size < 120_000
    with (tmp_path / "flight.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary.statistics.message_count == len(list(read_mcap(tmp_path / "flight.mcap"))) > 10


def wait_for(recorder):
    """Until the writing thread has taken what it was given."""
    end = time.monotonic() + 10.0
    while not recorder._queue.empty() and time.monotonic() < end:
        time.sleep(0.001)


def test_a_killed_process_leaves_files_that_plain_readers_open(tmp_path, flown):
    code = f"""
import sys, time
from pathlib import Path
from gcs.recording.recorder import Recorder
from gcs.recording.tlog import read_tlog
from gcs.team import TeamMonitor
from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
scenario = load_scenario(Path({str(flown.folder / "scenario.yaml")!r}))
recorder, monitor, codec = Recorder(Path({str(tmp_path)!r}), scenario), TeamMonitor(scenario), Codec(1, 1)
for i in range(1_000_000):
    now_s = {T0_USEC} * 1e-6 + 0.1 * i
    frame = codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 81, i, 4, 3))
    for message in codec.decode(frame):
        monitor.receive(message, now_s)
    recorder.write("vehicle1_autopilot", round(now_s * 1e6), frame)
    recorder.show(monitor.state(now_s), "flying", None)
    if i % 10 == 9:
        recorder.flush()
    if i % 100 == 99:
        print(i + 1, flush=True)
    time.sleep(0.001)
"""
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True)
    with process:
        said = [int(process.stdout.readline()) for _ in range(3)]
        process.kill()
    log = mavutil.mavlink_connection(str(tmp_path / "vehicle1_autopilot.tlog"))
    modes = []
    while (message := log.recv_match(type="HEARTBEAT")) is not None:
        modes.append(message.custom_mode)
    log.close()
    assert modes == list(range(len(modes)))
    assert len(modes) >= said[-1] - 100, "what was flushed is there"
    with (tmp_path / "flight.mcap").open("rb") as file, contextlib.suppress(EndOfFile):
        seen = 0
        for record in StreamReader(file).records:
            seen += isinstance(record, Message)
    ours = list(read_mcap(tmp_path / "flight.mcap"))
    assert len(ours) == seen > 100
    assert ours[-1].time_s >= T0_USEC * 1e-6 + 0.1 * (said[-1] - 100)
