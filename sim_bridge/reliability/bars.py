"""What bad radio costs the estimates: loss with jitter against a good radio, and a partition that heals."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from onboard.config import Scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from sim_bridge.reliability.flight import Flight
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.verdict import squared_errors

__all__ = ["LossResult", "PartitionResult", "loss", "measure", "partition"]

LOSS, JITTER_S = 0.3, 0.1
PARTITION_S = 60.0
AGREEMENT_LIMIT_S = 20.0
MAP_AGREEMENT = 0.95
"""Share of the cells that a pair of maps has in common; in an unbroken team it is what it is for news on their way."""
TRACK_AGREEMENT_M = 0.4
"""Mean over the targets of how far the two estimates that differ most are apart; the latest looks make some of it."""

_UNKNOWN_M = 1.0
"""What a target that only some know counts for."""

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
        unbroken: Share of the instants in the 10 s before the partition at which all maps agree.
        apart: Map agreement of the worst pair at the end of the partition.
        maps_agree_s: From its end until all maps agree, s; infinity if they do not within 20 s.
        healed: Share of the instants in those 20 s at which they do.
        estimates_agree_s: The same for the estimates.
        nees_before: Mean NEES per degree of freedom over the tracks in the 10 s before the partition.
        nees_during: The same while it lasts.
        nees_after: The same in the 20 s after it.
    """

    seed: int
    unbroken: float
    apart: float
    maps_agree_s: float
    healed: float
    estimates_agree_s: float
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


def partition(
    lab: Scenario, seed: int, length_s: float = PARTITION_S, *, forget_after_s: float | None
) -> PartitionResult:
    """Fly, cut one vehicle off for a while, and wait until all agree again; maps forget as told (None: never)."""
    exploration = lab.exploration.model_copy(update={"forget_after_s": forget_after_s})
    lab = lab.model_copy(update={"exploration": exploration})
    assert lab.simulation is not None
    radio = lab.simulation.radio.model_copy(update={"range_m": None})
    flight = _tracking(lab.model_copy(update={"simulation": lab.simulation.model_copy(update={"radio": radio})}), seed)
    unbroken, before = [], []
    for elapsed_s in _steps(flight, 20.0):
        if elapsed_s > 10.0:
            unbroken.append(_map_agreement(flight) >= MAP_AGREEMENT)
            before += [error.nees for error in squared_errors(flight)]
    flight.inject(
        FaultConfig(
            component=Component.RADIO, type=FaultType.OFF, vehicles=(2,), since="boot", from_s=0.0, until_s=length_s
        )
    )
    during = [error.nees for _ in _steps(flight, length_s) for error in squared_errors(flight)]
    apart, maps_s, estimates_s, healed, after = _map_agreement(flight), math.inf, math.inf, [], []
    for elapsed_s in _steps(flight, AGREEMENT_LIMIT_S):
        after += [error.nees for error in squared_errors(flight)]
        healed.append(_map_agreement(flight) >= MAP_AGREEMENT)
        if healed[-1]:
            maps_s = min(maps_s, elapsed_s)
        if _disagreement_m(flight) <= TRACK_AGREEMENT_M:
            estimates_s = min(estimates_s, elapsed_s)
    return PartitionResult(
        seed,
        float(np.mean(unbroken)),
        apart,
        maps_s,
        float(np.mean(healed)),
        estimates_s,
        *(float(np.mean(nees)) / 2.0 for nees in (before, during, after)),
    )


def measure(lab: Scenario, seeds: int) -> str:
    """Both for several seeds, as Markdown."""
    losses = [loss(lab, seed) for seed in range(1, seeds + 1)]
    maps = {"as the lab's, forgetful": lab.exploration.forget_after_s, "as the paper's, never forgets": None}
    partitions = [
        (name, partition(lab, seed, forget_after_s=forget_after_s))
        for name, forget_after_s in maps.items()
        for seed in range(1, seeds + 1)
    ]
    return "\n".join([*_loss_table(losses), "", *_partition_table(partitions)])


def _loss_table(losses: Sequence[LossResult]) -> list[str]:
    rows = [
        f"| {r.seed} | {r.found} of {r.targets} | {r.rmse_good_m:.2f} | {r.rmse_bad_m:.2f} | "
        f"{100.0 * (r.rmse_bad_m / r.rmse_good_m - 1.0):.0f} |"
        for r in losses
    ]
    return [
        f"**{100 * LOSS:.0f} % loss with {1e3 * JITTER_S:.0f} ms jitter** on top of the lab's radio, 60 s of tracking:",
        "",
        "| seed | targets found | RMSE, good radio, m | RMSE, bad radio, m | growth, % |",
        "| ---: | ---: | ---: | ---: | ---: |",
        *rows,
    ]


def _partition_table(partitions: Sequence[tuple[str, PartitionResult]]) -> list[str]:
    rows = [
        f"| {name} | {r.seed} | {100 * r.unbroken:.0f} | {100 * r.apart:.0f} | {r.maps_agree_s:.1f} | "
        f"{100 * r.healed:.0f} | {r.estimates_agree_s:.1f} | "
        f"{r.nees_before:.2f} | {r.nees_during:.2f} | {r.nees_after:.2f} |"
        for name, r in partitions
    ]
    return [
        f"**Vehicle 2 cut off for {PARTITION_S:.0f} s**, radio of unlimited range otherwise. Maps agree when any two "
        f"have {100 * MAP_AGREEMENT:.0f} % of their cells in common; estimates when the two of a target that differ "
        f"most are {TRACK_AGREEMENT_M:g} m apart or less, in the mean over the targets. NEES is per degree of freedom "
        "(1 is consistent; the robots' paths are no random walks).",
        "",
        "| map | seed | maps agree in the 10 s before it, % of instants | equal cells at its end, % "
        "| maps agree after, s | in the 20 s after, % of instants | estimates agree after, s | NEES before "
        "| during | 20 s after |",
        "| --- | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: | ---: |",
        *rows,
    ]


def _tracking(lab: Scenario, seed: int, *faults: FaultConfig) -> Flight:
    flight = Flight(lab, seed)
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


def _disagreement_m(flight: Flight) -> float:
    """Mean over the targets of how far the two vehicles' estimates that differ most are apart, m."""
    agents = [companion.agent for companion in flight.team.companions.values() if companion.agent is not None]
    tracks = [agent.tracks for agent in agents]
    known = set().union(*tracks)
    apart = [
        max(
            float(np.linalg.norm(first[target_id].mean[:2] - second[target_id].mean[:2]))
            if target_id in first and target_id in second
            else _UNKNOWN_M
            for first, second in combinations(tracks, 2)
        )
        for target_id in known
    ]
    return float(np.mean(apart)) if apart else 0.0
