"""The station's routing, acknowledgement, heartbeats and recording, with a link and a clock of the test's own."""

import pytest

from gcs.mission import HURRIED, MissionDirector, Phase
from gcs.operator_desk import Action, Order, Outcome
from gcs.recording.recorder import Recorder
from gcs.recording.tlog import read_tlog
from gcs.router import TEAM
from gcs.station import GroundStation
from gcs.switchboard import SHARE
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

    def read(self):
        return True

    def send(self, data, address=None):
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
        self.station.switchboard.receive(self.link, data, self.address, self.station._clock())


@pytest.fixture
def clock():
    return Clock()


@pytest.fixture
def station(scenario, clock, monkeypatch):
    director = MissionDirector(scenario.mission.step_s, scenario.mission.takeoff_time_s, 60.0)
    station = GroundStation(scenario, director=director, clock=clock, steady=clock)
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


def test_who_has_joined_hears_that_the_station_lives_even_when_no_vehicle_says_anything(station, clock, heartbeat):
    station.switchboard.attach(SHARE, share := Loopback())
    monitor = Remote(station, 255, 26, 55000, SHARE)
    mavsdk, mavproxy = Remote(station, 255, 25, 55001, SHARE), Remote(station, 255, 230, 55002, SHARE)
    for _ in range(30):
        if clock.now_s - T0 < 0.05:
            for guest in (monitor, mavsdk, mavproxy):
                guest.say(heartbeat())
        station.tick()
        clock.now_s += 0.1
    ours = [address for address, m in share.take("HEARTBEAT") if m.get_srcComponent() == 190]
    assert set(ours) == {monitor.address}
    assert len(ours) in (3, 4)


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
    station = GroundStation(scenario, recorder=recorder, clock=clock, steady=clock)
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
        station.switchboard.receive(TEAM, data, ("127.0.0.1", 1), T0)
    for system in range(50, 250):
        Remote(station, system, 33, 40000).say(heartbeat())
    remotes[3, 1].say(heartbeat(armed=True))
    assert station.team.state(T0).vehicle(3).armed
    station.tick()
    assert len(station.loop.take("HEARTBEAT")) == 1 + 32


def test_strangers_doubles_and_what_cannot_be_read_are_told_and_not_shown(station, remotes, clock, heartbeat):
    twin = Remote(station, 1, 1, 50001)
    stranger = Remote(station, 9, 1, 50002)
    for i in range(80):
        remotes[1, 1].say(heartbeat(), mavlink.MAVLink_local_position_ned_message(i, 1.0, 2.0, -1.0, 0.0, 0.0, 0.0))
        twin.say(heartbeat(), mavlink.MAVLink_local_position_ned_message(i, 3.0, 7.0, -1.0, 0.0, 0.0, 0.0))
        stranger.say(heartbeat())
        damaged = bytearray(Codec(1, 1).encode(heartbeat()))
        damaged[-1] ^= 1  # as with the checksum of another dialect's message of this number
        station.switchboard.receive(TEAM, bytes(damaged), remotes[1, 1].address, clock())
        damaged[6] = 191
        station.switchboard.receive(TEAM, bytes(damaged) + b"garbage", ("10.0.0.7", 14550), clock())
        station.tick()
        clock.now_s += 0.1
    assert station.team.state(clock()).vehicle(1).north_m == 1.0
    assert (1, 191) not in station.switchboard.heard(), "what cannot be read says nothing about who is where"
    told = [event.text for event in station.team.take_events()]
    assert [text for text in told if text.startswith("system 9")] == [
        "system 9 is heard from 127.0.0.1:50002, but lab has no such vehicle: it is neither shown nor commanded"
    ]
    assert [text[:61] for text in told if "two vehicles" in text] == [
        "autopilot is heard from 127.0.0.1:18570 and from 127.0.0.1:50"
    ]
    assert "2 no MAVLink, 1 with a wrong checksum" in next(text for text in told if "frames refused" in text)


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


def test_pause_and_resume_wait_for_each_other_so_that_no_answer_is_taken_for_the_others(
    station, remotes, stand_by, clock
):
    stand_by(FlightState.TRACK, armed=True)
    for action in (Action.PAUSE, Action.RESUME):
        station.desk.submit(Order(action, (2,)))
    station.tick()
    assert [message.param1 for _, message in station.loop.take("COMMAND_LONG")] == [0.0]
    remotes[2, 191].say(ack(mavlink.MAV_CMD_DO_PAUSE_CONTINUE))
    station.tick()
    assert [message.param1 for _, message in station.loop.take("COMMAND_LONG")] == [1.0]
    assert [record.outcome for record in station.desk.records] == [Outcome.ACKNOWLEDGED, Outcome.SENT]


def test_who_did_not_answer_is_said_to_be_silent_if_it_is(station, remotes, stand_by, clock, heartbeat):
    remotes[2, 1].say(heartbeat())
    clock.now_s += 7.0
    remotes[3, 191].say(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))
    station.desk.submit(Order(Action.LAND, (2,)))
    station.desk.submit(Order(Action.PAUSE, (2, 3)))
    for _ in range(40):
        station.tick()
        clock.now_s += 0.1
    assert [record.result for record in station.desk.records] == [
        "no answer; silent for 10 s",
        "no answer; it is not heard",
        "no answer",
    ]


def test_a_start_that_is_pressed_twice_is_one_and_an_answer_after_the_last_attempt_still_counts(
    station, remotes, stand_by, clock
):
    station._dispatch.director = None
    stand_by(FlightState.STANDBY)
    station.desk.submit(Order(Action.START, (2,)))
    station.tick()
    clock.now_s += 0.6
    station.desk.submit(Order(Action.START, (2,)))
    for _ in range(35):
        station.tick()
        clock.now_s += 0.1
    starts = station.loop.take("COMMAND_INT")
    assert len({(m.x, m.y) for _, m in starts}) == 1
    assert [record.outcome for record in station.desk.records] == [Outcome.TIMED_OUT] * 2
    remotes[2, 191].say(ack(mavlink.MAV_CMD_ARVI_START))
    assert [record.outcome for record in station.desk.records] == [Outcome.ACKNOWLEDGED] * 2
    assert any(event.text.endswith("took ARVI_START, late") for event in station.team.take_events())


def test_an_operator_who_lands_all_ends_the_flight(station, remotes, stand_by, clock):
    stand_by(FlightState.TRACK, armed=True)
    station.desk.submit(Order(Action.LAND, (1, 2, 3)))
    station.tick()
    assert station.director.phase is Phase.LANDING
    for _ in range(10):
        clock.now_s += 0.1
        station.tick()
    asked = {(m.target_system, m.target_component) for _, m in station.loop.take("COMMAND_LONG")}
    assert asked == {(1, 1), (2, 1), (3, 1)}, "the director does not ask to fly home those that are told to land here"


def test_who_is_started_later_plans_in_turn_with_the_others(station, remotes, stand_by, status, clock, scenario):
    stand_by(FlightState.TRACK, armed=True)
    began_s = T0 - 30.5
    remotes[1, 191].say(status(T0 + 0.5, state=FlightState.TRACK, mission_start_usec=round(began_s * 1e6)))
    absurd = status(T0 + 0.5, state=FlightState.TRACK, mission_start_usec=2**63)
    remotes[3, 191].say(absurd)
    station.desk.submit(Order(Action.START, (2,)))
    station.tick()
    ((_, start),) = station.loop.take("COMMAND_INT")
    later_s = start.x + 1e-6 * start.y - began_s
    epoch_s = scenario.mission.replan_steps * scenario.mission.step_s
    assert later_s / epoch_s == round(later_s / epoch_s)
    assert 0.0 <= began_s + later_s - T0 - scenario.mission.takeoff_time_s < epoch_s


def test_a_vehicle_that_the_operator_landed_is_not_started_again(station, remotes, stand_by, clock):
    station.desk.submit(Order(Action.LAND, (1,)))
    station.tick()
    stand_by()
    for _ in range(60):
        station.tick()
        clock.now_s += 0.1
    assert {m.target_system for _, m in station.loop.take("COMMAND_INT")} == {2, 3}
    assert station.director.phase is not Phase.LANDING


class Late:
    """Reads the team's link late: what arrives waits, as in the system's buffer, until the station looks."""

    def __init__(self, station, clock):
        self.station, self.clock, self.waiting, self.per_read = station, clock, [], None
        station.loop.read = self.read

    def arrive(self, system, component, *messages):
        data = b"".join(Codec(system, component).encode(message) for message in messages)
        self.waiting.append((data, ("127.0.0.1", 1000 * component + system), self.clock.now_s))

    def beat(self, heartbeat, seconds, systems=(1, 2, 3), **changes):
        """A second of the team's heartbeats after the other, and nobody looks."""
        for _ in range(seconds):
            self.clock.now_s += 1.0
            for system in systems:
                self.arrive(system, 1, heartbeat(**changes))
                self.arrive(system, 191, ONBOARD_HEARTBEAT)

    def read(self):
        now, self.waiting = self.waiting[: self.per_read], self.waiting[self.per_read :] if self.per_read else []
        for item in now:
            self.station.switchboard.receive(TEAM, *item)
        return not self.waiting

    def tick(self, count=1):
        for _ in range(count):
            self.station.tick()
            self.clock.now_s += 0.1

    def texts(self):
        return [(event.source, event.text) for event in self.station.team.take_events()]


ONBOARD_HEARTBEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3)


@pytest.fixture
def late(scenario, clock):
    station = GroundStation(scenario, clock=clock, steady=lambda: clock.now_s)
    station.loop = Loopback()
    station.switchboard.attach(TEAM, station.loop)
    return Late(station, clock)


def test_a_station_that_stood_still_calls_nobody_silent_who_spoke_meanwhile(late, heartbeat):
    late.beat(heartbeat, 2)
    late.tick()
    late.beat(heartbeat, 20)
    late.tick(30)
    assert late.texts() == [
        ("ground", "ground station is 20 s behind: what it shows is old"),
        ("ground", "ground station has caught up; it was up to 20 s behind"),
    ]


def test_a_station_that_stood_still_tells_who_fell_silent_and_who_came_back_meanwhile(late, heartbeat):
    late.beat(heartbeat, 2)
    late.tick()
    late.beat(heartbeat, 10, systems=(1, 2))
    late.beat(heartbeat, 3)
    late.beat(heartbeat, 6, systems=(1, 3))
    late.tick()
    told = [(source, text) for source, text in late.texts() if source != "ground"]
    assert told == [
        ("vehicle 3", "autopilot is silent: no heartbeat for 5.1 s"),
        ("vehicle 3", "onboard process is silent: no heartbeat for 5.1 s"),
        ("vehicle 3", "autopilot is heard again"),
        ("vehicle 3", "onboard process is heard again"),
        ("vehicle 2", "autopilot is silent: no heartbeat for 5.0 s"),
        ("vehicle 2", "onboard process is silent: no heartbeat for 5.0 s"),
    ]
    team = late.station.team.state(late.clock.now_s)
    assert [vehicle.onboard_alive for vehicle in team.vehicles] == [True, False, True]


def test_while_it_is_behind_it_shows_the_team_as_it_was_and_says_so(late, heartbeat):
    late.tick()
    late.beat(heartbeat, 30, mode=0x00060000)
    late.per_read = 6  # a second of what waits, each time that it looks
    late.tick(3)
    team = late.station.team.state(late.clock.now_s)
    assert team.behind_s == pytest.approx(30.0, abs=1.0)
    assert [vehicle.autopilot_age_s for vehicle in team.vehicles] == [0.0] * 3
    assert not [text for source, text in late.texts() if "silent" in text]
    late.tick(60)
    assert late.station.team.state(late.clock.now_s).behind_s is None
    assert late.station.team.state(late.clock.now_s).vehicle(1).autopilot_age_s > 4.5, "and now it is"


def test_what_the_system_had_no_room_for_is_neither_silence_nor_a_lossy_link(late, heartbeat):
    late.beat(heartbeat, 2)
    late.tick()
    late.beat(heartbeat, 5)
    waiting = late.waiting
    late.beat(heartbeat, 60)
    late.waiting = waiting
    late.read()
    late.station._missed(360, late.clock.now_s)
    late.arrive(1, 1, heartbeat())
    late.tick(10)
    assert not [text for source, text in late.texts() if "silent" in text]
    assert late.station.team.state(late.clock.now_s).vehicle(1).link.lost == 0
    late.tick(40)
    assert {source for source, text in late.texts() if "silent" in text} == {"vehicle 1", "vehicle 2", "vehicle 3"}


def test_a_computer_that_slept_waits_anew_for_who_was_heard_before(scenario, clock, heartbeat):
    awake_s = [0.0]
    station = GroundStation(scenario, clock=clock, steady=lambda: awake_s[0])
    station.loop = Loopback()
    station.switchboard.attach(TEAM, station.loop)
    late = Late(station, clock)
    late.beat(heartbeat, 2)
    awake_s[0] += 2.0
    late.tick()
    awake_s[0] += 0.1
    late.arrive(2, 1, heartbeat())  # unread when the lid is shut
    clock.now_s += 3600.0
    for _ in range(40):
        late.arrive(1, 191, ONBOARD_HEARTBEAT)
        late.tick()
        awake_s[0] += 0.1
    assert [text for _, text in late.texts()] == [
        "this computer slept, or its clock was set ahead, by 3600 s: nobody is called silent for that time"
    ]
    for _ in range(20):
        late.tick()
        awake_s[0] += 0.1
    assert ("vehicle 2", "autopilot is silent: no heartbeat for 4.6 s") in late.texts()


def test_an_acknowledgement_that_waits_unread_is_no_silence(late, heartbeat):
    late.beat(heartbeat, 1)
    late.tick()
    late.station.desk.submit(Order(Action.PAUSE, (2,)))
    late.tick(24)
    late.beat(heartbeat, 2)
    late.per_read = 1
    late.arrive(2, 191, ack(mavlink.MAV_CMD_DO_PAUSE_CONTINUE))
    late.tick(11)
    assert [record.outcome for record in late.station.desk.records] == [Outcome.SENT]
    late.tick(3)
    assert [record.outcome for record in late.station.desk.records] == [Outcome.ACKNOWLEDGED]


def test_frames_are_recorded_by_when_they_arrived(scenario, clock, tmp_path, heartbeat):
    recorder = Recorder(tmp_path)
    station = GroundStation(scenario, recorder=recorder, clock=clock, steady=clock)
    station.loop = Loopback()
    station.switchboard.attach(TEAM, station.loop)
    late = Late(station, clock)
    late.tick()
    late.beat(heartbeat, 30, systems=(1,))
    late.tick()
    recorder.close()
    times = [usec / 1e6 for usec, _ in read_tlog(tmp_path / "vehicle1_onboard.tlog")]
    assert times[:30] == pytest.approx([T0 + 0.1 + second for second in range(1, 31)])
