"""Flights of stand-in processes (``fakes/``) with real sockets and signals: all is watched, landed, stopped."""

import asyncio
import json
import os
import signal
import subprocess
import sys
import textwrap
import time
from dataclasses import replace
from pathlib import Path

import pytest

from gcs.errors import GroundError
from gcs.launcher import FlightOptions, Programs, fly
from onboard.config import load_scenario

FAKES = Path(__file__).parent / "fakes"


class Watching:
    """A display that remembers."""

    def __init__(self):
        self.events = []
        self.phases = []

    def show(self, team, phase, time_left_s):
        if phase not in self.phases:
            self.phases.append(phase)

    def event(self, event):
        self.events.append(event.text)


def programs(config, **others):
    python = sys.executable
    fake = Programs(
        warm_up=[python, "-c", "pass"],
        bridge=[python, str(FAKES / "fake_bridge.py"), str(config)],
        onboard=lambda vehicle: [python, str(FAKES / "fake_onboard.py"), str(config), str(vehicle)],
    )
    return replace(fake, **others)


def options(config, duration_s=0.5, record=None):
    return FlightOptions(config, load_scenario(config), duration_s, 7, record, "1.2.3")


def crashing(config, vehicle, code):
    """Onboard processes of which one is another program, and the others do not end when they should."""
    real = programs(config).onboard
    return lambda number: [sys.executable, "-c", code] if number == vehicle else [*real(number), "--ignore-term"]


async def until(condition, timeout_s=30.0):
    async with asyncio.timeout(timeout_s):
        while not condition():
            await asyncio.sleep(0.02)


def processes_of(config):
    """Ids of processes that have this configuration on their command line."""
    found = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        try:
            arguments = path.read_bytes().split(b"\0")
        except OSError:
            continue
        if str(config).encode() in arguments and int(path.parent.name) != os.getpid():
            found.append(int(path.parent.name))
    return found


async def test_a_flight_from_launch_to_summary(own_ports, tmp_path):
    watching = Watching()
    result = await fly(options(own_ports, record=tmp_path / "rec"), watching, programs(own_ports))
    assert result.problems == ()
    assert [vehicle["landed"] and vehicle["disarmed"] for vehicle in result.summary["vehicles"]] == [True] * 2
    assert watching.phases[:4] == ["waiting for all vehicles", "taking off", "flying", "landing"]
    assert (result.summary["seed"], result.summary["version"], result.summary["targets"]) == (7, "1.2.3", 5)
    assert 0.5 <= result.summary["duration_s"] < 1.5
    assert result.summary["cpu_cores"] > 0.0
    assert set(result.summary["cpu_s"]) == {"ground", "bridge", "vehicle1", "vehicle2"}
    names = {path.name for path in result.folder.iterdir()}
    assert names >= {"scenario.yaml", "flight.json", "summary.json", "flight.mcap", "bridge.tlog", "bridge.log"}
    assert {f"vehicle{i}_{part}" for i in (1, 2) for part in ("autopilot.tlog", "onboard.tlog")} <= names
    assert json.loads((result.folder / "flight.json").read_text())["seed"] == 7
    assert json.loads((result.folder / "summary.json").read_text()) == result.summary
    assert (result.folder / "scenario.yaml").read_bytes() == own_ports.read_bytes()
    assert processes_of(own_ports) == []


async def test_one_dies_in_flight_and_the_others_fly_on(own_ports, tmp_path):
    watching = Watching()
    flight = asyncio.create_task(fly(options(own_ports, 2.0, tmp_path), watching, programs(own_ports)))
    await until(lambda: "flying" in watching.phases)
    (victim,) = [
        pid for pid in processes_of(own_ports) if Path(f"/proc/{pid}/cmdline").read_bytes().endswith(b"\x002\0")
    ]
    os.kill(victim, signal.SIGKILL)
    await until(lambda: any("killed by SIGKILL" in text for text in watching.events), 2.0)
    assert "landing" not in watching.phases, "the others fly on"
    result = await flight
    assert result.problems == ("vehicle 2's onboard process ended: killed by SIGKILL",)
    assert "  | onboard 2 runs" in watching.events, "its last log line"
    assert "autopilot took NAV_LAND" in watching.events, "landed by its autopilot"
    assert all(vehicle["landed"] and vehicle["disarmed"] for vehicle in result.summary["vehicles"])


async def test_nobody_takes_off_without_a_complete_team_and_the_stubborn_are_ended(own_ports, tmp_path):
    watching = Watching()
    broken = crashing(own_ports, 2, "import time; time.sleep(1.5); raise SystemExit('no camera')")
    result = await fly(options(own_ports, record=tmp_path), watching, programs(own_ports, onboard=broken))
    assert result.problems == (
        "vehicle 2's onboard process ended: exit code 1",
        "the team is not complete, so nobody takes off",
    )
    assert "  | no camera" in watching.events
    assert watching.phases == ["waiting for all vehicles"]
    assert processes_of(own_ports) == []


async def test_a_flight_ends_with_its_bridge(own_ports, tmp_path):
    watching = Watching()
    bridge = [sys.executable, "-c", "import time; time.sleep(0.3); raise SystemExit(4)"]
    result = await fly(options(own_ports, record=tmp_path), watching, programs(own_ports, bridge=bridge))
    assert result.problems[0] == "the bridge ended: exit code 4"
    assert processes_of(own_ports) == []


async def test_kernels_that_do_not_compile_end_it_before_anything_starts(own_ports, tmp_path):
    watching = Watching()
    bad = [sys.executable, "-c", "raise SystemExit('bad kernel')"]
    result = await fly(options(own_ports, record=tmp_path), watching, programs(own_ports, warm_up=bad))
    assert result.summary is None
    assert result.problems == ("the planner's kernels cannot be compiled (exit code 1)",)
    assert "  | bad kernel" in watching.events


async def test_an_error_in_the_launcher_itself_leaves_nothing_behind(own_ports, tmp_path):
    class Broken(Watching):
        def show(self, team, phase, time_left_s):
            raise RuntimeError("broken display")

    with pytest.raises(RuntimeError, match="broken display"):
        await fly(options(own_ports, record=tmp_path), Broken(), programs(own_ports))
    assert processes_of(own_ports) == []


async def test_a_scenario_of_real_vehicles_is_refused(own_ports):
    given = options(own_ports)
    real = replace(given, scenario=given.scenario.model_copy(update={"simulation": None}))
    with pytest.raises(GroundError, match="arvi gcs CONFIG --start"):
        await fly(real, Watching(), programs(own_ports))


async def test_a_folder_that_cannot_be_made_is_refused(own_ports, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(GroundError, match="cannot be made"):
        await fly(options(own_ports, record=tmp_path / "file"), Watching(), programs(own_ports))


def launched(config, duration_s=60.0):
    """A launcher in a process of its own, to send signals to; prints its phases, and at last its problems."""
    code = f"""
        import asyncio, sys
        sys.path.insert(0, {str(Path(__file__).parent)!r})
        from pathlib import Path
        from test_launcher import Watching, options, programs
        from gcs.launcher import fly

        class Telling(Watching):
            def show(self, team, phase, time_left_s):
                if phase not in self.phases:
                    print(phase, flush=True)
                super().show(team, phase, time_left_s)

        config = Path({str(config)!r})
        result = asyncio.run(fly(options(config, {duration_s}), Telling(), programs(config)))
        print("problems", *result.problems)
        sys.exit(bool(result.problems))
    """
    temporary = config.parent / "temporary"
    temporary.mkdir()
    environment = {**os.environ, "TMPDIR": str(temporary)}
    program = [sys.executable, "-c", textwrap.dedent(code)]
    return subprocess.Popen(program, stdout=subprocess.PIPE, text=True, env=environment)


def read_until(process, word):
    for line in process.stdout:
        if line.startswith(word):
            return line
    raise AssertionError(f"ended without saying {word!r}")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGHUP])
def test_a_first_signal_lands_the_team(own_ports, number):
    with launched(own_ports) as process:
        read_until(process, "flying")
        began = time.monotonic()
        process.send_signal(number)
        read_until(process, "landing")
        process.send_signal(signal.SIGHUP)  # the second of a closed terminal changes nothing
        assert read_until(process, "problems").split() == ["problems"]
        assert process.wait(20.0) == 0
        assert time.monotonic() - began < 20.0
    assert processes_of(own_ports) == []
    assert list((own_ports.parent / "temporary").iterdir()) == [], "a good flight leaves no logs"


def test_a_second_signal_stops_at_once(own_ports):
    with launched(own_ports) as process:
        read_until(process, "flying")
        process.send_signal(signal.SIGINT)
        read_until(process, "landing")
        process.send_signal(signal.SIGINT)
        assert "stopped at once" in read_until(process, "problems")
        assert process.wait(5.0) == 1
    assert processes_of(own_ports) == []


def test_a_signal_before_takeoff_ends_it(own_ports):
    with launched(own_ports) as process:
        read_until(process, "waiting")
        process.send_signal(signal.SIGTERM)
        assert "stopped before takeoff" in read_until(process, "problems")
        assert process.wait(10.0) == 1
    assert processes_of(own_ports) == []


@pytest.mark.skipif(sys.platform != "linux", reason="prctl is Linux's")
def test_nothing_outlives_a_launcher_that_is_killed(own_ports):
    with launched(own_ports) as process:
        read_until(process, "taking off")
        assert len(processes_of(own_ports)) == 3
        process.kill()
    deadline = time.monotonic() + 5.0
    while processes_of(own_ports) and time.monotonic() < deadline:
        time.sleep(0.02)
    assert processes_of(own_ports) == []
