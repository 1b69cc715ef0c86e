"""The ground station is killed in flight and started again: the vehicles fly on, and the new one has them at once."""

import asyncio
import contextlib
import os
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
from onboard.messages import FlightState

pytestmark = pytest.mark.system

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"


@pytest.fixture
def config(tmp_path):
    """Two of the lab's vehicles on ports of their own."""
    data = yaml.safe_load(LAB.read_text(encoding="utf-8"))
    del data["vehicles"][2:]
    with contextlib.ExitStack() as stack:
        ports = []
        for _ in range(7):
            sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            sock.bind(("127.0.0.1", 0))
            ports.append(sock.getsockname()[1])
    ground, *others = ports
    data["ground"] = {"url": f"udpin:127.0.0.1:{ground}"}
    for vehicle, (autopilot, peers, sensor) in zip(data["vehicles"], (others[:3], others[3:]), strict=True):
        vehicle["links"] = {
            "autopilot": f"udpin:127.0.0.1:{autopilot}",
            "peers": f"udpout:127.0.0.1:{peers}",
            "sensor": f"udpin:127.0.0.1:{sensor}",
            "ground": f"udpout:127.0.0.1:{ground}",
        }
    path = tmp_path / "two.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


@pytest.fixture
def start():
    """Starts programs of ours, and ends them."""
    processes = []

    def run(*arguments):
        process = subprocess.Popen([sys.executable, "-m", *map(str, arguments)], stdout=subprocess.DEVNULL)
        processes.append(process)
        return process

    yield run
    for process in processes:
        process.kill()
        process.wait()


async def until(condition, limit_s):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "it did not come"
        await asyncio.sleep(0.1)


async def test_vehicles_fly_on_without_the_ground_station_and_obey_the_next(config, start):
    scenario = load_scenario(config)
    start("sim_bridge", config)
    for vehicle in scenario.vehicles:
        start("onboard", config, "--vehicle", vehicle.id)
    first = start("gcs", "gcs", config, "--start", "--headless", "--no-record")
    # Another station cannot listen there, but hears the same through the first one's shared port.
    watcher = GroundStation(scenario, component_id=40)
    await watcher.open(scenario.ground.share_url.replace("udpin", "udpout"), mavsdk=False)
    ticking = asyncio.create_task(watcher.run())

    def vehicles(station):
        return station.team.state(time.time()).vehicles

    def all_track(station):
        return all(vehicle.flight_state is FlightState.TRACK for vehicle in vehicles(station))

    await until(lambda: all_track(watcher), 90.0)
    plans = {vehicle.id: vehicle.plans for vehicle in vehicles(watcher)}
    ticking.cancel()
    await watcher.close()
    os.kill(first.pid, signal.SIGKILL)
    first.wait()
    await asyncio.sleep(6.0)  # longer than any heartbeat's timeout

    second = GroundStation(scenario)
    await second.open()
    ticking = asyncio.create_task(second.run())
    try:
        await until(lambda: all_track(second), 5.0)
        await until(lambda: all(vehicle.mode is not None for vehicle in vehicles(second)), 5.0)
        for vehicle in vehicles(second):
            assert vehicle.plans >= plans[vehicle.id] + 5, "it has planned all the while"
            assert vehicle.mode == "OFFBOARD"
        second.desk.submit(Order(Action.LAND, (1, 2)))
        await until(
            lambda: [record.outcome for record in second.desk.records] == [Outcome.ACKNOWLEDGED] * 2,
            10.0,
        )
        await until(lambda: all(vehicle.flight_state is FlightState.RELEASED for vehicle in vehicles(second)), 10.0)
    finally:
        ticking.cancel()
        await second.close()
