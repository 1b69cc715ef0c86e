"""A ground station's process that is really stopped and continued, between a team that goes on talking."""

import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.link_url import LinkUrl

STOPPED_S = 6.5
"""Longer than a heartbeat may be missing."""

HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 0, 0x03040000, 4, 3)


class Talkers(threading.Thread):
    """The autopilots of two vehicles, five heartbeats a second each until it is switched off."""

    def __init__(self, scenario: Scenario) -> None:
        super().__init__(daemon=True)
        self.alive = {vehicle.id for vehicle in scenario.vehicles}
        self._codecs = {vehicle.id: Codec(vehicle.id, 1) for vehicle in scenario.vehicles}
        url = LinkUrl.parse(scenario.ground.url)
        self._address = (url.host, url.port)
        self._ended = threading.Event()

    def run(self) -> None:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            while not self._ended.wait(0.2):
                for vehicle in tuple(self.alive):
                    sock.sendto(self._codecs[vehicle].encode(HEARTBEAT), self._address)

    def end(self) -> None:
        self._ended.set()
        self.join()


class Monitor:
    """A real ``arvi monitor``, and what it prints."""

    def __init__(self, config: Path) -> None:
        self.lines: list[str] = []
        command = [sys.executable, "-m", "gcs", "monitor", str(config), "--headless"]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        self.lines.extend(iter(self.process.stdout.readline, ""))

    def wait_for(self, words: str, within_s: float = 30.0) -> str:
        end_s = time.monotonic() + within_s
        while time.monotonic() < end_s:
            for line in list(self.lines):
                if words in line:
                    return line
            time.sleep(0.05)
        raise AssertionError(f"{words!r} not within {within_s} s in:\n{''.join(self.lines)}")

    def end(self) -> None:
        self.process.send_signal(signal.SIGCONT)
        self.process.terminate()
        self.process.wait(10.0)
        self._reader.join(5.0)
        assert self.process.stdout is not None
        self.process.stdout.close()


@pytest.fixture
def talkers(own_ports: Path) -> Iterator[Talkers]:
    talkers = Talkers(load_scenario(own_ports))
    talkers.start()
    yield talkers
    talkers.end()


@pytest.fixture
def monitor(own_ports: Path, talkers: Talkers) -> Iterator[Monitor]:
    monitor = Monitor(own_ports)
    yield monitor
    monitor.end()


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when a datagram arrived")
def test_a_station_that_was_stopped_tells_its_own_lateness_and_only_true_losses(
    monitor: Monitor, talkers: Talkers
) -> None:
    monitor.wait_for("watching")
    time.sleep(1.0)
    monitor.process.send_signal(signal.SIGSTOP)
    time.sleep(0.5)
    talkers.alive.discard(2)  # really dies while nobody looks
    time.sleep(STOPPED_S - 0.5)
    monitor.process.send_signal(signal.SIGCONT)
    line = monitor.wait_for("s behind: what it shows is old")
    assert int(line.split(" is ")[1].split(" s ")[0]) in range(6, 10)
    assert "vehicle 2" in monitor.wait_for("autopilot is silent: no heartbeat for")
    monitor.wait_for("ground station has caught up; it was up to")
    assert not [line for line in monitor.lines if "vehicle 1" in line and "silent" in line]


def test_who_has_joined_a_stopped_station_calls_no_vehicle_silent(
    monitor: Monitor, talkers: Talkers, own_ports: Path
) -> None:
    monitor.wait_for("watching")
    joined = Monitor(own_ports)
    try:
        assert "joined the ground station at" in joined.wait_for("monitor:")
        joined.wait_for("LOITER")
        monitor.process.send_signal(signal.SIGSTOP)
        joined.wait_for("s behind: what it shows is old")
        time.sleep(2.0)
        monitor.process.send_signal(signal.SIGCONT)
        joined.wait_for("ground station has caught up")
        assert not [line for line in joined.lines if "silent" in line]
    finally:
        joined.end()
