"""Figures of a run: curves over time as in the paper's Fig. 2 and 4, means by arm, and what it cost.

Colours are those of Okabe and Ito, which colour-blind people tell apart, or a gradient of one brightness scale where
arms are values of a swept quantity.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from sim_bridge.experiments.statistics import ArmTrials, interval_curve
from sim_bridge.figure_files import STYLE

__all__ = ["BLUE", "GREEN", "ORANGE", "draw_costs", "draw_curves", "draw_means"]

BLUE, ORANGE, GREEN = "#0072B2", "#D55E00", "#009E73"
_COLORS = (BLUE, ORANGE, GREEN, "#CC79A7", "#E69F00", "#56B4E9", "#000000")
_LINES = ("-", "--", ":")

_PANELS = (
    ("entropy_nats", "entropy per known target, nats"),
    ("known_by_robot", "targets known to a robot"),
    ("rmse_per_target_m", "position RMSE per known target, m"),
)
_COSTS = (
    ("planning_ms", "processor time per plan, ms", 1.0),
    ("messages_per_robot_step", "messages per robot and step", 1.0),
    ("bytes_per_robot_step", "kB per robot and step", 1e-3),
    ("cpu_ms_per_robot_step", "processor time per robot\nand step, ms", 1.0),
    ("peak_memory_mb", "peak memory of a trial, MB", 1.0),
)
_MAX_POINTS = 160
_FEW_TRIALS = 4
"""With fewer, each trial is drawn, for a band would say little."""
_CROWD = len(_COLORS)
"""With more arms only means are drawn, for bands would hide each other; their intervals are in the other figure."""
_LOG_RATIO = 8.0
"""Positive curves that differ by more than this share a logarithmic axis."""


class _Look(NamedTuple):
    color: Any
    line: str


def draw_curves(arms: Sequence[ArmTrials], *, ordered: bool = False) -> Figure:
    """Entropy, known targets and RMSE over time: mean of the trials; with its 95 % band, or each trial if they are few.

    Args:
        arms: What to draw.
        ordered: Whether they are values of a swept quantity, in its order.
    """
    with mpl.rc_context(STYLE):
        rows = math.ceil(len(arms) / 5)
        figure = Figure(figsize=(11.0, 3.3 + 0.25 * rows))
        for axes, (column, title) in zip(_row(figure, len(_PANELS)), _PANELS, strict=True):
            for look, arm in zip(_looks(len(arms), ordered), arms, strict=True):
                _draw_curve(axes, arm, column, look, alone=len(arms) > _CROWD)
            axes.set(title=title, xlabel="time, s")
            if column == "rmse_per_target_m":
                _scale_positive(axes)
        figure.legend(*figure.axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5, fontsize=8)
        return figure


def draw_means(summary: Mapping[str, Any]) -> Figure:
    """The same three by arm: mean over time, with the 95 % interval over trials."""
    arms = summary["arms"]
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(11.0, 0.9 + 0.3 * len(arms)))
        axes = _row(figure, len(_PANELS))
        for axis, (column, title) in zip(axes, _PANELS, strict=True):
            _draw_by_arm(axis, arms, [arm["time_mean"][column] for arm in arms], 1.0)
            axis.set(title=f"{title},\nmean over time")
        _label_arms(axes, arms)
        return figure


def draw_costs(axis: str | None, summary: Mapping[str, Any]) -> Figure:
    """Planning time, messages and bytes, processor time and memory: against the swept value, or by arm."""
    arms = summary["arms"]
    swept = axis is not None and all(arm["value"] is not None for arm in arms)
    with mpl.rc_context(STYLE):
        figure = Figure(figsize=(13.0, 2.8 if swept else 1.2 + 0.3 * len(arms)))
        axes = _row(figure, len(_COSTS))
        for panel, (key, title, unit) in zip(axes, _COSTS, strict=True):
            values = [arm[key] for arm in arms]
            if swept:
                _draw_against(panel, [arm["value"] for arm in arms], values, unit, "all" if "cpu" in key else None)
                panel.set_xlabel(axis or "")
            else:
                _draw_by_arm(panel, arms, values, unit)
            if swept and key == "cpu_ms_per_robot_step":
                without = [arm["unplanned_ms_per_robot_step"] for arm in arms]
                _draw_against(panel, [arm["value"] for arm in arms], without, unit, "without planning", ORANGE)
                panel.legend(fontsize=8)
            panel.set(title=title)
            if swept:
                panel.set_ylim(bottom=0.0)
            else:
                panel.set_xlim(left=0.0)
        if not swept:
            _label_arms(axes, arms)
        return figure


def _draw_curve(axes: Axes, arm: ArmTrials, column: str, look: _Look, *, alone: bool) -> None:
    """The mean over trials; unless it is to stand alone, with what shows their spread."""
    every = math.ceil(arm.values["step"].shape[1] / _MAX_POINTS)
    time_s, values = arm.values["time_s"][0, ::every], arm.values[column][:, ::every]
    mean, low, high = interval_curve(values)
    count = len(arm.trials)
    label = arm.label if count >= _FEW_TRIALS else f"{arm.label} ({count} trial{'s' * (count > 1)})"
    axes.plot(time_s, mean, look.line, color=look.color, label=label, linewidth=1.5)
    if alone:
        return
    if count >= _FEW_TRIALS:
        axes.fill_between(time_s, low, high, color=look.color, alpha=0.13, linewidth=0.0)
    elif count > 1:
        axes.plot(time_s, values.T, look.line, color=look.color, linewidth=0.6, alpha=0.5)


def _scale_positive(axes: Axes) -> None:
    """From zero, or logarithmic where the curves' ends differ by an order of magnitude."""
    ends = np.array([np.asarray(line.get_ydata(), dtype=np.float64)[-1] for line in axes.lines])
    ends = ends[ends > 0.0]
    if len(ends) and ends.max() > _LOG_RATIO * ends.min():
        axes.set_yscale("log")
    else:
        axes.set_ylim(bottom=0.0)


def _draw_by_arm(axes: Axes, arms: Sequence[Any], values: Sequence[Mapping[str, Any]], unit: float) -> None:
    """A dot and its interval for each arm, one below the other."""
    for place, (look, value) in enumerate(zip(_looks(len(arms), ordered=False), values, strict=True)):
        if value["mean"] is None:
            continue
        if value["low"] is not None:
            axes.plot([unit * value["low"], unit * value["high"]], [place, place], color=look.color, linewidth=2.0)
        axes.plot(unit * value["mean"], place, "o", color=look.color)
    axes.set(yticks=range(len(arms)), yticklabels=[])
    axes.set_ylim(len(arms) - 0.5, -0.5)


def _draw_against(
    axes: Axes,
    places: Sequence[float],
    values: Sequence[Mapping[str, Any]],
    unit: float,
    label: str | None,
    color: str = BLUE,
) -> None:
    """A curve over the swept quantity, with intervals."""
    shown = [(x, value) for x, value in zip(places, values, strict=True) if value["mean"] is not None]
    axes.plot([x for x, _ in shown], [unit * value["mean"] for _, value in shown], "o-", color=color, label=label)
    for x, value in shown:
        if value["low"] is not None:
            axes.plot([x, x], [unit * value["low"], unit * value["high"]], color=color, linewidth=1.0)


def _label_arms(axes: Sequence[Axes], arms: Sequence[Any]) -> None:
    axes[0].set_yticklabels([arm["label"] for arm in arms])


def _row(figure: Figure, count: int) -> list[Axes]:
    return list(np.atleast_1d(figure.subplots(1, count)))


def _looks(count: int, ordered: bool) -> list[_Look]:
    """A colour and a kind of line for each arm."""
    if ordered and count > 2:
        return [_Look(mpl.colormaps["viridis"](0.9 * index / (count - 1)), "-") for index in range(count)]
    colors = len(_COLORS)
    return [_Look(_COLORS[index % colors], _LINES[index // colors % len(_LINES)]) for index in range(count)]
