"""Figures of merit of the team's estimates: targets discovered, position RMSE and entropy (paper, section V).

At each mission step, of each target that somebody knows, over the robots that know it:

- squared error ``mean_i ‖p̂_i − p‖²`` of the estimated position against the truth at the step, m²;
- entropy ``mean_i ½ log det(2πe Σ_i)``, nats.

The team's RMSE at a step is the root of the mean of the squared errors over the targets known then, its entropy their
mean; ``rmse_m`` and ``entropy_nats`` are the means of these over the steps from the first discovery on. One lost target
decides ``rmse_m``; ``rmse_per_target_m``, the mean over the targets of each one's root, is the paper's "average RMSE
per target", and what experiments compare.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from gcs.errors import GroundError
from gcs.target_truth import TargetTruths
from onboard.clock import MissionClock
from onboard.messages import Belief
from onboard.protocol import dialect as mavlink

__all__ = ["Estimate", "EstimateMetrics", "MetricsFigures", "NotGaussianError", "TargetState", "estimate"]

_SETTLE_S = 1.0
"""A step is evaluated this long after its time, when late beliefs and the truth on both sides of it have arrived."""

_TRUTH_MEMORY_S = 5.0


class NotGaussianError(GroundError):
    """A belief whose information matrix is not positive definite, or nearly so that nothing finite comes of it."""


@dataclass(frozen=True, slots=True)
class Estimate:
    """One robot's belief of a target at a step.

    Attributes:
        robot: System id.
        time_s: UNIX time of the step, s.
        north_m: Mean, m.
        east_m: Mean, m.
        position_std_m: Root of the trace of the position's covariance, m.
        entropy_nats: ½ log det(2πe Σ) of the whole state, nats.
        covariance_m2: Of the position: north-north, north-east, east-east, m²; None where it was not kept.
    """

    robot: int
    time_s: float
    north_m: float
    east_m: float
    position_std_m: float
    entropy_nats: float
    covariance_m2: tuple[float, float, float] | None = None


@dataclass(frozen=True, slots=True)
class TargetState:
    """A target at one moment.

    Attributes:
        id: Target.
        discovered_s: UNIX time of the first belief of anybody; None if there is none.
        known_by: Robots whose belief is recent.
        best: The recent estimate of smallest entropy.
        truth: True north m, east m, when the ground is told.
        estimates: The recent estimate of each robot that has one, by system id.
    """

    id: int
    discovered_s: float | None
    known_by: tuple[int, ...]
    best: Estimate | None
    truth: tuple[float, float] | None
    estimates: tuple[Estimate, ...] = ()


@dataclass(frozen=True, slots=True)
class MetricsFigures:
    """The team's estimates so far.

    Attributes:
        rmse_m: Time mean of the RMSE since the first discovery, m; None without truth.
        entropy_nats: Time mean of the entropy since the first discovery, nats.
        rmse_now_m: RMSE at the last evaluated step, m.
        entropy_now_nats: Entropy at the last evaluated step, nats.
        steps: Steps evaluated since the first discovery.
        rmse_per_target_m: Time mean of the RMSE per target, m; None without truth.
    """

    rmse_m: float | None
    entropy_nats: float | None
    rmse_now_m: float | None
    entropy_now_nats: float | None
    steps: int
    rmse_per_target_m: float | None = None


def estimate(belief: Belief, clock: MissionClock) -> Estimate:
    """The Gaussian of a belief: mean = Ω⁻¹ω by Cholesky.

    Raises:
        NotGaussianError: Ω is not positive definite, or so nearly singular that mean or covariance overflow.
    """
    # Ω = L Lᵀ. With L x = e₁, L y = e₂ and L z = ω: Σ₁₁ = x·x, Σ₁₂ = x·y, Σ₂₂ = y·y, mean = (x·z, y·z). By hand, with
    # numbers of Python: a team of twenty tells of two thousand beliefs a second, and numpy takes five times as long.
    matrix, vector = belief.information_matrix.tolist(), belief.information_vector.tolist()
    factor: list[list[float]] = []
    solved: list[tuple[float, float, float]] = []
    log_det = 0.0
    for i, row in enumerate(matrix):
        entries: list[float] = []
        x, y, z = float(i == 0), float(i == 1), vector[i]
        for j, above in enumerate(factor):
            value = row[j]
            for k in range(j):
                value -= entries[k] * above[k]
            value /= above[j]
            entries.append(value)
            x_j, y_j, z_j = solved[j]
            x, y, z = x - value * x_j, y - value * y_j, z - value * z_j
        pivot = row[i]
        for value in entries:
            pivot -= value * value
        if not pivot > 0.0:
            raise NotGaussianError(
                f"vehicle {belief.sender}'s belief of target {belief.target_id} has no positive definite information "
                "matrix"
            )
        diagonal = math.sqrt(pivot)
        factor.append([*entries, diagonal])
        solved.append((x / diagonal, y / diagonal, z / diagonal))
        log_det -= math.log(pivot)
    north = cross = east = north_m = east_m = 0.0
    for x, y, z in solved:
        north, cross, east = north + x * x, cross + x * y, east + y * y
        north_m, east_m = north_m + x * z, east_m + y * z
    if not math.isfinite(north_m * north_m + east_m * east_m + north + east):
        raise NotGaussianError(f"vehicle {belief.sender}'s belief of target {belief.target_id} is at no finite place")
    return Estimate(
        robot=belief.sender,
        time_s=clock.time_of(belief.step),
        north_m=north_m,
        east_m=east_m,
        position_std_m=math.sqrt(north + east),
        entropy_nats=0.5 * (len(vector) * math.log(2.0 * math.pi * math.e) + log_det),
        covariance_m2=(north, cross, east),
    )


class EstimateMetrics:
    """Collects beliefs and truth, and evaluates each step once.

    Args:
        clock: Time of the steps that beliefs count in.

    Attributes:
        end_s: UNIX time after which steps are no longer counted: when the team is sent home, it looks no more.
    """

    def __init__(self, clock: MissionClock) -> None:
        self.end_s = math.inf
        self._clock = clock
        self._open: dict[int, dict[int, dict[int, Estimate]]] = {}
        self._evaluated_until: int | None = None
        self._latest: dict[int, dict[int, Estimate]] = {}
        self._truth = TargetTruths(_TRUTH_MEMORY_S)
        self._discovered_s: dict[int, float] = {}
        self._rmse_sum = 0.0
        self._rmse_per_target_sum = 0.0
        self._rmse_steps = 0
        self._entropy_sum = 0.0
        self._entropy_steps = 0
        self._now: tuple[float | None, float | None] = (None, None)

    @property
    def discovered(self) -> dict[int, float]:
        """UNIX time of each discovered target's first belief, s."""
        return dict(self._discovered_s)

    @property
    def truth_targets(self) -> int:
        """How many targets the truth speaks of."""
        return len(self._truth.ids)

    def belief(self, belief: Belief) -> int | None:
        """Take a robot's belief; the target's id when this discovers it.

        Raises:
            NotGaussianError: Ω is not positive definite.
        """
        gaussian = estimate(belief, self._clock)
        target = belief.target_id
        self._latest.setdefault(target, {})[belief.sender] = gaussian
        if self._evaluated_until is None or belief.step > self._evaluated_until:
            self._open.setdefault(belief.step, {}).setdefault(target, {})[belief.sender] = gaussian
        if target in self._discovered_s:
            return None
        self._discovered_s[target] = gaussian.time_s
        return target

    def truth(self, message: mavlink.MAVLink_target_truth_message) -> None:
        """Take a target's true position."""
        self._truth.receive(message)

    def advance(self, unix_s: float) -> None:
        """Evaluate the steps that are over by this UNIX time."""
        for step in sorted(self._open):
            if self._clock.time_of(step) + _SETTLE_S > unix_s:
                break
            targets = self._open.pop(step)
            self._evaluated_until = step
            if self._clock.time_of(step) <= self.end_s:
                self._evaluate(step, targets)

    def figures(self) -> MetricsFigures:
        """The figures so far."""
        return MetricsFigures(
            rmse_m=self._rmse_sum / self._rmse_steps if self._rmse_steps else None,
            rmse_per_target_m=self._rmse_per_target_sum / self._rmse_steps if self._rmse_steps else None,
            entropy_nats=self._entropy_sum / self._entropy_steps if self._entropy_steps else None,
            rmse_now_m=self._now[0],
            entropy_now_nats=self._now[1],
            steps=self._entropy_steps,
        )

    def targets(self, unix_s: float) -> tuple[TargetState, ...]:
        """All targets that beliefs or truth speak of, at this UNIX time."""
        states = []
        for target in sorted({*self._truth.ids, *self._discovered_s}):
            estimates = self._latest.get(target, {})
            recent = [e for e in estimates.values() if unix_s - e.time_s < _SETTLE_S + 2.0 * self._clock.step_s]
            states.append(
                TargetState(
                    id=target,
                    discovered_s=self._discovered_s.get(target),
                    known_by=tuple(sorted(e.robot for e in recent)),
                    best=min(recent, key=lambda e: e.entropy_nats, default=None),
                    truth=self._truth.latest(target),
                    estimates=tuple(sorted(recent, key=lambda e: e.robot)),
                )
            )
        return tuple(states)

    def _evaluate(self, step: int, targets: dict[int, dict[int, Estimate]]) -> None:
        squared, entropies = [], []
        for target, estimates in targets.items():
            entropies.append(sum(e.entropy_nats for e in estimates.values()) / len(estimates))
            truth = self._truth.at(target, self._clock.time_of(step))
            if truth is not None:
                errors = [(e.north_m - truth[0]) ** 2 + (e.east_m - truth[1]) ** 2 for e in estimates.values()]
                squared.append(sum(errors) / len(errors))
        entropy = sum(entropies) / len(entropies)
        self._entropy_sum += entropy
        self._entropy_steps += 1
        rmse = None
        if squared:
            rmse = math.sqrt(sum(squared) / len(squared))
            self._rmse_sum += rmse
            self._rmse_per_target_sum += sum(map(math.sqrt, squared)) / len(squared)
            self._rmse_steps += 1
        self._now = (rmse, entropy)
