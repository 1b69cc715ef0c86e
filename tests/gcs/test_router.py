"""MAVLink's routing rules (https://mavlink.io/en/guide/routing.html), with frames as they are on the wire."""

import pytest

from gcs.router import TEAM, Port, Router
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

ONE, TWO, TWO_B = (Port(TEAM, ("127.0.0.1", port)) for port in (18571, 18572, 40002))
QGC, PROXY = Port("qgc", ("127.0.0.1", 14560)), Port("share", ("127.0.0.1", 50000))
HEARTBEAT = mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 4, 3)


def frame(system, component, message=HEARTBEAT):
    return Codec(system, component).encode(message)


def command(system, component):
    return mavlink.MAVLink_command_long_message(system, component, 400, 0, *[0.0] * 7)


@pytest.fixture
def router():
    """Vehicles 1 and 2, of which 2 has its onboard process elsewhere; two ground stations."""
    router = Router()
    for port, system, component in ((ONE, 1, 1), (TWO, 2, 1), (TWO_B, 2, 191), (QGC, 255, 190), (PROXY, 255, 230)):
        assert router.receive(frame(system, component), port, 0.0)
    return router


def test_a_vehicles_broadcast_goes_to_every_ground_station_and_no_vehicle(router):
    assert set(router.ways(frame(1, 1), ONE)) == {QGC, PROXY}


def test_a_ground_stations_broadcast_goes_to_all_others_but_not_back_and_spares_onboard_processes(router):
    assert set(router.ways(frame(255, 190), QGC)) == {ONE, TWO, PROXY}
    router.receive(frame(1, 191), ONE, 0.0)
    assert ONE in router.ways(frame(255, 190), QGC), "an autopilot is there, too"


@pytest.mark.parametrize(
    ("target", "ports"),
    [((2, 1), {TWO}), ((2, 191), {TWO_B}), ((2, 0), {TWO, TWO_B}), ((2, 100), set()), ((9, 1), set())],
)
def test_what_is_addressed_goes_where_its_addressee_was_heard(router, target, ports):
    assert set(router.ways(frame(255, 230, command(*target)), PROXY)) == ports


def test_an_acknowledgement_goes_to_who_asked_only(router):
    ack = mavlink.MAVLink_command_ack_message(400, 0, 0, 0, 255, 230)
    assert router.ways(frame(1, 1, ack), ONE) == [PROXY]
    ours = mavlink.MAVLink_command_ack_message(400, 0, 0, 0, 254, 190)
    assert router.ways(frame(1, 1, ours), ONE) == []


def test_the_direct_way_to_a_component_beats_the_copy_that_its_autopilot_forwards(router):
    router.receive(frame(2, 191), TWO, 1.0)
    assert router.team_port((2, 191)) == TWO_B
    # After a standstill of this program, the copy may be the first to be read.
    router.receive(frame(2, 191), TWO, 60.0)
    assert router.team_port((2, 191)) == TWO
    router.receive(frame(2, 191), TWO_B, 60.1)
    router.receive(frame(2, 191), TWO, 60.2)
    assert router.team_port((2, 191)) == TWO_B


def test_ground_stations_with_one_id_all_get_what_is_addressed_to_it(router):
    """QGroundControl is 255/190 wherever it runs."""
    router.receive(frame(255, 190), PROXY, 0.0)
    ack = mavlink.MAVLink_command_ack_message(400, 0, 0, 0, 255, 190)
    assert set(router.ways(frame(1, 1, ack), ONE)) == {QGC, PROXY}


def test_a_component_that_is_heard_at_two_places_is_told_once_and_one_that_moved_is_not(router):
    other, moved = Port(TEAM, ("10.0.0.9", 18571)), Port(TEAM, ("10.0.0.9", 40003))
    for tenth in range(80):
        now_s = 0.1 * tenth
        for port in (ONE, other):
            router.receive(frame(1, 1), port, now_s)
        router.receive(frame(2, 191), moved, now_s)
        router.receive(frame(2, 191), TWO, now_s)  # its autopilot forwards it
    assert router.take_doubled() == [((1, 1), ONE, other)]
    assert router.take_doubled() == []
    assert router.team_port((1, 1)) == ONE
    assert router.team_port((2, 191)) == moved


def test_vehicles_are_not_connected_with_each_other(router):
    assert router.ways(frame(1, 1, command(2, 1)), ONE) == []


def test_what_is_unknown_is_passed_on(router):
    unknown = bytearray(frame(1, 1))
    unknown[7:10] = (54999).to_bytes(3, "little")
    assert set(router.ways(bytes(unknown), ONE)) == {QGC, PROXY}


def test_a_vehicle_is_not_believed_from_elsewhere_so_that_circles_end(router):
    assert not router.receive(frame(1, 1), QGC, 1.0)
    assert router.team_port((1, 1)) == ONE
    assert router.refused == 1


def test_an_outgoing_link_gets_broadcasts_before_it_speaks_and_guests_go_when_silent():
    router = Router()
    router.add_remote(QGC)
    router.receive(frame(1, 1), ONE, 0.0)
    router.receive(frame(255, 230), PROXY, 0.0)
    assert set(router.ways(frame(1, 1), ONE)) == {QGC, PROXY}
    router.forget_silent(11.0)
    assert router.ways(frame(1, 1), ONE) == [QGC]
    assert router.ways(frame(1, 1, mavlink.MAVLink_command_ack_message(400, 0, 0, 0, 255, 230)), ONE) == []


def test_a_crowd_of_guests_is_bounded(router):
    admitted = [router.receive(frame(200, i), Port("share", ("127.0.0.1", 51000 + i)), 0.0) for i in range(1, 60)]
    assert 0 < sum(admitted) < 20
