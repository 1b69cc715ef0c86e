"""The station's routing, acknowledgement, heartbeats and recording, with a link and a clock of the test's own."""

import pytest

from gcs.mission import HURRIED, MissionDirector, Phase
from gcs.operator_desk import Action, Order, Outcome
from gcs.recording.recorder import Recorder
from gcs.router import TEAM
from gcs.station import GroundStation
from onboard.config import load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import LinkUrl, TransportError

T0 = 1.5e9


class Loopback:
    """In place of the UDP link: keeps what is sent."""

    url = LinkUrl("udpin", "127.0.0.1", 14550)

    def __init__(self):
        self.sent = []
        self._codec = Codec(1, 1)

    def send_to(self, data, address):
        (message,) = self._codec.decode(data)
        self.sent.append((address, message))

    def take(self, name):
        taken = [(address, m) for address, m in self.sent if m.get_type() == name]
        self.sent = [item for item in self.sent if item not in taken]
        return taken

    def close(self):
        pass


class Clock:
    now_s = T0

    def __call__(self):
        return self.now_s


class Remote:
    """A component that talks to the station from an address."""

    def __init__(self, station, system, component, port, link=TEAM):
        self.link = link
        self.station, self.codec, self.address = station, Codec(system, component), ("127.0.0.1", port)

    def say(self, *messages):
        data = b"".join(self.codec.encode(message) for message in messages)
        self.station.switchboard.receive(self.link, data, self.address)


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def station(scenario, clock, monkeypatch):
    director = MissionDirector(scenario.mission.step_s, scenario.mission.takeoff_time_s, 60.0)
    station = GroundStation(scenario, director=director, clock=clock)
    station.switchboard.attach(TEAM, Loopback())
    station.loop = station.switchboard._links[TEAM]
    return station


@pytest.fixture
def remotes(station):
    return {
        (vehicle, component): Remote(station, vehicle, component, port + vehicle)
        for vehicle in (1, 2, 3)
        for component, port in ((1, 18569), (191, 40000))
    }


@pytest.fixture
def stand_by(remotes, heartbeat, status, clock):
    def say(state=FlightState.STANDBY, armed=False):
        for (_, component), remote in remotes.items():
            if component == 1:
                remote.say(heartbeat(armed=armed))
            else:
                remote.say(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3), status(clock.now_s, state=state))

    return say


def ack(command, result=0, system=255):
    return mavlink.MAVLink_command_ack_message(command, result, 0, 0, system, 190)


def test_heartbeats_of_a_ground_station_go_to_everybody_heard_once_a_second(station, remotes, clock, heartbeat):
    remotes[1, 1].say(heartbeat())
    remotes[2, 191].say(heartbeat())
    for _ in range(31):
        station.tick()
        clock.now_s += 0.1
    sent = station.loop.take("HEARTBEAT")
    for key in ((1, 1), (2, 191)):
        assert sum(address == remotes[key].address for address, _ in sent) in (3, 4)
    message = sent[0][1]
    assert (message.get_srcSystem(), message.get_srcComponent(), message.type) == (255, 190, mavlink.MAV_TYPE_GCS)


def test_commands_go_to_the_address_their_component_was_heard_from(station, remotes, stand_by):
    stand_by()
    station.tick()
    starts = station.loop.take("COMMAND_INT")
    assert [(address, m.target_system) for address, m in starts] == [
        (remotes[vehicle, 191].address, vehicle) for vehicle in (1, 2, 3)
    ]


def test_a_component_that_moves_is_followed(station, remotes, stand_by, clock):
    stand_by()
    remotes[2, 191].address = ("127.0.0.1", 50002)
    clock.now_s += 3.5
    stand_by()
    station.tick()
    assert station.loop.take("COMMAND_INT")[1][0] == ("127.0.0.1", 50002)


def test_a_copy_that_an_autopilot_forwards_does_not_replace_the_direct_way(station, remotes, stand_by, clock):
    stand_by()
    direct, remotes[2, 191].address = remotes[2, 191].address, remotes[2, 1].address
    stand_by()
    remotes[2, 191].address = direct
    station.tick()
    assert station.loop.take("COMMAND_INT")[1][0] == direct


def test_land_is_repeated_with_confirmation_until_acknowledged(station, remotes, stand_by, clock, heartbeat):
    stand_by(FlightState.TRACK, armed=True)
    remotes[1, 1].say(mavlink.MAVLink_extended_sys_state_message(0, mavlink.MAV_LANDED_STATE_IN_AIR))
    station.director.land(clock.now_s, HURRIED)
    confirmations = []
    for i in range(20):
        station.tick()
        for address, message in station.loop.take("COMMAND_LONG"):
            if address == remotes[1, 191].address:
                confirmations.append(message.confirmation)
        if i == 12:
            remotes[1, 191].say(ack(mavlink.MAV_CMD_NAV_LAND))
        clock.now_s += 0.1
    assert confirmations == [0, 1, 2]
    assert "onboard process took NAV_LAND" in [event.text for event in station.team.take_events()]


def test_refusals_and_silence_are_visible(station, remotes, stand_by, clock):
    stand_by()
    station.tick()
    remotes[1, 191].say(ack(mavlink.MAV_CMD_ARVI_START, mavlink.MAV_RESULT_DENIED))
    remotes[2, 191].say(ack(mavlink.MAV_CMD_ARVI_START, system=254))  # somebody else's
    for _ in range(35):
        clock.now_s += 0.1
        station.tick()
    events = [(event.source, event.text) for event in station.team.take_events()]
    assert ("vehicle 1", "onboard process refused ARVI_START: denied") in events
    assert ("vehicle 2", "onboard process did not answer ARVI_START") in events


def test_every_frame_is_recorded_by_link(scenario, clock, tmp_path, heartbeat):
    recorder = Recorder(tmp_path)
    station = GroundStation(scenario, recorder=recorder, clock=clock)
    station.switchboard.attach(TEAM, Loopback())
    station.loop = station.switchboard._links[TEAM]
    attitude = mavlink.MAVLink_attitude_message(0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    Remote(station, 1, 1, 18570).say(heartbeat(), attitude)
    Remote(station, 250, 1, 40000).say(heartbeat())
    Remote(station, 77, 1, 40001).say(heartbeat())
    station.tick()
    recorder.close()
    sizes = {path.stem: path.stat().st_size for path in tmp_path.iterdir()}
    reply = 8 + 21
    assert sizes == {
        "vehicle1_autopilot": 8 + 21 + 8 + len(Codec(1, 1).encode(attitude)) + reply,
        "bridge": 8 + 21 + reply,
        "others": 8 + 21 + reply,
    }


def test_garbage_and_crowds_of_strangers_are_survived(station, heartbeat, remotes):
    for data in (b"\x00\xfd\xff garbage", b""):
        station.switchboard.receive(TEAM, data, ("127.0.0.1", 1))
    for system in range(50, 250):
        Remote(station, system, 33, 40000).say(heartbeat())
    remotes[3, 1].say(heartbeat(armed=True))
    assert station.team.state(T0).vehicle(3).armed
    station.tick()
    assert len(station.loop.take("HEARTBEAT")) == 1 + 32


def test_who_was_never_heard_is_not_sent_to(station, clock):
    station.director.land(clock.now_s, HURRIED)
    station.tick()
    assert station.loop.sent == []


async def test_a_second_station_on_the_same_port_is_told_so(own_ports):
    first, second = (GroundStation(load_scenario(own_ports)) for _ in range(2))
    await first.open()
    try:
        with pytest.raises(TransportError, match="in use"):
            await second.open()
    finally:
        await first.close()


def test_an_operators_order_goes_out_and_its_end_is_recorded(station, remotes, stand_by, clock):
    stand_by(FlightState.TRACK, armed=True)
    station.desk.submit(Order(Action.PAUSE, (2,)))
    station.tick()
    ((address, command),) = station.loop.take("COMMAND_LONG")
    assert address == remotes[2, 191].address
    assert (command.command, command.param1) == (mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0.0)
    remotes[2, 191].say(ack(mavlink.MAV_CMD_DO_PAUSE_CONTINUE, mavlink.MAV_RESULT_TEMPORARILY_REJECTED))
    assert [(record.vehicle, record.outcome) for record in station.desk.records] == [(2, Outcome.REFUSED)]
    assert ("operator", "pause vehicle 2") in [(event.source, event.text) for event in station.team.take_events()]


def test_an_operator_who_lands_all_ends_the_flight(station, remotes, stand_by, clock):
    stand_by(FlightState.TRACK, armed=True)
    station.desk.submit(Order(Action.LAND, (1, 2, 3)))
    station.tick()
    assert station.director.phase is Phase.LANDING
    assert len(station.loop.take("COMMAND_LONG")) == 3, "operator's and director's are one"


def test_a_vehicle_that_the_operator_landed_is_not_started_again(station, remotes, stand_by, clock):
    station.desk.submit(Order(Action.LAND, (1,)))
    station.tick()
    stand_by()
    for _ in range(60):
        station.tick()
        clock.now_s += 0.1
    assert {m.target_system for _, m in station.loop.take("COMMAND_INT")} == {2, 3}
    assert station.director.phase is not Phase.LANDING
