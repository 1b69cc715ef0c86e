"""The report of one flight."""

from __future__ import annotations

import json
import time
from pathlib import Path

from gcs.dashboard.palette import vehicle_colour
from gcs.dashboard.wording import number
from gcs.reports.figures import FIGURES, draw_all
from gcs.reports.flight_series import FlightSeries, VehicleSeries
from gcs.reports.page import EventRow, Page, Row, Table, write_page
from gcs.reports.tables import write_tables

__all__ = ["flight_facts", "write_report"]

_ERROR, _WARNING = 3, 4
_VEHICLE_HEADER = (
    "vehicle", "setpoints", "longest gap", "plans", "late", "plan time (p99)", "budget", "to peers", "off track (RMS)",
    "closest", "end",
)  # fmt: skip


def write_report(flight: FlightSeries, path: Path) -> Path:
    """Write the report's page, its figures and their numbers; the folder of figures and numbers.

    Raises:
        GroundError: They cannot be written.
    """
    about, scenario = flight.recording.about, flight.recording.scenario
    texts = [
        ("Configuration as flown", (flight.recording.folder / "scenario.yaml").read_text(encoding="utf-8")),
        ("Flight, versions, seed", json.dumps(about, indent=2, ensure_ascii=False)),
        ("Summary", json.dumps(flight.summary, indent=2, ensure_ascii=False)),
    ]
    started = time.strftime("%Y-%m-%d %H:%M:%S", time.localtime(flight.recording.start_s))
    seed, count = flight.summary["seed"], len(scenario.vehicles)
    software = about.get("software")
    commit = str(software["commit"])[:12] if isinstance(software, dict) and "commit" in software else None
    parts = [
        f"{count} vehicle{'s' * (count != 1)}", started, f"version {flight.summary['version']}",
        *([f"seed {seed}"] if seed is not None else []), *([f"commit {commit}"] if commit else []), flight.name,
    ]  # fmt: skip
    page = Page(
        title=f"{scenario.name}: {started}",
        heading=f"Flight of {scenario.name}",
        subtitle=" · ".join(parts),
        problems=[*flight.summary["problems"], *flight.recording.problems],
        facts=flight_facts(flight),
        tables=[Table("Vehicles", _VEHICLE_HEADER, _vehicle_rows(flight))],
        figures=draw_all(flight),
        beside="PNG, SVG, and their numbers as CSV",
        captions={name: caption for name, (_, caption) in FIGURES.items()},
        events=[
            EventRow(
                time=number(event.time_s - flight.zero_s, 1),
                severity="error" if event.severity <= _ERROR else "warning" if event.severity == _WARNING else "info",
                source=event.source,
                text=event.text,
            )
            for event in flight.events
        ],
        texts=texts,
    )
    folder = write_page(page, path)
    write_tables(flight, folder)
    return folder


def flight_facts(flight: FlightSeries) -> list[tuple[str, str]]:
    """The figures that matter most, with units."""
    summary, times = flight.summary, flight.discovery_times_s
    total = "?" if summary["targets"] is None else summary["targets"]
    explored = flight.final.explored
    return [
        ("mission time", number(summary["duration_s"], 1, " s")),
        ("targets found", f"{summary['discovered']} of {total}"),
        ("last one found after", number(times[-1] if times else None, 1, " s")),
        ("position RMSE", number(summary["rmse_m"], 2, " m")),
        ("entropy per target", number(summary["entropy_nats"], 2, " nats")),
        ("explored", "–" if explored is None else f"{100 * explored.share:.0f} %"),
        ("plans late", f"{sum(v['deadline_misses'] or 0 for v in summary['vehicles'])}"),
        ("processor", number(summary["cpu_cores"], 2, " cores")),
    ]


def _vehicle_rows(flight: FlightSeries) -> list[Row]:
    rows = []
    for i, vehicle in enumerate(flight.summary["vehicles"]):
        gap_s, p99_s = vehicle["setpoint_gap_max_s"], vehicle["planning_time_p99_s"]
        ending = (
            "landed, disarmed"
            if vehicle["landed"] and vehicle["disarmed"]
            else "not down"
            if vehicle["disarmed"] is False
            else "–"
        )
        cells = (
            str(vehicle["id"]),
            number(vehicle["setpoint_rate_hz"], 1, " Hz"),
            number(_milli(gap_s), 0, " ms"),
            number(vehicle["plans"], 0),
            number(vehicle["deadline_misses"], 0),
            number(_milli(p99_s), 0, " ms"),
            _budgets(flight.vehicles.get(vehicle["id"])),
            number(vehicle["peer_bytes_per_s"], 0, " B/s"),
            number(vehicle["tracking_error_rms_m"], 2, " m"),
            number(vehicle["min_separation_m"], 2, " m"),
            ending,
        )
        rows.append(Row(cells, vehicle_colour(i)))
    return rows


def _budgets(series: VehicleSeries | None) -> str:
    """From the shortest to the longest: who plans after others has less."""
    budgets_ms = [1e3 * plan.budget_s for plan in series.plans] if series is not None else []
    if not budgets_ms:
        return "–"
    least, most = f"{min(budgets_ms):.0f}", f"{max(budgets_ms):.0f}"
    return f"{least} ms" if least == most else f"{least}–{most} ms"


def _milli(value: float | None) -> float | None:
    return None if value is None else 1e3 * value
