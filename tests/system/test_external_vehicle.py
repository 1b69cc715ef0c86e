"""A team of two simulated vehicles and one that another program flies, from the command line as a user starts it."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from tests.shifted_lab import SHIFT, shifted_lab

pytestmark = pytest.mark.system


def scenario(folder, firmware):
    data = shifted_lab()
    link = f"udpin:127.0.0.1:{14840 + SHIFT}"
    data["vehicles"][0] |= {"autopilot": firmware, "external": {"link": link}}
    path = folder / "external.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


@pytest.mark.parametrize("firmware", ["px4", "ardupilot"])
def test_an_external_autopilot_flies_with_the_team(tmp_path, firmware):
    path, result = scenario(tmp_path, firmware), tmp_path / "result.json"
    ports = [str(port + SHIFT) for port in (14540, 14550, 14840)]
    program = Path(__file__).with_name("external_autopilot.py")
    elsewhere = subprocess.Popen([sys.executable, str(program), firmware, *ports])
    fly = [sys.executable, "-m", "gcs", "fly", str(path), "--headless", "--no-record", "--duration", "5"]
    try:
        done = subprocess.run([*fly, "--json", str(result)], capture_output=True, text=True, timeout=240, check=False)
        assert elsewhere.poll() is None
    finally:
        elsewhere.kill()
        elsewhere.wait()
    assert done.returncode == 0, done.stdout + done.stderr
    summary = json.loads(result.read_text(encoding="utf-8"))
    external, *others = summary["vehicles"]
    assert all(vehicle["landed"] and vehicle["disarmed"] for vehicle in (external, *others))
    # Its place is known to the bridge and to itself: else it would be metres off its plans, or blind and alone.
    assert external["true_tracking_error_rms_m"] < 0.6
    assert external["true_yaw_error_rms_deg"] is not None
    assert external["min_separation_m"] < 4.0
    assert external["peer_bytes_received_per_s"] > 0.0
    # Nobody counts setpoints where they arrive: what was sent is told.
    assert external["setpoint_rate_hz"] == pytest.approx(50.0, abs=10.0)
