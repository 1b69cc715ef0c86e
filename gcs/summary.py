"""The summary of a flight: one JSON object, and a table for the terminal.

What is not known is null; nothing is filled in.
"""

from __future__ import annotations

import json
import math
import os
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from rich.box import SIMPLE_HEAD
from rich.console import Group, RenderableType
from rich.table import Table
from rich.text import Text

from gcs.errors import GroundError
from gcs.team import TeamMonitor
from gcs.vehicle_state import VehicleFigures

__all__ = ["FlightFacts", "render", "summarize", "write_json"]


@dataclass(frozen=True, slots=True)
class FlightFacts:
    """What the summary says besides what the messages say.

    Attributes:
        scenario: The scenario's name.
        version: Of this program.
        seed: Of the simulation; None on hardware.
        mission_start_s: UNIX time of step 0; None if the team never started.
        mission_end_s: UNIX time at which landing began; None if the team never started.
        cpu_cores: CPU seconds of all processes per second of the flight; None if they are not ours.
        cpu_s: CPU seconds of each process, by name, where the system told.
        problems: What went wrong, one sentence each.
    """

    scenario: str
    version: str
    seed: int | None
    mission_start_s: float | None
    mission_end_s: float | None
    cpu_cores: float | None
    cpu_s: dict[str, float]
    problems: tuple[str, ...]


def summarize(team: TeamMonitor, facts: FlightFacts, now_s: float) -> dict[str, Any]:
    """The summary.

    ``targets`` is how many there are, ``discovered`` how many somebody has seen, ``time_to_discover_s`` says for each
    target, by its id, the time from step 0 to the first belief of it. ``rmse_m``, ``rmse_per_target_m`` and
    ``entropy_nats`` are those of :mod:`gcs.metrics`; a vehicle's figures those of
    :class:`gcs.vehicle_state.VehicleFigures`.
    """
    state, figures = team.state(now_s), team.figures()
    discovered = team.metrics.discovered
    ids = sorted({*(target.id for target in state.targets), *discovered})
    start_s, end_s = facts.mission_start_s, facts.mission_end_s
    return {
        "scenario": facts.scenario,
        "version": facts.version,
        "seed": facts.seed,
        "mission_start_s": _rounded(start_s, 6),
        "duration_s": _rounded(end_s - start_s if start_s is not None and end_s is not None else None, 2),
        "targets": state.target_count,
        "discovered": state.discovered,
        "rmse_m": _rounded(state.figures.rmse_m, 4),
        "rmse_per_target_m": _rounded(state.figures.rmse_per_target_m, 4),
        "entropy_nats": _rounded(state.figures.entropy_nats, 4),
        "time_to_discover_s": {
            str(target): _rounded(max(0.0, discovered[target] - start_s), 2)
            if target in discovered and start_s is not None
            else None
            for target in ids
        },
        "vehicles": [_vehicle(vehicle_id, figures[vehicle_id]) for vehicle_id in figures],
        "cpu_cores": _rounded(facts.cpu_cores, 3),
        "cpu_s": {name: _rounded(seconds, 2) for name, seconds in facts.cpu_s.items()},
        "problems": list(facts.problems),
    }


def write_json(summary: dict[str, Any], path: Path) -> None:
    """Write a summary so that whoever reads the file sees all of it or none.

    Raises:
        GroundError: It cannot be written.
    """
    text = json.dumps(summary, indent=2, allow_nan=False, ensure_ascii=False) + "\n"
    temporary = None
    try:
        handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        temporary = Path(name)
        with os.fdopen(handle, "w", encoding="utf-8") as file:
            file.write(text)
        temporary.chmod(0o644)
        temporary.replace(path)
    except OSError as error:
        if temporary is not None:
            temporary.unlink(missing_ok=True)
        raise GroundError(f"{path}: the summary cannot be written: {error.strerror or error}") from None


def render(summary: dict[str, Any]) -> RenderableType:
    """The summary as tables; only the problems of a team that never took off."""
    problems = [Text(f"! {problem}", style="red") for problem in summary["problems"]]
    if summary["duration_s"] is None and problems:
        return Group(*problems)
    times = summary["time_to_discover_s"]
    found = ", ".join(f"{target}: {seconds:.1f}" for target, seconds in times.items() if seconds is not None)
    total = "?" if summary["targets"] is None else summary["targets"]
    head = Table.grid(padding=(0, 3))
    head.add_column(style="dim")
    head.add_column()
    seed = "" if summary["seed"] is None else f", seed {summary['seed']}"
    head.add_row("flight", f"{summary['scenario']}{seed}, {_shown(summary['duration_s'], 1, ' s')}")
    head.add_row("targets found", Text(f"{summary['discovered']} of {total}", style="bold"))
    head.add_row("found after, s", found or "–")
    per_target = _shown(summary["rmse_per_target_m"], 3, " m per target")
    head.add_row("position RMSE", Text.assemble((_shown(summary["rmse_m"], 3, " m"), "bold"), f"   {per_target}"))
    head.add_row("entropy per target", _shown(summary["entropy_nats"], 2, " nats"))
    head.add_row("processor", _shown(summary["cpu_cores"], 2, " cores"))
    table = Table(box=SIMPLE_HEAD, header_style="dim", pad_edge=False, collapse_padding=True)
    for name in (
        "",
        "setpoints",
        "longest\ngap",
        "plans",
        "late",
        "plan time\n(p99)",
        "to peers",
        "off track\n(RMS)",
        "past\nfence",
        "closest",
    ):
        table.add_column(name, justify="right", no_wrap=True)
    table.add_column("end", no_wrap=True)
    for vehicle in summary["vehicles"]:
        table.add_row(
            str(vehicle["id"]),
            _shown(vehicle["setpoint_rate_hz"], 1, " Hz"),
            _shown(_milli(vehicle["setpoint_gap_max_s"]), 0, " ms"),
            _shown(vehicle["plans"], 0),
            _shown(vehicle["deadline_misses"], 0),
            _shown(_milli(vehicle["planning_time_p99_s"]), 0, " ms"),
            _shown(vehicle["peer_bytes_per_s"], 0, " B/s"),
            _off_track(vehicle),
            _shown(vehicle["true_outside_fence_max_m"], 2, " m"),
            _shown(vehicle["min_separation_m"], 2, " m"),
            _ending(vehicle),
        )
    return Group(head, table, *problems)


def _vehicle(vehicle_id: int, figures: VehicleFigures) -> dict[str, Any]:
    true = figures.true_tracking
    return {
        "id": vehicle_id,
        "setpoint_rate_hz": _rounded(figures.setpoint_rate_hz, 3),
        "setpoint_gap_max_s": _rounded(figures.setpoint_gap_max_s, 4),
        "plans": figures.plans,
        "deadline_misses": figures.deadline_misses,
        "planning_time_p99_s": _rounded(figures.planning_time_p99_s, 4),
        "planning_budget_s": _rounded(figures.planning_budget_s, 4),
        "peer_bytes_per_s": _rounded(figures.peer_bytes_per_s, 1),
        "peer_bytes_received_per_s": _rounded(figures.peer_bytes_received_per_s, 1),
        "tracking_error_rms_m": _rounded(figures.tracking_error_rms_m, 4),
        "true_tracking_error_rms_m": _rounded(true.position_rms_m if true is not None else None, 4),
        "true_tracking_error_max_m": _rounded(true.position_max_m if true is not None else None, 4),
        "true_yaw_error_rms_deg": _rounded(math.degrees(true.yaw_rms_rad) if true is not None else None, 2),
        "true_outside_fence_max_m": _rounded(true.outside_fence_max_m if true is not None else None, 3),
        "min_separation_m": _rounded(figures.min_separation_m, 3),
        "landed": figures.landed,
        "disarmed": figures.disarmed,
    }


def _ending(vehicle: dict[str, Any]) -> Text:
    if vehicle["landed"] and vehicle["disarmed"]:
        return Text("landed", style="green")
    if vehicle["disarmed"] is None:
        return Text("never heard", style="red")
    if vehicle["disarmed"]:
        return Text("did not fly", style="yellow")
    return Text("landed, still armed" if vehicle["landed"] else "not landed", style="red")


def _rounded(value: float | None, digits: int) -> float | None:
    """Null, too, for what is no number: JSON has none for it."""
    return None if value is None or not math.isfinite(value) else round(value, digits)


def _off_track(vehicle: dict[str, Any]) -> str:
    """Truly, with the heading's error, where that is known; else as the vehicle believes."""
    if vehicle["true_tracking_error_rms_m"] is None:
        return _shown(vehicle["tracking_error_rms_m"], 2, " m")
    return _shown(vehicle["true_tracking_error_rms_m"], 2, " m") + _shown(
        vehicle["true_yaw_error_rms_deg"], 0, "°", " "
    )


def _milli(value: float | None) -> float | None:
    return None if value is None else 1e3 * value


def _shown(value: float | None, digits: int, unit: str = "", before: str = "") -> str:
    return "–" if value is None else f"{before}{value:z.{digits}f}{unit}"
