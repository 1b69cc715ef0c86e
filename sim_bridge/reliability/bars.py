"""What bad radio costs the estimates: loss with jitter against a good radio, and a partition that heals."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from onboard.config import Scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from sim_bridge.reliability.flight import Flight, suite_scenario
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.verdict import squared_errors

__all__ = ["LossResult", "PartitionResult", "loss", "measure", "partition"]

LOSS, JITTER_S = 0.3, 0.1
PARTITION_S = 60.0
AGREEMENT_LIMIT_S = 20.0
MAP_AGREEMENT = 0.95
"""Share of the cells that a pair of maps has in common; in an unbroken team it is what it is for news on their way."""
TRACK_AGREEMENT_M = 0.3

_SETTLE_S = 20.0
_STEP_S = 0.5


@dataclass(frozen=True, slots=True)
class LossResult:
    """The same flight with a good and a bad radio.

    Attributes:
        seed: Of both.
        found: Targets known to anybody in the end, of all, with the bad radio.
        targets: How many there are.
        rmse_good_m: Over vehicles, targets and steps after the first 20 s.
        rmse_bad_m: The same with the bad radio.
    """

    seed: int
    found: int
    targets: int
    rmse_good_m: float
    rmse_bad_m: float


@dataclass(frozen=True, slots=True)
class PartitionResult:
    """A partition of a team that could hear each other all the time otherwise.

    Attributes:
        seed: Of the flight.
        apart: Map agreement of the worst pair at the end of the partition.
        agree_s: From its end until all maps and estimates agree, s; infinity if they do not within 20 s.
        nees_before: Mean NEES per degree of freedom over the tracks in the 10 s before the partition.
        nees_during: The same while it lasts.
        nees_after: The same in the 20 s after it.
    """

    seed: int
    apart: float
    agree_s: float
    nees_before: float
    nees_during: float
    nees_after: float


def loss(lab: Scenario, seed: int, duration_s: float = 60.0) -> LossResult:
    """Fly twice: with the scenario's radio, and with 30 % loss and 100 ms jitter on top."""
    bad = FaultConfig(
        component=Component.RADIO, type=FaultType.INTERMITTENT, since="boot", from_s=0.0, parameters={"loss": LOSS}
    )
    late = FaultConfig(
        component=Component.RADIO,
        type=FaultType.DELAYED,
        since="boot",
        from_s=0.0,
        parameters={"delay_s": 0.0, "jitter_s": JITTER_S},
    )
    rmse, found, targets = [], 0, 0
    for faults in ((), (bad, late)):
        flight = _tracking(lab, seed, *faults)
        squares: list[float] = []
        for elapsed_s in _steps(flight, duration_s):
            if elapsed_s >= _SETTLE_S:
                squares += [error.squared_m2 for error in squared_errors(flight)]
        rmse.append(math.sqrt(float(np.mean(squares))))
        known = {error.target_id for error in squared_errors(flight)}
        found, targets = len(known), len(flight.team.bridge.world.target_truth())
    return LossResult(seed, found, targets, *rmse)


def partition(lab: Scenario, seed: int, length_s: float = PARTITION_S) -> PartitionResult:
    """Fly, cut one vehicle off for a while, and wait until all agree again."""
    assert lab.simulation is not None
    radio = lab.simulation.radio.model_copy(update={"range_m": None})
    flight = _tracking(lab.model_copy(update={"simulation": lab.simulation.model_copy(update={"radio": radio})}), seed)
    before = [error.nees for elapsed_s in _steps(flight, 20.0) for error in squared_errors(flight) if elapsed_s > 10.0]
    flight.inject(
        FaultConfig(
            component=Component.RADIO, type=FaultType.OFF, vehicles=(2,), since="boot", from_s=0.0, until_s=length_s
        )
    )
    during = [error.nees for _ in _steps(flight, length_s) for error in squared_errors(flight)]
    apart, agree_s, after = _map_agreement(flight), math.inf, []
    for elapsed_s in _steps(flight, AGREEMENT_LIMIT_S):
        after += [error.nees for error in squared_errors(flight)]
        if math.isinf(agree_s) and _map_agreement(flight) >= MAP_AGREEMENT and _tracks_agree(flight):
            agree_s = elapsed_s
    return PartitionResult(seed, apart, agree_s, *(float(np.mean(nees)) / 2.0 for nees in (before, during, after)))


def measure(lab: Scenario, seeds: int) -> str:
    """Both for several seeds, as Markdown."""
    losses = [loss(lab, seed) for seed in range(1, seeds + 1)]
    partitions = [partition(lab, seed) for seed in range(1, seeds + 1)]
    growth = [100.0 * (result.rmse_bad_m / result.rmse_good_m - 1.0) for result in losses]
    return "\n".join(
        [
            f"**{100 * LOSS:.0f} % loss with {1e3 * JITTER_S:.0f} ms jitter**, 60 s of tracking, {seeds} seeds:",
            "",
            "| seed | targets found | RMSE, good radio, m | RMSE, bad radio, m | growth, % |",
            "| ---: | ---: | ---: | ---: | ---: |",
            *(
                f"| {r.seed} | {r.found} of {r.targets} | {r.rmse_good_m:.2f} | {r.rmse_bad_m:.2f} | {more:.0f} |"
                for r, more in zip(losses, growth, strict=True)
            ),
            "",
            f"**One vehicle cut off for {PARTITION_S:.0f} s**, radio of unlimited range, {seeds} seeds. Agreement: "
            f"{100 * MAP_AGREEMENT:.0f} % of the cells of any two maps, all estimates of a target within "
            f"{TRACK_AGREEMENT_M:g} m. NEES per degree of freedom: 1 is consistent.",
            "",
            "| seed | equal cells at its end, % | agree again after, s | NEES before | during | 20 s after |",
            "| ---: | ---: | ---: | ---: | ---: | ---: |",
            *(
                f"| {r.seed} | {100 * r.apart:.0f} | {r.agree_s:.1f} | {r.nees_before:.2f} | {r.nees_during:.2f} | "
                f"{r.nees_after:.2f} |"
                for r in partitions
            ),
        ]
    )


def _tracking(lab: Scenario, seed: int, *faults: FaultConfig) -> Flight:
    flight = Flight(suite_scenario(lab), seed)
    flight.inject(*faults)
    flight.fly_to(Phase.TRACKING)
    return flight


def _steps(flight: Flight, duration_s: float) -> Iterator[float]:
    for step in range(round(duration_s / _STEP_S)):
        flight.run(_STEP_S)
        yield (step + 1) * _STEP_S


def _map_agreement(flight: Flight) -> float:
    """Share of equal cells of the two maps that differ most."""
    grids = [companion.agent.grid for companion in flight.team.companions.values() if companion.agent is not None]
    return min(
        float(np.mean(first.explored[first.inside] == second.explored[first.inside]))
        for first, second in combinations(grids, 2)
    )


def _tracks_agree(flight: Flight) -> bool:
    """Whether all vehicles know the same targets, at the same places."""
    agents = [companion.agent for companion in flight.team.companions.values() if companion.agent is not None]
    tracks = [agent.tracks for agent in agents]
    if any(known.keys() != tracks[0].keys() for known in tracks):
        return False
    return all(
        float(np.linalg.norm(first[target_id].mean[:2] - second[target_id].mean[:2])) <= TRACK_AGREEMENT_M
        for first, second in combinations(tracks, 2)
        for target_id in first
    )
