"""``arvi mocap``: what it prints of a system that speaks NatNet, and of configurations without one."""

import json
import math
from pathlib import Path

import pytest
from typer.testing import CliRunner

from gcs.checks import Outcome
from gcs.cli import app
from gcs.mocap_command import MocapView
from onboard.config import Scenario
from sim_bridge.mocap.bodies import Frame
from tests.sim_bridge.mocap.natnet_server import NatNetServer

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"
NOON = 1_790_000_000.0


def real_lab(lab, port=1510):
    """The lab with vehicle 1 as body ``drone``."""
    vehicles = [
        vehicle | {"external": {"pose": "mocap"}} if vehicle["id"] == 1 else vehicle for vehicle in lab["vehicles"]
    ]
    mocap = {"provider": "optitrack", "host": "127.0.0.1", "options": {"port_command": port}, "bodies": {"drone": 1}}
    return lab | {"vehicles": vehicles, "mocap": mocap}


@pytest.fixture
def lab(scenario):
    return scenario.model_dump(mode="json", exclude_none=True)


def test_rate_age_and_pose_are_shown_for_each_vehicle(lab):
    view = MocapView(Scenario.model_validate_json(json.dumps(real_lab(lab))))
    assert view.lines(NOON) == ["vehicle 1 (drone): not seen"]
    half = math.radians(15)
    for k in range(200):
        view.receive(
            Frame(
                NOON + 0.01 * k,
                {"drone": (1.0, -2.0, 0.5, math.cos(half), 0.0, 0.0, -math.sin(half)), "wand": (0.0,) * 7},
            )
        )
    line, others = view.lines(NOON + 2.0)
    for part in ("100.0 Hz", " 20 ms old", "north   1.000", "east   2.000", "up  0.500", "yaw   30.0°"):
        assert part in line, line
    assert others == "not in mocap.bodies: wand"
    assert "not seen" in view.lines(NOON + 10.0)[0]


def test_before_a_flight_a_body_is_seen_often_and_never_twice_the_same(lab):
    scenario = Scenario.model_validate_json(json.dumps(real_lab(lab)))

    def outcome(rate_hz: float, *, moving_until_s: float = 4.0, until_s: float = 4.0) -> tuple[Outcome, str]:
        view = MocapView(scenario)
        for k in range(round(until_s * rate_hz)):
            moved_m = 1e-4 * min(k / rate_hz, moving_until_s)
            view.receive(Frame(NOON + k / rate_hz, {"drone": (1.0 + moved_m, -2.0, 0.5, 1.0, 0.0, 0.0, 0.0)}))
        (check,) = view.checks(NOON + 4.0)
        assert check.name == "motion capture of vehicle 1"
        return check.outcome, check.found

    assert outcome(100.0) == (Outcome.PASS, "100 Hz, 20 ms old")
    assert outcome(40.0)[0] is Outcome.WARN, "mocap.rate_hz is 100"
    assert outcome(5.0)[0] is Outcome.FAIL
    assert outcome(100.0, until_s=1.0) == (Outcome.FAIL, "not seen")
    frozen, told = outcome(100.0, moving_until_s=3.0)
    assert frozen is Outcome.FAIL
    assert told.endswith("frozen")


def test_a_real_system_is_looked_at(lab, tmp_path):
    server = NatNetServer(["drone"], lambda _: [(1.0, -2.0, 0.5, 1.0, 0.0, 0.0, 0.0, True)])
    path = tmp_path / "real.yaml"
    path.write_text(json.dumps(real_lab(lab, server.command_port)), encoding="utf-8")
    try:
        result = CliRunner().invoke(app, ["mocap", str(path), "--duration", "6"])
    finally:
        server.close()
    assert result.exit_code == 0, result.output
    assert "motion capture optitrack sees drone" in result.output
    assert "north   1.000 m, east   2.000 m, up  0.500 m" in result.output


def test_a_scenario_without_a_system_says_so():
    result = CliRunner().invoke(app, ["mocap", str(LAB)])
    assert result.exit_code == 2
    assert "has no section mocap" in result.output
