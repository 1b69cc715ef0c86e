"""``python -m fuzzing.messages --each 1000000``: hostile messages into each link of an onboard computer in flight.

They are copies of genuine messages with some of their words replaced, or any message with any payload, from teammates,
the ground, the autopilot and strangers, with valid checksums and without signatures: what a team that flies unsigned
must survive, and a signed one when a teammate is broken. Nothing may raise or hang, every setpoint stays finite, every
belief Gaussian; and what comes from teammates and sensors changes no flight state and keeps back no setpoint.
"""

from __future__ import annotations

import argparse
import random
import sys
import time
import traceback

from fuzzing.engine import STALL_S, watchdog
from fuzzing.flight import FuzzedFlight
from onboard.links import MAX_RATES_HZ, LinkName
from onboard.planning.warmup import warm_kernels

__all__ = ["flood_link", "main"]

_AT_ONCE = {LinkName.AUTOPILOT: 100, LinkName.PEERS: 100, LinkName.SENSOR: 100, LinkName.GROUND: 12}
"""Hostile frames between two setpoints: of seven senders each stays below its rate, so that all are read."""


def flood_link(link: LinkName, messages: int, seed: int) -> int:
    """Write so many hostile messages into one link of ever new flights.

    Returns:
        Flights into which they were written.

    Raises:
        BrokenPromiseError: A promise is broken; whatever else is raised is a defect, too.
        StalledError: The messages between two setpoints took longer than the watchdog allows.
    """
    source = random.Random(f"{link}-{seed}")
    flight, flights = FuzzedFlight(), 1
    while messages > 0:
        if flight.is_over:
            flight, flights = FuzzedFlight(), flights + 1
        count = min(messages, _AT_ONCE[link])
        with watchdog(STALL_S):
            flight.flood(link, source, count)
        messages -= count
    return flights


def main(arguments: list[str] | None = None) -> int:
    """Flood all links; the exit code: 0 when all was survived, 1 when something was not."""
    parser = argparse.ArgumentParser(prog="python -m fuzzing.messages", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("links", nargs="*", type=LinkName, metavar="LINK", help="autopilot, peers, sensor, ground; all")
    parser.add_argument("--each", type=int, default=20_000, metavar="N", help="messages into each link (20000)")
    parser.add_argument("--seed", type=int, default=1, metavar="N", help="of the messages (1)")
    options = parser.parse_args(arguments)
    warm_kernels()  # compilation takes seconds, which is not a stall
    code = 0
    for link in options.links or list(MAX_RATES_HZ):
        begun_s = time.process_time()
        try:
            flights = flood_link(link, options.each, options.seed)
        except Exception:  # whatever it is, it is a finding
            sys.stdout.write(f"{traceback.format_exc()}{link}: did not survive seed {options.seed}\n")
            code = 1
            continue
        took_s = time.process_time() - begun_s
        sys.stdout.write(f"{link}: survived {options.each} messages in {flights} flights, {took_s:.0f} s of CPU\n")
        sys.stdout.flush()
    return code


if __name__ == "__main__":
    sys.exit(main())
