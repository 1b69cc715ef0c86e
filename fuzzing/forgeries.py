"""``python -m fuzzing.forgeries --packets 10000``: on a signed link, packets of those who have no key, and old ones.

Each is made from a genuine one: with other bytes or another signature, with another key, dated ahead, replayed, cut,
for another link, from a new stream that is too old, without a signature. None may be let in, and after each the next
genuine packet of the sender must be.
"""

from __future__ import annotations

import argparse
import random
import sys
from collections import Counter
from collections.abc import Callable
from enum import StrEnum

from fuzzing.flight import BrokenPromiseError
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import MAX_TICKS, SignedLink, Signing, SigningKey, signing_time

__all__ = ["Attack", "forge", "main"]

NOW_S = 1_800_000_000.0
_SENDER, _COMPONENT = 7, 191
_TIMESTAMP, _SIGNATURE = slice(-12, -6), slice(-6, None)
_PERIOD_S = 0.01


class Attack(StrEnum):
    """What a hostile packet is."""

    DAMAGED = "damaged"
    OTHER_SIGNATURE = "with a random signature"
    OTHER_KEY = "signed with another key"
    LOCK_OUT = "with the greatest timestamp"
    AHEAD = "signed ahead of time"
    REPLAYED = "replayed"
    TRUNCATED = "truncated"
    OTHER_LINK = "signed for another link"
    STALE = "signed long ago, of a new stream"
    UNSIGNED = "unsigned"


class _Sender:
    def __init__(self, key: SigningKey, link: SignedLink = SignedLink.PEERS, component: int = _COMPONENT) -> None:
        self.signing = Signing(key)
        self._codec = Codec(_SENDER, component, self.signing.link(link))

    def say(self, time_s: float) -> bytes:
        self.signing.advance(time_s)
        return self._codec.encode(_MESSAGE)


_MESSAGE = mavlink.MAVLink_command_long_message(1, _COMPONENT, mavlink.MAV_CMD_NAV_LAND, 0, *[1.0] * 7)


def forge(packets: int, seed: int) -> Counter[Attack]:
    """Attack one signed link; how often with what.

    Raises:
        BrokenPromiseError: A hostile packet was let in, or a genuine one was not.
    """
    source = random.Random(seed)
    key, other_key = (SigningKey(source.randbytes(32)) for _ in range(2))
    sender, thief, ahead = _Sender(key), _Sender(other_key), _Sender(key, component=_COMPONENT + 1)
    elsewhere = _Sender(key, SignedLink.GROUND)
    receiver_signing = Signing(key)
    receiver = Codec(1, _COMPONENT, receiver_signing.link(SignedLink.PEERS))
    heard: list[bytes] = []
    made: Counter[Attack] = Counter()

    def damaged(genuine: bytes, _: float) -> bytes:
        frame = bytearray(genuine)
        for _ in range(1 + source.randrange(3)):
            frame[source.randrange(1, len(frame))] ^= 1 + source.randrange(255)
        return bytes(frame) if bytes(frame) != genuine else genuine[:-1]

    def with_timestamp(genuine: bytes, ticks: int) -> bytes:
        frame = bytearray(genuine)
        frame[_TIMESTAMP] = ticks.to_bytes(6, "little")
        return bytes(frame)

    attacks: dict[Attack, Callable[[bytes, float], bytes]] = {
        Attack.DAMAGED: damaged,
        Attack.OTHER_SIGNATURE: lambda genuine, _: genuine[:-6] + source.randbytes(6),
        Attack.OTHER_KEY: lambda _, now_s: thief.say(now_s),
        Attack.LOCK_OUT: lambda genuine, _: with_timestamp(genuine, MAX_TICKS),
        Attack.AHEAD: lambda _, now_s: ahead.say(now_s + 61.0 + source.random() * 1e6),
        Attack.REPLAYED: lambda _, now_s: source.choice(heard),
        Attack.TRUNCATED: lambda genuine, _: genuine[: source.randrange(len(genuine))],
        Attack.OTHER_LINK: lambda _, now_s: elsewhere.say(now_s),
        Attack.STALE: lambda _, now_s: _Sender(key, component=1 + source.randrange(190)).say(now_s - 61.0),
        Attack.UNSIGNED: lambda _genuine, _now: Codec(_SENDER, _COMPONENT).encode(_MESSAGE),
    }
    for number in range(packets + 1):
        now_s = NOW_S + _PERIOD_S * number
        receiver_signing.advance(now_s)
        genuine = sender.say(now_s)
        if number > 0:
            attack = source.choice(list(Attack))
            hostile = attacks[attack](genuine, now_s)
            if receiver.decode(hostile):
                raise BrokenPromiseError(f"packet {number}, {attack}, was let in: {hostile.hex()}")
            made[attack] += 1
        if len(receiver.decode(genuine)) != 1:
            raise BrokenPromiseError(f"the sender was not heard after packet {number}")
        heard.append(genuine)
    if receiver_signing.past.streams != {(_SENDER, _COMPONENT, SignedLink.PEERS): signing_time(now_s)}:
        raise BrokenPromiseError(f"hostile packets left a trace: {receiver_signing.past.streams}")
    return made


def main(arguments: list[str] | None = None) -> int:
    """Attack a signed link; the exit code: 0 when all was refused, 1 when something was not."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing.forgeries", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--packets", type=int, default=10_000, metavar="N", help="hostile packets (10000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the packets (1)")
    options = parser.parse_args(arguments)
    try:
        made = forge(options.packets, options.seed)
    except BrokenPromiseError as error:
        sys.stdout.write(f"{error}\n")
        return 1
    kinds = ", ".join(f"{made[attack]} {attack}" for attack in Attack)
    sys.stdout.write(f"0 of {options.packets} hostile packets let in, the sender heard after each: {kinds}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
