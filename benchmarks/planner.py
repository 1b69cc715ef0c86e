"""How fast the planner is, and how good its plans are after how long.

    python -m benchmarks.planner [--seconds S] [--plans N] [--json FILE]

Everything runs in one process on one core. Rates are the best of several runs, in CPU time of the planning thread, so
that other work on the machine disturbs them little. The plain numpy twin and dense joint covariances do the same work
per successor (predict, look, log det) in the same run; ratios to them travel better between machines than rates.
"""

from __future__ import annotations

import argparse
import json
import math
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose
from onboard.planning.plan import Budget
from onboard.planning.planner import Planner
from onboard.planning.primitives import Primitive, advance
from onboard.planning.problem import Block, Problem
from onboard.planning.problem_file import load_problem
from onboard.planning.warmup import warm_kernels

REFERENCE = Path(__file__).parents[1] / "tests" / "data" / "problems"
PRIMITIVES = tuple(Primitive(speed, rate) for speed in (1.0, 3.0) for rate in (0.0, 1.0, -1.0, 3.0, -3.0))
SENSOR = RangeBearingSensor(0.15, math.radians(5.0), 10.0, math.radians(94.0), noise_floor=1.0)


def problem_of(targets: int, horizon: int, seed: int = 0) -> Problem:
    """The paper's simulation model, targets spread so that their density stays the same."""
    rng = np.random.default_rng(seed)
    half = 3.2 * math.sqrt(targets) + 4.0
    blocks = tuple(
        Block(
            number,
            TargetMotion(TargetModel.DOUBLE_INTEGRATOR, 0.001),
            np.array([*rng.uniform(-half, half, 2), 0.0, 0.0]),
            np.diag([1.0, 1.0, 0.1, 0.1]),
        )
        for number in range(targets)
    )
    return Problem(Pose(0.0, 0.0, 0.0), 0.5, horizon, PRIMITIVES, SENSOR, blocks)


def rate(work: Callable[[], int], repeats: int = 5) -> float:
    """Successors per second of CPU time, best of several runs."""
    best = 0.0
    for _ in range(repeats):
        start = time.thread_time()
        best = max(best, work() / (time.thread_time() - start))
    return best


def numpy_successors(problem: Problem, dense: bool, wanted: int = 60) -> int:
    """Expand the root again and again in plain numpy: per block, or with one joint covariance as the authors do."""
    blocks, tau = problem.blocks, problem.step_s
    size = 4 * len(blocks)
    a, w = blocks[0].motion.transition(tau), blocks[0].motion.process_noise(tau)
    stacked = np.array([block.covariance for block in blocks])
    means = np.array([block.mean for block in blocks])[:, :2]
    joint = np.zeros((size, size))
    for index, block in enumerate(blocks):
        joint[4 * index : 4 * index + 4, 4 * index : 4 * index + 4] = block.covariance
    joint_a, joint_w = np.kron(np.eye(len(blocks)), a), np.kron(np.eye(len(blocks)), w)
    made = 0
    while made < wanted:
        for primitive in problem.primitives:
            pose = advance(problem.pose, primitive, tau)
            looks = [(i, problem.sensor.position_information(pose, *m)) for i, m in enumerate(means)]
            if dense:
                sigma = joint_a @ joint @ joint_a.T + joint_w
                information = np.zeros((size, size))
                for index, look in looks:
                    information[4 * index : 4 * index + 2, 4 * index : 4 * index + 2] = look
                sigma = sigma @ np.linalg.solve(np.eye(size) + information @ sigma, np.eye(size))
                np.linalg.slogdet(sigma)
            else:
                sigma = a @ stacked @ a.T + w
                for index, look in looks:
                    if look.any():
                        p = sigma[index, :, :2]
                        sigma[index] -= p @ np.linalg.solve(np.eye(2) + look @ p[:2], look @ p.T)
                np.linalg.slogdet(sigma)[1].sum()
            made += 1
    return made


def rates(planner: Planner) -> list[dict[str, float]]:
    """Successors per second over targets and horizon, pruning included: the whole call of the planner."""
    rows = []
    for targets, horizon in [*((m, 12) for m in (1, 2, 4, 9, 16, 25, 49, 100)), *((25, t) for t in (4, 8, 16, 24))]:
        problem = problem_of(targets, horizon)
        nodes = min(200_000, 4_000_000 // targets)
        planner_rate = rate(lambda p=problem, n=nodes: planner.plan(p, Budget(nodes=n)).nodes_generated)
        rows.append(
            {
                "targets": targets,
                "horizon": horizon,
                "per_s": planner_rate,
                "times_numpy": planner_rate / rate(lambda p=problem: numpy_successors(p, dense=False), 2),
                "times_dense": planner_rate / rate(lambda p=problem: numpy_successors(p, dense=True), 2),
            }
        )
    return rows


def qualities(planner: Planner) -> list[dict[str, float | str]]:
    """How far above the best known cost, in per cent, after 0.02, 0.1 and 0.5 s."""
    known = json.loads((REFERENCE / "reference.json").read_text())["problems"]
    rows: list[dict[str, float | str]] = []
    for name, entry in known.items():
        problem = load_problem(REFERENCE / f"{name}.json")
        row: dict[str, float | str] = {"problem": name, "best_known": entry["best_known"]}
        row["authors_2s"] = 100.0 * (1.0 - min(entry["authors_cpp"].values()) / entry["best_known"])
        for seconds in (0.02, 0.1, 0.5):
            plan = planner.plan(problem, Budget(deadline_s=time.perf_counter() + seconds))
            row[f"after_{seconds}"] = 100.0 * (1.0 - plan.cost / entry["best_known"])
        rows.append(row)
    return rows


def overruns(planner: Planner, plans: int) -> dict[str, float]:
    """By how much deadlines are missed, ms, over plans of mixed size, with a busy process beside.

    ``undisturbed``: only plans during which the operating system did not take the core away.
    """
    problems = [problem_of(m, t, seed) for seed, (m, t) in enumerate([(1, 12), (4, 8), (9, 16), (25, 12), (49, 16)])]
    busy = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    late, undisturbed = [], []
    try:
        for number in range(plans):
            seconds = (0.005, 0.01, 0.02, 0.05)[number % 4]
            switches = resource.getrusage(resource.RUSAGE_THREAD).ru_nivcsw
            deadline = time.perf_counter() + seconds
            planner.plan(problems[number % len(problems)], Budget(deadline_s=deadline))
            late.append(1e3 * (time.perf_counter() - deadline))
            if resource.getrusage(resource.RUSAGE_THREAD).ru_nivcsw == switches:
                undisturbed.append(late[-1])
    finally:
        busy.kill()
        busy.wait()
    return {
        "median_ms": float(np.median(late)),
        "p99_ms": float(np.quantile(late, 0.99)),
        "max_ms": max(late),
        "undisturbed": float(len(undisturbed)),
        "undisturbed_p99_ms": float(np.quantile(undisturbed, 0.99)),
        "undisturbed_max_ms": max(undisturbed),
    }


def memory(planner: Planner) -> dict[str, float]:
    """The planner's own memory, the process's peak, and its growth over 10,000 plans, MB."""
    problem = problem_of(9, 8)
    planner.plan(problem, Budget(nodes=20_000))
    before = _resident_mb()
    for _ in range(10_000):
        planner.plan(problem, Budget(nodes=200))
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {"planner_mb": planner.nbytes / 2**20, "peak_mb": peak, "growth_mb": _resident_mb() - before}


def _resident_mb() -> float:
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * os.sysconf("SC_PAGE_SIZE") / 2**20


def start_up() -> dict[str, float]:
    """Seconds of wall time to import and warm the kernels, in a new process: cold and warm cache."""
    code = "import time; t = time.perf_counter(); from onboard.planning.warmup import warm_kernels; warm_kernels(); "
    code += "print(time.perf_counter() - t)"
    with tempfile.TemporaryDirectory() as folder:
        times = [
            float(
                subprocess.run(
                    [sys.executable, "-c", code],
                    env={**os.environ, "NUMBA_CACHE_DIR": folder},
                    check=True,
                    capture_output=True,
                    text=True,
                ).stdout
            )
            for _ in range(2)
        ]
    return {"cold_s": times[0], "warm_s": times[1]}


def table(rows: list[dict[str, float | str]]) -> str:
    """Rows as a Markdown table."""
    heads = list(rows[0])
    lines = ["| " + " | ".join(heads) + " |", "|" + " --- |" * len(heads)]
    for row in rows:
        cells = [f"{value:,.4g}" if isinstance(value, float) and value < 1e4 else f"{value:,.0f}"
                 if isinstance(value, float) else str(value) for value in row.values()]  # fmt: skip
        lines.append("| " + " | ".join(cells) + " |")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--plans", type=int, default=1000, help="plans for the overrun statistics")
    parser.add_argument("--json", type=Path, help="write all results to this file as well")
    options = parser.parse_args()
    warm_kernels()
    planner = Planner()
    results = {
        "rates": rates(planner),
        "quality_percent_above_best_known": qualities(planner),
        "overrun": [overruns(planner, options.plans)],
        "memory": [memory(planner)],
        "start_up": [start_up()],
    }
    for name, rows in results.items():
        print(f"\n## {name}\n\n{table(rows)}", flush=True)  # type: ignore[arg-type]
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
