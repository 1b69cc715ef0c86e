"""A team's state as messages for 3D viewers and plots: Foxglove's schemas and ours as plain dictionaries.

Frames: ``map`` is the root, z up, x east, y north, as viewers like it. ``mission_ned`` is the mission frame (north,
east, down); it turns into ``map`` by half a turn about the axis between north and east. ``vehicle_N`` is the body
frame of vehicle N (forward, right, down), a child of ``mission_ned``. Everything but the explored area is given in
``mission_ned`` or ``vehicle_N``.

What has no finite place, or an absurd one, is not drawn; numbers that nobody knows are left out.
"""

from __future__ import annotations

import base64
import math
from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from gcs.dashboard.palette import ALARM, ESTIMATE, TWO_WAY, link_style, vehicle_colour
from gcs.dashboard.shapes import ellipse_95, planned_path
from gcs.dashboard.view import MapBounds
from gcs.dashboard.wording import flight_state_text, vehicle_is_silent
from gcs.explored import ExploredArea
from gcs.metrics import Estimate, TargetState
from gcs.recording import scene_parts as parts
from gcs.recording.schemas import FRAME_TRANSFORMS, GRID, LOG, SCENE_UPDATE, TARGETS, TEAM, VEHICLE, Schema
from gcs.team import Event, TeamState
from gcs.vehicle_state import VehicleState
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink

__all__ = ["MAP", "MISSION_NED", "Message", "Scene", "channels", "event_message"]

MAP = "map"
MISSION_NED = "mission_ned"

Message = tuple[str, dict[str, Any]]
"""Topic and content."""

_HALF_TURN = math.sqrt(0.5)
_SLOW_EVERY = 2
"""Scenes and numbers come with every second moment, 2.5 times a second, and when the phase changes."""
_TRAIL_POINTS = 60
_ARCS = 16
_TRUTH_COLOUR = "#20262d"
_LEVELS = (5, 5, 5, 4, 3, 2, 2, 1)
"""Foxglove's log level by MAV_SEVERITY."""


def channels(scenario: Scenario) -> dict[str, Schema]:
    """Each topic's schema."""
    scenes = ("/arena", "/vehicles", "/trails", "/plans", "/estimates", "/truth", "/radio", "/landmarks")
    return {
        "/tf": FRAME_TRANSFORMS,
        **dict.fromkeys(scenes, SCENE_UPDATE),
        "/explored": GRID,
        "/events": LOG,
        "/team": TEAM,
        "/targets": TARGETS,
        **{f"/vehicle_{vehicle.id}": VEHICLE for vehicle in scenario.vehicles},
    }


def event_message(event: Event) -> Message:
    """An event as a log entry."""
    severity = event.severity if 0 <= event.severity < len(_LEVELS) else int(mavlink.MAV_SEVERITY_INFO)
    return "/events", {
        "timestamp": parts.timestamp(event.time_s),
        "level": _LEVELS[severity],
        "message": event.text,
        "name": event.source,
        "file": mavlink.enums["MAV_SEVERITY"][severity].name,
        "line": 0,
    }


class Scene:
    """Turns moments into messages.

    Args:
        scenario: Whose team it is.
    """

    def __init__(self, scenario: Scenario) -> None:
        self._scenario = scenario
        self._bounds = MapBounds(scenario)
        self._primitives = scenario.primitive_set
        self._colours = {vehicle.id: vehicle_colour(i) for i, vehicle in enumerate(scenario.vehicles)}
        self._trails: dict[int, deque[tuple[float, float, float]]] = {
            vehicle.id: deque(maxlen=_TRAIL_POINTS) for vehicle in scenario.vehicles
        }
        self._explored: ExploredArea | None = None
        self._moments = 0
        self._phase = ""

    def messages(self, team: TeamState, phase: str, time_left_s: float | None) -> Iterator[Message]:
        """The messages of one moment; five moments a second are expected."""
        now_s = team.time_s
        placed = [v for v in team.vehicles if self._bounds.plausible(v.north_m, v.east_m)]
        yield "/tf", {"transforms": [_map_from_ned(now_s), *(_body(vehicle, now_s) for vehicle in placed)]}
        if self._moments == 0:
            yield "/arena", self._arena(now_s)
        self._moments += 1
        if self._moments % _SLOW_EVERY != 1 and phase == self._phase:
            return
        self._phase = phase
        yield "/team", _team_numbers(team, phase, time_left_s)
        yield (
            "/targets",
            {"timestamp": parts.timestamp(now_s), "targets": [_target_numbers(t, now_s) for t in team.targets]},
        )
        for vehicle in team.vehicles:
            yield f"/vehicle_{vehicle.id}", _vehicle_numbers(vehicle, now_s)
        yield "/vehicles", parts.scene_update(now_s, (self._vehicle(vehicle, now_s) for vehicle in placed))
        yield "/trails", parts.scene_update(now_s, self._trail_entities(placed, now_s))
        yield "/plans", parts.scene_update(now_s, self._plan_entities(team, now_s))
        yield "/estimates", parts.scene_update(now_s, self._estimate_entities(team.targets, now_s))
        yield "/radio", parts.scene_update(now_s, _radio_entities(placed, now_s))
        yield "/landmarks", parts.scene_update(now_s, self._landmark_entities(placed, now_s))
        if any(target.truth is not None for target in team.targets):
            yield "/truth", parts.scene_update(now_s, self._truth_entities(team.targets, now_s))
        if team.explored is not None and team.explored is not self._explored:
            self._explored = team.explored
            yield "/explored", _grid(team.explored, now_s)

    def _arena(self, now_s: float) -> dict[str, Any]:
        mission = self._scenario.mission
        border = parts.colour(TWO_WAY, 1.0)
        fence = parts.line(_ground(mission.fence), border, 3.0, loop=True)
        entities = [parts.entity("fence", MISSION_NED, now_s, lines=[fence])]
        for i, corners in enumerate(mission.obstacles, 1):
            outline = parts.line(_ground(corners), border, 5.0, loop=True)
            entities.append(parts.entity(f"obstacle {i}", MISSION_NED, now_s, lines=[outline]))
        return parts.scene_update(now_s, entities)

    def _vehicle(self, vehicle: VehicleState, now_s: float) -> dict[str, Any]:
        """Arrow, label and the sensor's footprint on the ground, in the vehicle's own frame."""
        colour = ALARM if vehicle_is_silent(vehicle) else self._colours[vehicle.id]
        arrow = {
            "pose": parts.pose((-0.15, 0.0, 0.0)),
            "shaft_length": 0.2,
            "shaft_diameter": 0.1,
            "head_length": 0.15,
            "head_diameter": 0.2,
            "color": parts.colour(colour, 1.0),
        }
        entity = parts.entity(f"vehicle {vehicle.id}", f"vehicle_{vehicle.id}", now_s, locked=True, arrows=[arrow])
        entity["texts"] = [parts.label(f"{vehicle.id} {flight_state_text(vehicle)}", (0.0, 0.0, -0.3), colour)]
        sensor = self._scenario.sensor
        half = math.radians(0.5 * min(sensor.fov_deg, 360.0))
        height_m = vehicle.height_m if vehicle.height_m is not None and math.isfinite(vehicle.height_m) else 0.0
        steps = max(2, round(_ARCS * half / math.pi) * 2)
        angles = [half * (2 * i / steps - 1) for i in range(steps + 1)]
        arc = [(sensor.max_range_m * math.cos(a), sensor.max_range_m * math.sin(a), height_m) for a in angles]
        centre = [] if sensor.fov_deg >= 360.0 else [(0.0, 0.0, height_m)]
        entity["lines"] = [parts.line([*centre, *arc], parts.colour(colour, 0.6), 1.5, loop=True)]
        return entity

    def _trail_entities(self, vehicles: Iterable[VehicleState], now_s: float) -> Iterator[dict[str, Any]]:
        for vehicle in vehicles:
            trail = self._trails[vehicle.id]
            trail.append(_place(vehicle))
            line = parts.line(list(trail), parts.colour(self._colours[vehicle.id], 0.5), 1.5)
            yield parts.entity(f"trail {vehicle.id}", MISSION_NED, now_s, lines=[line])

    def _plan_entities(self, team: TeamState, now_s: float) -> Iterator[dict[str, Any]]:
        for vehicle in team.vehicles:
            plan = vehicle.plan
            if plan is None or vehicle.plan_age_s is None or vehicle_is_silent(vehicle):
                continue
            if not self._bounds.plausible(plan.start.north_m, plan.start.east_m):
                continue
            easts, norths = planned_path(plan, self._primitives, self._scenario.mission.step_s)
            down_m = _place(vehicle)[2]
            points = [(north_m, east_m, down_m) for north_m, east_m in zip(norths, easts, strict=True)]
            line = parts.line(points, parts.colour(self._colours[vehicle.id], 1.0), 3.0)
            metadata = {"cost": plan.cost, "lower_bound": plan.lower_bound, "nodes": plan.nodes}
            yield parts.entity(f"plan {vehicle.id}", MISSION_NED, now_s, metadata=metadata, lines=[line])

    def _estimate_entities(self, targets: Iterable[TargetState], now_s: float) -> Iterator[dict[str, Any]]:
        for target in targets:
            best = target.best
            if best is None or not self._bounds.plausible(best.north_m, best.east_m):
                continue
            centre = (best.north_m, best.east_m, 0.0)
            entity = parts.entity(
                f"target {target.id}",
                MISSION_NED,
                now_s,
                metadata={"robot": best.robot, "entropy_nats": round(best.entropy_nats, 3)},
                texts=[parts.label(str(target.id), (best.north_m, best.east_m, -0.15), ESTIMATE)],
                spheres=[parts.solid(centre, (0.12, 0.12, 0.12), parts.colour(ESTIMATE, 1.0))],
            )
            ellipse = ellipse_95(best.covariance_m2) if best.covariance_m2 is not None else None
            if ellipse is not None:
                major_m, minor_m, angle = ellipse
                # The angle runs from east towards north; in mission_ned, yaw runs from north towards east.
                disc = parts.solid(centre, (major_m, minor_m, 0.01), parts.colour(ESTIMATE, 0.3), 0.5 * math.pi - angle)
                entity["cylinders"] = [{**disc, "bottom_scale": 1.0, "top_scale": 1.0}]
            yield entity

    def _truth_entities(self, targets: Iterable[TargetState], now_s: float) -> Iterator[dict[str, Any]]:
        for target in targets:
            if target.truth is not None and self._bounds.plausible(*target.truth):
                cube = parts.solid((*target.truth, -0.05), (0.1, 0.1, 0.1), parts.colour(_TRUTH_COLOUR, 1.0))
                yield parts.entity(f"truth {target.id}", MISSION_NED, now_s, cubes=[cube])

    def _landmark_entities(self, vehicles: Iterable[VehicleState], now_s: float) -> Iterator[dict[str, Any]]:
        for vehicle in vehicles:
            places = [place for place in vehicle.landmarks if self._bounds.plausible(*place)]
            if places and not vehicle_is_silent(vehicle):
                colour = parts.colour(self._colours[vehicle.id], 0.7)
                cubes = [parts.solid((*place, 0.0), (0.12, 0.12, 0.02), colour, 0.25 * math.pi) for place in places]
                yield parts.entity(f"landmarks {vehicle.id}", MISSION_NED, now_s, cubes=cubes)


def _radio_entities(vehicles: list[VehicleState], now_s: float) -> Iterator[dict[str, Any]]:
    """A line between each two of which one hears the other."""
    for i, first in enumerate(vehicles):
        for second in vehicles[i + 1 :]:
            there, back = second.id in first.neighbours, first.id in second.neighbours
            if there or back:
                losses = [first.peer_loss.get(second.id, 0.0)] * there + [second.peer_loss.get(first.id, 0.0)] * back
                colour, pixels = link_style(max(losses))
                line = parts.line([_place(first), _place(second)], parts.colour(colour, 0.6), pixels)
                yield parts.entity(f"radio {first.id} {second.id}", MISSION_NED, now_s, lines=[line])


def _map_from_ned(now_s: float) -> dict[str, Any]:
    return parts.transform(MAP, MISSION_NED, now_s, (0.0, 0.0, 0.0), (_HALF_TURN, _HALF_TURN, 0.0, 0.0))


def _body(vehicle: VehicleState, now_s: float) -> dict[str, Any]:
    yaw = vehicle.yaw_rad if vehicle.yaw_rad is not None and math.isfinite(vehicle.yaw_rad) else 0.0
    return parts.transform(MISSION_NED, f"vehicle_{vehicle.id}", now_s, _place(vehicle), parts.about_z(yaw))


def _place(vehicle: VehicleState) -> tuple[float, float, float]:
    """North, east, down of a vehicle whose place is plausible; on the ground if its height is not known."""
    height_m = vehicle.height_m if vehicle.height_m is not None and math.isfinite(vehicle.height_m) else 0.0
    return round(vehicle.north_m or 0.0, 3), round(vehicle.east_m or 0.0, 3), round(-height_m, 3)


def _team_numbers(team: TeamState, phase: str, time_left_s: float | None) -> dict[str, Any]:
    figures = team.figures
    return _finite(
        timestamp=parts.timestamp(team.time_s),
        phase=phase,
        time_left_s=time_left_s,
        discovered=team.discovered,
        target_count=team.target_count,
        rmse_m=figures.rmse_now_m,
        rmse_mean_m=figures.rmse_m,
        entropy_nats=figures.entropy_now_nats,
        entropy_mean_nats=figures.entropy_nats,
        explored_share=team.explored.share if team.explored is not None else None,
        behind_s=team.behind_s,
    )


def _vehicle_numbers(vehicle: VehicleState, now_s: float) -> dict[str, Any]:
    plan = vehicle.plan
    return _finite(
        timestamp=parts.timestamp(now_s),
        id=vehicle.id,
        flight_state=vehicle.flight_state.name if vehicle.flight_state is not None else None,
        mode=vehicle.mode,
        armed=vehicle.armed,
        battery=vehicle.battery,
        north_m=vehicle.north_m,
        east_m=vehicle.east_m,
        height_m=vehicle.height_m,
        yaw_rad=vehicle.yaw_rad,
        speed_m_s=vehicle.speed_m_s,
        autopilot_age_s=vehicle.autopilot_age_s,
        onboard_age_s=vehicle.onboard_age_s,
        plan_age_s=vehicle.plan_age_s,
        planning_time_s=vehicle.planning_time_s,
        planning_budget_s=vehicle.planning_budget_s,
        plans=vehicle.plans,
        deadline_misses=vehicle.deadline_misses,
        setpoint_rate_hz=vehicle.setpoint_rate_hz,
        tracking_error_m=vehicle.tracking_error_m,
        neighbours=len(vehicle.neighbours),
        targets=vehicle.targets,
        cost=plan.cost if plan is not None else None,
        lower_bound=plan.lower_bound if plan is not None else None,
        epsilon=plan.epsilon if plan is not None else None,
        delta_m=plan.delta if plan is not None else None,
        width=plan.width if plan is not None else None,
        nodes=plan.nodes if plan is not None else None,
        link_loss=vehicle.link.loss if vehicle.link is not None else None,
        radio_loss_max=max(vehicle.peer_loss.values(), default=None),
        delay_s=vehicle.delay_s,
    )


def _target_numbers(target: TargetState, now_s: float) -> dict[str, Any]:
    best: Estimate | None = target.best
    truth = target.truth
    return _finite(
        timestamp=parts.timestamp(best.time_s if best is not None else now_s),
        id=target.id,
        known_by=len(target.known_by),
        robot=best.robot if best is not None else None,
        north_m=best.north_m if best is not None else None,
        east_m=best.east_m if best is not None else None,
        position_std_m=best.position_std_m if best is not None else None,
        entropy_nats=best.entropy_nats if best is not None else None,
        truth_north_m=truth[0] if truth is not None else None,
        truth_east_m=truth[1] if truth is not None else None,
        error_m=math.hypot(best.north_m - truth[0], best.east_m - truth[1]) if best and truth else None,
    )


def _finite(**values: Any) -> dict[str, Any]:
    """Without what is unknown or infinite; to six digits after the point."""
    kept = {}
    for name, value in values.items():
        if value is None or (isinstance(value, float) and not math.isfinite(value)):
            continue
        kept[name] = round(value, 6) if isinstance(value, float) else value
    return kept


def _grid(area: ExploredArea, now_s: float) -> dict[str, Any]:
    """The explored cells in blue, in the frame ``map``: rows go north (y), columns east (x)."""
    rows, columns = area.cells.shape
    pixels = np.zeros((rows, columns, 4), np.uint8)
    pixels[area.cells] = (86, 180, 233, 60)
    names = ("red", "green", "blue", "alpha")
    return {
        "timestamp": parts.timestamp(now_s),
        "frame_id": MAP,
        "pose": parts.pose((area.west_m, area.south_m, -0.02)),
        "column_count": columns,
        "cell_size": {"x": area.cell_m, "y": area.cell_m},
        "row_stride": 4 * columns,
        "cell_stride": 4,
        "fields": [{"name": name, "offset": i, "type": 1} for i, name in enumerate(names)],
        "data": base64.b64encode(pixels.tobytes()).decode("ascii"),
    }


def _ground(corners: Iterable[tuple[float, float]]) -> list[tuple[float, float, float]]:
    return [(north_m, east_m, 0.0) for north_m, east_m in corners]
