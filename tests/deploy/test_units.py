"""The systemd units say what the programs do."""

import configparser
import re
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


def systemd_analyze(*arguments: str, since: int) -> subprocess.CompletedProcess[str]:
    """Run systemd-analyze; skips where there is none, or one of before the release that knows these arguments."""
    program = shutil.which("systemd-analyze")
    if program is None:
        pytest.skip("no systemd-analyze here to check units with")
    told = subprocess.run([program, "--version"], capture_output=True, text=True, check=True).stdout
    release = re.match(r"systemd (\d+)", told)
    if release is None or int(release[1]) < since:
        pytest.skip(f"systemd {since} or newer is needed, here is: {told.splitlines()[0]}")
    return subprocess.run([program, *arguments], capture_output=True, text=True, check=False)


@pytest.fixture
def instance(tmp_path: Path) -> Path:
    """The unit of vehicle 1, with a program that is there."""
    text = UNIT.read_text(encoding="utf-8").replace("/opt/arvi/.venv/bin/arvi", sys.executable)
    path = tmp_path / UNIT.name.replace("@", "@1")
    path.write_text(text, encoding="utf-8")
    return path


def test_systemd_understands_the_unit(instance: Path) -> None:
    answer = systemd_analyze("verify", str(instance), since=0)
    assert (answer.returncode, answer.stderr) == (0, "")


def test_systemd_finds_little_exposed(instance: Path) -> None:
    """Of ten, less is better; an option taken out by mistake is seen here."""
    answer = systemd_analyze("security", "--offline=yes", "--no-pager", "--threshold=21", str(instance), since=250)
    assert answer.returncode == 0, answer.stdout
