"""A :class:`Problem` as contiguous arrays: what the kernels read."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.target_models import TargetModel
from onboard.planning.blocks import FOUR, TWO, pack_block
from onboard.planning.feasibility import PackedBounds, pack_bounds
from onboard.planning.jit import entry_kernel
from onboard.planning.looks import PackedSensor, is_seen, look_weights, pack_sensor
from onboard.planning.primitives import sinc
from onboard.planning.problem import Block, Problem

__all__ = ["PackedBlocks", "PackedProblem", "pack_problem"]


class PackedBlocks(NamedTuple):
    """Targets and landmarks, the four-state ones first.

    Attributes:
        n4: Number of four-state blocks.
        n2: Number of two-state blocks.
        step_s: τ, s.
        prior: (1, L) packed covariances at step 0.
        means: (T + 1, B, 2) predicted mean positions, north m, east m.
        process_noise: (B, 3) the position, cross and velocity entries of W (each times I₂).
        team_information: (T + 1, B, 3) nn, ne, ee entries of the teammates' information, m⁻².
        team_looks: (T + 1,) how many blocks the teammates see at each step.
    """

    n4: int
    n2: int
    step_s: float
    prior: NDArray[np.float64]
    means: NDArray[np.float64]
    process_noise: NDArray[np.float64]
    team_information: NDArray[np.float64]
    team_looks: NDArray[np.int64]


class PackedProblem(NamedTuple):
    """One planning problem.

    Attributes:
        start: (3,) north m, east m, yaw rad.
        horizon: T.
        motions: (U, 7) per primitive: displacement ahead and to the right in the body frame at the step's start (m),
            turn (rad), its cosine and sine, speed (m/s), yaw rate (rad/s).
        reach_m: The longest displacement in a step, m.
        sensor: The sensor.
        blocks: Targets and landmarks.
        bounds: Where the robot may be.
    """

    start: NDArray[np.float64]
    horizon: int
    motions: NDArray[np.float64]
    reach_m: float
    sensor: PackedSensor
    blocks: PackedBlocks
    bounds: PackedBounds


def pack_problem(problem: Problem) -> PackedProblem:
    """The problem as the kernels want it.

    Raises:
        ValueError: If there are no primitives, the horizon is not positive, or an array has the wrong shape.
    """
    if not problem.primitives:
        raise ValueError("primitives: at least one is needed")
    if problem.horizon < 1:
        raise ValueError(f"horizon: must be at least 1 step, is {problem.horizon}")
    four = [block for block in problem.blocks if block.motion.model is TargetModel.DOUBLE_INTEGRATOR]
    two = [block for block in problem.blocks if block.motion.model is not TargetModel.DOUBLE_INTEGRATOR]
    horizon, step_s = problem.horizon, float(problem.step_s)
    blocks = [*four, *two]
    sensor = pack_sensor(problem.sensor)
    means = _mean_positions(four, two, horizon, step_s)
    team_information = np.zeros((horizon + 1, len(blocks), 3))
    for teammate in problem.teammates:
        if teammate.poses.shape != (horizon, 3):
            raise ValueError(f"teammate's poses: shape ({horizon}, 3) is needed, got {teammate.poses.shape}")
        _add_looks(sensor, np.ascontiguousarray(teammate.poses, dtype=np.float64), means, team_information)
    motions = _motions(problem)
    return PackedProblem(
        start=np.array(problem.pose.as_tuple(), dtype=np.float64),
        horizon=horizon,
        motions=motions,
        reach_m=float(np.hypot(motions[:, 0], motions[:, 1]).max()),
        sensor=sensor,
        blocks=PackedBlocks(
            n4=len(four),
            n2=len(two),
            step_s=step_s,
            prior=_prior(four, two),
            means=means,
            process_noise=_process_noise(blocks, step_s),
            team_information=team_information,
            team_looks=np.count_nonzero(team_information.any(axis=2), axis=1).astype(np.int64),
        ),
        bounds=pack_bounds(problem),
    )


def _motions(problem: Problem) -> NDArray[np.float64]:
    rows = []
    for primitive in problem.primitives:
        half_turn = 0.5 * primitive.yaw_rate_rad_s * problem.step_s
        chord = problem.step_s * primitive.speed_m_s * sinc(half_turn)
        rows.append((
            chord * math.cos(half_turn), chord * math.sin(half_turn),
            2.0 * half_turn, math.cos(2.0 * half_turn), math.sin(2.0 * half_turn),
            primitive.speed_m_s, primitive.yaw_rate_rad_s,
        ))  # fmt: skip
    return np.array(rows, dtype=np.float64)


def _prior(four: list[Block], two: list[Block]) -> NDArray[np.float64]:
    row = np.empty((1, FOUR * len(four) + TWO * len(two)))
    position = 0
    for block in [*four, *two]:
        packed = pack_block(block.covariance)
        row[0, position : position + packed.size] = packed
        position += packed.size
    return row


def _mean_positions(four: list[Block], two: list[Block], horizon: int, step_s: float) -> NDArray[np.float64]:
    """Predicted positions: constant velocity for a double integrator, at rest otherwise."""
    start = np.array([block.mean[:2] for block in [*four, *two]], dtype=np.float64).reshape(-1, 2)
    velocity = np.zeros_like(start)
    velocity[: len(four)] = np.array([block.mean[2:] for block in four], dtype=np.float64).reshape(-1, 2)
    return start + (step_s * np.arange(horizon + 1))[:, None, None] * velocity


def _process_noise(blocks: list[Block], step_s: float) -> NDArray[np.float64]:
    """The distinct entries of W, from its definition so that there is one of it."""
    entries = np.zeros((len(blocks), 3))
    for index, block in enumerate(blocks):
        w = block.motion.process_noise(step_s)
        entries[index, 0] = w[0, 0]
        if block.motion.model is TargetModel.DOUBLE_INTEGRATOR:
            entries[index, 1:] = w[0, 2], w[2, 2]
    return entries


@entry_kernel
def _add_looks(
    sensor: PackedSensor, poses: NDArray[np.float64], means: NDArray[np.float64], information: NDArray[np.float64]
) -> None:
    """Add what a teammate at ``poses`` (T, 3) sees to ``information`` (T + 1, B, 3)."""
    for step in range(1, means.shape[0]):
        cosine, sine = math.cos(poses[step - 1, 2]), math.sin(poses[step - 1, 2])
        for block in range(means.shape[1]):
            north = means[step, block, 0] - poses[step - 1, 0]
            east = means[step, block, 1] - poses[step - 1, 1]
            if is_seen(sensor, north, east, cosine, sine):
                along, across, n, e = look_weights(sensor, north, east, cosine, sine)
                information[step, block, 0] += along * n * n + across * e * e
                information[step, block, 1] += (along - across) * n * e
                information[step, block, 2] += along * e * e + across * n * n
