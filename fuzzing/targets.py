"""What is fuzzed. A target takes bytes and must neither raise, nor hang, nor break what it promises.

Each is made by a factory, so that state which outlives one input (an onboard computer in flight) is the target's own.
"""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

from fuzzing.flight import BrokenPromiseError, FuzzedFlight
from fuzzing.genuine import BEGUN_S
from fuzzing.ground import FuzzedStation
from onboard.config import ConfigError, load_scenario
from onboard.links import COMPONENT
from onboard.planning.problem_file import ProblemFileError, load_problem
from onboard.planning.warmup import warm_kernels
from onboard.protocol.codec import Codec, split_frames
from onboard.protocol.signing import SignedLink, Signing, SigningKey

__all__ = ["TARGETS", "Target"]

Target = Callable[[bytes], None]


def codec() -> Target:
    """Datagrams of anything: every byte is at most once in a frame, and what is valid has finite headers."""
    reader = Codec(255, 190)

    def run(data: bytes) -> None:
        if sum(len(frame) for frame in split_frames(data) if frame is not None) > len(data):
            raise BrokenPromiseError("more bytes in frames than in the datagram")
        reader.decode(data)

    return run


def signing() -> Target:
    """Datagrams of strangers on a signed link: nothing gets in, and nothing is learned from them."""
    ours = Signing(SigningKey(bytes(range(32))))
    ours.advance(BEGUN_S)
    reader = Codec(1, COMPONENT, ours.link(SignedLink.PEERS))

    def run(data: bytes) -> None:
        if reader.decode(data) or ours.past.streams:
            raise BrokenPromiseError("a frame without the team's signature was let in")

    return run


def scenario() -> Target:
    """Scenario files of anything: a scenario, or one clear error."""
    path = Path(tempfile.mkdtemp(prefix="arvi-fuzz-")) / "scenario.yaml"

    def run(data: bytes) -> None:
        path.write_bytes(data)
        try:
            load_scenario(path)
        except ConfigError as error:
            if not str(error).strip():
                raise BrokenPromiseError("an error without a text") from None

    return run


def problem() -> Target:
    """Problem files of anything: a problem, or one clear error."""
    path = Path(tempfile.mkdtemp(prefix="arvi-fuzz-")) / "problem.json"

    def run(data: bytes) -> None:
        path.write_bytes(data)
        try:
            load_problem(path)
        except ProblemFileError as error:
            if not str(error).strip():
                raise BrokenPromiseError("an error without a text") from None

    return run


def onboard() -> Target:
    """A whole onboard computer in a mission, with hostile frames on every link, for ever new flights.

    Whatever arrives, its setpoints stay finite and what it believes stays Gaussian: finite, symmetric, positive
    definite.
    """
    warm_kernels()  # compilation takes seconds, which is not a stall
    flight = FuzzedFlight()

    def run(data: bytes) -> None:
        nonlocal flight
        if flight.is_over:
            flight = FuzzedFlight()
        flight.feed(data)

    return run


def ground() -> Target:
    """A whole ground station with its terminal, with hostile frames and orders of all kinds, for ever new flights.

    Whatever arrives, only printable characters reach the terminal, the summary is JSON, and memory stays bounded.
    """
    station = FuzzedStation()

    def run(data: bytes) -> None:
        nonlocal station
        if station.is_over:
            station = FuzzedStation()
        station.feed(data)

    return run


TARGETS: dict[str, Callable[[], Target]] = {
    "codec": codec,
    "ground": ground,
    "onboard": onboard,
    "problem": problem,
    "scenario": scenario,
    "signing": signing,
}
