"""MAVLink 2 signing, without files or clocks (https://mavlink.io/en/guide/message_signing.html).

A signed frame ends with the id of the link on which it was sent, a timestamp that only grows on one stream (system,
component, link), and the first 48 bits of SHA-256 over key and frame. What is kept of a stream changes only after a
frame that proved genuine: a forged timestamp must not lock out the one who really speaks there.
"""

from __future__ import annotations

import hashlib
import hmac
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import IntEnum, StrEnum

from onboard.errors import OnboardError
from onboard.protocol import dialect as mavlink

__all__ = [
    "KEY_BYTES",
    "LinkSigning",
    "SignedLink",
    "Signing",
    "SigningError",
    "SigningKey",
    "SigningPast",
    "Verdict",
    "signing_time",
]

KEY_BYTES = 32
EPOCH_UNIX_S = 1_420_070_400
"""2015-01-01 UTC, from which signing counts."""
TICKS_PER_S = 100_000
MAX_TICKS = (1 << 48) - 1
NEW_STREAM_MAX_AGE_S = 60.0
"""MAVLink: the first frame of a stream may be one minute old at most."""
MAX_AHEAD_S = 60.0
"""A frame from further in the future is refused: its sender's clock is wrong, or it waits to be replayed."""

_SIGNATURE_BYTES = 6
_BLOCK_BYTES = mavlink.MAVLINK_SIGNATURE_BLOCK_LEN

StreamId = tuple[int, int, int]
"""System, component and link id of a sender."""


class SigningError(OnboardError):
    """A key that cannot be used; the text says why, and never holds the key."""


class SignedLink(IntEnum):
    """The link ids of a team: a frame signed for one link is worth nothing on another."""

    PEERS = 1
    GROUND = 2


class Verdict(StrEnum):
    """What a receiver makes of one frame's signature."""

    GENUINE = "genuine"
    UNSIGNED = "unsigned"
    FORGED = "wrong signature"
    WRONG_LINK = "signed for another link"
    REPLAYED = "replayed or out of order"
    STALE = "too old for a new stream"
    FUTURE = "from the future"


@dataclass(frozen=True, slots=True)
class SigningKey:
    """A team's secret.

    Attributes:
        secret: 32 bytes; never shown.

    Raises:
        SigningError: It is not 32 bytes, or all of them are zero.
    """

    secret: bytes

    def __post_init__(self) -> None:
        if len(self.secret) != KEY_BYTES:
            raise SigningError(f"a signing key has {KEY_BYTES} bytes, not {len(self.secret)}")
        if not any(self.secret):
            raise SigningError("a signing key of zeros signs nothing; make one with arvi keygen")

    def __repr__(self) -> str:
        return "SigningKey(secret=...)"

    def signature(self, signed_part: bytes) -> bytes:
        """The 48 bits that end a frame; ``signed_part`` is all of it before them."""
        return hashlib.sha256(self.secret + signed_part).digest()[:_SIGNATURE_BYTES]


def signing_time(unix_s: float) -> int:
    """A UNIX time in signing's unit, 10 µs since 2015, as far as 48 bits go."""
    return min(max(int((unix_s - EPOCH_UNIX_S) * TICKS_PER_S), 0), MAX_TICKS)


@dataclass(frozen=True, slots=True)
class SigningPast:
    """What a process must not forget over a restart.

    Attributes:
        sent: The newest timestamp that it signed.
        streams: The newest verified timestamp of each sender.
    """

    sent: int = 0
    streams: Mapping[StreamId, int] = field(default_factory=dict)


class Signing:
    """The signing state of one process: its key, its clock, and the streams that it knows.

    Args:
        key: The team's secret.
        past: Of an earlier run: what is not newer is refused, and what is signed from now on is newer.

    Attributes:
        key: The team's secret.
        now: The present time, 10 µs since 2015; set by :meth:`advance`.
    """

    def __init__(self, key: SigningKey, past: SigningPast = SigningPast()) -> None:
        self.key = key
        self.now = 0
        self._sent = past.sent
        self._streams = dict(past.streams)

    def advance(self, unix_s: float) -> None:
        """Tell the time; a clock that is set back does not take signatures back."""
        self.now = signing_time(unix_s)

    def link(self, link: SignedLink) -> LinkSigning:
        """Signs and verifies on one link, whose other ends use the same id."""
        return LinkSigning(self, int(link))

    @property
    def past(self) -> SigningPast:
        """A copy of what a restart must not forget."""
        return SigningPast(self._sent, dict(self._streams))

    def next_timestamp(self) -> int:
        """A timestamp newer than all before."""
        self._sent = min(max(self._sent + 1, self.now), MAX_TICKS)
        return self._sent

    def judge_time(self, stream: StreamId, timestamp: int) -> Verdict:
        """Whether a timestamp is acceptable on a stream; changes nothing."""
        if timestamp > self.now + MAX_AHEAD_S * TICKS_PER_S:
            return Verdict.FUTURE
        last = self._streams.get(stream)
        if last is None:
            fresh = timestamp >= self.now - NEW_STREAM_MAX_AGE_S * TICKS_PER_S
            return Verdict.GENUINE if fresh else Verdict.STALE
        return Verdict.GENUINE if timestamp > last else Verdict.REPLAYED

    def keep(self, stream: StreamId, timestamp: int) -> None:
        """Remember a verified frame's timestamp."""
        self._streams[stream] = timestamp


class LinkSigning:
    """Signs and verifies the frames of one link; made by :meth:`Signing.link`."""

    def __init__(self, process: Signing, link_id: int) -> None:
        self._process = process
        self._link_id = link_id

    def prepare(self, packer: mavlink.MAVLink) -> None:
        """Have the next message that a packer packs signed, with the next timestamp."""
        signing = packer.signing
        signing.secret_key = self._process.key.secret
        signing.link_id = self._link_id
        signing.timestamp = self._process.next_timestamp()
        signing.sign_outgoing = True

    def verify(self, frame: bytes) -> Verdict:
        """Judge one whole frame; only :attr:`Verdict.GENUINE` changes what is known of its stream.

        Args:
            frame: As split from a datagram, of either MAVLink version.
        """
        if frame[0] != mavlink.PROTOCOL_MARKER_V2 or not frame[2] & mavlink.MAVLINK_IFLAG_SIGNED:
            return Verdict.UNSIGNED
        # The signature first: what an unproven frame claims of link and time is not even looked at.
        expected = self._process.key.signature(frame[:-_SIGNATURE_BYTES])
        if not hmac.compare_digest(expected, frame[-_SIGNATURE_BYTES:]):
            return Verdict.FORGED
        link_id = frame[-_BLOCK_BYTES]
        if link_id != self._link_id:
            return Verdict.WRONG_LINK
        timestamp = int.from_bytes(frame[1 - _BLOCK_BYTES : -_SIGNATURE_BYTES], "little")
        stream = (frame[5], frame[6], link_id)
        verdict = self._process.judge_time(stream, timestamp)
        if verdict is Verdict.GENUINE:
            self._process.keep(stream, timestamp)
        return verdict
