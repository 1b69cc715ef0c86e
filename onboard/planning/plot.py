"""A picture of a plan: the search tree, the chosen path, fields of view, and targets with their ellipses."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import Ellipse, Polygon, Wedge
from numpy.typing import NDArray

from onboard.planning.evaluation import posterior_covariances
from onboard.planning.plan import Plan
from onboard.planning.problem import Problem

__all__ = ["draw_plan"]

_CHI2_95 = 5.991464547107979  # 95 % quantile of χ² with two degrees of freedom
_BEFORE, _AFTER, _PATH = "tab:orange", "tab:green", "tab:blue"


def draw_plan(problem: Problem, plan: Plan, tree: NDArray[np.float64], path: Path) -> None:
    """Write the picture; the suffix of ``path`` chooses the file format.

    Args:
        problem: What was planned.
        plan: The plan.
        tree: (K, 2, 2) segments of the search tree, each from (north m, east m) to (north m, east m).
        path: Where to write.

    Raises:
        OSError: If the file cannot be written.
    """
    figure = Figure(figsize=(8.0, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.add_collection(LineCollection(list(tree[:, :, ::-1]), colors="0.8", linewidths=0.4, zorder=1))
    _draw_bounds(axes, problem)
    _draw_targets(axes, problem, plan)
    for teammate in problem.teammates:
        axes.plot(teammate.poses[:, 1], teammate.poses[:, 0], ".--", color="tab:purple", linewidth=1.0, zorder=4)
    _draw_path(axes, problem, plan)
    axes.set_aspect("equal", adjustable="datalim")
    axes.autoscale_view()
    axes.set_xlabel("east, m")
    axes.set_ylabel("north, m")
    axes.set_title(f"J = {plan.cost:.3f}, lower bound {plan.lower_bound:.3f}, {plan.nodes_generated} successors")
    axes.legend(loc="best", fontsize="small")
    figure.savefig(path, dpi=130)


def _draw_bounds(axes: Axes, problem: Problem) -> None:
    if problem.fence is not None:
        axes.add_patch(Polygon(problem.fence[:, ::-1], fill=False, edgecolor="tab:red", linewidth=1.5, label="fence"))
    if problem.obstacles is not None:
        obstacles = problem.obstacles
        rows, columns = obstacles.blocked.shape
        south, west = obstacles.origin_north_m, obstacles.origin_east_m
        axes.imshow(
            np.where(obstacles.blocked, 0.35, np.nan), origin="lower", cmap="gray", vmin=0.0, vmax=1.0, zorder=0,
            extent=(west, west + columns * obstacles.cell_m, south, south + rows * obstacles.cell_m),
        )  # fmt: skip


def _draw_targets(axes: Axes, problem: Problem, plan: Plan) -> None:
    """Each target's 95 % ellipse at the start, and at the end of the plan where it is expected then."""
    for index, block in enumerate(problem.blocks):
        at_end = block.mean
        for _ in range(problem.horizon):
            at_end = block.motion.transition(problem.step_s) @ at_end
        after = posterior_covariances(problem, block, plan.poses)[-1]
        for mean, covariance, colour, label in (
            (block.mean, block.covariance, _BEFORE, "target before, 95 %"),
            (at_end, after, _AFTER, "target after, 95 %"),
        ):
            axes.add_patch(_ellipse(mean, covariance, colour, label if index == 0 else None))
        axes.plot(block.mean[1], block.mean[0], "x", color="black", markersize=4.0, zorder=4)


def _ellipse(mean: NDArray[np.float64], covariance: NDArray[np.float64], colour: str, label: str | None) -> Ellipse:
    values, vectors = np.linalg.eigh(covariance[:2, :2])
    height, width = 2.0 * np.sqrt(_CHI2_95 * values)  # along the minor and the major axis
    major_north, major_east = vectors[:, 1]
    return Ellipse(
        (mean[1], mean[0]), width, height, angle=math.degrees(math.atan2(major_north, major_east)),
        fill=False, edgecolor=colour, linewidth=1.2, zorder=3, label=label,
    )  # fmt: skip


def _draw_path(axes: Axes, problem: Problem, plan: Plan) -> None:
    poses = np.vstack([problem.pose.as_tuple(), plan.poses])
    axes.plot(poses[:, 1], poses[:, 0], "o-", color=_PATH, markersize=3.0, zorder=5, label="plan")
    axes.plot(poses[0, 1], poses[0, 0], "s", color=_PATH, markersize=7.0, zorder=5, label="start")
    half_deg = 0.5 * math.degrees(problem.sensor.fov_rad)
    for north, east, yaw in plan.poses:
        middle_deg = 90.0 - math.degrees(yaw)  # the picture's angles are counterclockwise from east
        axes.add_patch(
            Wedge(
                (east, north),
                problem.sensor.max_range_m,
                middle_deg - half_deg,
                middle_deg + half_deg,
                facecolor=_PATH,
                edgecolor="none",
                alpha=0.04,
                zorder=2,
            )
        )
