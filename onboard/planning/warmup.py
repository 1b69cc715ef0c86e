"""Compiling the kernels before they are needed: their first call costs seconds."""

from __future__ import annotations

import fcntl
import hashlib
import math
import os
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.estimation.warmup import warm_filter
from onboard.geometry import Pose
from onboard.mapping.line_of_sight import warm_line_of_sight
from onboard.mapping.visibility_grid import VisibilityGrid
from onboard.planning.jit import is_cached, source_digest
from onboard.planning.plan import Budget
from onboard.planning.planner import Planner
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Problem, Teammate
from onboard.planning.search import run_schedule

__all__ = ["warm_filter_and_map", "warm_kernels"]


def warm_kernels() -> None:
    """Compile every kernel of an onboard process, or load it from the cache on disk.

    Numba's cache is not made for several processes that compile at once. So this holds a lock while it works: of
    several processes that start together one compiles, and the others wait and load. What is not the planner's is
    compiled beside it, in a process of its own, for compiling keeps one core busy for seconds.

    Raises:
        OSError: If the lock file cannot be made.
    """
    with _lock_path().open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        beside = None if is_cached(run_schedule) else subprocess.Popen(_WARM_BESIDE, env=_environment())
        try:
            Planner(node_limit=64).plan(_small_problem(), Budget(nodes=32))
        finally:
            if beside is not None:
                beside.wait()
        warm_filter_and_map()


def warm_filter_and_map() -> None:
    """Compile or load what is not the planner's; :func:`warm_kernels` does so under its lock."""
    warm_filter()
    warm_line_of_sight()
    square = ((0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0))
    told, grid = (VisibilityGrid(square, 0.5, forget_after_s=1.0) for _ in range(2))
    grid.observe(Pose(1.0, 1.0, 0.0), RangeBearingSensor(0.1, 0.1, 1.0, math.tau), 0.0)
    for tile in grid.tiles(changed_since_last=True):
        told.merge(tile, 0.0)
    told.frontier()
    told.expire(0.0)


_WARM_BESIDE = [sys.executable, "-c", "from onboard.planning.warmup import warm_filter_and_map as warm; warm()"]


def _environment() -> dict[str, str]:
    """This process's environment, with this very package first on the path."""
    root = str(Path(__file__).resolve().parents[2])
    path = os.environ.get("PYTHONPATH")
    return {**os.environ, "PYTHONPATH": root if path is None else os.pathsep.join((root, path))}


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
