"""A seeded mutation fuzzer with a stall watchdog: the same inputs on every machine, so that it can run in CI.

For days of fuzzing there is atheris, which is guided by coverage (:mod:`fuzzing.guided`).
"""

from __future__ import annotations

import random
import signal
import traceback
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from types import FrameType

from fuzzing.targets import Target

__all__ = ["Finding", "StalledError", "mutations", "run", "watchdog"]

STALL_S = 5.0
MAX_BYTES = 4096


class StalledError(Exception):
    """One input took longer than the watchdog allows."""


@dataclass(frozen=True, slots=True)
class Finding:
    """An input that a target did not survive.

    Attributes:
        data: The input.
        text: What it raised, with the way there.
    """

    data: bytes
    text: str


@contextmanager
def watchdog(seconds: float) -> Iterator[None]:
    """Raises :class:`StalledError` in the block when it takes too long; main thread only."""

    def stalled(_number: int, _frame: FrameType | None) -> None:
        raise StalledError(f"no answer for {seconds:g} s")

    before = signal.signal(signal.SIGALRM, stalled)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, before)


def mutations(seeds: Sequence[bytes], seed: int) -> Iterator[bytes]:
    """Endless inputs: the seeds themselves first, then mutations of them and of each other."""
    source = random.Random(seed)
    yield from seeds
    while True:
        data = bytearray(source.choice(seeds))
        for _ in range(1 + int(source.expovariate(0.4))):
            _mutate(data, source, seeds)
        yield bytes(data[:MAX_BYTES])


def _mutate(data: bytearray, source: random.Random, seeds: Sequence[bytes]) -> None:
    at = source.randrange(len(data) + 1)
    match source.randrange(7):
        case 0 if data:
            data[at % len(data)] ^= 1 << source.randrange(8)
        case 1:
            data[at:at] = source.randbytes(source.choice((1, 2, 4, 8, 64)))
        case 2:
            del data[at : at + source.choice((1, 2, 4, 16))]
        case 3:
            other = source.choice(seeds)
            begin = source.randrange(len(other) + 1)
            data[at:] = other[begin:]
        case 4:
            data[at : at + 4] = source.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\xff\xff\xff\xff", b"\0\0\0\x80"))
        case 5:
            data[at:at] = data[at : at + 32] * source.choice((1, 2, 20))
        case _:
            data[at:at] = source.randbytes(source.randrange(300))


def run(
    target: Target,
    seeds: Sequence[bytes],
    runs: int,
    seed: int,
    *,
    stall_s: float = STALL_S,
    progress: Callable[[int], None] = lambda _: None,
) -> Finding | None:
    """Feed a target; the first input that it does not survive, or None.

    Args:
        target: Made by one of ``TARGETS``.
        seeds: Meaningful inputs to start from; at least one.
        runs: How many inputs.
        seed: Of the mutations.
        stall_s: Longest time that one input may take, s.
        progress: Called with the number of inputs done, every hundred.
    """
    for number, data in enumerate(mutations(seeds, seed)):
        if number >= runs:
            return None
        try:
            with watchdog(stall_s):
                target(data)
        except Exception:  # whatever it is, it is a finding
            return Finding(data, traceback.format_exc())
        if number % 100 == 99:
            progress(number + 1)
    return None
