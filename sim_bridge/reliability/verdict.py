"""Flies one case and judges it: the reaction in time, and what holds of every flight."""

from __future__ import annotations

import math
import time
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np

from onboard.config import Scenario
from onboard.config.polygon import outside_distance
from sim_bridge.reliability.case import SEPARATION_M, Case, Expected
from sim_bridge.reliability.flight import Flight
from sim_bridge.reliability.phases import HELD, Phase
from sim_bridge.reliability.reactions import Evidence, disturbance

__all__ = ["Outcome", "TrackError", "judge", "squared_errors"]

RECOVERY_S = 5.0
"""After a fault's end, before the team is called home."""

LANDING_LIMIT_S = 45.0
"""From the call to land until all stand: a return, 10 s of waiting for others, a descent."""

CHI2_99 = 9.21
"""Of two degrees of freedom."""

MIN_TRACKED = 0.4
"""Share of the tracks that must be where they claim; robots are no random walks, so it is far from 99 % at its best."""


@dataclass(frozen=True, slots=True)
class TrackError:
    """One vehicle's estimate of one target against the truth.

    Attributes:
        target_id: Which target.
        squared_m2: Squared error of the position, m².
        nees: Squared error over covariance.
    """

    target_id: int
    squared_m2: float
    nees: float


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of one flight.

    Attributes:
        case: Its fault.
        phase: When it began.
        seed: Of the flight.
        failures: What went against expectations, one sentence each; empty after a good flight.
        gap: The known gap that explains all failures; empty if there is none.
        reaction_s: When the reaction came after the fault's beginning, s; None if it did not.
        separation_m: Smallest distance between two vehicles from the fault on, m; None if nobody flew.
        outside_m: How far outside the fence a vehicle came, m.
        tracked: Share of the team's tracks whose error is within what they claim (χ², 99 %), when watching ended.
        lands_s: From the call to land until all stood on the ground, s.
        cpu_s: Processor time, s.
        told: Conditions that failsafe ladders reacted to from the fault on, by name.
    """

    case: str
    phase: str
    seed: int
    failures: tuple[str, ...]
    gap: str
    reaction_s: float | None
    separation_m: float | None
    outside_m: float
    tracked: float | None
    lands_s: float
    cpu_s: float
    told: tuple[str, ...] = ()

    def to_json(self) -> dict[str, object]:
        """As a mapping of plain values."""
        return asdict(self)

    @classmethod
    def from_json(cls, data: dict[str, Any]) -> Outcome:
        """From what :meth:`to_json` gave."""
        return cls(**{**data, "failures": tuple(data["failures"]), "told": tuple(data.get("told", ()))})


def judge(flight: Flight, scenario: Scenario, case: Case, phase: Phase, seed: int) -> Outcome:
    """Let a case happen to a flight that has just come to its phase, and say what came of it."""
    began_s = time.process_time()
    expected = case.expected[phase]
    fault_s = flight.now_s
    flight.inject(case.fault)
    _watch(flight, case, phase, expected)
    ids = [vehicle.id for vehicle in scenario.vehicles]
    evidence = Evidence(flight, case.fault.vehicles or tuple(ids), fault_s, flight.now_s)
    tracked = _tracked(flight)
    all_down = flight.land_all(LANDING_LIMIT_S, ground_lands=expected.ground_lands)
    lands_s = flight.now_s - evidence.end_s

    failures = []
    reaction_s = expected.reaction.seen(evidence)
    if reaction_s is None:
        found = "; ".join(filter(None, (f"vehicle {i}: {text}" for i in ids if (text := disturbance(evidence, i)))))
        failures.append(f"not seen: {expected.reaction.text}" + (f" ({found})" if found else ""))
    elif reaction_s > expected.deadline_s:
        failures.append(f"{expected.reaction.text} after {reaction_s:.2f} s, not within {expected.deadline_s:g} s")
    if expected.others:
        for other in set(ids) - set(evidence.victims):
            if trouble := disturbance(evidence, other):
                failures.append(f"vehicle {other}, whom it does not concern: {trouble}")
    separation_m = min(flight.team.bridge.world.min_separation_m.values())
    if separation_m < SEPARATION_M:
        failures.append(f"separation {separation_m:.2f} m")
    outside_m = max((_outside_m(flight, scenario, fault_s)), default=0.0)
    if outside_m > expected.fence_m:
        failures.append(f"{outside_m:.2f} m outside the fence")
    if not all_down:
        states = {i: getattr(flight.state(i), "name", None) for i in ids if not flight.grounded(i)}
        failures.append(f"not down {LANDING_LIMIT_S:g} s after the call to land: {states}")
    if phase is Phase.TRACKING and case.length_s is not None and tracked is not None and tracked < MIN_TRACKED:
        failures.append(f"only {100 * tracked:.0f} % of the tracks are where they claim to be")
    return Outcome(
        case.name,
        phase.value,
        seed,
        tuple(failures),
        expected.gap.text if failures and expected.gap is not None and expected.gap.explains(failures) else "",
        reaction_s,
        separation_m if math.isfinite(separation_m) else None,
        outside_m,
        tracked,
        lands_s,
        time.process_time() - began_s,
        tuple(sorted({told.condition.value for told in flight.told if told.time_s > fault_s})),
    )


def _watch(flight: Flight, case: Case, phase: Phase, expected: Expected) -> None:
    """Let the fault happen, pass, and be recovered from."""
    length_s = 0.0 if case.length_s is None else case.length_s
    enough_s = max(length_s + (RECOVERY_S if case.length_s is not None else 3.0), expected.deadline_s + 0.5)
    end_s = flight.now_s + enough_s
    if phase is Phase.GROUND:
        flight.run(1.0)
        flight.start()
    if phase in (Phase.GROUND, Phase.ARMING, Phase.TAKEOFF):
        flight.attend(max(end_s, flight.start_s + 4.0) - flight.now_s)
    elif phase in HELD:
        flight.attend(max(length_s, expected.deadline_s) + 0.5)
        flight.resume()
        flight.attend(RECOVERY_S)
    elif phase is Phase.TRACKING:
        flight.attend(enough_s)
    else:
        flight.run(max(length_s, expected.deadline_s) + 0.5)


def squared_errors(flight: Flight) -> list[TrackError]:
    """Of all tracks of all vehicles now."""
    truth = {target.target_id: target for target in flight.team.bridge.world.target_truth()}
    errors = []
    for companion in flight.team.companions.values():
        for target_id, track in companion.agent.tracks.items() if companion.agent is not None else ():
            error = track.mean[:2] - np.array([truth[target_id].north_m, truth[target_id].east_m])
            nees = float(error @ np.linalg.solve(track.covariance[:2, :2], error))
            errors.append(TrackError(target_id, float(error @ error), nees))
    return errors


def _tracked(flight: Flight) -> float | None:
    """Share of all tracks with a squared error over covariance below χ²(2)'s 99 % quantile; None without any."""
    errors = squared_errors(flight)
    return sum(error.nees < CHI2_99 for error in errors) / len(errors) if errors else None


def _outside_m(flight: Flight, scenario: Scenario, since_s: float) -> list[float]:
    """How far each vehicle is outside the fence in each sample since a time, m; 0 inside."""
    return [
        outside_distance(scenario.mission.fence, (north, east))
        for sample in flight.samples
        if sample.time_s > since_s
        for north, east, _ in sample.positions.values()
    ]
