"""``arvi monitor`` and ``arvi command``: a second terminal beside a ground station, to watch and to order."""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

from enum import StrEnum
from typing import Annotated

import typer

from gcs.arguments import Config, Headless, load, refuse, vehicles_of

__all__ = ["command", "monitor"]

Via = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Join the ground station whose shared port (ground.share) is at udpout:HOST:PORT; without this, the port "
        "of a station on this machine, or the team's own if there is none.",
    ),
]


def monitor(config: Config, headless: Headless = False, via: Via = None) -> None:
    """Show the team in the terminal: vehicles, figures and events; commands nothing.

    Works beside a running `arvi fly` or `arvi gcs` on this machine, or alone, listening where a ground station would.

    **Examples**

    - `arvi monitor configs/lab.yaml`: beside `arvi fly configs/lab.yaml` in another shell

    - `arvi monitor configs/lab.yaml --via udpout:10.0.0.5:14551`: beside a station elsewhere that shares its port

    Ctrl-C ends it, as does the end of who reads it (`arvi monitor … | head`). Like every ground station it says once a
    second that it is there: alone, it is the vehicles' ground station. Exits with 0, or with 2 for bad input or ports
    in use.
    """
    scenario = load(config)
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

    To the onboard processes: start (take off and fly the mission), pause (hold the place), resume, finish (fly home and
    land). Straight to the autopilots, also when an onboard process is dead: hold (stop; the onboard process lets go),
    land (where it is), return (the autopilot's own). **stop turns the motors off: what flies falls.**

    **Examples**

    - `arvi command configs/lab.yaml land --yes`

    - `arvi command configs/lab.yaml pause --vehicle 2 --yes`

    Says for each vehicle whether it was acknowledged, refused and why, or timed out. Ctrl-C calls nothing back that has
    been sent.

    Exits with 0 when every vehicle acknowledged, 1 otherwise, 2 for bad input or ports in use, 130 after Ctrl-C.
    """
    scenario = load(config)
    ids = vehicles_of(scenario, config, vehicle or ())
    what = "turn the MOTORS OFF of" if action is Word.STOP else action.value
    if not yes and not typer.confirm(f"{what} vehicle{'s' * (len(ids) > 1)} {', '.join(map(str, ids))}?"):
        raise typer.Exit(1)
    from gcs.order_command import ACTIONS, run_order

    raise typer.Exit(run_order(scenario, ACTIONS[action.value], ids, _via(via)))


def _via(url: str | None) -> str | None:
    from onboard.protocol.transport import LinkUrl, TransportError

    if url is None:
        return None
    try:
        if LinkUrl.parse(url).kind == "udpout":
            return url
    except TransportError:
        pass
    refuse(f"--via {url}: udpout:HOST:PORT is needed")
