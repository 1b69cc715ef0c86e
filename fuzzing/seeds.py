"""Meaningful inputs from which fuzzing starts, made from what the project has: scenarios, problems, messages."""

from __future__ import annotations

import random
from pathlib import Path

from fuzzing.genuine import BEGUN_S
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import SignedLink, Signing, SigningKey

__all__ = ["frames", "seeds_of"]

ROOT = Path(__file__).parent.parent
_BLOB_BYTES = 700


def seeds_of(target: str) -> list[bytes]:
    """The seeds of a target, by its name."""
    match target:
        case "scenario":
            return [path.read_bytes() for path in sorted((ROOT / "configs").glob("*.yaml"))]
        case "problem":
            paths = sorted((ROOT / "benchmarks" / "problems").glob("*.json"), key=lambda path: path.stat().st_size)
            return [path.read_bytes() for path in paths[:3]]
        case "codec":
            return frames(Codec(1, 1))
        case "signing":
            stranger = Signing(SigningKey(bytes(range(1, 33))))
            stranger.advance(BEGUN_S)
            return frames(Codec(2, 191, stranger.link(SignedLink.PEERS)))
    source = random.Random(target)
    return [source.randbytes(_BLOB_BYTES) for _ in range(50)]


def frames(codec: Codec) -> list[bytes]:
    """A frame of each of some messages, packed by a sender."""
    messages = (
        mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3),
        mavlink.MAVLink_command_long_message(1, 191, 0, mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 0, 0, 0, 0),
        mavlink.MAVLink_statustext_message(4, b"text", 0, 0),
        mavlink.MAVLink_target_belief_message(10**15, [0.0] * 4, [1.0] * 10, 1, 1, 0),
        mavlink.MAVLink_explored_tile_message(0, 0, 250, [255] * 128, 123),
    )
    return [codec.encode(message) for message in messages]
