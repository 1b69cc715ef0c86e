"""The command line as a user meets it: help, exit codes, messages without tracebacks."""

import json
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from onboard.config import load_scenario

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"


def arvi(*arguments, timeout=60.0):
    return subprocess.run(
        [sys.executable, "-m", "gcs", *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=timeout,
        check=False,
    )


@pytest.fixture
def broken(tmp_path):
    path = tmp_path / "broken.yaml"
    path.write_text(LAB.read_text(encoding="utf-8").replace("horizon: 12", "horizon: twelve"), encoding="utf-8")
    return path


@pytest.fixture
def hardware(tmp_path):
    text = LAB.read_text(encoding="utf-8")
    path = tmp_path / "hardware.yaml"
    path.write_text(text[: text.index("simulation:")], encoding="utf-8")
    return path


@pytest.mark.parametrize("command", [(), ("fly",), ("onboard",), ("bridge",), ("gcs",), ("check",)])
def test_every_command_explains_itself(command):
    result = arvi(*command, "--help")
    assert result.returncode == 0
    assert result.stderr == ""
    assert "arvi" in result.stdout
    if command:
        assert f"arvi {command[0]} configs/" in result.stdout, "an example"


def test_help_loads_nothing_heavy():
    code = (
        "import sys\n"
        "from gcs.cli import main\n"
        "sys.argv = ['arvi', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "heavy = {'numba', 'numpy', 'pydantic', 'pymavlink', 'onboard.protocol.dialect'} & set(sys.modules)\n"
        "sys.stderr.write(' '.join(heavy))\n"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert result.stderr == ""


def test_a_vehicles_installation_says_what_is_missing_for_a_ground_station(own_ports):
    lacking = "import sys; sys.modules['mcap'] = sys.modules['mcap.writer'] = None; from gcs.cli import main; main()"
    done = subprocess.run(
        [sys.executable, "-c", lacking, "gcs", str(own_ports)], capture_output=True, text=True, timeout=60, check=False
    )
    assert done.returncode == 2
    assert "needs mcap" in done.stderr
    assert "Traceback" not in done.stderr


def test_version():
    from importlib.metadata import version

    assert arvi("--version").stdout == f"arvi {version('arvi-flight-stack')}\n"


@pytest.mark.parametrize(
    "arguments",
    [
        ("fly",),
        ("fly", "missing.yaml"),
        ("fly", LAB, "--duration", "-1"),
        ("fly", LAB, "--duration", "nan"),
        ("gcs", LAB, "--start", "--duration", "nan"),
        ("fly", LAB, "--seed", "-3"),
        ("fly", LAB, "--json", "/no/such/folder/r.json"),
        ("onboard", LAB, "--vehicle", "9"),
        ("onboard", LAB),
        ("bridge", "missing.yaml"),
        ("gcs", LAB, "--duration", "5"),
        ("check",),
        ("check", "missing.yaml"),
        ("nonsense",),
    ],
    ids=lambda arguments: " ".join(str(argument).removeprefix(str(LAB.parent)) for argument in arguments),
)
def test_bad_input_exits_with_2_and_one_explanation(arguments):
    result = arvi(*arguments)
    assert result.returncode == 2
    assert result.stderr.strip()
    assert "Traceback" not in result.stderr + result.stdout


@pytest.mark.parametrize("command", [("fly",), ("onboard", "--vehicle", "1"), ("bridge",), ("gcs",), ("check",)])
def test_a_mistake_in_the_scenario_names_line_key_and_value(command, broken):
    result = arvi(command[0], broken, *command[1:])
    assert result.returncode == 2
    line = next(i for i, text in enumerate(broken.read_text().splitlines(), 1) if "twelve" in text)
    assert f'{broken}:{line}: mission.horizon: "twelve"' in result.stderr
    assert "Traceback" not in result.stderr


def test_check_shows_the_right_and_names_the_wrong(broken, hardware):
    result = arvi("check", LAB, broken, hardware)
    assert result.returncode == 2
    assert "mission.horizon" in result.stderr
    assert "lab is valid" in result.stdout
    assert "T = 12 steps of 0.5 s" in result.stdout
    assert "5 ground robots" in result.stdout
    assert "nothing: real vehicles" in result.stdout
    assert arvi("check", LAB).returncode == 0


@pytest.mark.parametrize(
    ("change", "mistake"),
    [
        (("count: 5", "count: 500"), "simulation.ground_robots: 500 robots"),
        (
            ("  parameters:\n", "  parameters:\n    FOO_BAR: 3\n"),
            "simulation.parameters.FOO_BAR: neither PX4 nor ArduPilot has such",
        ),
    ],
)
@pytest.mark.parametrize("command", ["check", "fly"])
def test_what_cannot_be_simulated_is_said_before_anything_starts(tmp_path, command, change, mistake):
    path = tmp_path / "crowded.yaml"
    path.write_text(LAB.read_text(encoding="utf-8").replace(*change))
    result = arvi(command, path)
    assert result.returncode == 2
    assert f"{path}: {mistake}" in result.stderr
    assert "Traceback" not in result.stderr


def test_hardware_is_not_flown_from_here(hardware):
    result = arvi("fly", hardware)
    assert result.returncode == 2
    assert "arvi onboard CONFIG --vehicle N" in result.stderr


@pytest.mark.parametrize("command", ["fly", "gcs"])
def test_ports_in_use_are_named_and_exit_with_2(command, own_ports):
    port = int(load_scenario(own_ports).ground.url.rpartition(":")[2])
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", port))
        result = arvi(command, own_ports, "--headless")
    assert result.returncode == 2
    assert f"UDP port {port}" in result.stderr
    assert "in use" in result.stderr
    assert "second copy" in result.stderr


def test_a_station_alone_watches_records_and_stops_on_ctrl_c(own_ports, tmp_path):
    process = subprocess.Popen(
        [sys.executable, "-m", "gcs", "gcs", own_ports, "--no-dashboard", "--record", tmp_path / "rec"],
        stdout=subprocess.PIPE,
        text=True,
    )
    with process:
        assert process.stdout.readline().startswith("recording to ")
        assert "watching" in process.stdout.readline()
        time.sleep(0.1)
        process.send_signal(2)
        assert process.wait(10.0) == 0
    (folder,) = (tmp_path / "rec").iterdir()
    assert json.loads((folder / "flight.json").read_text())["scenario"] == "own-ports"
    assert (folder / "scenario.yaml").read_bytes() == own_ports.read_bytes()
    summary = json.loads((folder / "summary.json").read_text())
    assert (summary["mission_start_s"], [vehicle["id"] for vehicle in summary["vehicles"]]) == (None, [1, 2])
