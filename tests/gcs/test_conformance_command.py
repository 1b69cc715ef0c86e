"""``arvi conformance``: in virtual time, over UDP, and what it refuses."""

import asyncio
import json
import socket

import numpy as np
import pytest
from typer.testing import CliRunner

from gcs.cli import app
from gcs.conformance_run import ConformanceError, perform
from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol.codec import Codec
from onboard.protocol.transport import open_link
from sim_bridge.autopilot import ONBOARD, SimulatedAutopilot
from sim_bridge.conformance import Family, Outcome, Plan
from sim_bridge.vehicle import Vehicle


def run(*arguments):
    return CliRunner().invoke(app, ["conformance", *arguments])


def test_simulated_autopilot_and_its_results_as_json(tmp_path):
    file = tmp_path / "result.json"
    result = run("simulated:px4", "--only", "ping", "--only", "request/*", "--json", str(file))
    assert "holds   ping/answered" in result.output
    document = json.loads(file.read_text(encoding="utf-8"))
    outcomes = {found["id"]: found["outcome"] for found in document["results"]}
    assert outcomes["ping/answered"] == "holds"
    differs = [name for name, outcome in outcomes.items() if outcome == "differs"]
    assert result.exit_code == (1 if differs else 0)
    assert document["autopilot"] == "px4"
    assert all(found["source"] for found in document["results"])


def test_entries_are_listed_with_their_sources():
    result = run("udpin://0.0.0.0:14540", "--list", "--autopilot", "ardupilot", "--only", "ping")
    assert result.exit_code == 0
    assert "ping/not-answered" in result.output
    assert "p1_connect 169.36" in result.output


@pytest.mark.parametrize(
    ("arguments", "reason"),
    [
        (["simulated:px5"], "simulated:px4 and simulated:ardupilot there are"),
        (["simulated:px4", "--autopilot", "ardupilot"], "--autopilot ardupilot: simulated:px4 is another one"),
        (["simulated:px4", "--only", "dance"], "--only dance: no entry of this name"),
        (["simulated:px4", "--json", "/no/such/folder/x.json"], "the folder /no/such/folder does not exist"),
        (["nonsense://"], "'nonsense://' is no link; udpin:HOST:PORT"),
        (["tcp://127.0.0.1:9"], "nobody listens on TCP port 9"),
        (["serial:///dev/no-such:57600"], "No such file or directory"),
    ],
)
def test_bad_input_is_refused(arguments, reason):
    result = run(*arguments)
    assert result.exit_code == 2
    assert reason in result.output


class Vehicles:
    """A simulated PX4 that is ready soon, in real time."""

    def __init__(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
            probe.bind(("127.0.0.1", 0))
            self.port = probe.getsockname()[1]
        vehicle = Vehicle(VehicleDynamicsConfig(), (0.0, 0.0, 0.0), 0.0, rng=np.random.default_rng(1))
        self.autopilot = SimulatedAutopilot(
            7, vehicle, origin=OriginConfig(), parameters={}, rng=np.random.default_rng(2), boot_time_s=-9.0
        )

    async def run(self):
        codec, steps = Codec(7, 1), 0

        def receive(datagram):
            for message in codec.decode(datagram):
                self.autopilot.receive(message, ONBOARD, steps * 0.01)

        link = await open_link(f"udpout:127.0.0.1:{self.port}", receive)
        try:
            while True:
                steps += 1
                self.autopilot.step(steps * 0.01, 0.01)
                for name, message in self.autopilot.outbox():
                    if name == ONBOARD:
                        link.send(codec.encode(message))
                await asyncio.sleep(0.01)
        finally:
            link.close()


async def live(plan, **wanted):
    vehicles = Vehicles()
    running = asyncio.create_task(vehicles.run())
    try:
        url = f"udpin://127.0.0.1:{vehicles.port}"
        return await perform(url, plan, wanted.get("family"), wanted.get("system_id"), lambda _: None)
    finally:
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)


async def test_a_live_autopilot_over_udp():
    session = await live(Plan(only=("ping", "timesync", "parameter/read-*"), latency_s=0.3), family=Family.PX4)
    assert session.dialogue.system_id == 7
    assert {result.outcome for result in session.results} == {Outcome.HOLDS}, session.results
    assert len(session.results) >= 8


async def test_another_autopilot_than_wanted_is_named(monkeypatch):
    monkeypatch.setattr("gcs.conformance_run._CONNECT_S", 2.5)
    with pytest.raises(ConformanceError, match="heard were: system 7, px4"):
        await live(Plan(), family=Family.ARDUPILOT)
