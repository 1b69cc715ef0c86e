"""Output to somebody who has gone away."""

import io
import os
import subprocess
import sys

from gcs.output import SteadyOutput


def test_a_closed_pipe_swallows_what_follows():
    reader, writer = os.pipe()
    with os.fdopen(writer, "w", encoding="utf-8") as stream:
        output = SteadyOutput(stream)
        output.write("heard")
        output.flush()
        assert os.read(reader, 100) == b"heard"
        os.close(reader)
        for _ in range(3):
            output.write("lost" * 10_000)
            output.flush()
        assert (output.encoding, output.isatty(), output.fileno()) == ("utf-8", False, writer)


def test_a_standing_stream_is_passed_through():
    below = io.BytesIO()
    output = SteadyOutput(io.TextIOWrapper(below, encoding="utf-8"))
    assert output.write("RMSE ◆") == 6
    output.flush()
    assert below.getvalue().decode() == "RMSE ◆"


def test_a_monitor_ends_with_its_reader(own_ports):
    process = subprocess.Popen(
        [sys.executable, "-m", "gcs", "monitor", own_ports, "--headless"], stdout=subprocess.PIPE, text=True
    )
    try:
        assert "listening on" in process.stdout.readline()
        process.stdout.close()
        assert process.wait(30.0) == 0
    finally:
        process.kill()
        process.wait()
        process.stdout.close()


def test_a_station_whose_reader_has_gone_still_stops_in_order(own_ports):
    process = subprocess.Popen(
        [sys.executable, "-m", "gcs", "gcs", own_ports, "--headless", "--no-record"],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    try:
        assert "watching" in process.stdout.readline()
        process.stdout.close()
        process.send_signal(2)
        assert process.wait(30.0) == 0
        assert process.stderr.read() == ""
    finally:
        process.kill()
        process.wait()
        process.stdout.close()
        process.stderr.close()
