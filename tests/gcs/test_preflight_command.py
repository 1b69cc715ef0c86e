"""``arvi preflight`` against a simulated autopilot on a UDP link."""

import contextlib
import json
import socket
import threading
import time
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from gcs import host_checks
from gcs.cli import app
from gcs.host_checks import ClockState, HostFacts
from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot import ONBOARD
from sim_bridge.bridge import Port, build_bridge

READY = HostFacts(ClockState(True, 0.001, 0.02), None, "", 1.0, Path("flights"), 5_000_000_000, urgent=True)


class Autopilot(threading.Thread):
    """The scenario's first vehicle in real time, switched on ten seconds ago, as its autopilot shows it at a port."""

    def __init__(self, config: Path, port: int, parameters: dict[str, int | float], *, armed: bool = False) -> None:
        super().__init__(daemon=True)
        scenario = load_scenario(config)
        assert scenario.simulation is not None
        robots = scenario.simulation.ground_robots.model_copy(update={"count": 0})
        simulation = scenario.simulation.model_copy(
            update={
                "ground_robots": robots,
                "physics_rate_hz": 100.0,
                "parameters": {**scenario.simulation.parameters, **parameters},
            }
        )
        alone = scenario.model_copy(update={"vehicles": scenario.vehicles[:1], "simulation": simulation})
        now_s = time.time()
        self._bridge = build_bridge(alone, 1, now_s - 10.0)
        self._bridge.advance(now_s)
        self._bridge.outbox()
        self._codec = Codec(1, 1)
        self._armed = armed
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.setblocking(False)
        self._socket.connect(("127.0.0.1", port))
        self.over = threading.Event()

    def run(self) -> None:
        while not self.over.wait(0.01):
            now_s = time.time()
            self._receive(now_s)
            self._bridge.advance(now_s)
            for port, _, message in self._bridge.outbox():
                if port is Port.ONBOARD:
                    self._send(message)
        self._socket.close()

    def _receive(self, now_s: float) -> None:
        while True:
            try:
                datagram = self._socket.recv(2048)
            except (BlockingIOError, ConnectionRefusedError):
                return
            for message in self._codec.decode(datagram):
                self._bridge.receive(1, ONBOARD, message, now_s)

    def _send(self, message: mavlink.MAVLink_message) -> None:
        if self._armed and isinstance(message, mavlink.MAVLink_heartbeat_message):
            message.base_mode |= mavlink.MAV_MODE_FLAG_SAFETY_ARMED
        with contextlib.suppress(ConnectionRefusedError):  # nobody listens yet
            self._socket.send(self._codec.encode(message))


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """A computer that is ready, and rates over half a second."""
    monkeypatch.setattr(host_checks, "look", lambda _scenario, _recordings: READY)
    monkeypatch.setattr("gcs.autopilot_checks.WINDOW_S", 0.5)


@pytest.fixture
def port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


@pytest.fixture
def config(tmp_path: Path, port: int) -> Path:
    document = yaml.safe_load(Path("configs/lab.yaml").read_text(encoding="utf-8"))
    document["vehicles"][0]["links"] = {"autopilot": f"udpin:127.0.0.1:{port}"}
    path = tmp_path / "scenario.yaml"
    path.write_text(yaml.safe_dump(document), encoding="utf-8")
    return path


@pytest.fixture
def fly(port: int) -> Iterator[list[Autopilot]]:
    autopilots: list[Autopilot] = []
    yield autopilots
    for autopilot in autopilots:
        autopilot.over.set()
        autopilot.join()


def test_what_is_wrong_is_shown_and_set_only_when_asked_for(config: Path, port: int, fly: list[Autopilot]) -> None:
    autopilot = Autopilot(config, port, {"MC_YAWRATE_MAX": 100.0, "EKF2_EV_CTRL": 3})
    fly.append(autopilot)
    autopilot.start()
    arguments = ["preflight", str(config), "--vehicle", "1"]
    looked = CliRunner().invoke(app, [*arguments, "--json"])
    assert looked.exit_code == 1
    document = json.loads(looked.stdout)
    (report,) = document["vehicles"]
    assert report["autopilot"] == "PX4"
    wrong = {entry["name"]: entry for entry in report["parameters"] if entry["verdict"] == "wrong"}
    assert set(wrong) == {"MC_YAWRATE_MAX", "EKF2_EV_CTRL"}
    assert wrong["MC_YAWRATE_MAX"]["value"] == 100.0
    assert wrong["MC_YAWRATE_MAX"]["wanted"] == "at least 171.887"
    assert not document["go"]
    assert len(document["faults"]) == 2
    assert document["faults"][0].startswith("vehicle 1: MC_YAWRATE_MAX is 100 deg/s, should be at least 171.887")
    checks = {check["name"]: check["outcome"] for check in (*document["computer"], *report["checks"])}
    assert {"link", "TIMESYNC", "position", "place", "battery", "kernels", "disk"} <= set(checks)
    assert set(checks.values()) <= {"pass", "warn"}, "nothing but parameters is wrong"

    mended = CliRunner().invoke(app, [*arguments, "--set"])
    assert mended.exit_code == 0, mended.stdout
    assert "set MC_YAWRATE_MAX to 172" in mended.stdout
    assert mended.stdout.rstrip().endswith("\nGO")


def test_an_armed_vehicle_is_left_alone(config: Path, port: int, fly: list[Autopilot]) -> None:
    autopilot = Autopilot(config, port, {"MC_YAWRATE_MAX": 100.0}, armed=True)
    fly.append(autopilot)
    autopilot.start()
    result = CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "1", "--set"])
    assert result.exit_code == 1
    assert "it is armed: nothing was set" in result.stdout
    assert "NO-GO" in result.stdout


def test_a_computer_that_is_not_ready_forbids_to_fly(
    config: Path, port: int, fly: list[Autopilot], monkeypatch: pytest.MonkeyPatch
) -> None:
    full = HostFacts(None, None, "", 1.0, Path("flights"), 1000, urgent=False)
    monkeypatch.setattr(host_checks, "look", lambda _scenario, _recordings: full)
    autopilot = Autopilot(config, port, {})
    fly.append(autopilot)
    autopilot.start()
    result = CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "1", "--json"])
    assert result.exit_code == 1
    assert json.loads(result.stdout)["faults"] == ["disk: 0.0 GB free; should be: 2 GB free for a recording in flights"]


def test_a_port_in_use_and_an_unknown_vehicle_are_said(config: Path, port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        result = CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "1"])
    assert result.exit_code == 1
    assert f"{port} is in use" in result.stdout.replace("\n", " ")
    assert CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "9"]).exit_code == 2
