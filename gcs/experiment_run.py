"""What ``arvi experiment`` does once its arguments are understood; the exit codes."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from itertools import chain
from pathlib import Path

from rich.console import Console
from rich.markdown import Markdown
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

from gcs.exit_codes import EXIT_BAD_INPUT, EXIT_FAILED, EXIT_INTERRUPTED
from gcs.experiment_flight import fly_trial
from gcs.output import open_console
from gcs.version import program_version
from onboard.errors import OnboardError
from sim_bridge.errors import BridgeError
from sim_bridge.experiments import figures, report, statistics
from sim_bridge.experiments import snapshot as pictures
from sim_bridge.experiments.loader import Experiment, load_experiment
from sim_bridge.experiments.records import Failure, TrialKey, TrialTask, trial_seed
from sim_bridge.experiments.run import Outcome, connect, run_trials
from sim_bridge.experiments.store import ResultFolder
from sim_bridge.figure_files import save

__all__ = ["ExperimentOptions", "run_experiment"]

_FRAMES = 150
"""A film has at most so many."""

OnProgress = Callable[[TrialKey, int], None]


@dataclass(frozen=True)
class ExperimentOptions:
    """The command's arguments; None takes what the file says.

    Attributes:
        config: The experiment's file.
        trials: Of each arm.
        steps: Of each trial.
        workers: Local processes; None for one per core.
        scheduler: Address of a dask.distributed scheduler instead.
        out: Folder for the results; None for runs/NAME.
        resume: Continue what is there.
        redraw: Only summarise and draw what is there.
        arms: Only these; all if empty.
        snapshot: Draw the first trial at this step instead of running the experiment.
        animate: Film the first trial instead.
    """

    config: Path
    trials: int | None = None
    steps: int | None = None
    workers: int | None = None
    scheduler: str | None = None
    out: Path | None = None
    resume: bool = False
    redraw: bool = False
    arms: tuple[str, ...] = ()
    snapshot: int | None = None
    animate: bool = False


def run_experiment(options: ExperimentOptions) -> int:
    """Run, or draw; the exit code."""
    console = open_console()
    try:
        experiment = load_experiment(options.config)
        tasks = _tasks(experiment, options)
        folder = options.out or Path("runs") / experiment.name
        if options.snapshot is not None or options.animate:
            _draw(console, tasks[0], experiment.arms[tasks[0].arm].label, folder, options)
            return 0
        trials = options.trials or experiment.trials
        store = ResultFolder(folder, experiment, trials, tasks[0].steps, resume=options.resume, redraw=options.redraw)
        if options.redraw:
            _conclude(console, experiment, store)
            return 0
        return _run(console, experiment, tasks, store, options)
    except (OnboardError, BridgeError) as error:
        sys.stderr.write(f"{error}\n")
        return EXIT_BAD_INPUT


def _tasks(experiment: Experiment, options: ExperimentOptions) -> list[TrialTask]:
    """All trials, the first trial of every arm first: an interrupted run has something of each."""
    known = [arm.label for arm in experiment.arms]
    for label in options.arms:
        if label not in known:
            raise BridgeError(f"--arm {label!r}: no such arm in {options.config}; there are {', '.join(known)}")
    return [
        TrialTask(
            arm=index,
            trial=trial,
            seed=trial_seed(experiment.seed, trial),
            steps=options.steps or experiment.steps,
            setting=arm.setting,
        )
        for trial in range(options.trials or experiment.trials)
        for index, arm in enumerate(experiment.arms)
        if (not options.arms or arm.label in options.arms) and trial < arm.trials(trial + 1)
    ]


def _run(
    console: Console, experiment: Experiment, tasks: list[TrialTask], store: ResultFolder, options: ExperimentOptions
) -> int:
    done = store.completed()
    todo = [task for task in tasks if task.key not in done]
    if len(todo) < len(tasks):
        console.print(f"{len(tasks) - len(todo)} of {len(tasks)} trials are complete already")
    failures: dict[TrialKey, Failure] = {}
    interrupted = False
    if todo:
        try:
            _work(console, experiment, todo, store, options, failures)
        except KeyboardInterrupt:
            interrupted = True
    store.write_failures(failures)
    _conclude(console, experiment, store)
    for (arm, trial), failure in sorted(failures.items()):
        sys.stderr.write(f"trial {trial} of arm {experiment.arms[arm].label!r} crashed: {failure.reason}\n")
    if failures:
        sys.stderr.write(f"tracebacks: {store.path / 'failures.json'}; --resume tries them again\n")
    if interrupted:
        sys.stderr.write("interrupted; --resume goes on with what is missing\n")
        return EXIT_INTERRUPTED
    return EXIT_FAILED if failures else 0


def _work(
    console: Console,
    experiment: Experiment,
    todo: list[TrialTask],
    store: ResultFolder,
    options: ExperimentOptions,
    failures: dict[TrialKey, Failure],
) -> None:
    """Run what is missing, with a bar that counts steps; what is flown comes last, when the machine is calm."""
    steps_done: dict[TrialKey, int] = {}
    flights = [task for task in todo if task.setting.harness == "processes"]
    simulated = [task for task in todo if task.setting.harness != "processes"]
    with _progress(console) as progress:
        trials = progress.add_task(experiment.name, total=len(todo))
        steps = progress.add_task("steps", total=sum(task.steps for task in todo))

        def on_progress(key: TrialKey, done: int) -> None:
            steps_done[key] = max(steps_done.get(key, 0), done)
            progress.update(steps, completed=sum(steps_done.values()))

        for outcome in chain(
            _simulated(simulated, options, on_progress), _flown(flights, store.path / "flights", on_progress)
        ):
            if outcome.result is not None:
                store.write(outcome.result)
            if outcome.failure is not None:
                failures[outcome.key] = outcome.failure
            on_progress(outcome.key, todo[0].steps)
            progress.advance(TaskID(trials))


def _simulated(tasks: list[TrialTask], options: ExperimentOptions, on_progress: OnProgress) -> Iterator[Outcome]:
    if tasks:
        workers = min(options.workers or os.cpu_count() or 1, len(tasks))
        with connect(workers, options.scheduler) as client:
            yield from run_trials(client, tasks, on_progress)


def _flown(tasks: list[TrialTask], folder: Path, on_progress: OnProgress) -> Iterator[Outcome]:
    """One after the other, on this machine: they share the ports of a flight."""
    for task in tasks:
        place = folder / "-".join(map(str, task.key))
        try:
            result = fly_trial(task, place, program_version(), partial(on_progress, task.key))
        except Exception as error:
            yield Outcome(task.key, None, Failure.of(error))
        else:
            yield Outcome(task.key, result)


def _progress(console: Console) -> Progress:
    return Progress(
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        console=console,
    )


def _conclude(console: Console, experiment: Experiment, store: ResultFolder) -> None:
    """Merge, summarise and draw what is complete."""
    arms = statistics.arm_trials(store.merge(), experiment)
    if not arms:
        console.print("no trial is complete")
        return
    summary = statistics.summarise(experiment, arms, store.machine_records())
    store.write_json("summary.json", summary)
    page = report.markdown(summary)
    store.write_text("summary.md", page)
    pictures_of_run = store.path / "figures"
    save(figures.draw_curves(arms, ordered=_is_sweep(experiment)), pictures_of_run / "curves")
    save(figures.draw_means(summary), pictures_of_run / "means")
    save(figures.draw_costs(experiment.axis, summary), pictures_of_run / "costs")
    console.print(Markdown(page))
    console.print(f"results: {store.path}", soft_wrap=True)


def _is_sweep(experiment: Experiment) -> bool:
    return all(arm.value is not None for arm in experiment.arms)


def _draw(console: Console, task: TrialTask, label: str, folder: Path, options: ExperimentOptions) -> None:
    if task.setting.harness != "lockstep":
        raise BridgeError(f"arm {label!r} is flown, not simulated in lock-step: choose another with --arm to draw it")
    target = folder / "figures"
    try:
        target.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise BridgeError(f"{target}: cannot be made: {error.strerror or error}") from None
    name = "".join(character if character.isalnum() else "-" for character in label)
    files: list[Path] = []
    if options.snapshot is not None:
        files += pictures.snapshot(task, options.snapshot, target / f"snapshot-{name}-{options.snapshot}")
    if options.animate:
        files.append(pictures.animate(task, target / f"film-{name}", math.ceil(task.steps / _FRAMES)))
    for path in files:
        console.print(str(path), soft_wrap=True)
