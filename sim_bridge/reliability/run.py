"""Flies the suite: one flight up to each phase, and from there a child process for each fault.

A flight up to a phase is the same for all faults, so it is flown once and forked; objects without sockets, threads or
clocks are as good in the child as in the parent.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import random
import resource
import time
import traceback
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from multiprocessing.queues import SimpleQueue
from multiprocessing.sharedctypes import Synchronized

from onboard.config import Scenario
from onboard.planning.warmup import warm_kernels
from sim_bridge.autopilot.firmwares import FIRMWARES, Firmware
from sim_bridge.reliability.case import Case
from sim_bridge.reliability.flight import Flight, NotReachedError
from sim_bridge.reliability.phases import ORDINARY, Phase
from sim_bridge.reliability.suite import ANYTIME, CASES, REPRESENTATIVE
from sim_bridge.reliability.verdict import Outcome, judge

__all__ = ["Batch", "batches", "flown_by", "fly", "fly_batch", "moments", "representative"]

CPU_LIMIT_S = 120
"""A flight takes a few seconds of processor time; one that takes so many hangs."""

_BATCH = 8
_MOMENT_S = 4.0
"""How long after a phase's beginning something may happen at a random moment."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Flights that share their way to a phase.

    Attributes:
        phase: Which.
        seed: Of all of them.
        cases: What happens then, one in each flight; all with the same autopilot.
        later_s: From the phase's beginning on until it happens, s.
    """

    phase: Phase
    seed: int
    cases: tuple[Case, ...]
    later_s: float = 0.0

    @property
    def autopilot(self) -> Firmware:
        """What flies the vehicles."""
        return self.cases[0].autopilot


def batches(seeds: Sequence[int], cases: Iterable[Case] = CASES, phases: Iterable[Phase] = Phase) -> list[Batch]:
    """All that is to be flown, seed by seed."""
    cases, phases = tuple(cases), tuple(phases)
    found = []
    for seed in seeds:
        for phase in phases:
            for autopilot in FIRMWARES:
                flown = tuple(case for case in cases if phase in case.expected and case.autopilot == autopilot)
                found += [Batch(phase, seed, flown[i : i + _BATCH]) for i in range(0, len(flown), _BATCH)]
    return found


def representative() -> list[Batch]:
    """What every test run flies."""
    by_name = {case.name: case for case in CASES}
    return [
        batch
        for phase, names in REPRESENTATIVE.items()
        for batch in batches((1,), [by_name[name] for name in names], (phase,))
    ]


def moments(count: int, vehicles: Sequence[int]) -> list[Batch]:
    """Flights in which what happens, to whom and when is drawn, each from its seed."""
    found = []
    for seed in range(1, count + 1):
        draw = random.Random(seed)
        case = draw.choice(ANYTIME).happening_to(draw.choice(vehicles))
        found.append(Batch(draw.choice(ORDINARY), seed, (case,), draw.uniform(0.0, _MOMENT_S)))
    return found


def fly(lab: Scenario, todo: Sequence[Batch], workers: int) -> Iterator[Outcome]:
    """Fly batches in several processes; outcomes as they come.

    Raises:
        RuntimeError: The processes ended before all was flown.
    """
    warm_kernels()
    context = multiprocessing.get_context("fork")  # what is to be done is inherited; reactions cannot be pickled
    taken = context.Value("i", 0)
    outcomes: SimpleQueue[Outcome] = context.SimpleQueue()
    processes = [context.Process(target=_work, args=(lab, todo, taken, outcomes)) for _ in range(workers)]
    for process in processes:
        process.start()
    for _ in range(sum(len(batch.cases) for batch in todo)):
        while outcomes.empty():
            if not any(process.is_alive() for process in processes) and outcomes.empty():
                raise RuntimeError("the processes that fly ended before all was flown")
            time.sleep(0.05)
        yield outcomes.get()
    for process in processes:
        process.join()


def _work(lab: Scenario, todo: Sequence[Batch], taken: Synchronized[int], outcomes: SimpleQueue[Outcome]) -> None:
    """Fly one batch after the other until none is left."""
    while True:
        with taken.get_lock():
            index, taken.value = taken.value, taken.value + 1
        if index >= len(todo):
            return
        for outcome in fly_batch(lab, todo[index]):
            outcomes.put(outcome)


def fly_batch(lab: Scenario, batch: Batch) -> Iterator[Outcome]:
    """Fly one batch; a flight that crashes or hangs fails without harming the others."""
    lab = flown_by(lab, batch.autopilot)
    flight = Flight(lab, batch.seed)
    try:
        flight.fly_to(batch.phase)
    except NotReachedError as error:
        yield from (_failed(case, batch, f"without a fault the phase is not reached: {error}") for case in batch.cases)
        return
    if batch.later_s > 0.0:
        flight.run(batch.later_s)
    for case in batch.cases:
        yield _in_child(flight, lab, case, batch)


def flown_by(lab: Scenario, autopilot: Firmware) -> Scenario:
    """The scenario with another autopilot in all vehicles."""
    vehicles = tuple(vehicle.model_copy(update={"autopilot": autopilot}) for vehicle in lab.vehicles)
    return lab.model_copy(update={"vehicles": vehicles})


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
    outcome = pickle.loads(answer)  # noqa: S301 - of a fork of this very process, over a pipe that nobody else has
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
    return Outcome(case.name, batch.phase.value, batch.seed, (failure,), "", None, None, 0.0, None, 0.0, 0.0)
