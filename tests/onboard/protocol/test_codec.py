"""MAVLink serialization: what is valid is read, what is not is counted and harms nothing."""

import random
import struct
from collections import Counter

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, RefusalNotice, split_frames
from onboard.protocol.signing import Verdict


def heartbeat() -> mavlink.MAVLink_heartbeat_message:
    return mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3)


def frame(codec: Codec) -> bytes:
    return codec.encode(heartbeat())


def test_a_message_survives_the_wire_with_its_sender() -> None:
    (message,) = Codec(1, 1).decode(frame(Codec(7, 191)))
    assert (message.get_srcSystem(), message.get_srcComponent(), message.get_type()) == (7, 191, "HEARTBEAT")


def test_every_message_of_the_dialect_is_packed_as_the_library_packs_it() -> None:
    """Our own, quicker way to a frame: random bytes as fields, and all zeros, which are cut off."""
    rng = random.Random(1)
    ours, decoder = Codec(7, 191), Codec(1, 1)
    library = mavlink.MAVLink(None, srcSystem=7, srcComponent=191)
    packed = 0
    for number, kind in mavlink.mavlink_map.items():
        for payload in (rng.randbytes(kind.unpacker.size), bytes(kind.unpacker.size)):
            header = struct.pack("<BBBBBBBHB", 0xFD, len(payload), 0, 0, 0, 7, 191, number & 0xFFFF, number >> 16)
            crc = mavlink.x25crc(header[1:] + payload + bytes((kind.crc_extra,))).crc
            for message in decoder.decode(header + payload + crc.to_bytes(2, "little")):  # text may not be UTF-8
                assert ours.encode(message) == bytes(message.pack(library)), kind.msgname
                library.seq = (library.seq + 1) % 256
                packed += 1
    assert packed > 1.8 * len(mavlink.mavlink_map)


def test_sequence_numbers_count_up_and_wrap() -> None:
    codec = Codec(1, 1)
    sequence = [frame(codec)[4] for _ in range(300)]
    assert sequence == [i % 256 for i in range(300)]


def test_several_frames_in_one_datagram() -> None:
    sender = Codec(1, 1)
    assert len(Codec(2, 1).decode(frame(sender) + frame(sender) + frame(sender))) == 3


def test_mavlink_1_frames_are_read() -> None:
    legacy = mavlink.MAVLink(None, srcSystem=3, srcComponent=1)
    data = bytes(heartbeat().pack(legacy, force_mavlink1=True))
    assert data[0] == 0xFE
    (message,) = Codec(2, 1).decode(data)
    assert message.get_srcSystem() == 3


@pytest.mark.parametrize("position", range(1, 21))
def test_a_flipped_byte_is_never_read_as_the_message(position: int) -> None:
    data = bytearray(frame(Codec(1, 1)))
    data[position] ^= 0x55
    codec = Codec(2, 1)
    whole = frame(Codec(1, 1))
    messages = codec.decode(bytes(data))
    assert messages == []
    assert codec.rejected + codec.unknown >= 1
    assert len(codec.decode(whole)) == 1, "a bad datagram must not spoil the next one"


def test_garbage_around_a_frame_is_skipped_and_counted() -> None:
    codec = Codec(2, 1)
    data = b"\x00\x01garbage" + frame(Codec(1, 1)) + b"\xfd\x00"
    assert len(codec.decode(data)) == 1
    assert codec.rejected == 2


def test_a_message_of_another_dialect_is_counted_as_unknown() -> None:
    codec = Codec(2, 1)
    data = bytearray(frame(Codec(1, 1)))
    data[7:10] = (12_345_678).to_bytes(3, "little")
    assert codec.decode(bytes(data)) == []
    assert (codec.unknown, codec.rejected) == (1, 0)


@given(st.binary(max_size=400))
def test_arbitrary_bytes_never_raise_and_no_byte_is_lost(data: bytes) -> None:
    Codec(2, 1).decode(data)
    assert sum(len(piece) for piece in split_frames(data) if piece is not None) <= len(data)


@given(st.sampled_from(sorted(mavlink.mavlink_map)), st.binary(max_size=255), st.integers(0, 255), st.integers(0, 255))
def test_valid_checksums_around_arbitrary_payloads_never_raise(
    message_id: int, payload: bytes, system: int, component: int
) -> None:
    """A sender that packs a known message wrongly is as harmless as noise."""
    header = bytes([len(payload), 0, 0, 0, system, component]) + message_id.to_bytes(3, "little")
    checksum = mavlink.x25crc(header + payload + bytes([mavlink.mavlink_map[message_id].crc_extra]))
    Codec(2, 1).decode(b"\xfd" + header + payload + checksum.crc.to_bytes(2, "little"))


def test_a_notice_comes_at_once_and_then_ever_more_rarely() -> None:
    notice, refused = RefusalNotice(), Counter({Verdict.UNSIGNED: 0})
    told = []
    for second in range(200):
        refused[Verdict.UNSIGNED] += 1
        if notice.update("ground", refused, float(second)) is not None:
            told.append(second)
    assert told == [0, 20, 60, 140]
    assert notice.update("peers", refused, 0.0) == "200 frames refused on the peers link; so far 200 unsigned"
