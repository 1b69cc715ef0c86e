"""What a planner is given: a start, a horizon, primitives, a sensor, and the blocks whose uncertainty counts."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetMotion
from onboard.geometry import Pose
from onboard.planning.primitives import Primitive

__all__ = ["Block", "Obstacles", "Problem", "Teammate"]


@dataclass(frozen=True)
class Block:
    """One target or landmark: an independent block of the joint state.

    Attributes:
        block_id: Number that the caller knows it by.
        motion: Target model and its noise.
        mean: (n,) at step 0: m, and m/s for a double integrator.
        covariance: (n, n) at step 0, symmetric positive definite: m², m²/s, m²/s².
    """

    block_id: int
    motion: TargetMotion
    mean: NDArray[np.float64]
    covariance: NDArray[np.float64]


@dataclass(frozen=True)
class Teammate:
    """A teammate's fixed plan (paper, eq. 9).

    Attributes:
        poses: (T, 3) north m, east m, yaw rad, one for each step 1..T.
        separation_m: Horizontal distance to keep from its pose at each step, m; 0 when it flies on another layer.
    """

    poses: NDArray[np.float64]
    separation_m: float = 0.0


@dataclass(frozen=True)
class Obstacles:
    """Static obstacles as a grid in the mission frame.

    Attributes:
        blocked: (rows, columns) bool; True where a robot must not be. Rows go north, columns east.
        origin_north_m: North of cell (0, 0)'s south-west corner, m.
        origin_east_m: East of the same corner, m.
        cell_m: Side of a cell, m.
    """

    blocked: NDArray[np.bool_]
    origin_north_m: float
    origin_east_m: float
    cell_m: float


@dataclass(frozen=True)
class Problem:
    """Active information acquisition for one robot (paper, Problem 1).

    Attributes:
        pose: Where the robot is at step 0.
        step_s: τ, s.
        horizon: T, steps.
        primitives: The finite control set; plans are indices into it.
        sensor: The robot's own sensor; teammates have the same.
        blocks: Targets and landmarks.
        teammates: Fixed plans of the robots that planned before.
        fence: (K, 2) corners north m, east m of a simple polygon to stay inside, or None. A pose is feasible when it
            is inside and the robot can still brake: turn as tightly as its primitives allow, or stop if it can hover.
        obstacles: Static obstacles, or None.
    """

    pose: Pose
    step_s: float
    horizon: int
    primitives: tuple[Primitive, ...]
    sensor: RangeBearingSensor
    blocks: tuple[Block, ...]
    teammates: tuple[Teammate, ...] = ()
    fence: NDArray[np.float64] | None = None
    obstacles: Obstacles | None = field(default=None)
