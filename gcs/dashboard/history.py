"""What was: figures over time for the charts, trails for the map, events for the list. All bounded."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Sequence

from gcs.dashboard.view import Columns, MapBounds
from gcs.dashboard.wording import SILENT_S
from gcs.team import Event, Places, TeamState
from gcs.vehicle_state import VehicleState

__all__ = ["ROWS", "TRAIL_S", "EventLog", "FlightHistory"]

ROWS = 1200
"""Samples that are kept: ten minutes."""

_PERIOD_S = 0.5
TRAIL_S = 20.0
_TRAIL_PERIOD_S = 0.2
"""A replay has places as often: :data:`~gcs.recording.player.PLACE_TICKS`."""
_SLACK_S = 0.05
"""Moments come when they come: one that is early by this much is taken."""

_EVENTS = 2000


class FlightHistory:
    """Samples a team's figures twice a second, and places five times a second.

    Args:
        vehicle_ids: System ids, in the scenario's order.
        bounds: Which places belong in a trail.

    Attributes:
        serial: Samples taken so far, also those that are forgotten.
        restarts: How often all has been forgotten: a replay goes back.
    """

    def __init__(self, vehicle_ids: Sequence[int], bounds: MapBounds) -> None:
        self.serial = 0
        self.restarts = 0
        self._ids = tuple(vehicle_ids)
        self._bounds = bounds
        self._rows: deque[dict[str, float]] = deque(maxlen=ROWS)
        self._trails: dict[int, deque[tuple[float, float, float]]] = {i: deque() for i in self._ids}
        self._next_s = -math.inf
        self._next_place_s = -math.inf

    def add(self, team: TeamState) -> None:
        """Take what is due: places for the trails, figures for the charts."""
        self.add_places(team.time_s, tuple((v.id, v.north_m, v.east_m) for v in team.vehicles))
        self.add_figures(team)

    def add_figures(self, team: TeamState) -> None:
        """Take figures for the charts if they are due."""
        if team.time_s < self._next_s:
            return
        self._next_s = team.time_s + _PERIOD_S - _SLACK_S
        self.serial += 1
        row = {
            "time": team.time_s,
            "entropy": _known(team.figures.entropy_now_nats),
            "rmse": _known(team.figures.rmse_now_m),
            "found": float(team.discovered),
            "explored": 100.0 * team.explored.share if team.explored is not None else math.nan,
            "silent": SILENT_S,
            "budget": max((_milliseconds(v.planning_budget_s) for v in team.vehicles), default=math.nan),
        }
        for vehicle in team.vehicles:
            row |= _vehicle_row(vehicle)
        self._rows.append(row)

    def add_places(self, time_s: float, places: Places) -> None:
        """Take places at a UNIX time if they are due; what cannot be true leaves no trail."""
        if time_s < self._next_place_s:
            return
        self._next_place_s = time_s + _TRAIL_PERIOD_S - _SLACK_S
        for trail in self._trails.values():
            while trail and trail[0][0] <= time_s - TRAIL_S:
                trail.popleft()
        for vehicle_id, north_m, east_m in places:
            if self._bounds.plausible(north_m, east_m):
                self._trails[vehicle_id].append((time_s, _rounded(east_m), _rounded(north_m)))

    def restart(self) -> None:
        """Forget everything."""
        self.restarts += 1
        self._rows.clear()
        for trail in self._trails.values():
            trail.clear()
        self._next_s = self._next_place_s = -math.inf

    def columns(self, since: int = 0) -> Columns:
        """The samples after a serial number, as far as they are kept."""
        count = min(len(self._rows), self.serial - since)
        rows = list(self._rows)[len(self._rows) - count :] if count > 0 else []
        return {name: [row[name] for row in rows] for name in self.names}

    @property
    def names(self) -> tuple[str, ...]:
        """The columns."""
        return (
            *("time", "entropy", "rmse", "found", "explored", "silent", "budget"),
            *(f"{name}_{i}" for i in self._ids for name in ("planning", "cost", "bound", "age", "loss", "radio")),
        )

    def trails(self) -> Columns:
        """East m and north m of each vehicle's last 20 s."""
        trails = self._trails.values()
        return {
            "xs": [[east_m for _, east_m, _ in trail] for trail in trails],
            "ys": [[north_m for _, _, north_m in trail] for trail in trails],
        }


class EventLog:
    """The latest events.

    Attributes:
        serial: Events taken so far.
    """

    def __init__(self) -> None:
        self.serial = 0
        self._events: deque[Event] = deque(maxlen=_EVENTS)

    def add(self, event: Event) -> None:
        """Take an event."""
        self.serial += 1
        self._events.append(event)

    def restart(self) -> None:
        """Forget everything: a replay goes back."""
        self.serial += 1
        self._events.clear()

    def find(self, words: str = "", severity: int = 7, limit: int = 200) -> list[Event]:
        """Events, newest first.

        Args:
            words: All of these words are in source or text; case does not matter.
            severity: MAV_SEVERITY of the least severe events wanted.
            limit: At most so many.
        """
        wanted = words.casefold().split()
        found: list[Event] = []
        for event in reversed(self._events):
            if len(found) == limit:
                break
            text = f"{event.source} {event.text}".casefold()
            if event.severity <= severity and all(word in text for word in wanted):
                found.append(event)
        return found


def _vehicle_row(vehicle: VehicleState) -> dict[str, float]:
    plan = vehicle.plan if vehicle.plan_age_s is not None else None
    return {
        f"planning_{vehicle.id}": _milliseconds(vehicle.planning_time_s) if plan is not None else math.nan,
        f"cost_{vehicle.id}": _known(plan.cost) if plan is not None else math.nan,
        f"bound_{vehicle.id}": _known(plan.lower_bound) if plan is not None else math.nan,
        f"age_{vehicle.id}": _known(vehicle.onboard_age_s),
        f"loss_{vehicle.id}": _percent(vehicle.link.loss if vehicle.link is not None else None),
        f"radio_{vehicle.id}": _percent(max(vehicle.peer_loss.values(), default=None)),
    }


def _known(value: float | None) -> float:
    """NaN, a gap in the line, for what is unknown or infinite."""
    return value if value is not None and math.isfinite(value) else math.nan


def _percent(share: float | None) -> float:
    return 100.0 * _known(share)


def _milliseconds(value_s: float | None) -> float:
    return 1e3 * _known(value_s)


def _rounded(value_m: float | None) -> float:
    return round(_known(value_m), 3)
