"""Messages beyond the dialect are byte for byte those that a PX4 1.15 sent."""

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id

REQUEST = mavlink.MAV_CMD_REQUEST_MESSAGE
RECORDED = {
    300: ["fd1600006e01012c0100c8006400c80000000000000000000f935d336b8d55a3cba4"],
    395: [
        "fd370000cb01018b0100c41b000019744e9c000000006d6674703a2f2f6574632f6578747261732f636f6d706f6e656e745f67656e65"
        "72616c2e6a736f6e2e787a6edb"
    ],
    397: [
        "fd3300004901018d0100141e000019744e9c6d6674703a2f2f6574632f6578747261732f636f6d706f6e656e745f67656e6572616c2e"
        "6a736f6e2e787a7d77"
    ],
    435: [
        "fd1100003d0101b3010000000100010000001901004d616e75616ce970",
        "fd0b0000400101b301000000040401000000190407b6a0",
        "fd130000460101b301000000060001000000190a004f6666626f617264bb7a",
    ],
    436: ["fd080000a40101b4010000000403000004037736"],
}
TIME_BYTES = 4
"""Messages 395 and 397 begin with the time since the boot."""


@pytest.mark.parametrize("kind", sorted(RECORDED))
def test_frames_are_those_recorded(bench, kind):
    flight = bench()
    flight.run(3.0)
    flight.sent.clear()
    assert flight.command(REQUEST, kind) == mavlink.MAV_RESULT_ACCEPTED
    sent = [m for _, _, m in flight.sent if m.get_type() not in ("COMMAND_ACK", "EVENT") and m.get_msgId() == kind]
    assert len(sent) == (25 if kind == 435 else 1)
    for recorded in map(bytes.fromhex, RECORDED[kind]):
        frames = []
        for message in sent:
            if kind in (395, 397):
                message.payload_bytes = recorded[10 : 10 + TIME_BYTES] + message.payload_bytes[TIME_BYTES:]
            codec = Codec(1, 1)
            for _ in range(recorded[4]):  # so that the sequence number is the recorded one
                codec.encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 0, 3))
            frames.append(codec.encode(message))
        assert recorded in frames
        assert message_id(recorded) == kind


def test_one_mode_is_asked_for_by_its_index(bench):
    flight = bench()
    flight.run(3.0)
    for index, result, count in ((10, "ACCEPTED", 1), (26, "DENIED", 0)):
        flight.sent.clear()
        assert flight.command(REQUEST, 435, index) == getattr(mavlink, f"MAV_RESULT_{result}")
        assert len(flight.messages("AVAILABLE_MODES")) == count
