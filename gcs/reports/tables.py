"""The numbers behind the figures, for figures of one's own: CSV files, an empty cell for what was not known."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Sequence
from pathlib import Path

from gcs.errors import GroundError
from gcs.reports.flight_series import FlightSeries

__all__ = ["write_tables"]

Cell = float | int | str | None


def write_tables(flight: FlightSeries, folder: Path) -> list[Path]:
    """Write ``series.csv``, a row each half second, and ``plans.csv``, a row for each plan; the files.

    Times are since step 0, s; columns carry their units.

    Raises:
        GroundError: They cannot be written.
    """
    columns: dict[str, Sequence[Cell]] = {
        "time_s": flight.times_s,
        "targets_found": flight.discovered,
        "rmse_m": flight.rmse_m,
        "entropy_nats": flight.entropy_nats,
        "explored_share": flight.explored_share,
    }
    for vehicle_id, series in flight.vehicles.items():
        columns |= {
            f"vehicle{vehicle_id}_state": [state.name if state is not None else None for state in series.states],
            f"vehicle{vehicle_id}_north_m": series.north_m,
            f"vehicle{vehicle_id}_east_m": series.east_m,
            f"vehicle{vehicle_id}_tracking_error_m": series.tracking_error_m,
            f"vehicle{vehicle_id}_link_loss": series.loss,
            f"vehicle{vehicle_id}_radio_loss": series.radio_loss,
            f"vehicle{vehicle_id}_neighbours": series.neighbours,
        }
    for target_id, entropies in flight.target_entropy_nats.items():
        columns[f"target{target_id}_entropy_nats"] = entropies
        columns[f"target{target_id}_error_m"] = flight.target_error_m[target_id]
    plans: list[tuple[Cell, ...]] = [
        (vehicle_id, plan.time_s, plan.planning_time_s, plan.budget_s)
        for vehicle_id, series in flight.vehicles.items()
        for plan in series.plans
    ]
    return [
        _write(folder / "series.csv", list(columns), zip(*columns.values(), strict=True)),
        _write(folder / "plans.csv", ["vehicle", "time_s", "planning_time_s", "budget_s"], plans),
    ]


def _write(path: Path, header: list[str], rows: Iterable[Sequence[Cell]]) -> Path:
    try:
        with path.open("w", encoding="utf-8", newline="") as file:
            writer = csv.writer(file)
            writer.writerow(header)
            writer.writerows([_shown(cell) for cell in row] for row in rows)
    except OSError as error:
        raise GroundError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _shown(cell: Cell) -> Cell:
    if isinstance(cell, float):
        return round(cell, 6) if math.isfinite(cell) else None
    return cell
