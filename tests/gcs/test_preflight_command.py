"""``arvi preflight`` against an autopilot's parameters on a UDP link."""

import json
import socket
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from typer.testing import CliRunner

from gcs.cli import app
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot import ONBOARD
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.parameter_service import ParameterService
from sim_bridge.autopilot.px4.parameters import INDOOR_PARAMETERS, RHYTHM, load_parameters


class Autopilot(threading.Thread):
    """Heartbeats to a port, and a PX4's parameters for whoever asks there."""

    def __init__(self, port: int, overrides: dict[str, int | float], *, armed: bool = False) -> None:
        super().__init__(daemon=True)
        self.store = load_parameters({**INDOOR_PARAMETERS, **overrides})
        self._outbox = Outbox()
        self._service = ParameterService(self.store, self._outbox, RHYTHM, lambda _system, _component: True)
        self._codec = Codec(1, 1)
        self._flags = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.settimeout(0.1)
        self._socket.connect(("127.0.0.1", port))
        self.over = threading.Event()

    def run(self) -> None:
        while not self.over.is_set():
            try:
                self._socket.send(self._codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, self._flags, 0, 3, 3)))
                datagram = self._socket.recv(2048)
            except (TimeoutError, ConnectionRefusedError):
                continue
            for message in self._codec.decode(datagram):
                for answer in self._answer(message):
                    self._socket.send(self._codec.encode(answer))
        self._socket.close()

    def _answer(self, message: mavlink.MAVLink_message) -> list[mavlink.MAVLink_message]:
        if isinstance(message, mavlink.MAVLink_command_long_message):
            return [mavlink.MAVLink_command_ack_message(message.command, mavlink.MAV_RESULT_ACCEPTED)]
        handler = self._service.handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, ONBOARD)
        return [answer for _, answer in self._outbox.take()]


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
    autopilot = Autopilot(port, {"MC_YAWRATE_MAX": 100.0, "EKF2_EV_CTRL": 1})
    fly.append(autopilot)
    autopilot.start()
    arguments = ["preflight", str(config), "--vehicle", "1"]
    looked = CliRunner().invoke(app, [*arguments, "--json"])
    assert looked.exit_code == 1
    (report,) = json.loads(looked.stdout)
    assert report["autopilot"] == "PX4"
    wrong = {entry["name"]: entry for entry in report["parameters"] if entry["verdict"] == "wrong"}
    assert set(wrong) == {"MC_YAWRATE_MAX", "EKF2_EV_CTRL"}
    assert wrong["MC_YAWRATE_MAX"]["value"] == 100.0
    assert wrong["MC_YAWRATE_MAX"]["wanted"] == "at least 171.887"
    assert autopilot.store["MC_YAWRATE_MAX"] == 100.0, "it was only asked"

    mended = CliRunner().invoke(app, [*arguments, "--set"])
    assert mended.exit_code == 0
    assert "set MC_YAWRATE_MAX to 172" in mended.stdout
    assert autopilot.store["MC_YAWRATE_MAX"] == 172.0
    assert autopilot.store["EKF2_EV_CTRL"] == 11
    assert autopilot.store["COM_OBL_RC_ACT"] == 4


def test_an_armed_vehicle_is_left_alone(config: Path, port: int, fly: list[Autopilot]) -> None:
    autopilot = Autopilot(port, {"MC_YAWRATE_MAX": 100.0}, armed=True)
    fly.append(autopilot)
    autopilot.start()
    result = CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "1", "--set"])
    assert result.exit_code == 1
    assert "it is armed: nothing was set" in result.stdout
    assert autopilot.store["MC_YAWRATE_MAX"] == 100.0


def test_a_port_in_use_and_an_unknown_vehicle_are_said(config: Path, port: int) -> None:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as taken:
        taken.bind(("127.0.0.1", port))
        result = CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "1"])
    assert result.exit_code == 1
    assert f"{port} is in use" in result.stdout.replace("\n", " ")
    assert CliRunner().invoke(app, ["preflight", str(config), "--vehicle", "9"]).exit_code == 2
