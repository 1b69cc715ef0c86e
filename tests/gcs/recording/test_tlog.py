"""Telemetry logs: signatures and keys stay out, whole records come back from files that end anywhere."""

import pytest
from pymavlink import mavutil

from gcs.recording.tlog import read_tlog, stamped, unsigned
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

MESSAGES = [
    mavlink.MAVLink_heartbeat_message(2, 12, 81, 5, 4, 3),
    mavlink.MAVLink_statustext_message(6, b"a text of some length"),
    mavlink.MAVLink_statustext_message(6, b"x" * 50),
    mavlink.MAVLink_system_time_message(1, 2),
]


def signing_sender():
    sender = mavlink.MAVLink(None, srcSystem=3, srcComponent=191)
    sender.signing.secret_key = bytes(range(32))
    sender.signing.link_id = 1
    sender.signing.timestamp = 1
    sender.signing.sign_outgoing = True
    return sender


@pytest.mark.parametrize("message", MESSAGES)
def test_a_signed_frame_becomes_the_frame_that_an_unsigned_link_would_have_sent(message):
    """Oracle: pymavlink packs the same message with and without signature."""
    signed = bytes(message.pack(signing_sender()))
    plain = bytes(message.pack(mavlink.MAVLink(None, srcSystem=3, srcComponent=191)))
    assert signed != plain
    assert unsigned(signed) == plain
    assert unsigned(plain) == plain


def test_frames_of_the_first_version_and_of_unknown_messages_are_kept(monkeypatch):
    sender = mavlink.MAVLink(None, srcSystem=3, srcComponent=191)
    old = bytes(mavlink.MAVLink_heartbeat_message(2, 12, 81, 5, 4, 3).pack(sender, force_mavlink1=True))
    assert unsigned(old) == old
    unknown = bytearray(mavlink.MAVLink_heartbeat_message(2, 12, 81, 5, 4, 3).pack(signing_sender()))
    unknown[7:10] = (60000).to_bytes(3, "little")
    assert len(unsigned(bytes(unknown))) == len(unknown) - mavlink.MAVLINK_SIGNATURE_BLOCK_LEN


def test_a_secret_key_is_never_written():
    setup = mavlink.MAVLink_setup_signing_message(1, 1, bytes(range(32)), 5)
    assert stamped(1, Codec(255, 190).encode(setup)) == b""


def test_a_file_cut_anywhere_gives_its_whole_records(tmp_path):
    codec = Codec(1, 1)
    frames = [codec.encode(message) for message in MESSAGES * 5]
    records = [stamped(1_500_000_000_000_000 + i, frame) for i, frame in enumerate(frames)]
    whole = b"".join(records)
    path = tmp_path / "cut.tlog"
    for end in range(len(whole) + 1):
        path.write_bytes(whole[:end])
        lengths = [len(b"".join(records[:i])) for i in range(len(records) + 1)]
        complete = sum(length <= end for length in lengths) - 1
        expected = [(1_500_000_000_000_000 + i, frame) for i, frame in enumerate(frames[:complete])]
        assert list(read_tlog(path)) == expected


def test_our_reader_and_pymavlinks_agree_on_a_whole_flight(flown):
    total = 0
    for path in sorted(flown.folder.glob("*.tlog")):
        ours = list(read_tlog(path))
        log = mavutil.mavlink_connection(str(path))
        theirs = 0
        while (message := log.recv_match()) is not None:
            theirs += message.get_type() != "BAD_DATA"
        log.close()
        assert theirs == len(ours) > 0, path.name
        total += theirs
    assert total == flown.frames
