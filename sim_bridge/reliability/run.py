"""Flies the suite: one flight up to each phase, and from there a child process for each fault.

A flight up to a phase is the same for all faults, so it is flown once and forked; objects without sockets, threads or
clocks are as good in the child as in the parent.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import resource
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial

from onboard.config import Scenario
from onboard.planning.warmup import warm_kernels
from sim_bridge.reliability.cases import CASES, Case
from sim_bridge.reliability.flight import Flight, NotReachedError, suite_scenario
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.verdict import Outcome, judge

__all__ = ["Batch", "batches", "fly", "fly_batch"]

CPU_LIMIT_S = 120
"""A flight takes a few seconds of processor time; one that takes so many hangs."""

_BATCH = 8


@dataclass(frozen=True, slots=True)
class Batch:
    """Flights that share their way to a phase.

    Attributes:
        phase: Which.
        seed: Of all of them.
        cases: Names of what happens then, one in each flight.
    """

    phase: Phase
    seed: int
    cases: tuple[str, ...]


def batches(seeds: Sequence[int], cases: Iterable[Case] = CASES, phases: Iterable[Phase] = Phase) -> list[Batch]:
    """All that is to be flown, seed by seed."""
    cases, phases = tuple(cases), tuple(phases)
    found = []
    for seed in seeds:
        for phase in phases:
            names = tuple(case.name for case in cases if phase in case.expected)
            found += [Batch(phase, seed, names[i : i + _BATCH]) for i in range(0, len(names), _BATCH)]
    return found


def fly(lab: Scenario, todo: Sequence[Batch], workers: int) -> Iterator[Outcome]:
    """Fly batches in several processes; outcomes as they come."""
    warm_kernels()
    with multiprocessing.get_context("fork").Pool(workers) as pool:
        for outcomes in pool.imap_unordered(partial(fly_batch, lab), todo):
            yield from outcomes


def fly_batch(lab: Scenario, batch: Batch) -> list[Outcome]:
    """Fly one batch; a flight that crashes or hangs fails without harming the others."""
    scenario = suite_scenario(lab)
    by_name = {case.name: case for case in CASES}
    cases = [by_name[name] for name in batch.cases]
    flight = Flight(scenario, batch.seed)
    try:
        flight.fly_to(batch.phase)
    except NotReachedError as error:
        return [_failed(case, batch, f"without any fault the phase is not reached: {error}") for case in cases]
    return [_in_child(flight, scenario, case, batch) for case in cases]


def _in_child(flight: Flight, scenario: Scenario, case: Case, batch: Batch) -> Outcome:
    reader, writer = os.pipe()
    child = os.fork()
    if child == 0:
        _become_child(flight, scenario, case, batch, writer)
    os.close(writer)
    with os.fdopen(reader, "rb") as pipe:
        answer = pipe.read()
    _, status = os.waitpid(child, 0)
    if not answer:
        return _failed(case, batch, f"the flight hangs or crashes (exit status {os.waitstatus_to_exitcode(status)})")
    outcome = pickle.loads(answer)
    return outcome if isinstance(outcome, Outcome) else _failed(case, batch, str(outcome))


def _become_child(flight: Flight, scenario: Scenario, case: Case, batch: Batch, writer: int) -> None:
    """Fly on, answer and end, whatever happens."""
    try:
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_LIMIT_S, CPU_LIMIT_S))
        answer: Outcome | str = judge(flight, scenario, case, batch.phase, batch.seed)
    except BaseException:
        answer = f"the stack raised: {traceback.format_exc(limit=-3)}"
    with os.fdopen(writer, "wb") as pipe:
        pickle.dump(answer, pipe)
    os._exit(0)


def _failed(case: Case, batch: Batch, failure: str) -> Outcome:
    gap = case.expected[batch.phase].gap
    return Outcome(case.name, batch.phase.value, batch.seed, (failure,), gap, None, None, 0.0, None, 0.0, 0.0)
