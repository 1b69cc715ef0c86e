"""What a planner gives back: controls, their poses and cost, and what is known about their quality."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

__all__ = ["Budget", "Plan", "Progress"]


@dataclass(frozen=True, slots=True)
class Budget:
    """How long a planner may search; the first limit reached ends it. The first (greedy) pass always completes.

    Attributes:
        deadline_s: Instant on ``time.perf_counter``'s clock at which the plan must be back, s; None for no deadline.
        nodes: Number of successors that may be generated; None for the planner's memory bound. With a node budget and
            no deadline the same problem gives the same plan on every run.
    """

    deadline_s: float | None = None
    nodes: int | None = None


@dataclass(frozen=True, slots=True)
class Progress:
    """One entry of the cost history: the state after a pass of ImprovePath that lowered the cost or proved a bound.

    Attributes:
        elapsed_s: Since the search began, s.
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
        elapsed_s: Time taken, s.
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
