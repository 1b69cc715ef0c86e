"""How values read: numbers with units, ages, states; what is unknown is a dash, what is absurd is shown as such."""

from __future__ import annotations

import math

from gcs.vehicle_state import VehicleState

__all__ = ["SILENT_S", "age_text", "flight_state_text", "number", "onboard_is_silent", "vehicle_is_silent"]

SILENT_S = 4.0
"""From this age of a heartbeat on a component is shown as silent."""

_LARGE = 1e5


def number(value: float | None, digits: int, unit: str = "") -> str:
    """A value with its unit; a dash when it is unknown."""
    if value is None or math.isnan(value):
        return "–"
    if math.isinf(value):
        return "∞" if value > 0.0 else "−∞"
    text = f"{value:.3g}" if abs(value) >= _LARGE else f"{value:z.{digits}f}"
    return f"{text.replace('-', '−')}{unit}"


def age_text(age_s: float | None) -> str:
    """How long ago."""
    return "never heard" if age_s is None else f"{number(max(0.0, age_s), 1)} s ago"


def flight_state_text(vehicle: VehicleState) -> str:
    """The flight state, or that it cannot be known."""
    if vehicle.flight_state is None:
        return "not heard"
    return "SILENT" if onboard_is_silent(vehicle) else vehicle.flight_state.name


def onboard_is_silent(vehicle: VehicleState) -> bool:
    """Whether an onboard process that was heard is no longer."""
    if vehicle.onboard_age_s is None:
        return vehicle.flight_state is not None
    return vehicle.onboard_age_s >= SILENT_S


def vehicle_is_silent(vehicle: VehicleState) -> bool:
    """Whether a component that was heard is no longer."""
    autopilot_silent = vehicle.autopilot_age_s is not None and vehicle.autopilot_age_s >= SILENT_S
    return autopilot_silent or onboard_is_silent(vehicle)
