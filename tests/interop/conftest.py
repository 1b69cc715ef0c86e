"""Simulated autopilots over UDP, in real time or faster, for clients that nobody here wrote."""

import asyncio
import contextlib
import socket
import time

import numpy as np
import pytest

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol.codec import Codec
from onboard.protocol.transport import open_link
from sim_bridge.autopilot import ONBOARD, SimulatedAutopilot
from sim_bridge.vehicle import Vehicle

STEP_S = 0.005


class Simulation:
    """Autopilots of one client, each on a UDP socket of its own that sends to the client's port.

    Args:
        port: Where the client listens.
        speed_up: How much faster than the client the vehicles live.
    """

    def __init__(self, port: int, speed_up: float) -> None:
        self.port = port
        self.speed_up = speed_up
        self.autopilots = []
        self.steps = 0

    def add(self, system_id=1, **options):
        """One more vehicle, three metres east of the one before."""
        place = (1.0, 2.0 + 3.0 * len(self.autopilots), 0.0)
        vehicle = Vehicle(VehicleDynamicsConfig(), place, 0.5, rng=np.random.default_rng((1, system_id)))
        options = {"origin": OriginConfig(), "parameters": {}, **options}
        autopilot = SimulatedAutopilot(
            system_id, vehicle, rng=np.random.default_rng((2, system_id)), boot_time_s=0.0, **options
        )
        self.autopilots.append(autopilot)
        return autopilot

    @property
    def time_s(self):
        """Time of the vehicles, s."""
        return self.steps * STEP_S

    async def run(self):
        """Step until cancelled."""
        async with contextlib.AsyncExitStack() as stack:
            wires = []
            for autopilot in self.autopilots:
                codec = Codec(autopilot.system_id, 1)
                link = await open_link(f"udpout:127.0.0.1:{self.port}", self._receiver(autopilot, codec))
                stack.callback(link.close)
                wires.append((autopilot, codec, link))
            started_s = time.monotonic()
            while True:
                while self.time_s < self.speed_up * (time.monotonic() - started_s):
                    self.steps += 1
                    for autopilot, codec, link in wires:
                        autopilot.step(self.time_s, STEP_S)
                        for name, message in autopilot.outbox():
                            if name == ONBOARD:
                                link.send(codec.encode(message))
                await asyncio.sleep(STEP_S / self.speed_up)

    def _receiver(self, autopilot, codec):
        def receive(datagram):
            for message in codec.decode(datagram):
                autopilot.receive(message, ONBOARD, self.time_s)

        return receive

    @contextlib.asynccontextmanager
    async def running(self):
        """Stepped in the background."""
        task = asyncio.create_task(self.run())
        try:
            yield self
        finally:
            task.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await task


@pytest.fixture
def simulation():
    """Makes simulations, each with a free port for its client."""

    def make(speed_up=2.0):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            port = probe.getsockname()[1]
        return Simulation(port, speed_up)

    return make
