"""``arvi plan``: plan one problem file and print the plan as JSON.

Everything heavy is imported when the command runs, so that ``arvi --help`` stays quick.
"""

from __future__ import annotations

import json
import math
import time
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs.arguments import refuse

if TYPE_CHECKING:
    from onboard.planning.plan import Plan, Progress
    from onboard.planning.planner import Planner
    from onboard.planning.problem import Problem

__all__ = ["Algorithm", "plan", "plan_document"]

_DEFAULT_TIME_S = 0.5
_MAX_TIME_S = 3600.0
_NODES_PER_S = 10_000_000  # more than any machine makes
_SMALLEST_NODE_LIMIT = 100_000
_LARGEST_NODE_LIMIT = 8_000_000


class Algorithm(StrEnum):
    """What ``--algorithm`` may be."""

    ARVI = "arvi"
    RVI = "rvi"
    FVI = "fvi"


def plan(
    problem: Annotated[Path, typer.Argument(help="Problem file, format arvi-problem/1.", show_default=False)],
    algorithm: Annotated[Algorithm, typer.Option(help="Which search.")] = Algorithm.ARVI,
    time_s: Annotated[
        float | None, typer.Option("--time", help=f"Seconds to search; {_DEFAULT_TIME_S} unless --nodes is given.")
    ] = None,
    nodes: Annotated[int | None, typer.Option(help="Successors to generate: the repeatable alternative.")] = None,
    epsilon: Annotated[float | None, typer.Option(help="ε of rvi (algebraic redundancy).")] = None,
    delta: Annotated[float | None, typer.Option(help="δ of rvi, m (trajectory crossing).")] = None,
    plot: Annotated[Path | None, typer.Option(help="Write a picture of the plan (PNG, SVG or PDF).")] = None,
) -> None:
    """Plan one problem and print the plan as JSON."""
    from onboard.planning.problem_file import ProblemFileError, load_problem  # noqa: PLC0415

    try:
        _check_options(algorithm, time_s, nodes, epsilon, delta, plot)
        loaded = load_problem(problem)
        planner = _make_planner(time_s, nodes)
        found = _search(planner, loaded, algorithm, time_s, nodes, epsilon or 0.0, delta or 0.0)
    except (ProblemFileError, ValueError) as error:
        refuse(f"arvi plan: {error}")
    if plot is not None:
        _draw(loaded, found, planner, plot)
    typer.echo(json.dumps(plan_document(found), indent=1, allow_nan=False))


def plan_document(found: Plan) -> dict[str, Any]:
    """A plan as JSON data. ∞ and "no limit" become null."""
    return {
        "controls": found.controls.tolist(),
        "poses": found.poses.tolist(),
        "cost": found.cost,
        "lower_bound": found.lower_bound,
        "epsilon": _finite(found.epsilon),
        "delta": _finite(found.delta),
        "width": found.width,
        "complete": found.complete,
        "feasible": found.feasible,
        "nodes_generated": found.nodes_generated,
        "nodes_expanded": found.nodes_expanded,
        "elapsed_s": found.elapsed_s,
        "history": [_progress_document(progress) for progress in found.history],
    }


def _progress_document(progress: Progress) -> dict[str, Any]:
    return {
        "elapsed_s": progress.elapsed_s,
        "cost": progress.cost,
        "epsilon": _finite(progress.epsilon),
        "delta": _finite(progress.delta),
        "width": progress.width,
        "bound_holds": progress.bound_holds,
    }


def _finite(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _check_options(
    algorithm: Algorithm,
    time_s: float | None,
    nodes: int | None,
    epsilon: float | None,
    delta: float | None,
    plot: Path | None,
) -> None:
    if time_s is not None and not 0.0 < time_s <= _MAX_TIME_S:
        raise ValueError(f"--time: must be between 0 and {_MAX_TIME_S:g} s, is {time_s:g}")
    if nodes is not None and nodes < 1:
        raise ValueError(f"--nodes: must be positive, is {nodes}")
    for name, value in (("--epsilon", epsilon), ("--delta", delta)):
        if value is not None and algorithm is not Algorithm.RVI:
            raise ValueError(f"{name}: only for --algorithm rvi; {algorithm} has no such parameter")
        if value is not None and not 0.0 <= value < math.inf:
            raise ValueError(f"{name}: must be finite and not negative, is {value:g}")
    if plot is not None and plot.suffix.lower() not in (".png", ".svg", ".pdf"):
        raise ValueError(f"--plot: a name that ends in .png, .svg or .pdf is needed, got {plot}")


def _make_planner(time_s: float | None, nodes: int | None) -> Planner:
    """A planner with compiled kernels and no more memory than the budget can fill."""
    from onboard.planning.planner import DEFAULT_NODE_LIMIT, Planner  # noqa: PLC0415
    from onboard.planning.warmup import warm_kernels  # noqa: PLC0415

    warm_kernels()
    limits = [_LARGEST_NODE_LIMIT]
    if nodes is not None:
        limits.append(nodes)
    if time_s is not None:
        limits.append(max(int(time_s * _NODES_PER_S), _SMALLEST_NODE_LIMIT))
    if nodes is None and time_s is None:
        limits.append(DEFAULT_NODE_LIMIT)
    return Planner(max(min(limits), _SMALLEST_NODE_LIMIT))


def _search(
    planner: Planner,
    problem: Problem,
    algorithm: Algorithm,
    time_s: float | None,
    nodes: int | None,
    epsilon: float,
    delta: float,
) -> Plan:
    from onboard.planning.plan import Budget  # noqa: PLC0415

    if time_s is None and nodes is None and algorithm is Algorithm.ARVI:
        time_s = _DEFAULT_TIME_S
    deadline_s = None if time_s is None else time.perf_counter() + time_s
    budget = Budget(deadline_s=deadline_s, nodes=nodes)
    if algorithm is Algorithm.FVI:
        return planner.fvi(problem, budget)
    if algorithm is Algorithm.RVI:
        return planner.rvi(problem, epsilon, delta, budget)
    return planner.plan(problem, budget)


def _draw(problem: Problem, found: Plan, planner: Planner, path: Path) -> None:
    from onboard.planning.plot import draw_plan  # noqa: PLC0415 - matplotlib: only for who wants a picture

    try:
        draw_plan(problem, found, planner.open_segments(), path)
    except OSError as error:
        refuse(f"arvi plan: --plot: {path}: {error.strerror or error}")
