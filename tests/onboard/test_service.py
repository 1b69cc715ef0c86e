"""sd_notify(3), told to a socket that stands in for systemd's."""

import asyncio
import contextlib
import itertools
import os
import signal
import socket
from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.config.models import PlannerConfig
from onboard.config.schema import Scenario
from onboard.config.vehicle import LinksConfig
from onboard.links import LinkName
from onboard.process import _Process
from onboard.service import NotifySocket, ServiceReport


def test_ready_once_and_pings_at_a_quarter_of_the_watchdog() -> None:
    report = ServiceReport(watchdog_s=2.0)
    told = [(0.02 * tick, state) for tick in range(250) for state in report.ticked(0.02 * tick)]
    assert told[0] == (0.0, "READY=1")
    pings = [time_s for time_s, state in told if state == "WATCHDOG=1"]
    assert len(told) == 1 + len(pings), "nothing else is told"
    gaps = [after - before for before, after in itertools.pairwise(pings)]
    assert max(gaps) <= 0.53, "four chances within the watchdog's two seconds"
    assert min(gaps) >= 0.49


def test_a_loop_that_hangs_is_silent_and_one_without_watchdog_never_pings() -> None:
    report = ServiceReport(watchdog_s=2.0)
    report.ticked(0.0)
    assert report.ticked(7.0) == ["WATCHDOG=1"], "one ping when it goes on, none made up for the time between"
    assert "WATCHDOG=1" not in ServiceReport().ticked(0.0)


def test_a_status_is_told_when_it_changes_and_cannot_smuggle_in_another_state() -> None:
    report = ServiceReport()
    assert report.wants_status(0.0)
    assert report.ticked(0.0, "WAIT: no heartbeat") == ["READY=1", "STATUS=WAIT: no heartbeat"]
    assert not report.wants_status(0.5)
    assert report.ticked(1.0, "WAIT: no heartbeat") == []
    assert report.ticked(2.0, "evil\nWATCHDOG=1") == ["STATUS=evil WATCHDOG=1"]


@pytest.mark.parametrize("abstract", [False, True])
def test_states_reach_a_socket_on_disk_and_in_the_abstract_namespace(tmp_path: Path, abstract: bool) -> None:
    name = f"@arvi-test-{os.getpid()}" if abstract else str(tmp_path / "notify")
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind("\0" + name[1:] if abstract else name)
        environment = {"NOTIFY_SOCKET": name, "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": str(os.getpid())}
        notifier = NotifySocket.of(environment)
        assert notifier.watchdog_s == 2.0
        notifier.send(["READY=1", "STATUS=up"])
        assert systemd.recv(100) == b"READY=1\nSTATUS=up"
    notifier.send(["WATCHDOG=1"])  # systemd is gone: the flight goes on
    notifier.close()
    notifier.send(["WATCHDOG=1"])


@pytest.mark.parametrize(
    "environment",
    [
        {},
        {"NOTIFY_SOCKET": ""},
        {"NOTIFY_SOCKET": "vsock:2:1234", "WATCHDOG_USEC": "1"},
        {"NOTIFY_SOCKET": "/run/x", "WATCHDOG_USEC": "2000000", "WATCHDOG_PID": "1"},
        {"NOTIFY_SOCKET": "/run/x", "WATCHDOG_USEC": "soon"},
    ],
)
def test_nobody_who_watches_means_no_watchdog(environment: dict[str, str]) -> None:
    notifier = NotifySocket.of(environment)
    assert notifier.watchdog_s is None
    notifier.send(["READY=1"])
    notifier.close()


def closed_scenario() -> Scenario:
    """The lab, its first vehicle's links where nobody is."""
    lab = load_scenario(Path("configs/lab.yaml"))
    links = LinksConfig(
        autopilot="udpout:127.0.0.1:9",
        peers="udpout:127.0.0.1:9",
        sensor="udpout:127.0.0.1:9",
        ground="udpout:127.0.0.1:9",
    )
    vehicle = lab.vehicles[0].model_copy(update={"links": links})
    return lab.model_copy(update={"vehicles": (vehicle,), "planner": PlannerConfig(node_limit=1000)})


async def test_the_onboard_process_tells_its_life_from_its_own_loop(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    address = tmp_path / "notify"
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as systemd:
        systemd.bind(str(address))
        systemd.setblocking(False)
        monkeypatch.setenv("NOTIFY_SOCKET", str(address))
        monkeypatch.setenv("WATCHDOG_USEC", "200000")
        monkeypatch.delenv("WATCHDOG_PID", raising=False)
        process = _Process(closed_scenario(), 1)
        vehicle = closed_scenario().vehicles[0]
        await process.open(dict.fromkeys(LinkName, vehicle.autopilot_url))
        running = asyncio.create_task(process.run())
        states: list[str] = []

        def hear() -> None:
            with contextlib.suppress(BlockingIOError):
                while True:
                    states.extend(systemd.recv(1000).decode().split("\n"))

        async with asyncio.timeout(30.0):
            while states.count("WATCHDOG=1") < 3:
                await asyncio.sleep(0.01)
                hear()
            os.kill(os.getpid(), signal.SIGTERM)
            await running
        hear()
        process.close()
    assert states[:3] == ["READY=1", "STATUS=WAIT: no heartbeat", "WATCHDOG=1"]
    assert states.count("READY=1") == states.count("STOPPING=1") == 1
