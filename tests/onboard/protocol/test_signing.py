"""Signing by https://mavlink.io/en/guide/message_signing.html: who has no key gets in never, who has it always."""

import hashlib
from collections import Counter

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import (
    EPOCH_UNIX_S,
    MAX_TICKS,
    SignedLink,
    Signing,
    SigningError,
    SigningKey,
    Verdict,
    signing_time,
)

KEY = SigningKey(bytes(range(32)))
NOW_S = EPOCH_UNIX_S + 3.0e8


class End:
    """One process with one signed link."""

    def __init__(
        self, system_id: int, key: SigningKey = KEY, link: SignedLink = SignedLink.PEERS, now_s: float = NOW_S
    ) -> None:
        self.signing = Signing(key)
        self.signing.advance(now_s)
        self.codec = Codec(system_id, 191, self.signing.link(link))

    def say(self) -> bytes:
        return self.codec.encode(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3))

    def hears(self, frame: bytes) -> bool:
        return bool(self.codec.decode(frame))


def test_a_frame_is_signed_as_mavlink_says() -> None:
    frame = End(7).say()
    assert frame[2] == mavlink.MAVLINK_IFLAG_SIGNED
    assert frame[-13] == SignedLink.PEERS
    assert int.from_bytes(frame[-12:-6], "little") == signing_time(NOW_S)
    assert frame[-6:] == hashlib.sha256(KEY.secret + frame[:-6]).digest()[:6]


def test_the_library_of_everybody_else_accepts_what_is_signed_here() -> None:
    theirs = mavlink.MAVLink(None)
    theirs.signing.secret_key = KEY.secret
    theirs.signing.timestamp = signing_time(NOW_S)
    assert theirs.decode(bytearray(End(7).say())).get_srcSystem() == 7


def test_what_the_library_of_everybody_else_signs_is_accepted_here() -> None:
    theirs = mavlink.MAVLink(None, srcSystem=9, srcComponent=191)
    theirs.signing.secret_key = KEY.secret
    theirs.signing.timestamp = signing_time(NOW_S)
    theirs.signing.link_id = SignedLink.PEERS
    theirs.signing.sign_outgoing = True
    assert End(1).hears(bytes(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3).pack(theirs)))


def test_timestamps_grow_even_when_the_clock_does_not() -> None:
    sender = End(7)
    sender.signing.advance(NOW_S)
    first, second = sender.say(), sender.say()
    sender.signing.advance(NOW_S - 100.0)
    third = sender.say()
    stamps = [int.from_bytes(frame[-12:-6], "little") for frame in (first, second, third)]
    assert stamps == sorted(set(stamps))


def test_one_forged_frame_with_the_greatest_timestamp_does_not_lock_the_sender_out() -> None:
    """The library's own verifier stores a timestamp before it verifies; that is the attack."""
    sender, receiver = End(7), End(1)
    assert receiver.hears(sender.say())
    forged = bytearray(sender.say())
    forged[-12:-6] = MAX_TICKS.to_bytes(6, "little")
    assert not receiver.hears(bytes(forged))
    assert receiver.hears(sender.say())


def test_a_frame_is_heard_once() -> None:
    sender, receiver = End(7), End(1)
    first, second = sender.say(), sender.say()
    assert receiver.hears(second)
    assert not receiver.hears(second)
    assert not receiver.hears(first)
    assert receiver.codec.refused == Counter({Verdict.REPLAYED: 2})
    assert receiver.hears(sender.say())


def test_a_frame_of_one_link_is_worth_nothing_on_another() -> None:
    receiver = End(1, link=SignedLink.GROUND)
    assert not receiver.hears(End(7, link=SignedLink.PEERS).say())
    assert receiver.codec.refused == Counter({Verdict.WRONG_LINK: 1})


@pytest.mark.parametrize(("age_s", "heard"), [(59.0, True), (61.0, False), (-59.0, True), (-61.0, False)])
def test_a_new_stream_is_at_most_a_minute_off(age_s: float, heard: bool) -> None:
    assert End(1).hears(End(7, now_s=NOW_S - age_s).say()) is heard


def test_a_known_stream_may_be_silent_for_long_and_come_back_but_never_from_far_ahead() -> None:
    sender, receiver = End(7), End(1)
    assert receiver.hears(sender.say())
    for later_s in (3600.0, 3600.0 + 61.0):
        sender.signing.advance(NOW_S + later_s)
        receiver.signing.advance(NOW_S + 3600.0)
        assert receiver.hears(sender.say()) is (later_s == 3600.0)


def test_a_restart_refuses_what_the_run_before_had_heard() -> None:
    sender, receiver = End(7), End(1)
    frame = sender.say()
    assert receiver.hears(frame)
    restarted = Signing(KEY, receiver.signing.past)
    restarted.advance(NOW_S + 1.0)
    codec = Codec(1, 191, restarted.link(SignedLink.PEERS))
    assert codec.decode(frame) == []
    assert len(codec.decode(sender.say())) == 1


@pytest.mark.parametrize("secret", [b"", b"short", bytes(32), bytes(33)])
def test_a_bad_key_is_refused_and_no_key_is_ever_shown(secret: bytes) -> None:
    with pytest.raises(SigningError) as error:
        SigningKey(secret)
    assert secret.hex() not in str(error.value) or not secret
    assert KEY.secret.hex() not in repr(KEY)
    assert str(KEY.secret) not in repr(KEY)
