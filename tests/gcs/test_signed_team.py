"""A team with a key from end to end, over UDP: every way of giving orders works, and none without the key."""

import asyncio
import contextlib
import socket
import time
from pathlib import Path

import pytest
import yaml

from gcs.joining import joined_station
from gcs.operator_desk import Action, OperatorDesk, Order, Outcome
from gcs.order_command import run_order
from gcs.station import GroundStation
from onboard.companion import Companion
from onboard.config import load_scenario
from onboard.links import COMPONENT, LinkName
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import SignedLink, Signing, Verdict
from onboard.protocol.signing_files import read_key, write_new_key
from onboard.protocol.transport import open_datagram_link
from onboard.signing_keeper import SigningKeeper

HOLD = mavlink.MAV_CMD_DO_SET_MODE


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return sock.getsockname()[1]


@pytest.fixture
def scenario(tmp_path):
    """One vehicle of the lab, with a key, on ports that nobody else has."""
    write_new_key(tmp_path / "team.key")
    data = yaml.safe_load(Path("configs/lab.yaml").read_text())
    ground = free_port()
    data["vehicles"] = [{**data["vehicles"][0], "links": {"ground": f"udpout:127.0.0.1:{ground}"}}]
    data["ground"] = {
        "url": f"udpin:127.0.0.1:{ground}",
        "share": f"udpin:127.0.0.1:{free_port()}",
        "forward": [f"udpin:127.0.0.1:{free_port()}"],
    }
    data["signing"] = {"key_file": "team.key", "state_folder": "state"}
    path = tmp_path / "signed.yaml"
    path.write_text(yaml.safe_dump(data))
    return load_scenario(path)


class Vehicle:
    """A real onboard computer core and an autopilot that takes every command, both on the ground link."""

    def __init__(self, scenario):
        self.keeper = SigningKeeper(scenario.signing, "vehicle-1")
        self.unit = Companion(scenario, 1, time.time(), self.keeper.signing)
        self.url = scenario.vehicle(1).ground_url
        self.autopilot = Codec(1, 1)
        self.commands = []

    async def open(self):
        self.onboard_link = await open_datagram_link(self.url, self.from_ground)
        self.autopilot_link = await open_datagram_link(self.url, self.to_autopilot)

    def from_ground(self, datagram):
        self.unit.receive(LinkName.GROUND, datagram, time.time())

    def to_autopilot(self, datagram):
        for message in Codec(9, 9).decode(datagram):
            if message.get_type() == "COMMAND_LONG":
                self.commands.append((message.get_srcComponent(), message.command))
                ack = mavlink.MAVLink_command_ack_message(message.command, 0, 0, 0, 255, message.get_srcComponent())
                self.autopilot_link.send(self.autopilot.encode(ack))

    async def run(self):
        while True:
            self.autopilot_link.send(
                self.autopilot.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0x03040000, 3, 3))
            )
            for _ in range(10):
                self.unit.tick(time.time())
                for link, frame in self.unit.outbox():
                    if link is LinkName.GROUND:
                        self.onboard_link.send(frame)
                await asyncio.sleep(0.02)

    @property
    def refused(self):
        return self.unit._links._codecs[LinkName.GROUND].refused


async def test_orders_of_every_kind_arrive_signed_and_strangers_stay_outside(scenario):
    vehicle, desk = Vehicle(scenario), OperatorDesk()
    station = GroundStation(scenario, desk=desk)
    await station.open(mavsdk=False)
    await vehicle.open()
    running = [asyncio.create_task(coroutine) for coroutine in (vehicle.run(), station.run())]
    guest_frames = []
    guest = await open_datagram_link(scenario.ground.forward[0].replace("udpin", "udpout"), guest_frames.append)
    other_station = Codec(254, 190)
    try:
        # The dashboard's orders: a desk. One to the onboard process, one straight to the autopilot, without MAVSDK.
        await until(lambda: station.switchboard.heard() >= {(1, 1), (1, COMPONENT)})
        desk.submit(Order(Action.PAUSE, (1,)))
        desk.submit(Order(Action.HOLD, (1,)))
        await until(lambda: len(desk.records) == 2 and all(record.ended_s for record in desk.records))
        outcomes = {record.action: record.outcome for record in desk.records}
        assert outcomes == {Action.PAUSE: Outcome.REFUSED, Action.HOLD: Outcome.ACKNOWLEDGED}, "nothing flies to pause"
        # `arvi command` beside the station, through its shared port, with a stream of its own.
        via = scenario.ground.share_url.replace("udpin", "udpout")
        assert await asyncio.to_thread(run_order, scenario, Action.FINISH, [1], via) in (0, 1)
        assert vehicle.refused.total() == 0, "all that came was signed with the key, for this link, in order"
        # `arvi monitor`.
        monitor = joined_station(scenario)
        await monitor.open(via, mavsdk=False)
        await until(lambda: tell(monitor).flight_state is FlightState.WAIT)
        await monitor.close()
        # Another ground station on a forwarded link: it reaches autopilots, which have no key, and nobody else.
        for _ in range(3):
            for component in (1, COMPONENT):
                order = mavlink.MAVLink_command_long_message(1, component, HOLD, 0, *[0.0] * 7)
                guest.send(other_station.encode(order))
            await asyncio.sleep(0.1)
        assert vehicle.refused == {Verdict.UNSIGNED: 3}
        assert vehicle.commands.count((190, HOLD)) == 1 + 3
        # What it is shown of the onboard process is passed on with its signature.
        reader = Signing(read_key(Path(scenario.signing.key_file)))
        reader.advance(time.time())
        genuine = reader.link(SignedLink.GROUND)
        await until(lambda: any(frame[5:7] == bytes([1, COMPONENT]) for frame in guest_frames))
        onboard = [frame for frame in guest_frames if frame[5:7] == bytes([1, COMPONENT])]
        assert {genuine.verify(frame) for frame in onboard} == {Verdict.GENUINE}
    finally:
        for task in running:
            task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await asyncio.gather(*running)
        await station.close()
        for link in (guest, vehicle.onboard_link, vehicle.autopilot_link):
            link.close()


def tell(station):
    station.tick()
    return station.team.state(time.time()).vehicles[0]


async def until(condition, limit_s=10.0):
    end = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < end, "not in time"
        await asyncio.sleep(0.02)
