"""Trials that are flown: by real processes over MAVLink, in real time, on the ports that a flight uses."""

from __future__ import annotations

import asyncio
import json
import resource
import time
from collections.abc import Callable
from pathlib import Path

from gcs.errors import GroundError
from gcs.experiment_records import read_recording
from gcs.launcher import FlightOptions, FlightResult, Programs, fly
from gcs.team import Event, TeamState
from onboard.config import Scenario
from onboard.protocol import dialect as mavlink
from sim_bridge.experiments.records import TrialResult, TrialTask

__all__ = ["fly_trial"]


class _Progress:
    """The operator's display of a flight that nobody watches: tells how many steps are done, and keeps complaints."""

    def __init__(self, steps: int, step_s: float, on_step: Callable[[int], None]) -> None:
        self.complaints: list[str] = []
        self._steps = steps
        self._step_s = step_s
        self._on_step = on_step

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Report progress from the time that is left."""
        if time_left_s is not None:
            self._on_step(max(0, self._steps - round(time_left_s / self._step_s)))

    def event(self, event: Event) -> None:
        """Keep what is an error."""
        if event.severity <= mavlink.MAV_SEVERITY_ERROR:
            self.complaints.append(f"{event.source}: {event.text}")


def fly_trial(
    task: TrialTask,
    folder: Path,
    version: str,
    on_step: Callable[[int], None] = lambda _: None,
    programs: Callable[[Path, int], Programs] = Programs.of,
) -> TrialResult:
    """Fly a trial: launch bridge and onboard processes, take off, track for its steps, land, and read the recording.

    The seed decides the simulation; how the processes' messages meet in time is decided by the machine.

    Args:
        task: Which; its setting has a simulation.
        folder: A new one for scenario, recording and logs.
        version: Of this program.
        on_step: Called with the number of steps done, ten times a second.
        programs: What is started, by scenario file and seed.

    Raises:
        KeyboardInterrupt: The operator stopped it; the team has landed.
        OnboardError: The flight is not possible (its ports are in use, say), or went wrong.
    """
    scenario = task.setting.simulated_scenario("experiment")
    step_s = scenario.mission.step_s
    config = _write_scenario(scenario, folder)
    options = FlightOptions(
        config=config,
        scenario=scenario,
        duration_s=task.steps * step_s,
        seed=task.seed,
        record=folder,
        version=version,
    )
    display = _Progress(task.steps, step_s, on_step)
    begun_s = time.perf_counter()
    result = asyncio.run(fly(options, display, programs(config, task.seed)))
    wall_s = time.perf_counter() - begun_s
    summary = result.summary
    if result.problems or summary is None or result.folder is None:
        raise GroundError(_failure(result, display.complaints))
    if summary["duration_s"] < options.duration_s - step_s:
        raise KeyboardInterrupt
    record = read_recording(result.folder, scenario, summary["mission_start_s"], task.steps)
    return TrialResult(
        task.key,
        record.columns().values,
        record.planning_s,
        wall_s=wall_s,
        cpu_s=sum(seconds or 0.0 for seconds in summary["cpu_s"].values()),
        peak_memory_bytes=resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss * 1024,
    )


def _write_scenario(scenario: Scenario, folder: Path) -> Path:
    """The scenario as a file that the processes read: JSON, which is YAML."""
    path = folder / "scenario.yaml"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        path.write_text(json.dumps(scenario.model_dump(mode="json"), indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise GroundError(f"{path}: cannot be written: {error.strerror or error}") from None
    return path


def _failure(result: FlightResult, complaints: list[str]) -> str:
    problems = [*result.problems, *(text for text in complaints if text not in result.problems)]
    where = "" if result.folder is None else f" (logs: {result.folder})"
    return f"the flight failed: {'; '.join(problems) or 'no reason given'}{where}"
