"""The summary as a page of Markdown."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

__all__ = ["markdown"]

_COLUMNS = (
    ("entropy, nats", "time_mean", "entropy_nats", 2),
    ("known to a robot", "time_mean", "known_by_robot", 2),
    ("at the end", "last_step", "known_by_robot", 2),
    ("RMSE per target, m", "time_mean", "rmse_per_target_m", 2),
    ("tracked by a robot", "time_mean", "tracked_by_robot", 2),
)
_COSTS = (
    ("messages per robot and step", "messages_per_robot_step", 1, 1.0),
    ("kB per robot and step", "bytes_per_robot_step", 2, 1e-3),
    ("processor ms per robot and step", "cpu_ms_per_robot_step", 2, 1.0),
    ("without planning", "unplanned_ms_per_robot_step", 2, 1.0),
    ("peak memory, MB", "peak_memory_mb", 0, 1.0),
)


def markdown(summary: Mapping[str, Any]) -> str:
    """Tables of arms, costs and comparisons; a value is a mean over trials ± half of its 95 % confidence interval."""
    lines = [f"# {summary['experiment']}", "", summary["question"], ""]
    lines += ["| arm | trials | " + " | ".join(name for name, *_ in _COLUMNS) + " | ms per plan | nodes per plan |"]
    lines += ["|---|---" + "|---" * (len(_COLUMNS) + 2) + "|"]
    for arm in summary["arms"]:
        cells = [arm["label"], str(arm["trials"])]
        cells += [_interval(arm[group][key], digits) for _, group, key, digits in _COLUMNS]
        cells += [_interval(arm["planning_ms"], 1), _interval(arm["nodes_per_plan"], 0)]
        lines.append("| " + " | ".join(cells) + " |")
    lines += ["", "| arm | robots | targets | " + " | ".join(name for name, *_ in _COSTS) + " |"]
    lines += ["|---|---|---" + "|---" * len(_COSTS) + "|"]
    for arm in summary["arms"]:
        cells = [arm["label"], str(arm["robots"]), str(arm["targets"])]
        cells += [_interval(arm[key], digits, unit) for _, key, digits, unit in _COSTS]
        lines.append("| " + " | ".join(cells) + " |")
    if summary["comparisons"]:
        lines += ["", "| claim | metric | difference | holds |", "|---|---|---|---|"]
    for entry in summary["comparisons"]:
        answers = ("differs", "no difference shown") if entry["expect"] == "either" else ("yes", "no")
        holds = "too few trials" if entry["holds"] is None else answers[0 if entry["holds"] else 1]
        since = f" from step {entry['from_step']}" if entry["from_step"] else ""
        lines.append(
            f"| {entry['claim']} | {entry['metric']}{since}: {entry['arm']} − {entry['against']} "
            f"| {_interval(entry['difference'], 3)} | {holds} |"
        )
    return "\n".join(lines) + "\n"


def _interval(value: Mapping[str, float | None], digits: int, unit: float = 1.0) -> str:
    mean, low, high = value["mean"], value["low"], value["high"]
    if mean is None:
        return "–"
    text = f"{unit * mean:.{digits}f}"
    return text if low is None or high is None else f"{text} ± {0.5 * unit * (high - low):.{digits}f}"
