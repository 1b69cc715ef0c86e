"""Compiling the kernels before they are needed: their first call costs seconds."""

from __future__ import annotations

import fcntl
import hashlib
import math
import os
import tempfile
from pathlib import Path

import numpy as np

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.estimation.warmup import warm_filter
from onboard.geometry import Pose
from onboard.mapping.line_of_sight import warm_line_of_sight
from onboard.planning.jit import source_digest
from onboard.planning.plan import Budget
from onboard.planning.planner import Planner
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Problem, Teammate

__all__ = ["warm_kernels"]


def warm_kernels() -> None:
    """Compile every kernel of an onboard process, or load it from the cache on disk.

    Numba's cache is not made for several processes that compile at once. So this holds a lock while it works: of
    several processes that start together one compiles, and the others wait and load.

    Raises:
        OSError: If the lock file cannot be made.
    """
    with _lock_path().open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        warm_filter()
        warm_line_of_sight()
        Planner(node_limit=64).plan(_small_problem(), Budget(nodes=32))


def _lock_path() -> Path:
    """One lock per user, installation and version of the kernels."""
    name = f"{os.getuid()}:{Path(__file__).resolve()}:{source_digest()}"
    return Path(tempfile.gettempdir()) / f"arvi-kernels-{hashlib.sha256(name.encode()).hexdigest()[:16]}.lock"


def _small_problem() -> Problem:
    blocks = (
        Block(1, TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.1), np.array([1.0, 1.0, 0.0, 0.0]), np.eye(4)),
        Block(2, TargetMotion(TargetModel.STATIC, 0.0), np.array([2.0, 0.0]), np.eye(2)),
    )
    return Problem(
        pose=Pose(0.0, 0.0, 0.0),
        step_s=0.5,
        horizon=2,
        primitives=(Primitive(1.0, 0.0), Primitive(1.0, 1.0)),
        sensor=RangeBearingSensor(0.1, 0.1, 5.0, math.tau),
        blocks=blocks,
        teammates=(Teammate(np.zeros((2, 3))),),
        fence=np.array([[-9.0, -9.0], [9.0, -9.0], [9.0, 9.0], [-9.0, 9.0]]),
    )
