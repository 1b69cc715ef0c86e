"""``arvi replay``, ``arvi report`` and ``arvi compare``: what can be done with a recording."""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

from gcs.arguments import refuse
from gcs.exit_codes import EXIT_FAILED

__all__ = ["compare", "replay", "report"]

Folder = Annotated[
    Path,
    typer.Argument(
        metavar="FOLDER", help="A recording, e.g. flights/lab-20260131-120000; of a folder of recordings, the latest."
    ),
]


def replay(
    folder: Folder,
    speed: Annotated[float, typer.Option(metavar="X", min=0.01, max=1000.0, help="Times as fast as in flight.")] = 1.0,
    dashboard_port: Annotated[
        int, typer.Option(metavar="PORT", min=1, max=65535, help="TCP port; if in use, the next free one.")
    ] = 5006,
    dashboard_host: Annotated[str, typer.Option(metavar="ADDRESS", help="Address to serve at.")] = "127.0.0.1",
) -> None:
    """Show a recording in the dashboard, with play, pause, a slider and speeds; Ctrl-C ends it.

    **Example**: `arvi replay flights/lab-20260131-120000 --speed 5`
    """
    from gcs.dashboard.board import DashboardFeed
    from gcs.dashboard.player_bar import PlayerBar
    from gcs.dashboard.replay_board import ReplayBoard
    from gcs.dashboard.server import find_port, serve_dashboard
    from gcs.errors import GroundError
    from gcs.operator_desk import OperatorDesk
    from gcs.output import open_console
    from gcs.recording.player import Player
    from gcs.recording.reader import find_recording, open_recording

    console = open_console()
    try:
        recording = open_recording(find_recording(folder))
        for problem in recording.problems:
            console.print(problem, style="yellow", soft_wrap=True)
        feed = DashboardFeed(OperatorDesk())
        address = find_port(dashboard_host, dashboard_port)
        player = Player(recording, speed)
        with serve_dashboard(
            recording.scenario, feed, address, lambda _, feed: ReplayBoard(feed, player), lambda: PlayerBar(player)
        ):
            length = f"{recording.end_s - recording.start_s:.0f} s of {recording.folder}"
            console.print(f"replay: {address.entrance} ({length}; Ctrl-C ends it)", soft_wrap=True)
            while feed.failure is None:
                time.sleep(0.2)
            sys.stderr.write(f"the replay ended: {feed.failure}\n")
            raise typer.Exit(EXIT_FAILED)
    except GroundError as error:
        refuse(str(error))
    except KeyboardInterrupt:
        console.print("ended")


def report(
    folder: Folder,
    output: Annotated[
        Path | None,
        typer.Option("--output", "-o", metavar="FILE", show_default="FOLDER/report.html", help="The page to write."),
    ] = None,
) -> None:
    """Write a page about a recording, with figures inside and, as PNG, SVG and CSV, in a folder beside it.

    **Example**: `arvi report flights/lab-20260131-120000 -o lab.html`
    """
    from gcs.errors import GroundError
    from gcs.recording.reader import find_recording, open_recording
    from gcs.reports.flight_series import read_series
    from gcs.reports.report import write_report

    folder = find_recording(folder)
    path = output if output is not None else folder / "report.html"
    try:
        with _reading(folder) as progress:
            series = read_series(open_recording(folder), progress)
        figures = write_report(series, path)
    except GroundError as error:
        refuse(str(error))
    typer.echo(f"report: {path}\nfigures as PNG and SVG, their numbers as CSV: {figures}")


def compare(
    folders: Annotated[list[Path], typer.Argument(metavar="FOLDER...", help="Two recordings or more.")],
    output: Annotated[Path, typer.Option("--output", "-o", metavar="FILE", help="The page to write.")] = Path(
        "comparison.html"
    ),
) -> None:
    """Write a page that lays several recordings over each other: a table, curves and distributions.

    **Example**: `arvi compare flights/lab-20260131-120000 flights/lab-20260131-121500`
    """
    from gcs.errors import GroundError
    from gcs.recording.reader import open_recording
    from gcs.reports.compare import write_comparison
    from gcs.reports.flight_series import read_series

    if len(folders) < 2:
        refuse("one recording alone cannot be compared; `arvi report FOLDER` describes it")
    try:
        flights = []
        for folder in folders:
            with _reading(folder) as progress:
                flights.append(read_series(open_recording(folder), progress))
        figures = write_comparison(flights, output)
    except GroundError as error:
        refuse(str(error))
    typer.echo(f"comparison: {output}\nfigures as PNG and SVG: {figures}")


@contextmanager
def _reading(folder: Path) -> Iterator[Callable[[float], None]]:
    """How far a recording has been read, on a terminal, as long as it takes."""
    from rich.console import Console
    from rich.progress import BarColumn, Progress, TextColumn

    console = Console(stderr=True, markup=False, highlight=False)
    columns = (TextColumn("reading {task.description}", markup=False), BarColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as shown:
        task = shown.add_task(str(folder), total=1.0)
        yield lambda share: shown.update(task, completed=share)
