"""The systemd units say what the programs do."""

import configparser
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from gcs.cli import app
from onboard.realtime import _PRIORITY

UNIT = Path("deploy/systemd/arvi-onboard@.service")


def service() -> configparser.SectionProxy:
    parser = configparser.ConfigParser(strict=False, interpolation=None)
    parser.optionxform = str  # type: ignore[assignment, method-assign]
    parser.read_string(UNIT.read_text(encoding="utf-8"))
    return parser["Service"]


def test_the_unit_gives_what_the_process_uses() -> None:
    unit = service()
    assert unit["Type"] == "notify"
    assert int(unit["LimitRTPRIO"]) == _PRIORITY
    assert float(unit["WatchdogSec"]) == 2.0, "a ping comes each quarter of it: onboard/service.py"
    program, command, *arguments = unit["ExecStart"].split()
    assert Path(program).name == "arvi"
    assert command in {known.name or known.callback.__name__ for known in app.registered_commands if known.callback}
    assert arguments == ["/etc/arvi/team.yaml", "--vehicle", "%i"]


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="no systemd-analyze here to check units with")
def test_systemd_understands_the_unit(tmp_path: Path) -> None:
    text = UNIT.read_text(encoding="utf-8").replace("/opt/arvi/.venv/bin/arvi", sys.executable)
    (tmp_path / UNIT.name).write_text(text, encoding="utf-8")
    instance = tmp_path / "arvi-onboard@1.service"
    answer = subprocess.run(["systemd-analyze", "verify", str(instance)], capture_output=True, text=True, check=False)
    assert (answer.returncode, answer.stderr) == (0, "")
