"""One seed, and an independent random generator for each consumer.

Every consumer has its own key, so that a new consumer, another vehicle or a component that draws more often changes
nobody else's numbers (numpy's ``SeedSequence`` with ``spawn_key``,
https://numpy.org/doc/stable/reference/random/parallel.html).
"""

from __future__ import annotations

from enum import IntEnum

import numpy as np

__all__ = ["Stream", "generator"]


class Stream(IntEnum):
    """The consumers of randomness. The values are part of what a seed means: never renumber, only append."""

    GROUND_ROBOTS = 1
    MOCAP = 2
    DETECTOR = 3
    RADIO = 4
    VEHICLE = 5
    AUTOPILOT = 6
    LOCKSTEP_TARGETS = 7
    LOCKSTEP_RADIO = 8
    LOCKSTEP_START = 9
    PLANNER = 10
    RADIO_FAULTS = 11
    DETECTOR_FAULTS = 12
    MOCAP_FAULTS = 13
    LINK_FAULTS = 14
    COMPUTER_FAULTS = 15


def generator(seed: int, stream: Stream, member: int = 0) -> np.random.Generator:
    """The generator of one consumer.

    Args:
        seed: The scenario's seed, ≥ 0.
        stream: Which kind of consumer.
        member: Which one of them, such as a vehicle's system id; ≥ 0.
    """
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(int(stream), member)))
