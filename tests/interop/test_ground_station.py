"""Ground stations that nobody here wrote, beside ours: MAVSDK as the way of its orders, MAVProxy forwarded to."""

import asyncio
import contextlib
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
import yaml

from gcs.operator_desk import Action, Order, Outcome
from gcs.station import GroundStation
from onboard.config import load_scenario

pytestmark = pytest.mark.interop

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"
PATIENCE_S = 30.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


@pytest.fixture
def config(tmp_path):
    """Two of the lab's vehicles on ports of their own, forwarded to a port of the test's."""
    data = yaml.safe_load(LAB.read_text(encoding="utf-8"))
    del data["vehicles"][2:]
    ground = free_port()
    data["ground"] = {"url": f"udpin:127.0.0.1:{ground}", "forward": [f"udpout:127.0.0.1:{free_port()}"]}
    for vehicle in data["vehicles"]:
        vehicle["links"] = {
            "autopilot": f"udpin:127.0.0.1:{free_port()}",
            "peers": f"udpout:127.0.0.1:{free_port()}",
            "sensor": f"udpin:127.0.0.1:{free_port()}",
            "ground": f"udpout:127.0.0.1:{ground}",
        }
    path = tmp_path / "two.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


@pytest.fixture
def bridge(config):
    """The simulated vehicles; their autopilots speak to the ground by themselves."""
    process = subprocess.Popen([sys.executable, "-m", "sim_bridge", str(config)])
    yield process
    process.terminate()
    process.wait(10.0)


@contextlib.asynccontextmanager
async def station_of(config, **options):
    station = GroundStation(load_scenario(config))
    await station.open(**options)
    ticking = asyncio.create_task(station.run())
    try:
        yield station
    finally:
        ticking.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await ticking
        await station.close()


async def until(condition, limit_s=PATIENCE_S):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "it did not come"
        await asyncio.sleep(0.05)


def mode(station, vehicle):
    return station.team.state(time.time()).vehicle(vehicle).mode


async def order(station, action, vehicle):
    """Give an order and wait for its end."""
    station.desk.submit(Order(action, (vehicle,)))
    await until(
        lambda: (
            station.desk.records
            and station.desk.records[-1].action is action
            and station.desk.records[-1].outcome is not Outcome.SENT
        )
    )
    return station.desk.records[-1]


def worker_pid():
    for entry in Path("/proc").iterdir():
        if entry.name.isdigit():
            with contextlib.suppress(OSError):
                status = (entry / "status").read_text()
                if f"PPid:\t{os.getpid()}\n" in status and "mavsdk_worker" in (entry / "cmdline").read_text():
                    return int(entry.name)
    raise AssertionError("no worker")


async def test_orders_reach_autopilots_through_mavsdk_and_without_it(config, bridge):
    async with station_of(config) as station:
        await until(lambda: station.mavsdk_reaches(1) and station.mavsdk_reaches(2))
        before = mode(station, 1)
        record = await order(station, Action.LAND, 2)
        assert (record.outcome, record.to) == (Outcome.ACKNOWLEDGED, "autopilot, MAVSDK")
        await until(lambda: mode(station, 2) == "LAND")
        assert mode(station, 1) == before, "nobody ordered anything of vehicle 1"
        record = await order(station, Action.HOLD, 2)
        assert (record.outcome, record.to) == (Outcome.ACKNOWLEDGED, "autopilot, MAVSDK")
        await until(lambda: mode(station, 2) == "LOITER")

        os.kill(worker_pid(), signal.SIGKILL)
        await until(lambda: not station.mavsdk_reaches(2))
        record = await order(station, Action.LAND, 2)
        assert (record.outcome, record.to) == (Outcome.ACKNOWLEDGED, "autopilot, directly")
        await until(lambda: mode(station, 2) == "LAND")
        texts = [event.text for event in station.team.take_events()]
        assert any(text.startswith("MAVSDK ended (killed by signal 9)") for text in texts)
        await until(lambda: station.mavsdk_reaches(2))  # and it comes back by itself
        record = await order(station, Action.RETURN, 2)
        assert (record.outcome, record.to) == (Outcome.ACKNOWLEDGED, "autopilot, MAVSDK")


class MavProxy:
    """MAVProxy in a process of its own; what it prints."""

    def __init__(self, master, folder):
        # HOME is of the test's: MAVProxy writes there. No terminal: it reads its commands from the pipe.
        environment = {**os.environ, "HOME": str(folder), "TERM": "dumb", "PYTHONUNBUFFERED": "1"}
        program = Path(sys.executable).parent / "mavproxy.py"
        self.process = subprocess.Popen(
            [sys.executable, "-W", "ignore", str(program), f"--master={master}", "--logfile=flight.tlog"],
            stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, cwd=folder, env=environment,
        )  # fmt: skip
        os.set_blocking(self.process.stdout.fileno(), False)
        self.printed = ""

    def say(self, line):
        self.process.stdin.write(line.encode() + b"\n")
        self.process.stdin.flush()

    def read(self):
        self.printed += (self.process.stdout.read() or b"").decode("utf-8", "replace")
        return self.printed

    def end(self):
        self.process.kill()
        self.process.wait()
        self.process.stdin.close()
        self.process.stdout.close()


@pytest.fixture
def mavproxy(config, tmp_path):
    pytest.importorskip("MAVProxy", reason="MAVProxy is not installed: pip install MAVProxy")
    forward = yaml.safe_load(config.read_text(encoding="utf-8"))["ground"]["forward"][0]
    client = MavProxy(forward.replace("udpout", "udpin"), tmp_path)
    yield client
    client.end()


async def test_mavproxy_beside_our_station_sees_and_commands_every_vehicle(config, bridge, mavproxy, tmp_path):
    async with station_of(config, mavsdk=False) as station:
        await until(lambda: all(f"Detected vehicle {i}:1" in mavproxy.read() for i in (1, 2)))
        await until(lambda: "Received 898 parameters" in mavproxy.read())
        mavproxy.say("vehicle 2")
        await until(lambda: "Set vehicle 2" in mavproxy.read())
        # Not `mode LAND`: of PX4's modes MAVProxy 1.8.75 makes an invalid command.
        mavproxy.say("long DO_SET_MODE 1 4 6 0 0 0 0")
        await until(lambda: mode(station, 2) == "LAND")
        assert mode(station, 1) == "LOITER"
        await until(lambda: re.search(r"Got COMMAND_ACK: DO_SET_MODE: ACCEPTED", mavproxy.read()))
    seen = frames_of(tmp_path / "flight.tlog")
    for kind in ("HEARTBEAT", "GLOBAL_POSITION_INT", "SYS_STATUS", "PARAM_VALUE"):
        senders = {(message.get_srcSystem(), message.get_srcComponent()) for message in seen[kind]}
        wanted = {(1, 1)} if kind == "PARAM_VALUE" else {(1, 1), (2, 1)}
        assert wanted <= senders, f"{kind} from {senders}"
    assert {message.battery_remaining for message in seen["SYS_STATUS"]} <= {99, 100}
    assert len({message.param_id for message in seen["PARAM_VALUE"]}) >= 898


def frames_of(tlog):
    """What MAVProxy itself recorded, by message."""
    from pymavlink import mavutil

    log = mavutil.mavlink_connection(str(tlog), dialect="common")
    seen = {}
    while (message := log.recv_match()) is not None:
        seen.setdefault(message.get_type(), []).append(message)
    log.close()
    return seen


def arvi(*arguments):
    command = [sys.executable, "-m", "gcs", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=60.0, check=False)


async def test_a_shell_commands_and_watches_beside_the_station(config, bridge):
    async with station_of(config, mavsdk=False) as station:
        await until(lambda: mode(station, 2) is not None)
        done = await asyncio.to_thread(arvi, "command", config, "land", "--vehicle", 2, "--yes")
        assert done.returncode == 0, done.stdout + done.stderr
        assert re.search(r"vehicle 2 +land \(autopilot, (MAVSDK|directly)\) +acknowledged", done.stdout)
        await until(lambda: mode(station, 2) == "LAND")  # it shows in the next heartbeat
        assert mode(station, 1) == "LOITER"
        done = await asyncio.to_thread(arvi, "command", config, "pause", "--vehicle", 1, "--yes")
        assert done.returncode == 1, "there is no onboard process"
        assert "timed out: no answer" in done.stdout

        command = [sys.executable, "-m", "gcs", "monitor", str(config), "--headless"]
        watching = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        try:
            lines = []
            while not any("2: not heard LAND" in line for line in lines):  # its onboard process, that is
                assert len(lines) < 20, lines
                lines.append(await asyncio.wait_for(asyncio.to_thread(watching.stdout.readline), PATIENCE_S))
            assert any("joined the ground station" in line for line in lines)
            watching.send_signal(signal.SIGINT)
            assert await asyncio.to_thread(watching.wait, 10.0) == 0
        finally:
            watching.kill()
            watching.wait()
            watching.stdout.close()


def test_a_shell_commands_alone(config, bridge):
    done = arvi("command", config, "land", "--yes")
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count("acknowledged") == 2
    assert arvi("command", config, "land", "--vehicle", "9", "--yes").returncode == 2


async def test_who_is_silent_keeps_no_other_vehicle_waiting_for_its_order(config, bridge):
    data = yaml.safe_load(config.read_text(encoding="utf-8"))
    links = {"ground": data["vehicles"][0]["links"]["ground"]}
    for link, kind in (("autopilot", "udpin"), ("peers", "udpout"), ("sensor", "udpin")):
        links[link] = f"{kind}:127.0.0.1:{free_port()}"
    data["vehicles"].append(yaml.safe_load(LAB.read_text(encoding="utf-8"))["vehicles"][2] | {"links": links})
    larger = config.with_name("three.yaml")
    larger.write_text(yaml.safe_dump(data), encoding="utf-8")
    async with station_of(config, mavsdk=False) as station:
        await until(lambda: mode(station, 2) is not None)
        ordering = asyncio.create_task(asyncio.to_thread(arvi, "command", larger, "land", "--yes"))
        await until(lambda: (mode(station, 1), mode(station, 2)) == ("LAND", "LAND"))
        assert not ordering.done(), "it still waits for vehicle 3"
        done = await ordering
    assert done.returncode == 1
    assert done.stdout.count("acknowledged") == 2, done.stdout
    assert "timed out: no answer; it is not heard" in done.stdout
