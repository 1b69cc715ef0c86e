"""The command ``arvi``.

Heavy parts (kernels, the MAVLink dialect) are imported inside the commands, so that help comes at once.
"""
# ruff: noqa: PLC0415

from __future__ import annotations

import math
import os
import sys
from enum import StrEnum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gcs.conformance_command import conformance
from gcs.experiment_command import experiment
from gcs.keygen_command import keygen
from gcs.mocap_command import mocap
from gcs.plan_command import plan
from gcs.preflight_command import preflight
from gcs.recording_commands import compare, replay, report
from gcs.version import program_version

if TYPE_CHECKING:
    from gcs.run import RecordingOptions
    from onboard.config import Scenario

__all__ = ["app", "main"]

EXIT_BAD_INPUT = 2

_FLIGHTS = Path("flights")
"""Where flights are recorded unless told otherwise."""

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Scenario file, e.g. configs/lab.yaml.")]
Record = Annotated[
    Path | None,
    typer.Option(metavar="DIR", show_default="flights", help="Record the flight in a new folder in DIR."),
]
NoRecord = Annotated[bool, typer.Option("--no-record", help="Record nothing.")]
RecordLimit = Annotated[
    int, typer.Option(metavar="MB", min=1, help="Stop the recording, not the flight, at about this size.")
]
Headless = Annotated[bool, typer.Option("--headless", help="Lines of text instead of the live picture.")]

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

app = typer.Typer(
    name="arvi",
    help="Fly teams of robots that plan together where to look (MAVLink, PX4).",
    epilog="Start with: arvi fly configs/lab.yaml",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line: 0 fine, 1 something failed in flight, 2 bad input."""
    app()


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"arvi {program_version()}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Options of the command itself, before any subcommand."""


@app.command()
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
        _refuse("--duration nan: a time in seconds is needed, or inf to fly until Ctrl-C")
    scenario = _forwarding(_load(config), forward)
    if json is not None and not json.parent.is_dir():
        _refuse(f"--json {json}: the folder {json.parent} does not exist")
    from gcs.dashboard.start import DashboardOptions
    from gcs.run import run_flight

    recording = _recording(record, record_limit, wanted=not no_record)
    browser = DashboardOptions(dashboard, dashboard_host, dashboard_port)
    raise typer.Exit(
        run_flight(
            config, scenario, duration, seed, recording, json, program_version(), headless=headless, dashboard=browser
        )
    )


@app.command()
def onboard(
    config: Config,
    vehicle: Annotated[int, typer.Option(metavar="N", help="System id of the vehicle to fly.")],
) -> None:
    """Run the onboard process of one vehicle, as on its companion computer.

    It waits for its autopilot, then for the ground station's start. SIGTERM or Ctrl-C lands the vehicle and ends it.

    **Example**: `arvi onboard configs/lab.yaml --vehicle 2`
    """
    scenario = _load(config)
    if vehicle not in [known.id for known in scenario.vehicles]:
        ids = ", ".join(str(known.id) for known in scenario.vehicles)
        _refuse(f"--vehicle {vehicle}: no such vehicle in {config}; it has {ids}")
    from onboard.__main__ import run

    raise typer.Exit(run(config, vehicle))


@app.command()
def bridge(
    config: Config,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Instead of simulation.seed.")] = None,
) -> None:
    """Run the simulation alone: vehicles with their autopilots, motion capture, targets, detector and radio.

    **Example**: `arvi bridge configs/lab.yaml --seed 7`, then connect QGroundControl or MAVSDK to UDP 14540.
    """
    _load(config)
    from sim_bridge.__main__ import main as run_bridge

    raise typer.Exit(run_bridge([str(config), *([] if seed is None else ["--seed", str(seed)])]))


@app.command()
def gcs(
    config: Config,
    start: Annotated[bool, typer.Option("--start", help="Start the team when all stand by; Ctrl-C lands it.")] = False,
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
    """
    if duration is not None and not start:
        _refuse("--duration needs --start: a station that only watches does not end a flight")
    scenario = _forwarding(_load(config), forward)
    from gcs.dashboard.start import DashboardOptions
    from gcs.run import run_station

    recording = _recording(record, record_limit, wanted=not no_record)
    browser = DashboardOptions(dashboard, dashboard_host, dashboard_port)
    raise typer.Exit(
        run_station(
            config, scenario, duration, recording, program_version(), start=start, headless=headless, dashboard=browser
        )
    )


Via = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Join the ground station whose shared port (ground.share) is at udpout:HOST:PORT; without this, the port "
        "of a station on this machine, or the team's own if there is none.",
    ),
]


@app.command()
def monitor(config: Config, headless: Headless = False, via: Via = None) -> None:
    """Show the team in the terminal: vehicles, figures and events; commands nothing.

    Works beside a running `arvi fly` or `arvi gcs` on this machine, or alone, listening where a ground station would.

    **Examples**

    - `arvi monitor configs/lab.yaml`: beside `arvi fly configs/lab.yaml` in another shell

    - `arvi monitor configs/lab.yaml --via udpout:10.0.0.5:14551`: beside a station elsewhere that shares its port
    """
    scenario = _load(config)
    from gcs.monitor_command import run_monitor

    raise typer.Exit(run_monitor(scenario, _via(via), headless=headless))


class Word(StrEnum):
    """What `arvi command` can be told."""

    START = "start"
    PAUSE = "pause"
    RESUME = "resume"
    FINISH = "finish"
    HOLD = "hold"
    LAND = "land"
    RETURN = "return"
    STOP = "stop"


@app.command()
def command(
    config: Config,
    action: Annotated[Word, typer.Argument(help="What to order.")],
    vehicle: Annotated[
        list[int] | None, typer.Option(metavar="N", help="System id; may be repeated. All vehicles without it.")
    ] = None,
    yes: Annotated[bool, typer.Option("--yes", help="Do not ask.")] = False,
    via: Via = None,
) -> None:
    """Give the team an order from a shell, and say what became of it.

    start, pause, resume and finish (fly home and land) go to the onboard processes; hold, land, return and stop
    straight to the autopilots. **stop turns the motors off: what flies falls.**

    **Examples**

    - `arvi command configs/lab.yaml land --yes`

    - `arvi command configs/lab.yaml pause --vehicle 2 --yes`

    Exits with 0 when every vehicle acknowledged, 1 otherwise.
    """
    scenario = _load(config)
    known = [one.id for one in scenario.vehicles]
    wrong = [i for i in vehicle or () if i not in known]
    if wrong:
        _refuse(f"--vehicle {wrong[0]}: no such vehicle in {config}; it has {', '.join(map(str, known))}")
    ids = list(dict.fromkeys(vehicle or known))
    what = "turn the MOTORS OFF of" if action is Word.STOP else action.value
    if not yes and not typer.confirm(f"{what} vehicle{'s' * (len(ids) > 1)} {', '.join(map(str, ids))}?"):
        raise typer.Exit(1)
    from gcs.order_command import ACTIONS, run_order

    raise typer.Exit(run_order(scenario, ACTIONS[action.value], ids, _via(via)))


@app.command()
def check(
    configs: Annotated[list[Path], typer.Argument(help="Scenario files.")],
) -> None:
    """Validate scenarios: every mistake with its line, key and what is allowed, or a summary of what is flown.

    **Example**: `arvi check configs/*.yaml`
    """
    from gcs.errors import GroundError
    from gcs.output import open_console
    from gcs.preflight import check_signing, check_simulation
    from gcs.scenario_table import render_scenario
    from onboard.config import load_scenario
    from onboard.errors import OnboardError

    wrong = 0
    for config in configs:
        try:
            scenario = load_scenario(config)
            check_simulation(config, scenario, None)
            check_signing(scenario)
        except (OnboardError, GroundError) as error:
            wrong += 1
            typer.echo(str(error), err=True)
        else:
            open_console().print(render_scenario(config, scenario))
    raise typer.Exit(EXIT_BAD_INPUT if wrong else 0)


app.command()(plan)
app.command()(preflight)
app.command()(experiment)
app.command()(mocap)
app.command()(keygen)
app.command()(conformance)
app.command()(replay)
app.command()(report)
app.command()(compare)


def _load(config: Path) -> Scenario:
    from onboard.config import ConfigError, load_scenario

    try:
        return load_scenario(config)
    except ConfigError as error:
        _refuse(str(error))


def _recording(record: Path | None, limit_mb: int, *, wanted: bool) -> RecordingOptions:
    """Where to record; nowhere, with a word about it, when nobody has said where and this folder cannot be written."""
    from gcs.run import RecordingOptions

    if record is not None and not wanted:
        _refuse("--record and --no-record exclude each other")
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
        _refuse(f"--forward {', '.join(wrong)}: udpout:HOST:PORT or udpin:HOST:PORT is needed, at most eight of them")
    return scenario.model_copy(update={"ground": more})


def _via(url: str | None) -> str | None:
    from onboard.protocol.transport import LinkUrl, TransportError

    if url is None:
        return None
    try:
        if LinkUrl.parse(url).kind == "udpout":
            return url
    except TransportError:
        pass
    _refuse(f"--via {url}: udpout:HOST:PORT is needed")


def _refuse(text: str) -> NoReturn:
    """End because of what the user gave us."""
    sys.stderr.write(f"{text}\n")
    raise typer.Exit(EXIT_BAD_INPUT)


if __name__ == "__main__":
    main()
