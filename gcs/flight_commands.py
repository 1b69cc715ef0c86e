"""``arvi fly`` and ``arvi gcs``: a team with its ground station, or the ground station alone."""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

import math
import os
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from gcs.arguments import Config, Headless, load, refuse
from gcs.version import program_version

if TYPE_CHECKING:
    from gcs.run import RecordingOptions
    from onboard.config import Scenario

__all__ = ["fly", "gcs"]

_FLIGHTS = Path("flights")
"""Where flights are recorded unless told otherwise."""

Record = Annotated[
    Path | None,
    typer.Option(metavar="DIR", show_default="flights", help="Record the flight in a new folder in DIR."),
]
NoRecord = Annotated[bool, typer.Option("--no-record", help="Record nothing.")]
RecordLimit = Annotated[
    int, typer.Option(metavar="MB", min=1, help="Stop the recording, not the flight, at about this size.")
]

Dashboard = Annotated[
    bool | None,
    typer.Option(show_default=False, help="Serve the live dashboard; not with --headless unless asked for."),
]
DashboardPort = Annotated[
    int, typer.Option(metavar="PORT", min=1, max=65535, help="TCP port of the dashboard; if in use, the next free one.")
]
DashboardHost = Annotated[
    str,
    typer.Option(
        metavar="ADDRESS", help="Address of the dashboard; other than this machine's own it asks for the printed token."
    ),
]

Forward = Annotated[
    list[str] | None,
    typer.Option(
        metavar="URL",
        help="Let another ground station (QGroundControl, MAVProxy) see and command the team at udpout:HOST:PORT or "
        "udpin:HOST:PORT, besides ground.forward; may be repeated.",
    ),
]


def fly(
    config: Config,
    duration: Annotated[float, typer.Option(metavar="S", min=0.0, help="Mission time until landing, s.")] = 120.0,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Instead of simulation.seed.")] = None,
    headless: Headless = False,
    record: Record = None,
    no_record: NoRecord = False,
    record_limit: RecordLimit = 2000,
    forward: Forward = None,
    json: Annotated[Path | None, typer.Option(metavar="FILE", help="Write the summary as JSON.")] = None,
    dashboard: Dashboard = None,
    dashboard_port: DashboardPort = 5006,
    dashboard_host: DashboardHost = "127.0.0.1",
) -> None:
    """Fly a simulated team: take off, search, track, land; then print a summary.

    Starts the bridge, one onboard process per vehicle and the ground station, each a process of its own that speaks
    MAVLink over UDP, and a dashboard for the browser, whose address it prints. Ctrl-C lands the team; a second one
    stops everything at once.

    **Examples**

    - `arvi fly configs/lab.yaml`: two minutes with a live picture and the dashboard

    - `arvi fly configs/lab.yaml --duration 60 --seed 7 --headless --json result.json`: for scripts

    The flight is recorded in flights/NAME-DATE-TIME: .tlog for QGroundControl or MAVProxy, MCAP for Foxglove or
    Lichtblick.

    - `arvi fly configs/lab.yaml --forward udpout:127.0.0.1:14560`: QGroundControl, listening there, sees the team, too

    Exits with 0 when all landed, 1 when something failed in flight, 2 for bad input or ports in use.
    """
    if math.isnan(duration):
        refuse("--duration nan: a time in seconds is needed, or inf to fly until Ctrl-C")
    scenario = _forwarding(load(config), forward)
    if json is not None and not json.parent.is_dir():
        refuse(f"--json {json}: the folder {json.parent} does not exist")
    from gcs.dashboard.start import DashboardOptions
    from gcs.run import run_flight

    recording = _recording(record, record_limit, wanted=not no_record)
    browser = DashboardOptions(dashboard, dashboard_host, dashboard_port)
    raise typer.Exit(
        run_flight(
            config, scenario, duration, seed, recording, json, program_version(), headless=headless, dashboard=browser
        )
    )


def gcs(
    config: Config,
    start: Annotated[
        bool,
        typer.Option(
            "--start",
            help="Start the team when all stand by, or take up a mission that it flies already; Ctrl-C lands it.",
        ),
    ] = False,
    duration: Annotated[
        float | None, typer.Option(metavar="S", min=0.0, help="With --start: land after this mission time, s.")
    ] = None,
    headless: Headless = False,
    record: Record = None,
    no_record: NoRecord = False,
    record_limit: RecordLimit = 2000,
    forward: Forward = None,
    dashboard: Dashboard = None,
    dashboard_port: DashboardPort = 5006,
    dashboard_host: DashboardHost = "127.0.0.1",
) -> None:
    """Run the ground station alone, for a team whose processes are started elsewhere.

    Without --start it only watches, records, and commands what the dashboard's buttons order.

    **Examples**

    - `arvi gcs configs/lab.yaml`: watches

    - `arvi gcs configs/lab.yaml --start --duration 120`: flies the team

    Ctrl-C ends it when it only watches; the vehicles fly on. Exits with 0, or 1 when a team that it started did not
    land in time, 2 for bad input or ports in use.
    """
    if duration is not None and math.isnan(duration):
        refuse("--duration nan: a time in seconds is needed, or none to fly until Ctrl-C")
    if duration is not None and not start:
        refuse("--duration needs --start: a station that only watches does not end a flight")
    scenario = _forwarding(load(config), forward)
    from gcs.dashboard.start import DashboardOptions
    from gcs.run import run_station

    recording = _recording(record, record_limit, wanted=not no_record)
    browser = DashboardOptions(dashboard, dashboard_host, dashboard_port)
    raise typer.Exit(
        run_station(
            config, scenario, duration, recording, program_version(), start=start, headless=headless, dashboard=browser
        )
    )


def _recording(record: Path | None, limit_mb: int, *, wanted: bool) -> RecordingOptions:
    """Where to record; nowhere, with a word about it, when nobody has said where and this folder cannot be written."""
    from gcs.run import RecordingOptions

    if record is not None and not wanted:
        refuse("--record and --no-record exclude each other")
    parent = (record or _FLIGHTS) if wanted else None
    if parent is _FLIGHTS and not os.access(parent if parent.exists() else Path.cwd(), os.W_OK):
        sys.stderr.write(f"the flight is not recorded: {Path.cwd()} cannot be written to (try --record DIR)\n")
        parent = None
    return RecordingOptions(parent, limit_mb)


def _forwarding(scenario: Scenario, forward: list[str] | None) -> Scenario:
    """The scenario with more links to other ground stations."""
    if not forward:
        return scenario
    from pydantic import ValidationError

    ground = scenario.ground
    try:
        more = type(ground).model_validate(ground.model_dump() | {"forward": (*ground.forward, *forward)})
    except ValidationError as error:
        wrong = [str(e.get("input")) for e in error.errors()]
        refuse(f"--forward {', '.join(wrong)}: udpout:HOST:PORT or udpin:HOST:PORT is needed, at most eight of them")
    return scenario.model_copy(update={"ground": more})
