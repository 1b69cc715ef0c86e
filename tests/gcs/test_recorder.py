"""Recordings are what ground stations read: opened by pymavlink's own reader, which nobody here wrote."""

import os
import struct
import threading
from pathlib import Path

import pytest

from gcs.recorder import Recorder
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
    recorder = Recorder(tmp_path, queue_chunks=2)
    for i in range(5):
        recorder.write("bridge", T0_USEC + i, b"frame")
        recorder.flush()
    assert recorder.dropped >= 2
    (warning,) = recorder.take_warnings()
    assert "frames are not in the recording" in warning
    received = []

    def read():
        received.append((tmp_path / "bridge.tlog").read_bytes())

    reader = threading.Thread(target=read)
    reader.start()
    recorder.close()
    reader.join(5.0)
    assert len(received[0]) == (5 - recorder.dropped) * (8 + len(b"frame"))
