"""What goes into a trial and what comes out of it."""

from __future__ import annotations

import contextlib
import traceback
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from sim_bridge.experiments.schema import Setting
from sim_bridge.lockstep.figures_of_merit import FiguresOfMerit

__all__ = [
    "STEP_COLUMNS",
    "Failure",
    "StepColumns",
    "TrialKey",
    "TrialResult",
    "TrialTask",
    "trial_seed",
]

STEP_COLUMNS: dict[str, type] = {
    "step": int,
    "time_s": float,
    "entropy_nats": float,
    "known_by_robot": float,
    "rmse_m": float,
    "rmse_per_target_m": float,
    "tracked_by_robot": float,
    "known_by_team": int,
    "explored_share": float,
    "groups": int,
    "looks": int,
    "plans": int,
    "infeasible_plans": int,
    "nodes": int,
    "messages_sent": int,
    "bytes_sent": int,
    "messages_delivered": int,
    "messages_lost": int,
}
"""Columns of the record of a step; counts are of that step alone, and null where a harness does not count them."""

TrialKey = tuple[int, int]
"""Arm and trial, both from 0."""

Value = int | float | None


@dataclass(frozen=True)
class TrialTask:
    """What a worker needs for one trial.

    Attributes:
        arm: Which arm, from 0.
        trial: Which trial, from 0.
        seed: Of the trial.
        steps: How many.
        setting: Of the arm.
    """

    arm: int
    trial: int
    seed: int
    steps: int
    setting: Setting

    @property
    def key(self) -> TrialKey:
        """Arm and trial."""
        return self.arm, self.trial


@dataclass(frozen=True)
class TrialResult:
    """What came out of one trial.

    Attributes:
        key: Arm and trial.
        columns: A list for each of :data:`STEP_COLUMNS`, one entry a step. With a node budget it depends on nothing but
            the task.
        planning_s: Time that each plan took on the budget's clock, s, in the order they were made. This and the next
            three depend on the machine.
        wall_s: Of the whole trial, s.
        cpu_s: Processor time that it took, s; also where others use the machine.
        peak_memory_bytes: Of its process while it ran; see :class:`PeakMemory`.
    """

    key: TrialKey
    columns: dict[str, list[Value]]
    planning_s: list[float]
    wall_s: float
    cpu_s: float
    peak_memory_bytes: int


@dataclass(frozen=True)
class Failure:
    """Why a trial crashed.

    Attributes:
        reason: In a line.
        details: Traceback.
    """

    reason: str
    details: str

    @classmethod
    def of(cls, error: BaseException) -> Failure:
        """The failure that an exception was."""
        name, text = type(error).__name__, str(error).strip()
        return cls(f"{name}: {text.splitlines()[0]}" if text else name, "".join(traceback.format_exception(error)))


@dataclass
class StepColumns:
    """Collects the records of steps.

    Attributes:
        values: A list for each of :data:`STEP_COLUMNS`.
    """

    values: dict[str, list[Value]] = field(default_factory=lambda: {name: [] for name in STEP_COLUMNS})

    def append(self, *, merit: FiguresOfMerit, **others: int | float) -> None:
        """One step; columns that are not given are null."""
        row: dict[str, Value] = {
            "entropy_nats": merit.entropy_nats,
            "known_by_robot": merit.known_by_robot,
            "rmse_m": merit.rmse_m,
            "rmse_per_target_m": merit.rmse_per_target_m,
            "tracked_by_robot": merit.tracked_by_robot,
            "known_by_team": merit.known_by_team,
            **others,
        }
        for name, values in self.values.items():
            values.append(row.pop(name, None))
        if row:
            raise KeyError(f"no such columns: {', '.join(row)}")


def trial_seed(seed: int, trial: int) -> int:
    """The seed of a trial: the same in every arm, so that arms are compared pair by pair."""
    return int(np.random.SeedSequence(seed, spawn_key=(trial,)).generate_state(1, np.uint32)[0])


class PeakMemory:
    """The largest resident memory of this process from here on, bytes.

    Linux lets a process reset its high-water mark (proc(5): ``clear_refs``, ``VmHWM``). Elsewhere the mark is that of
    the process so far, which other trials in it may have set; 0 where there is none.
    """

    def __init__(self) -> None:
        with contextlib.suppress(OSError):
            Path("/proc/self/clear_refs").write_text("5", encoding="ascii")

    def bytes_now(self) -> int:
        """The mark."""
        with contextlib.suppress(OSError):
            for line in Path("/proc/self/status").read_text(encoding="ascii").splitlines():
                if line.startswith("VmHWM:"):
                    return int(line.split()[1]) * 1024
        try:
            import resource  # noqa: PLC0415 - not on every system
        except ImportError:
            return 0
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
