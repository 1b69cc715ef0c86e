"""MAVProxy, the ground station of ArduPilot's developers, flies the simulated autopilots from its console."""

import asyncio
import contextlib
import importlib.util
import re
import sys

import pytest

from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.px4_modes import Px4Mode

pytestmark = [
    pytest.mark.interop,
    pytest.mark.skipif(importlib.util.find_spec("MAVProxy") is None, reason="MAVProxy is not installed"),
]

PATIENCE_S = 20.0


class Console:
    """A MAVProxy process: what is typed, and what it prints."""

    def __init__(self, process):
        self._process = process
        self._text = ""

    async def type(self, line):
        self._process.stdin.write(f"{line}\n".encode())
        await self._process.stdin.drain()

    async def prints(self, pattern):
        """Wait until it has printed this after what was waited for before."""
        async with asyncio.timeout(PATIENCE_S):
            while (found := re.search(pattern, self._text)) is None:
                data = await self._process.stdout.read(4096)
                assert data, f"MAVProxy ended: {self._text}"
                self._text += data.decode(errors="replace")
        self._text = self._text[found.end() :]


@contextlib.asynccontextmanager
async def console(simulation, folder):
    """MAVProxy listening for the simulation, which runs."""
    modules = "--default-modules=mode,arm,cmdlong,param"
    arguments = [f"--master=udpin:127.0.0.1:{simulation.port}", modules, f"--state-basedir={folder}", "--nowait"]
    pipe = asyncio.subprocess.PIPE
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-u", "-m", "MAVProxy.mavproxy", *arguments),
        stdin=pipe,
        stdout=pipe,
        stderr=asyncio.subprocess.STDOUT,
        cwd=folder,
    )
    try:
        async with simulation.running():
            yield Console(process)
    finally:
        process.kill()
        await process.communicate()


async def until(condition):
    async with asyncio.timeout(PATIENCE_S):
        while not condition():
            await asyncio.sleep(0.02)


async def test_px4_takes_off_and_lands(simulation, tmp_path):
    fleet = simulation(speed_up=3.0)
    autopilot = fleet.add()
    vehicle = autopilot.vehicle
    async with console(fleet, tmp_path) as mavproxy:
        await mavproxy.prints(r"Detected vehicle 1:1")
        await mavproxy.prints(r"Received (89\d|9\d\d) parameters")
        await mavproxy.type("param set MIS_TAKEOFF_ALT 4")
        await until(lambda: autopilot.parameters["MIS_TAKEOFF_ALT"] == 4.0)
        await mavproxy.type("arm throttle")
        await mavproxy.prints(r"AP: Armed by external command")
        assert autopilot.armed
        # Its command "mode" fails on PX4's modes; the commands behind it do not.
        await mavproxy.type("long DO_SET_MODE 1 4 2 0 0 0 0")
        await mavproxy.prints(r"DO_SET_MODE: ACCEPTED")
        await mavproxy.prints(r"Mode TAKEOFF")
        await mavproxy.prints(r"Mode LOITER")
        assert vehicle.height_m == pytest.approx(4.0, abs=0.6)
        await mavproxy.type("long NAV_LAND 0 0 0 0 0 0 0")
        await mavproxy.prints(r"Mode LAND")
        await mavproxy.prints(r"AP: Disarmed by landing")
        assert vehicle.on_ground
        assert autopilot.mode is Px4Mode.LOITER


async def test_ardupilot_takes_off_flies_and_lands(simulation, tmp_path):
    fleet = simulation(speed_up=3.0)
    autopilot = fleet.add(firmware="ardupilot")
    vehicle = autopilot.vehicle
    async with console(fleet, tmp_path) as mavproxy:
        await mavproxy.prints(r"Detected vehicle 1:1")
        await mavproxy.prints(r"AP: ArduCopter V4")
        await mavproxy.prints(r"Received 1\d\d\d parameters")
        await mavproxy.type("takeoff 3")
        await mavproxy.prints(r"NAV_TAKEOFF: FAILED")
        await mavproxy.type("mode GUIDED")
        await mavproxy.prints(r"DO_SET_MODE: ACCEPTED\s+GUIDED> Mode GUIDED")
        await until(lambda: fleet.time_s > 20.0)  # it has said that it is ready by then
        await mavproxy.type("arm throttle")
        await mavproxy.prints(r"AP: Arming motors")
        assert autopilot.armed
        await mavproxy.type("takeoff 3")
        await mavproxy.prints(r"NAV_TAKEOFF: ACCEPTED")
        await until(lambda: vehicle.height_m > 2.9)
        await asyncio.sleep(0.5)
        start = vehicle.north_m, vehicle.east_m
        await mavproxy.type("velocity 1 0 0")
        flown = lambda: (vehicle.north_m - start[0]) ** 2 + (vehicle.east_m - start[1]) ** 2  # noqa: E731
        await until(lambda: flown() > 1.0)
        await mavproxy.type("mode LAND")
        await mavproxy.prints(r"Mode LAND")
        await mavproxy.prints(r"AP: Disarming motors")
        assert vehicle.on_ground
        assert autopilot.mode == CopterMode.LAND
