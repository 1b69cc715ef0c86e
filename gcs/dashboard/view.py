"""What the map shows: a team's state to columns of plain numbers and texts, one table for each layer.

Everything that arrives from a radio may be absurd. What has no finite place, or one far outside the mission area, is
left out of the columns and said in words (:attr:`MapView.notices`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from gcs.dashboard.palette import ALARM, link_style, vehicle_colour
from gcs.dashboard.shapes import axis_angle, ellipse_95, planned_path
from gcs.dashboard.wording import SILENT_S, age_text, flight_state_text, number, vehicle_is_silent
from gcs.fusion import fuse
from gcs.metrics import Estimate, TargetState
from gcs.team import TeamState
from gcs.vehicle_state import VehicleState
from onboard.config import Scenario
from onboard.messages import PeerPlan

__all__ = ["BEST", "FUSED", "Columns", "MapBounds", "MapView", "estimate_columns"]

Columns = dict[str, list[Any]]
"""Column name to values, all of one length; positions are x = east m, y = north m."""

FUSED, BEST = "fused", "best"
"""Whose estimates are shown, when not one robot's: those of all joined, or each target's of smallest entropy."""

_FAR = 20.0
"""So many times its own size away from the mission area, a position is taken for nonsense."""


class MapBounds:
    """The mission area, and which positions can be true.

    Attributes:
        south_m: Smallest north coordinate of the fence, m.
        north_m: Largest, m.
        west_m: Smallest east coordinate, m.
        east_m: Largest, m.
    """

    def __init__(self, scenario: Scenario) -> None:
        norths, easts = zip(*scenario.mission.fence, strict=True)
        self.south_m, self.north_m = min(norths), max(norths)
        self.west_m, self.east_m = min(easts), max(easts)
        self._far_m = _FAR * math.hypot(self.north_m - self.south_m, self.east_m - self.west_m)

    def plausible(self, north_m: float | None, east_m: float | None) -> bool:
        """Whether a place is known and can be drawn."""
        if north_m is None or east_m is None:
            return False
        away_m = math.hypot(north_m - 0.5 * (self.south_m + self.north_m), east_m - 0.5 * (self.west_m + self.east_m))
        return away_m <= self._far_m  # False for NaN, too


@dataclass(frozen=True, slots=True)
class MapLayers:
    """One moment of the map; see :class:`MapView`.

    Attributes:
        vehicles: Place, heading and field of view of each vehicle.
        links: Radio links as segments.
        plans: Planned paths as lines.
        landmarks: Places of exploration landmarks.
        truth: True places of targets.
        notices: What cannot be drawn, in words.
    """

    vehicles: Columns
    links: Columns
    plans: Columns
    landmarks: Columns
    truth: Columns
    notices: tuple[str, ...]


class MapView:
    """Turns states into map layers; paths of plans are worked out once for each plan."""

    def __init__(self, scenario: Scenario) -> None:
        self.bounds = MapBounds(scenario)
        self._scenario = scenario
        self._primitives = scenario.primitive_set
        self._colours = {vehicle.id: vehicle_colour(i) for i, vehicle in enumerate(scenario.vehicles)}
        self._paths: dict[int, tuple[PeerPlan, tuple[list[float], list[float]]]] = {}

    def layers(self, team: TeamState) -> MapLayers:
        """The layers that do not depend on what a viewer has chosen."""
        drawn = [vehicle for vehicle in team.vehicles if self.bounds.plausible(vehicle.north_m, vehicle.east_m)]
        return MapLayers(
            vehicles=self._vehicles(drawn),
            links=_links(drawn),
            plans=self._plans(team.vehicles),
            landmarks=self._landmarks(team.vehicles),
            truth=self._truth(team.targets),
            notices=self._notices(team),
        )

    def _vehicles(self, vehicles: Sequence[VehicleState]) -> Columns:
        half_fov = 0.5 * math.radians(self._scenario.sensor.fov_deg)
        columns: Columns = {name: [] for name in _VEHICLE_COLUMNS}
        for vehicle in vehicles:
            silent = vehicle_is_silent(vehicle)
            heading = axis_angle(vehicle.yaw_rad) if vehicle.yaw_rad is not None else math.nan
            row = (
                _millimetres(vehicle.east_m),
                _millimetres(vehicle.north_m),
                str(vehicle.id),
                self._colours[vehicle.id],
                ALARM if silent else "#ffffff",
                0.35 if silent else 1.0,
                round(heading, 3),
                round(heading - half_fov, 3),
                round(heading + half_fov, 3),
                f"{flight_state_text(vehicle)}, {vehicle.mode or 'mode unknown'}",
                f"{number(vehicle.north_m, 2)} m N, {number(vehicle.east_m, 2)} m E, "
                f"{number(vehicle.height_m, 2)} m high",
                f"{number(vehicle.speed_m_s, 2, ' m/s')}, heading {_heading_text(vehicle.yaw_rad)}",
                f"position {age_text(vehicle.position_age_s)}, onboard process {age_text(vehicle.onboard_age_s)}",
            )
            for name, value in zip(_VEHICLE_COLUMNS, row, strict=True):
                columns[name].append(value)
        return columns

    def _plans(self, vehicles: Sequence[VehicleState]) -> Columns:
        columns: Columns = {"xs": [], "ys": [], "colour": [], "label": [], "quality": [], "search": []}
        for vehicle in vehicles:
            plan = vehicle.plan
            if plan is None or vehicle.plan_age_s is None or vehicle_is_silent(vehicle):
                continue
            if not self.bounds.plausible(plan.start.north_m, plan.start.east_m):
                continue
            easts, norths = self._path(vehicle.id, plan)
            columns["xs"].append(easts)
            columns["ys"].append(norths)
            columns["colour"].append(self._colours[vehicle.id])
            columns["label"].append(str(vehicle.id))
            columns["quality"].append(f"cost {number(plan.cost, 1)}, lower bound {number(plan.lower_bound, 1)}")
            columns["search"].append(
                f"{plan.nodes} nodes in {number(1e3 * plan.planning_time_s, 0)} of {number(1e3 * plan.budget_s, 0)} ms"
            )
        return columns

    def _landmarks(self, vehicles: Sequence[VehicleState]) -> Columns:
        columns: Columns = {"x": [], "y": [], "colour": [], "label": [], "place": []}
        for vehicle in vehicles:
            if vehicle_is_silent(vehicle):
                continue
            for north_m, east_m in vehicle.landmarks:
                if self.bounds.plausible(north_m, east_m):
                    columns["x"].append(_millimetres(east_m))
                    columns["y"].append(_millimetres(north_m))
                    columns["colour"].append(self._colours[vehicle.id])
                    columns["label"].append(str(vehicle.id))
                    columns["place"].append(f"{number(north_m, 2)} m N, {number(east_m, 2)} m E")
        return columns

    def _path(self, vehicle_id: int, plan: PeerPlan) -> tuple[list[float], list[float]]:
        known = self._paths.get(vehicle_id)
        if known is None or known[0] is not plan:
            known = (plan, planned_path(plan, self._primitives, self._scenario.mission.step_s))
            self._paths[vehicle_id] = known
        return known[1]

    def _truth(self, targets: Sequence[TargetState]) -> Columns:
        drawn = [t for t in targets if t.truth is not None and self.bounds.plausible(*t.truth)]
        places = [t.truth for t in drawn if t.truth is not None]
        return {
            "x": [_millimetres(east_m) for _, east_m in places],
            "y": [_millimetres(north_m) for north_m, _ in places],
            "label": [str(target.id) for target in drawn],
            "place": [f"{number(north_m, 2)} m N, {number(east_m, 2)} m E" for north_m, east_m in places],
            "error": [_error_text(target) for target in drawn],
        }

    def _notices(self, team: TeamState) -> tuple[str, ...]:
        notices = [
            f"vehicle {vehicle.id} says it is at {vehicle.north_m:.3g} m north, {vehicle.east_m:.3g} m east: not drawn"
            for vehicle in team.vehicles
            if vehicle.north_m is not None
            and vehicle.east_m is not None
            and not self.bounds.plausible(vehicle.north_m, vehicle.east_m)
        ]
        lost = [
            str(target.id)
            for target in team.targets
            if target.best is not None and not self.bounds.plausible(target.best.north_m, target.best.east_m)
        ]
        if lost:
            notices.append(f"estimates of targets {', '.join(lost)} are far outside the area: not drawn")
        return tuple(notices)


_VEHICLE_COLUMNS = (
    "x",
    "y",
    "label",
    "colour",
    "rim",
    "alpha",
    "heading",
    "fov_from",
    "fov_to",
    "state",
    "place",
    "motion",
    "age",
)


def estimate_columns(team: TeamState, bounds: MapBounds, chosen_by: int | str) -> Columns:
    """Targets' estimates with their 95 % ellipses.

    Args:
        team: The team.
        bounds: Which places can be drawn.
        chosen_by: Whose estimates: a robot's system id, :data:`FUSED` or :data:`BEST`.
    """
    columns: Columns = {
        name: [] for name in ("x", "y", "width", "height", "angle", "label", "place", "spread", "source", "error")
    }
    for target in team.targets:
        chosen = _chosen(target, chosen_by)
        if chosen is None or not bounds.plausible(chosen.north_m, chosen.east_m):
            continue
        ellipse = ellipse_95(chosen.covariance_m2) if chosen.covariance_m2 is not None else None
        major, minor, angle = ellipse or (0.0, 0.0, 0.0)
        columns["x"].append(_millimetres(chosen.east_m))
        columns["y"].append(_millimetres(chosen.north_m))
        columns["width"].append(_millimetres(major))
        columns["height"].append(_millimetres(minor))
        columns["angle"].append(round(angle, 3))
        columns["label"].append(str(target.id))
        columns["place"].append(f"{number(chosen.north_m, 2)} m N, {number(chosen.east_m, 2)} m E")
        columns["spread"].append(
            f"95 % within {number(0.5 * major, 2)} × {number(0.5 * minor, 2)} m, {number(chosen.entropy_nats, 2)} nats"
        )
        columns["source"].append(f"{_source_text(target, chosen)}, {age_text(team.time_s - chosen.time_s)}")
        columns["error"].append(_error_text(target, chosen))
    return columns


def _chosen(target: TargetState, chosen_by: int | str) -> Estimate | None:
    if chosen_by == BEST:
        return target.best
    if chosen_by == FUSED:
        return fuse(target.estimates)
    return next((estimate for estimate in target.estimates if estimate.robot == chosen_by), None)


def _source_text(target: TargetState, estimate: Estimate) -> str:
    if estimate.robot:
        return f"vehicle {estimate.robot}"
    robots = [str(one.robot) for one in target.estimates]
    return f"vehicle{'s' * (len(robots) > 1)} {', '.join(robots)} fused"


def _links(vehicles: Sequence[VehicleState]) -> Columns:
    """A segment for each pair of which one hears the other lately."""
    columns: Columns = {name: [] for name in ("x0", "y0", "x1", "y1", "colour", "width", "dash", "label")}
    for i, first in enumerate(vehicles):
        for second in vehicles[i + 1 :]:
            there = second.id in first.neighbours and not _quiet(first)
            back = first.id in second.neighbours and not _quiet(second)
            if not (there or back):
                continue
            both = there and back
            columns["x0"].append(_millimetres(first.east_m))
            columns["y0"].append(_millimetres(first.north_m))
            columns["x1"].append(_millimetres(second.east_m))
            columns["y1"].append(_millimetres(second.north_m))
            losses = [_heard(first, second)] * there + [_heard(second, first)] * back
            colour, width = link_style(max((loss for _, loss in losses if loss is not None), default=0.0))
            columns["colour"].append(colour)
            columns["width"].append(width)
            columns["dash"].append("solid" if both else "dashed")
            columns["label"].append(("" if both else "one way: ") + "; ".join(text for text, _ in losses))
    return columns


def _heard(hearer: VehicleState, sender: VehicleState) -> tuple[str, float | None]:
    """How one hears another, in words, and the share of frames lost."""
    loss = hearer.peer_loss.get(sender.id)
    lost = "loss unknown" if loss is None else f"{number(100.0 * loss, 0)} % lost"
    return f"{hearer.id} hears {sender.id}, {lost}", loss


def _quiet(vehicle: VehicleState) -> bool:
    """Whether what it last said of its neighbours is old."""
    return vehicle.onboard_age_s is None or vehicle.onboard_age_s >= SILENT_S


def _error_text(target: TargetState, estimate: Estimate | None = None) -> str:
    """How far an estimate, the best unless told otherwise, is from the truth."""
    estimate = estimate if estimate is not None else target.best
    if target.truth is None:
        return "truth unknown"
    if estimate is None:
        return "no estimate"
    off_m = math.hypot(estimate.north_m - target.truth[0], estimate.east_m - target.truth[1])
    return f"{number(off_m, 2)} m"


def _heading_text(yaw_rad: float | None) -> str:
    return "unknown" if yaw_rad is None else f"{math.degrees(yaw_rad) % 360.0:.0f}°"


def _millimetres(value_m: float | None) -> float:
    return math.nan if value_m is None else round(value_m, 3)
