"""What is new beside flying: EVENT messages, a reboot, and whose clock the stamps of motion capture are in."""

import struct

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.clock import BootClock
from sim_bridge.autopilot.core.outbox import Outbox
from sim_bridge.autopilot.core.raw_messages import RawMessage
from sim_bridge.autopilot.px4.events import CRC_EXTRA, EventLog

ACCEPTED, REJECTED = mavlink.MAV_RESULT_ACCEPTED, mavlink.MAV_RESULT_TEMPORARILY_REJECTED
REBOOT = mavlink.MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN
EVENT = 410
ARMED, DISARMED, FAILSAFE, FRAME = 0x0190CAF3, 0x01F46777, 0x01DEDBD0, 0x01B04541


def events(flight, link="onboard"):
    """(id, arguments) of the events, unpacked from their frames."""
    codec, found = Codec(3, 1), []
    for _, name, message in flight.sent:
        if name == link and message.get_type() == "EVENT":
            frame = codec.encode(message)
            assert message_id(frame) == EVENT
            payload = frame[10:-2].ljust(53, b"\0")
            found.append((struct.unpack_from("<I", payload)[0], payload[13:]))
    return found


def test_events_tell_what_texts_would_whoever_listens(hovering):
    """The ids and arguments are those recorded; no ground station has been heard."""
    hovering.fly_offboard(hovering.setpoint(), 0.5)
    hovering.run(1.3, hovering.setpoint(frame=9))
    told = events(hovering)
    assert told == events(hovering, "gcs")
    assert told[0] == (ARMED, b"\x04".ljust(40, b"\0"))
    refused = [arguments for event, arguments in told if event == FRAME]
    assert len(refused) == 65
    assert {arguments[0] for arguments in refused} == {9}
    (failsafe,) = [arguments for event, arguments in told if event == FAILSAFE]
    assert struct.unpack_from("<IB", failsafe) == (Px4Mode.OFFBOARD, 2)  # to POSCTL
    hovering.run(12.0)
    assert events(hovering)[-1] == (DISARMED, b"\x06".ljust(40, b"\0"))  # by landing


def test_an_events_payload_is_byte_for_byte_px4s():
    """As recorded 41.148 s after a boot: armed by a command, event 24."""
    outbox, clock, codec = Outbox(), BootClock(0.0), Codec(1, 1)
    clock.advance(41.148)
    log = EventLog(outbox, clock)
    for _ in range(24):
        log.armed()
    frames = [codec.encode(message) for link, message in outbox.take() if link == "onboard"]
    recorded = bytes.fromhex("fd0e00005d01019a0100f3ca9001bca00000180000006604e926")
    assert frames[-1][10:-2] == recorded[10:-2]


def test_an_events_checksum_is_px4s():
    recorded = bytes.fromhex("fd0e00005d01019a0100f3ca9001bca00000180000006604e926")
    message = RawMessage(EVENT, "EVENT", CRC_EXTRA, recorded[10:-2])
    codec = Codec(1, 1)
    for _ in range(0x5D):
        codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3))
    assert codec.encode(message) == recorded


def test_a_reboot_is_silent_for_a_while_and_keeps_the_parameters(bench):
    flight = bench()
    flight.run(4.0)
    flight.send(mavlink.MAVLink_param_set_message(3, 1, b"COM_OF_LOSS_T", 0.5, mavlink.MAV_PARAM_TYPE_REAL32))
    assert flight.command(REBOOT, 1.0) == ACCEPTED
    flight.run(0.1)
    flight.sent.clear()
    flight.run(1.9)
    assert flight.sent == []
    flight.send(mavlink.MAVLink_param_request_read_message(3, 1, b"COM_OF_LOSS_T", -1))
    flight.run(1.0)
    assert flight.messages("HEARTBEAT")[0].custom_mode == Px4Mode.LOITER
    assert flight.messages("LOCAL_POSITION_NED")[-1].time_boot_ms < 3000
    assert flight.autopilot.parameters["COM_OF_LOSS_T"] == 0.5
    flight.run(2.0)
    assert flight.command(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0) == ACCEPTED
    assert flight.command(REBOOT, 1.0) == REJECTED


@pytest.mark.parametrize(("clock_s", "fused"), [(1.8e9, True), (5000.0, False)])
def test_stamps_are_believed_once_timesync_has_converged(bench, clock_s, fused):
    """Fifty seconds of answers in UNIX time; then stamps of another clock stop the fusion."""
    flight = bench(mocap=False)
    answered = 0
    for tick in range(1, 3200):
        flight.run(0.02)
        if tick % 2 == 0:
            stamp_s = 1.8e9 if tick < 3000 else clock_s
            flight.send(flight.odometry(time_usec=round(1e6 * (stamp_s + flight.time_s))))
        requests = flight.messages("TIMESYNC")
        flight.sent.clear()
        for request in requests:
            if request.tc1 == 0:
                answered += 1
                flight.send(mavlink.MAVLink_timesync_message(round(1e9 * (1.8e9 + flight.time_s)), request.ts1))
    assert answered > 550
    assert flight.autopilot.platform.vision.active(1.8e9 + flight.time_s) == fused
