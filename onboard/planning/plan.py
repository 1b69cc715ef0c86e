"""What a planner gives back: controls, their poses and cost, and what is known about their quality."""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

__all__ = ["Budget", "Plan", "Progress", "SearchClock"]


class SearchClock(IntEnum):
    """The clock that a search's time is counted on, by its number in Linux's ``clock_gettime``.

    A vehicle has to be done by an instant, so it counts elapsed time. An experiment asks what so much planning buys:
    there, time that the system gave to other processes must not count, or a budget would mean less on a busy machine.

    Attributes:
        MONOTONIC: Elapsed time, as ``time.perf_counter``.
        THREAD_CPU: Processor time of the thread that asks, as ``time.thread_time``; an instant of it means something
            to this thread only.
    """

    MONOTONIC = 1
    THREAD_CPU = 3

    def now_s(self) -> float:
        """The time on it, s."""
        return time.thread_time() if self is SearchClock.THREAD_CPU else time.perf_counter()


@dataclass(frozen=True, slots=True)
class Budget:
    """How long a planner may search; the first limit reached ends it. The first (greedy) pass always completes.

    Attributes:
        deadline_s: Instant on the clock at which the plan must be back, s; None for no deadline.
        nodes: Number of successors that may be generated; None for the planner's memory bound. With a node budget and
            no deadline the same problem gives the same plan on every run.
        clock: Of the deadline, and of the times that the plan tells.
    """

    deadline_s: float | None = None
    nodes: int | None = None
    clock: SearchClock = SearchClock.MONOTONIC

    @property
    def left_s(self) -> float:
        """Time until the deadline, s; negative after it, ∞ without one."""
        return math.inf if self.deadline_s is None else self.deadline_s - self.clock.now_s()


@dataclass(frozen=True, slots=True)
class Progress:
    """One entry of the cost history: the state after a pass of ImprovePath that lowered the cost or proved a bound.

    Attributes:
        elapsed_s: Since the search began, on the budget's clock, s.
        cost: Best J so far. After a start out of bounds, more than that by what the plan had more violation than the
            final one.
        epsilon: ε of the pass (∞ for the greedy one).
        delta: δ of the pass, m (∞ for the greedy one).
        width: W of the pass: nodes kept open per level; None for no limit.
        bound_holds: Whether the pass carries Theorem 1 (i): W did not bind.
    """

    elapsed_s: float
    cost: float
    epsilon: float
    delta: float
    width: int | None
    bound_holds: bool


@dataclass(frozen=True)
class Plan:
    """A T-step plan.

    Attributes:
        controls: (T,) indices into the problem's primitives; −1 is the stop primitive, used when nothing is feasible.
        poses: (T, 3) north m, east m, yaw rad after each step.
        cost: J of eq. (6), nats·2 (log det).
        lower_bound: A certified lower bound on the optimal J.
        epsilon: Smallest ε for which the suboptimality bound holds for this plan (∞ if none).
        delta: The δ that goes with it, m.
        width: W of the last pass; None for no limit.
        complete: Whether ImprovePath(0, 0, ∞) completed: the plan is optimal.
        feasible: Whether there is a primitive for every step that keeps fence, obstacles and separations (or, from a
            start outside, leads back in); False means that none was feasible at some step and the plan stops there.
        nodes_generated: Successors made.
        nodes_expanded: Nodes closed.
        elapsed_s: Time taken, on the budget's clock, s.
        history: How the cost fell.
    """

    controls: NDArray[np.int64]
    poses: NDArray[np.float64]
    cost: float
    lower_bound: float
    epsilon: float
    delta: float
    width: int | None
    complete: bool
    feasible: bool
    nodes_generated: int
    nodes_expanded: int
    elapsed_s: float
    history: tuple[Progress, ...]
