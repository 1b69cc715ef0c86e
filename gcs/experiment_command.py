"""``arvi experiment``: its arguments; what it does is in :mod:`gcs.experiment_run`."""

from __future__ import annotations

from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

import typer

from gcs.arguments import refuse

__all__ = ["experiment"]

_PACKAGES = ("distributed", "pyarrow", "scipy")


def experiment(
    config: Annotated[Path, typer.Argument(help="Experiment file, e.g. configs/experiments/communication.yaml.")],
    trials: Annotated[int | None, typer.Option(metavar="N", min=1, help="Of each arm, instead of the file's.")] = None,
    steps: Annotated[int | None, typer.Option(metavar="N", min=1, help="Of each trial, instead of the file's.")] = None,
    workers: Annotated[
        int | None, typer.Option(metavar="N", min=1, help="Local processes; one per core unless given.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="URL", help="A dask.distributed scheduler instead of local processes.")
    ] = None,
    out: Annotated[Path | None, typer.Option(metavar="DIR", help="For the results; runs/NAME unless given.")] = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Continue the run in the folder; what is complete is kept.")
    ] = False,
    redraw: Annotated[
        bool, typer.Option("--redraw", help="Only summarise and draw the results in the folder, of any version.")
    ] = False,
    arm: Annotated[list[str] | None, typer.Option(metavar="LABEL", help="Only this arm; may be repeated.")] = None,
    snapshot: Annotated[
        int | None, typer.Option(metavar="STEP", min=0, help="Only draw the first trial at this step.")
    ] = None,
    animate: Annotated[bool, typer.Option("--animate", help="Only film the first trial.")] = False,
) -> None:
    """Run a Monte-Carlo experiment in the lock-step world: Parquet records, summary with 95 % intervals, figures.

    Every trial is a seeded simulation of the very agents that fly. With a node budget the records are the same on every
    run, whatever the number of workers. Ctrl-C stops; --resume goes on.

    **Examples**

    - `arvi experiment configs/experiments/communication.yaml`: the paper's Fig. 2 a–c

    - `arvi experiment configs/experiments/communication.yaml --trials 1 --steps 60`: a quick look

    - `arvi experiment configs/experiments/planners.yaml --arm ARVI --snapshot 200`: one moment as a picture

    Exits with 0 when all trials are complete, 1 when one crashed, 2 for bad input, 130 when interrupted.
    """
    missing = [package for package in _PACKAGES if find_spec(package) is None]
    if missing:
        refuse(f"arvi experiment needs {', '.join(missing)}, from: pip install 'arvi-flight-stack[experiments]'")
    from gcs.experiment_run import ExperimentOptions, run_experiment  # noqa: PLC0415 - seconds of imports

    raise typer.Exit(
        run_experiment(
            ExperimentOptions(
                config=config,
                trials=trials,
                steps=steps,
                workers=workers,
                scheduler=scheduler,
                out=out,
                resume=resume,
                redraw=redraw,
                arms=tuple(arm or ()),
                snapshot=snapshot,
                animate=animate,
            )
        )
    )
