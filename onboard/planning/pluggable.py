"""Bring your own planner: a problem and a budget in, a plan out.

A planner is named in a configuration, ``use: package.module:Class`` or one of :data:`BUILT_IN`. The class is called
with a :class:`PlannerSetup` once for each robot, and its ``plan`` once for each epoch. The same class runs in the
lock-step world and on a vehicle. See docs/planners.md.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import TYPE_CHECKING, Protocol

import numpy as np
from numpy.typing import NDArray

from onboard.errors import OnboardError
from onboard.planning.certificate import replay
from onboard.planning.evaluation import follow
from onboard.planning.packing import pack_problem
from onboard.planning.plan import Budget, Plan
from onboard.planning.problem import Problem

if TYPE_CHECKING:
    from onboard.config.schema import Scenario

__all__ = ["BUILT_IN", "STATELESS", "PathPlanner", "PlannerError", "PlannerSetup", "load_planner", "plan_of"]

BUILT_IN: Mapping[str, str] = MappingProxyType(
    {
        "arvi": "onboard.planning.baselines.arvi:Arvi",
        "greedy": "onboard.planning.baselines.arvi:Greedy",
        "exhaustive": "onboard.planning.baselines.exhaustive:Exhaustive",
        "random": "onboard.planning.baselines.random_primitives:RandomPrimitives",
        "lawnmower": "onboard.planning.baselines.lawnmower:Lawnmower",
    }
)
"""Short names of the planners that come with the project."""

STATELESS = frozenset({"arvi", "greedy", "exhaustive"})
"""Of these, the ones that remember nothing from plan to plan: robots that plan in turn can share one."""


class PlannerError(OnboardError):
    """A planner that cannot be found or made."""


class PathPlanner(Protocol):
    """Plans for one robot, in one thread."""

    def plan(self, problem: Problem, budget: Budget) -> Plan:
        """A plan, back before the budget ends.

        Args:
            problem: Start, horizon, primitives, targets and landmarks, teammates' plans, fence.
            budget: Until when on which clock (``left_s`` is what is left), or a number of search nodes. A planner that
                is no search can ignore the nodes, never the deadline.
        """
        ...


@dataclass(frozen=True)
class PlannerSetup:
    """What a planner is made from.

    Attributes:
        scenario: Team, area, models.
        vehicle_id: System id of the robot that it plans for.
        seed: For whatever is random in it; different for each robot.
        options: ``planner.options`` of the configuration.
    """

    scenario: Scenario
    vehicle_id: int
    seed: int = 0
    options: Mapping[str, bool | int | float | str] = field(default_factory=dict)


def load_planner(name: str, setup: PlannerSetup) -> PathPlanner:
    """Import a planner and make it.

    Args:
        name: One of :data:`BUILT_IN`, or ``package.module:Class``.
        setup: Handed to the class.

    Raises:
        PlannerError: There is no such module or class, its constructor refuses, or it has no ``plan``.
    """
    target = BUILT_IN.get(name, name)
    module_name, _, class_name = target.partition(":")
    if not module_name or not class_name:
        raise PlannerError(f"planner {name!r}: give package.module:Class, or one of {', '.join(BUILT_IN)}")
    try:
        module = importlib.import_module(module_name)
    except ImportError as error:
        raise PlannerError(f"planner {name!r}: cannot import {module_name}: {error}") from error
    factory = getattr(module, class_name, None)
    if factory is None:
        raise PlannerError(f"planner {name!r}: {module_name} has no {class_name}")
    try:
        planner: PathPlanner = factory(setup)
    except (TypeError, ValueError, KeyError) as error:
        raise PlannerError(f"planner {name!r}: {class_name}(setup) failed: {error}") from error
    if not callable(getattr(planner, "plan", None)):
        raise PlannerError(f"planner {name!r}: {class_name} has no method plan(problem, budget)")
    return planner


def plan_of(problem: Problem, controls: NDArray[np.int64], *, nodes: int = 0, elapsed_s: float = 0.0) -> Plan:
    """A plan from controls alone: poses, the cost J of eq. (6), and no claim to any bound.

    Args:
        problem: What was planned for.
        controls: (T,) indices into its primitives; −1 stops where it is, and marks the plan as not feasible.
        nodes: Successors that were looked at.
        elapsed_s: Time that it took, s.

    Raises:
        ValueError: The controls have another length than the horizon, or an index does not exist.
    """
    controls = np.asarray(controls, dtype=np.int64)
    if controls.shape != (problem.horizon,):
        raise ValueError(f"controls: shape {controls.shape}, the horizon needs ({problem.horizon},)")
    if controls.min() < -1 or controls.max() >= len(problem.primitives):
        raise ValueError(f"controls: {controls.tolist()} are no indices of {len(problem.primitives)} primitives")
    poses = follow(problem, controls)
    packed = pack_problem(problem)
    return Plan(
        controls=controls,
        poses=poses,
        cost=float(replay(packed, poses, np.empty((2, packed.blocks.prior.shape[1])))),
        lower_bound=-np.inf,
        epsilon=np.inf,
        delta=np.inf,
        width=None,
        complete=False,
        feasible=bool((controls >= 0).all()),
        nodes_generated=nodes,
        nodes_expanded=nodes,
        elapsed_s=elapsed_s,
        history=(),
    )
