"""Figures of a run: curves over time as in the paper's Fig. 2 and 4, means by arm, and what it cost."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim_bridge.experiments.statistics import ArmTrials, interval_curve
from sim_bridge.figure_files import STYLE, save

__all__ = ["STYLE", "draw_costs", "draw_curves", "draw_means", "save"]

_PANELS = (
    ("entropy_nats", "entropy per known target, nats"),
    ("known_by_robot", "targets known to a robot"),
    ("rmse_per_target_m", "position RMSE per known target, m"),
)
_MAX_POINTS = 160


def draw_curves(arms: Sequence[ArmTrials]) -> Figure:
    """Entropy, known targets and RMSE over time: mean of the trials with its 95 % band."""
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 3.4))
        for axes, (column, title) in zip(_row(figure, len(_PANELS)), _PANELS, strict=True):
            for color, arm in zip(_colors(len(arms)), arms, strict=True):
                every = math.ceil(arm.values["step"].shape[1] / _MAX_POINTS)
                time_s = arm.values["time_s"][0, ::every]
                mean, low, high = interval_curve(arm.values[column][:, ::every])
                axes.plot(time_s, mean, color=color, label=arm.label, linewidth=1.4)
                axes.fill_between(time_s, low, high, color=color, alpha=0.15, linewidth=0.0)
            axes.set(title=title, xlabel="time, s")
        figure.axes[-1].set_ylim(bottom=0.0)
        figure.axes[0].legend(fontsize=8)
        return figure


def draw_means(summary: Mapping[str, Any]) -> Figure:
    """The same three by arm: mean over time, with the 95 % interval over trials."""
    arms = summary["arms"]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 0.9 + 0.32 * len(arms)))
        axes = _row(figure, len(_PANELS))
        for axis, (column, title) in zip(axes, _PANELS, strict=True):
            for place, (color, arm) in enumerate(zip(_colors(len(arms)), arms, strict=True)):
                value = arm["time_mean"][column]
                if value["mean"] is None:
                    continue
                if value["low"] is not None:
                    axis.plot([value["low"], value["high"]], [place, place], color=color, linewidth=2.5, alpha=0.5)
                axis.plot(value["mean"], place, "o", color=color)
            axis.set(title=title, yticks=range(len(arms)), yticklabels=[])
            axis.set_ylim(len(arms) - 0.5, -0.5)
        axes[0].set_yticklabels([arm["label"] for arm in arms])
        return figure


def draw_costs(axis: str | None, summary: Mapping[str, Any]) -> Figure:
    """Planning time, nodes, messages and bytes, time per step and memory, against the swept value or by arm."""
    arms = summary["arms"]
    numeric = all(arm["value"] is not None for arm in arms)
    places = [arm["value"] if numeric else index for index, arm in enumerate(arms)]
    panels: tuple[tuple[str, Callable[[Any], float | None]], ...] = (
        ("ms per plan", lambda arm: arm["planning_ms"]["mean"]),
        ("messages per robot and step", lambda arm: arm["messages_per_robot_step"]["mean"]),
        ("kB per robot and step", lambda arm: _thousandth(arm["bytes_per_robot_step"]["mean"])),
        ("processor ms per step of the team", lambda arm: arm["cpu_ms_per_step"]["mean"]),
        ("peak memory, MB", lambda arm: arm["peak_memory_mb"]),
    )
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 2.8))
        for axes, (title, pick) in zip(_row(figure, len(panels)), panels, strict=True):
            values = [pick(arm) for arm in arms]
            shown = [(x, y) for x, y in zip(places, values, strict=True) if y is not None]
            axes.plot([x for x, _ in shown], [y for _, y in shown], "o-" if numeric else "o")
            axes.set(title=title)
            axes.set_ylim(bottom=0.0)
            if numeric:
                axes.set_xlabel(axis or "")
            else:
                axes.set_xticks(places, [arm["label"] for arm in arms], rotation=45, ha="right", fontsize=7)
        return figure


def _thousandth(value: float | None) -> float | None:
    return None if value is None else value / 1e3


def _row(figure: Figure, count: int) -> list[Axes]:
    return list(np.atleast_1d(figure.subplots(1, count)))


def _colors(count: int) -> list[Any]:
    """Distinct for a few arms, a gradient for many."""
    if count <= 10:
        return [mpl.colormaps["tab10"](index) for index in range(count)]
    return [mpl.colormaps["viridis"](index / (count - 1)) for index in range(count)]
