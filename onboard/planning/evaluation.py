"""What a sequence of controls costs: eq. (6) term by term, in plain numpy and without anything of the search."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.geometry import Pose
from onboard.planning.primitives import advance
from onboard.planning.problem import Block, Problem

__all__ = ["evaluate", "follow", "posterior_covariances"]


def follow(problem: Problem, controls: Sequence[int] | NDArray[np.int64]) -> NDArray[np.float64]:
    """The poses (len(controls), 3), north m, east m, yaw rad, that controls lead through; −1 stays where it is."""
    poses = np.empty((len(controls), 3))
    pose = problem.pose
    for step, control in enumerate(controls):
        if control >= 0:
            pose = advance(pose, problem.primitives[control], problem.step_s)
        poses[step] = pose.as_tuple()
    return poses


def posterior_covariances(problem: Problem, block: Block, poses: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Σ of one block after each step, each (n, n), when the robot and its teammates look along their poses."""
    a = block.motion.transition(problem.step_s)
    w = block.motion.process_noise(problem.step_s)
    mean, covariance = block.mean, block.covariance
    h = np.eye(2, block.motion.model.state_size)
    result = []
    for step in range(len(poses)):
        mean = a @ mean
        covariance = a @ covariance @ a.T + w
        information = np.zeros((2, 2))
        for pose in (poses[step], *(teammate.poses[step] for teammate in problem.teammates)):
            information += problem.sensor.position_information(Pose(*map(float, pose)), float(mean[0]), float(mean[1]))
        # Σ⁺ = Σ − ΣHᵀ(I + MΣ_pp)⁻¹MHΣ
        gain = covariance @ h.T
        covariance = covariance - gain @ np.linalg.solve(np.eye(2) + information @ h @ gain, information @ gain.T)
        covariance = 0.5 * (covariance + covariance.T)
        result.append(covariance)
    return result


def evaluate(problem: Problem, controls: Sequence[int] | NDArray[np.int64]) -> float:
    """J of eq. (6): ``Σ_t Σ_blocks log det Σ_t`` for the poses that the controls lead through."""
    poses = follow(problem, controls)
    return float(
        sum(
            np.linalg.slogdet(covariance)[1]
            for block in problem.blocks
            for covariance in posterior_covariances(problem, block, poses)
        )
    )
