"""One moment of a trial as a picture (the paper's Fig. 1), and a whole trial as a short film."""

from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Ellipse, Patch, Wedge
from numpy.typing import NDArray

from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import Pose
from sim_bridge.experiments.figures import BLUE, GREEN, ORANGE
from sim_bridge.experiments.records import TrialTask
from sim_bridge.experiments.trial import build_world
from sim_bridge.figure_files import STYLE, save
from sim_bridge.lockstep.world import LockstepWorld

__all__ = ["animate", "draw_world", "snapshot"]

_CHI2_95 = 5.991
"""95 % of a two-dimensional Gaussian lies within this squared Mahalanobis distance."""


def snapshot(task: TrialTask, step: int, path: Path) -> list[Path]:
    """Run a trial up to a step and draw it; the files."""
    world = build_world(task.setting, task.seed)
    for _ in range(step + 1):
        world.step()
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(7.0, 7.0))
        draw_world(figure.subplots(), world, task)
        figure.legend(handles=_legend(), loc="outside lower center", ncols=4)
        return save(figure, path)


def animate(task: TrialTask, path: Path, every: int, on_step: Callable[[int], None] = lambda _: None) -> Path:
    """Run a trial and write it as a GIF with a frame for every few steps; the file."""
    world = build_world(task.setting, task.seed)
    with mpl.rc_context({**STYLE, "figure.constrained_layout.use": False}):
        figure = Figure(figsize=(5.2, 5.2))
        axes = figure.subplots()

        def frame(number: int) -> list[Any]:
            while world.next_step <= number * every:
                world.step()
                on_step(world.next_step)
            axes.clear()
            draw_world(axes, world, task)
            return []

        frames = max(1, math.ceil(task.steps / every))
        film = FuncAnimation(figure, frame, frames=frames, init_func=list, blit=False, repeat=False)
        target = path.with_suffix(".gif")
        film.save(target, writer=PillowWriter(fps=12), dpi=90)
    return target


def draw_world(axes: Axes, world: LockstepWorld, task: TrialTask) -> None:
    """East to the right, north up: explored area, robots with fields of view and plans, estimates, truth, landmarks.

    What several robots know of one target is drawn once, as the one who knows it best has it.
    """
    scenario = task.setting.scenario("experiment")
    sensor = scenario.sensor.build()
    _draw_explored(axes, world)
    fence = np.array([*scenario.mission.fence, scenario.mission.fence[0]])
    axes.plot(fence[:, 1], fence[:, 0], color="black", linewidth=1.0)
    for robot in world.robots:
        agent = robot.agent
        _draw_robot(axes, robot.motion.pose, sensor)
        if agent.own_plan is not None:
            plan = agent.trajectory(agent.own_plan)
            times = np.linspace(plan.start_s, plan.end_s, 61)
            poses = [plan.reference(float(time_s)).pose for time_s in times]
            axes.plot([p.east_m for p in poses], [p.north_m for p in poses], color=GREEN, linewidth=0.9, alpha=0.8)
        for north_m, east_m in agent.landmarks.values():
            axes.plot(east_m, north_m, "+", color=BLUE, markersize=5)
    for target in world.targets.truth():
        axes.plot(target.east_m, target.north_m, "x", color="black", markersize=5)
    _draw_estimates(axes, world)
    time_s = (world.next_step - 1) * scenario.mission.step_s
    axes.set(title=f"step {world.next_step - 1}, {time_s:.1f} s", xlabel="east, m", ylabel="north, m", aspect="equal")
    axes.grid(visible=False)
    margin = 0.03 * float(np.ptp(fence))
    axes.set_xlim(fence[:, 1].min() - margin, fence[:, 1].max() + margin)
    axes.set_ylim(fence[:, 0].min() - margin, fence[:, 0].max() + margin)


def _legend() -> list[Artist]:
    """What the signs of :func:`draw_world` mean."""

    def sign(marker: str, color: str, label: str, size: float = 6.0) -> Artist:
        return Line2D([], [], color=color, marker=marker, linestyle="", markersize=size, label=label)

    return [
        sign("^", GREEN, "robot", 9.0),
        Patch(color=GREEN, alpha=0.15, label="field of view"),
        Line2D([], [], color=GREEN, linewidth=0.9, label="plan"),
        sign("+", BLUE, "landmark"),
        sign("x", "black", "target"),
        sign(".", ORANGE, "estimate"),
        Patch(color=ORANGE, alpha=0.25, label="95 % ellipse"),
        Patch(color="0.75", label="unexplored"),
    ]


def _draw_explored(axes: Axes, world: LockstepWorld) -> None:
    """White where somebody has looked, grey where nobody has."""
    grid = world.robots[0].agent.grid
    explored: NDArray[np.bool_] = np.any([robot.agent.grid.explored for robot in world.robots], axis=0)
    shade = np.where(explored, 1.0, np.where(grid.inside, 0.75, np.nan))
    north, east = grid.origin
    rows, columns = shade.shape
    extent = (east, east + columns * grid.cell_m, north, north + rows * grid.cell_m)
    axes.imshow(
        shade, origin="lower", extent=extent, cmap="gray", vmin=0.0, vmax=1.0, interpolation="nearest", zorder=0
    )


def _draw_robot(axes: Axes, pose: Pose, sensor: RangeBearingSensor) -> None:
    # matplotlib's angles run anticlockwise from east, headings clockwise from north
    heading_deg = 90.0 - math.degrees(pose.yaw_rad)
    half_deg = math.degrees(0.5 * sensor.fov_rad)
    axes.add_patch(
        Wedge((pose.east_m, pose.north_m), sensor.max_range_m, heading_deg - half_deg, heading_deg + half_deg,
              facecolor=GREEN, edgecolor=GREEN, alpha=0.15)
    )  # fmt: skip
    axes.plot(pose.east_m, pose.north_m, marker=(3, 0, heading_deg - 90.0), color=GREEN, markersize=9)


def _draw_estimates(axes: Axes, world: LockstepWorld) -> None:
    tracks = [track for robot in world.robots for track in robot.agent.tracks.values()]
    for target_id in sorted({track.target_id for track in tracks}):
        best = min((track for track in tracks if track.target_id == target_id), key=lambda track: track.entropy_nats)
        north_m, east_m = best.mean[:2]
        values, vectors = np.linalg.eigh(best.covariance[:2, :2])
        width, height = 2.0 * np.sqrt(_CHI2_95 * values)
        tilt_deg = math.degrees(math.atan2(vectors[0, 0], vectors[1, 0]))
        axes.add_patch(
            Ellipse((east_m, north_m), width, height, angle=tilt_deg, facecolor=ORANGE, edgecolor=ORANGE, alpha=0.25)
        )
        axes.plot(east_m, north_m, ".", color=ORANGE, markersize=5)
