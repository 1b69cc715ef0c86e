"""``arvi replay``, ``arvi report`` and ``arvi compare``: what can be done with a recording."""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

import sys
import time
from pathlib import Path
from typing import Annotated

import typer

__all__ = ["replay"]

EXIT_FAILED = 1
EXIT_BAD_INPUT = 2

Folder = Annotated[Path, typer.Argument(metavar="FOLDER", help="A recording, e.g. flights/lab-20260131-120000.")]


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
    from gcs.dashboard.server import find_port, serve_dashboard
    from gcs.errors import GroundError
    from gcs.operator_desk import OperatorDesk
    from gcs.output import open_console
    from gcs.recording.player import Player, ReplayBoard
    from gcs.recording.reader import open_recording

    console = open_console()
    try:
        recording = open_recording(folder)
        feed = DashboardFeed(OperatorDesk())
        address = find_port(dashboard_host, dashboard_port)
        with serve_dashboard(
            recording.scenario, feed, address, lambda _, feed: ReplayBoard(feed, Player(recording, speed))
        ):
            length = f"{recording.end_s - recording.start_s:.0f} s of {recording.scenario.name}"
            console.print(f"replay: {address.url} ({length}; Ctrl-C ends it)", highlight=False, soft_wrap=True)
            while feed.failure is None:
                time.sleep(0.2)
            _end(EXIT_FAILED, f"the replay ended: {feed.failure}")
    except GroundError as error:
        _end(EXIT_BAD_INPUT, str(error))
    except KeyboardInterrupt:
        console.print("ended")


def _end(code: int, text: str) -> None:
    sys.stderr.write(f"{text}\n")
    raise typer.Exit(code)
