"""A flight as numbers over time, read from its recording by the same monitor that watched it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from gcs import summary
from gcs.recording.reader import Recording
from gcs.recording.replay import Replay
from gcs.team import Event, TeamState
from gcs.vehicle_state import VehicleState
from onboard.messages import FlightState, PeerPlan

__all__ = ["FlightSeries", "PlanPoint", "VehicleSeries", "read_series"]

_SAMPLE_TICKS = 5
_TRACK_TICKS = 2
"""Positions are taken as often as the ground reads them, so that curves are round on a map."""
_NAN = math.nan


@dataclass(frozen=True, slots=True)
class PlanPoint:
    """A plan at its epoch.

    Attributes:
        time_s: Of the epoch's start, since step 0, s.
        planning_time_s: That it took, s.
        budget_s: That it was given, s.
    """

    time_s: float
    planning_time_s: float
    budget_s: float


@dataclass(slots=True)
class VehicleSeries:
    """One vehicle twice a second; NaN is what was not known.

    Attributes:
        track: Five times a second: time since step 0, s, north and east in the mission frame, m.
        north_m: Mission frame, m.
        east_m: Mission frame, m.
        tracking_error_m: Horizontal distance from the planned trajectory, m.
        neighbours: How many it hears.
        loss: Frames lost on its link to the ground in the last ten seconds, 0 to 1.
        radio_loss: Frames lost from the neighbour that it hears worst, 0 to 1.
        states: What its onboard process did; None while it was silent.
        plans: Its plans.
    """

    track: list[tuple[float, float, float]] = field(default_factory=list)
    north_m: list[float] = field(default_factory=list)
    east_m: list[float] = field(default_factory=list)
    tracking_error_m: list[float] = field(default_factory=list)
    neighbours: list[float] = field(default_factory=list)
    loss: list[float] = field(default_factory=list)
    radio_loss: list[float] = field(default_factory=list)
    states: list[FlightState | None] = field(default_factory=list)
    plans: list[PlanPoint] = field(default_factory=list)


@dataclass(slots=True)
class FlightSeries:
    """A whole flight; times count from step 0, or from the recording's start if there was none.

    Attributes:
        recording: Where it is from.
        zero_s: UNIX time of time 0, s.
        started: Whether there was a step 0.
        landing_s: When landing began, s; None if it did not.
        summary: As :func:`gcs.summary.summarize` has it, worked out from the recording.
        final: The team when landing began; at the end if it did not.
        times_s: Of the samples, s.
        discovered: Targets found.
        rmse_m: Of the estimates at the last evaluated step, m.
        entropy_nats: Mean over the targets known, nats.
        explored_share: 0 to 1.
        vehicles: By system id.
        target_entropy_nats: Of each target's surest estimate, by the target's id, nats.
        target_error_m: Of the same estimate, m.
        truth_m: Each target's true place, north and east, m.
        events: What the operator was told.
    """

    recording: Recording
    zero_s: float
    started: bool
    landing_s: float | None
    summary: dict[str, Any]
    final: TeamState
    times_s: list[float] = field(default_factory=list)
    discovered: list[float] = field(default_factory=list)
    rmse_m: list[float] = field(default_factory=list)
    entropy_nats: list[float] = field(default_factory=list)
    explored_share: list[float] = field(default_factory=list)
    vehicles: dict[int, VehicleSeries] = field(default_factory=dict)
    target_entropy_nats: dict[int, list[float]] = field(default_factory=dict)
    target_error_m: dict[int, list[float]] = field(default_factory=dict)
    truth_m: dict[int, list[tuple[float, float]]] = field(default_factory=dict)
    events: list[Event] = field(default_factory=list)

    @property
    def name(self) -> str:
        """The recording's folder's name."""
        return self.recording.folder.resolve().name

    @property
    def discovery_times_s(self) -> list[float]:
        """When targets were found, since step 0, s, in that order."""
        return sorted(value for value in self.summary["time_to_discover_s"].values() if value is not None)

    @property
    def all_found(self) -> bool:
        """Whether all targets that there are were found."""
        return bool(len(self.discovery_times_s) == self.summary["targets"] != 0)


def read_series(recording: Recording, progress: Callable[[float], None] = lambda _: None) -> FlightSeries:
    """Go through a recording once.

    Args:
        recording: The flight.
        progress: Told what share of it has been read, 0 to 1.
    """
    replay = Replay(recording)
    samples = []
    tracks: dict[int, list[tuple[float, float, float]]] = {vehicle.id: [] for vehicle in recording.scenario.vehicles}
    landing_s = recording.landing_since_s
    final: TeamState | None = None
    while replay.tick < replay.ticks:
        replay.step()
        if landing_s is not None and final is None and replay.time_of(replay.tick) >= landing_s:
            final = replay.state()
        if replay.tick % _TRACK_TICKS == 0:
            for vehicle_id, north_m, east_m in replay.monitor.places(replay.time_of(replay.tick)):
                tracks[vehicle_id].append((replay.time_of(replay.tick), _known(north_m), _known(east_m)))
        if replay.tick % _SAMPLE_TICKS == 0:
            samples.append(replay.state())
            progress(replay.tick / replay.ticks)
    end = replay.state()
    start_s = next((team.mission_start_s for team in reversed((*samples, end)) if team.mission_start_s), None)
    zero_s = start_s if start_s is not None else recording.start_s
    series = FlightSeries(
        recording=recording,
        zero_s=zero_s,
        started=start_s is not None,
        landing_s=landing_s - zero_s if landing_s is not None else None,
        summary=_summary(recording, replay, start_s),
        final=final if final is not None else end,
        vehicles={
            vehicle_id: VehicleSeries(track=[(time_s - zero_s, north_m, east_m) for time_s, north_m, east_m in track])
            for vehicle_id, track in tracks.items()
        },
        events=replay.events(-1, replay.ticks),
    )
    for sample in samples:
        _add(series, sample)
    return series


def _summary(recording: Recording, replay: Replay, start_s: float | None) -> dict[str, Any]:
    """The flight's own summary; worked out anew as far as it is missing."""
    end_s = recording.landing_since_s or recording.end_s
    facts = summary.FlightFacts(
        scenario=recording.scenario.name,
        version=str(recording.about.get("version", "unknown")),
        seed=recording.about.get("seed"),
        mission_start_s=start_s,
        mission_end_s=end_s if start_s is not None and end_s >= start_s else None,
        cpu_cores=None,
        cpu_s={},
        problems=(),
    )
    worked_out = summary.summarize(replay.monitor, facts, replay.time_of(replay.ticks))
    own = recording.summary
    if own is not None and (completed := _completed(own, worked_out)) is not None:
        return completed
    lost = "left no summary" if own is None else "a summary that cannot be used"
    return {**worked_out, "problems": [f"the flight has {lost}: its figures are worked out from what was recorded"]}


def _completed(own: dict[str, Any], worked_out: dict[str, Any]) -> dict[str, Any] | None:
    """A summary, of an earlier version perhaps, with what one of this version has besides; None if it is malformed."""
    whole = {**worked_out, **own}
    if any(type(whole[key]) is not type(worked_out[key]) for key in ("time_to_discover_s", "vehicles", "problems")):
        return None
    vehicles = {vehicle.get("id"): vehicle for vehicle in whole["vehicles"] if isinstance(vehicle, dict)}
    return {**whole, "vehicles": [{**known, **vehicles.get(known["id"], {})} for known in worked_out["vehicles"]]}


def _add(series: FlightSeries, team: TeamState) -> None:
    count = len(series.times_s)
    series.times_s.append(team.time_s - series.zero_s)
    series.discovered.append(float(team.discovered))
    series.rmse_m.append(_known(team.figures.rmse_now_m))
    series.entropy_nats.append(_known(team.figures.entropy_now_nats))
    series.explored_share.append(team.explored.share if team.explored is not None else 0.0)
    for vehicle in team.vehicles:
        _add_vehicle(series.vehicles[vehicle.id], vehicle, series.zero_s, series.recording.scenario.mission.step_s)
    for target in team.targets:
        best, truth = target.best, target.truth
        error_m = math.hypot(best.north_m - truth[0], best.east_m - truth[1]) if best and truth else _NAN
        for columns, value in (
            (series.target_entropy_nats, _known(best.entropy_nats if best is not None else None)),
            (series.target_error_m, error_m),
        ):
            columns.setdefault(target.id, [_NAN] * count).append(value)
        if truth is not None:
            series.truth_m.setdefault(target.id, []).append(truth)
    for columns in (series.target_entropy_nats, series.target_error_m):
        for values in columns.values():
            values.extend([_NAN] * (count + 1 - len(values)))


def _add_vehicle(series: VehicleSeries, vehicle: VehicleState, zero_s: float, step_s: float) -> None:
    series.north_m.append(_known(vehicle.north_m))
    series.east_m.append(_known(vehicle.east_m))
    series.tracking_error_m.append(_known(vehicle.tracking_error_m))
    series.neighbours.append(float(len(vehicle.neighbours)) if vehicle.onboard_alive else _NAN)
    series.loss.append(_known(vehicle.link.loss if vehicle.link is not None else None))
    series.radio_loss.append(_known(max(vehicle.peer_loss.values(), default=None) if vehicle.onboard_alive else None))
    series.states.append(vehicle.flight_state if vehicle.onboard_alive else None)
    plan: PeerPlan | None = vehicle.plan
    if plan is not None:
        point = PlanPoint(plan.step * step_s - zero_s, plan.planning_time_s, plan.budget_s)
        if not series.plans or series.plans[-1].time_s != point.time_s:
            series.plans.append(point)


def _known(value: float | None) -> float:
    return value if value is not None and math.isfinite(value) else _NAN
