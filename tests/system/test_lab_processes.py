"""The lab flown by real processes over MAVLink, from the command line as a user does.

These tests take real time and use PX4's default ports. Rates and gaps are held to looser bars here than `arvi fly`
meets on an idle machine, because test machines are shared; the flight itself is held to all of them.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from mcap.reader import make_reader
from pymavlink import mavutil

from gcs.recording.reader import open_recording
from gcs.recording.replay import Replay
from onboard.protocol import dialect as mavlink

pytestmark = pytest.mark.system

SCENARIO = "configs/lab.yaml"


class Team:
    """``arvi fly`` in a process of its own, and the lines that it has printed."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "gcs", "fly", SCENARIO, "--headless", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        self.lines: list[str] = []
        self._reader = threading.Thread(target=self._read, daemon=True)
        self._reader.start()

    def _read(self) -> None:
        assert self.process.stdout is not None
        for line in self.process.stdout:
            self.lines.append(line)

    def said(self, text: str) -> bool:
        return any(text in line for line in list(self.lines))

    def wait_for(self, text: str, limit_s: float) -> None:
        wait_until(lambda: self.said(text) or self.process.poll() is not None, limit_s)
        assert self.said(text), f"never said {text!r}:\n" + "".join(self.lines)

    def finish(self, limit_s: float) -> int:
        code = self.process.wait(limit_s)
        self._reader.join(5.0)
        return code

    def children(self) -> dict[int, list[str]]:
        """Command lines of the launcher's processes, by process id."""
        found = {}
        for entry in Path("/proc").iterdir():
            if entry.name.isdigit():
                try:
                    parent = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
                    arguments = (entry / "cmdline").read_text().split("\0")
                except (OSError, ValueError):
                    continue  # it ended while we looked
                if parent == self.process.pid:
                    found[int(entry.name)] = arguments
        return found

    def onboard_pid(self, vehicle_id: int) -> int:
        (pid,) = [
            pid
            for pid, arguments in self.children().items()
            if "--vehicle" in arguments and arguments[arguments.index("--vehicle") + 1] == str(vehicle_id)
        ]
        return pid


def wait_until(condition: Callable[[], bool], limit_s: float) -> None:
    end = time.monotonic() + limit_s
    while not condition() and time.monotonic() < end:
        time.sleep(0.1)


def is_alive(pid: int) -> bool:
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Callable[..., Team]]:
    teams: list[Team] = []

    def run(*arguments: str) -> Team:
        teams.append(Team("--record", str(tmp_path / "flights"), *arguments))
        return teams[-1]

    yield run
    for team in teams:
        if team.process.poll() is None:
            team.process.send_signal(signal.SIGTERM)
            try:
                team.process.wait(30.0)
            except subprocess.TimeoutExpired:
                team.process.kill()
                team.process.wait()
        assert team.process.stdout is not None
        team.finish(5.0)
        team.process.stdout.close()


def test_the_team_finds_all_targets_and_lands(start: Callable[..., Team], tmp_path: Path) -> None:
    summary_file = tmp_path / "summary.json"
    team = start("--duration", "60", "--json", str(summary_file))
    assert team.finish(240.0) == 0, "".join(team.lines)
    summary = json.loads(summary_file.read_text())
    print(json.dumps(summary, indent=1))
    assert summary["targets"] == summary["discovered"] == 5
    assert set(summary["time_to_discover_s"]) == {"1", "2", "3", "4", "5"}
    assert 0.0 < summary["rmse_m"] < 4.0
    assert [vehicle["id"] for vehicle in summary["vehicles"]] == [1, 2, 3]
    for vehicle in summary["vehicles"]:
        assert vehicle["landed"]
        assert vehicle["disarmed"]
        assert vehicle["min_separation_m"] >= 0.5
        assert vehicle["setpoint_rate_hz"] >= 45.0
        assert vehicle["setpoint_gap_max_s"] <= 0.5
        assert vehicle["plans"] >= 55
        assert vehicle["deadline_misses"] <= 5
        assert 0.0 < vehicle["planning_time_p99_s"] <= 0.6
        assert 0.0 < vehicle["peer_bytes_per_s"] < 5000.0
    assert summary["cpu_cores"] <= 2.0
    (folder,) = (tmp_path / "flights").iterdir()
    check_recording(folder, summary)


def check_recording(folder: Path, summary: dict[str, Any]) -> None:
    """The recording, opened by readers that nobody here wrote and by replay, says what the live summary says."""
    plan, last = f"UNKNOWN_{mavlink.MAVLINK_MSG_ID_ARVI_PLAN}", {}
    for vehicle in summary["vehicles"]:
        log = mavutil.mavlink_connection(str(folder / f"vehicle{vehicle['id']}_onboard.tlog"))
        kinds: Counter[str] = Counter()
        while (message := log.recv_match()) is not None:
            kinds[message.get_type()] += 1
        log.close()
        assert kinds["BAD_DATA"] == 0
        assert kinds[plan] == pytest.approx(vehicle["plans"], abs=2)
        assert kinds["HEARTBEAT"] >= 60
    with (folder / "flight.mcap").open("rb") as file:
        reader = make_reader(file)
        counts = reader.get_summary().statistics.channel_message_counts
        for _, channel, message in reader.iter_messages():
            counts[channel.id] -= 1
            last[channel.topic] = json.loads(message.data)
    assert set(counts.values()) == {0}
    assert last["/team"]["discovered"] == summary["discovered"]
    assert last["/team"]["rmse_mean_m"] == pytest.approx(summary["rmse_m"], abs=2e-3)
    assert last["/team"]["entropy_mean_nats"] == pytest.approx(summary["entropy_nats"], abs=2e-3)
    for vehicle in summary["vehicles"]:
        assert last[f"/vehicle_{vehicle['id']}"]["plans"] == vehicle["plans"]
    replay = Replay(open_recording(folder))
    replay.go(replay.ticks)
    state = replay.state()
    assert state.discovered == summary["discovered"]
    assert state.figures.rmse_m == pytest.approx(summary["rmse_m"], abs=2e-3)
    assert state.figures.entropy_nats == pytest.approx(summary["entropy_nats"], abs=2e-3)


def test_a_killed_onboard_process_harms_only_itself_and_ctrl_c_lands_the_others(start: Callable[..., Team]) -> None:
    team = start("--duration", "300")
    team.wait_for("found by vehicle", 120.0)
    children = list(team.children())
    assert len(children) == 5, "the bridge, three onboard processes, and MAVSDK's"

    second = subprocess.run(
        [sys.executable, "-m", "gcs", "fly", SCENARIO, "--headless", "--no-record"],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    assert second.returncode == 2
    assert "14550" in second.stdout + second.stderr
    assert "in use" in second.stdout + second.stderr

    os.kill(team.onboard_pid(2), signal.SIGKILL)
    team.wait_for("vehicle 2's onboard process ended: killed by SIGKILL", 5.0)
    team.wait_for("vehicle 2: mode OFFBOARD → LAND", 5.0)
    team.wait_for("vehicle 2: Disarmed by landing", 20.0)
    assert sum("TRACK OFFBOARD" in part for part in progress(team)[-1].split("|")) == 2

    asked = time.monotonic()
    team.process.send_signal(signal.SIGINT)
    code = team.finish(25.0)
    assert time.monotonic() - asked < 20.0
    assert code == 1, "the flight ends well but for the process that died"
    for vehicle in (1, 3):  # one may wait for vehicle 2, of which it knows nothing, until the station lands it directly
        assert team.said(f"vehicle {vehicle}: Disarmed by landing")
    assert not any(is_alive(pid) for pid in children)


def progress(team: Team) -> list[str]:
    return [line for line in team.lines if " left | targets" in line]


def test_ctrl_c_in_flight_lands_all_and_exits_0(start: Callable[..., Team]) -> None:
    team = start("--duration", "300")
    team.wait_for("found by vehicle", 120.0)
    children = list(team.children())
    asked = time.monotonic()
    team.process.send_signal(signal.SIGINT)
    assert team.finish(25.0) == 0, "".join(team.lines)
    assert time.monotonic() - asked < 20.0
    for vehicle in (1, 2, 3):
        assert team.said(f"vehicle {vehicle}: LAND -> LANDED")
    assert not any(is_alive(pid) for pid in children)


def test_the_launchers_own_death_leaves_nobody_behind(start: Callable[..., Team]) -> None:
    team = start("--duration", "300")
    team.wait_for("waiting for all vehicles", 120.0)
    children = list(team.children())
    assert children
    team.process.kill()
    team.finish(10.0)
    wait_until(lambda: not any(is_alive(pid) for pid in children), 10.0)
    assert not any(is_alive(pid) for pid in children)
