"""``arvi conformance``: does an autopilot answer as the recorded ones did?

Everything heavy is imported when the command runs, so that ``arvi --help`` stays quick.
"""
# ruff: noqa: PLC0415

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs.arguments import refuse
from gcs.choices import AutopilotFamily, AutopilotLink
from gcs.exit_codes import EXIT_BAD_INPUT

if TYPE_CHECKING:
    from sim_bridge.conformance import Plan, Session

__all__ = ["conformance"]

_SIMULATED = "simulated:"


def conformance(
    url: Annotated[
        str,
        typer.Argument(
            metavar="URL",
            help="udpin://HOST:PORT, udpout://HOST:PORT, tcp://HOST:PORT, serial://DEVICE:BAUD, or simulated:px4, "
            "simulated:ardupilot for our own.",
            show_default=False,
        ),
    ],
    autopilot: Annotated[
        AutopilotFamily | None, typer.Option(help="Which it has to be; by default what its heartbeat says.")
    ] = None,
    system: Annotated[
        int | None, typer.Option(metavar="N", min=1, max=255, help="System id, if several are heard.")
    ] = None,
    link: Annotated[
        AutopilotLink, typer.Option(help="Which of the autopilot's links this is.")
    ] = AutopilotLink.ONBOARD,
    only: Annotated[
        list[str] | None,
        typer.Option(metavar="PATTERN", help="Entries or groups, e.g. setpoint, 'mode/*'; repeatable."),
    ] = None,
    fly: Annotated[bool, typer.Option("--fly", help="Also what starts motors and flies.")] = False,
    mocap: Annotated[
        bool, typer.Option("--mocap", help="A vehicle without GPS, fed with the truth that its simulator tells.")
    ] = False,
    dangerous: Annotated[
        bool, typer.Option("--dangerous", help="Also what lets the vehicle fall or crashes its autopilot.")
    ] = False,
    latency: Annotated[
        float, typer.Option(metavar="S", min=0.0, max=10.0, help="What the link may add to the time of an answer, s.")
    ] = 0.0,
    json_file: Annotated[Path | None, typer.Option("--json", metavar="FILE", help="Write the results as JSON.")] = None,
    list_only: Annotated[bool, typer.Option("--list", help="Only list the entries with their sources.")] = False,
) -> None:
    """Ask an autopilot what was asked of recorded ones, and compare its answers: type, result, mode, motion, time.

    Without --fly it sends requests only. With --fly it arms, takes off to 3 m, flies up to 6 m around, and lands: for
    autopilots in software-in-the-loop, or a real vehicle with room around it and a pilot who can take over. Ctrl-C
    lands; parameters that were changed are put back.

    **Examples**

    - `arvi conformance simulated:px4 --fly`: our simulated PX4, in virtual time

    - `arvi conformance udpin://0.0.0.0:14540 --fly --json result.json`: PX4 in the loop

    - `arvi conformance udpin://0.0.0.0:14540 --mocap --fly`: the same without GPS, on motion capture

    - `arvi conformance udpin://0.0.0.0:14640 --only parameter --only 'mode/*'`: a part, on the ground

    Exits with 0 when all that was performed holds, 1 when something differs, 2 when nothing could be performed.
    """
    if not math.isfinite(latency):
        refuse(f"arvi conformance: --latency {latency}: a time in seconds is needed")
    if json_file is not None and not json_file.parent.is_dir():
        refuse(f"arvi conformance: --json {json_file}: the folder {json_file.parent} does not exist")
    from gcs.conformance_table import Progress, print_entries, print_summary
    from gcs.output import open_console
    from sim_bridge.conformance import Family, Link, Outcome, Plan, Position, load_catalogue, select

    family = None if autopilot is None else Family(autopilot)
    if url.startswith(_SIMULATED):
        family = _simulated_family(url, family)
    position = Position.MOCAP if mocap else Position.GPS
    plan = Plan(Link(link), position, tuple(only or ()), fly=fly, dangerous=dangerous, latency_s=latency)
    families = [family] if family is not None else list(Family)
    if not any(select(load_catalogue(known), plan) for known in families):
        names = " ".join(plan.only)
        refuse(f"arvi conformance: --only {names}: no entry of this name; arvi conformance {url} --list shows them")
    console = open_console()
    if list_only:
        for known in families:
            print_entries(console, load_catalogue(known), plan)
        return
    with Progress(console) as progress:
        session = _perform(url, plan, family, system, progress)
    print_summary(console, session)
    if json_file is not None:
        try:
            json_file.write_text(json.dumps(document(url, session), indent=1), encoding="utf-8")
        except OSError as error:
            refuse(f"arvi conformance: --json {json_file}: {error.strerror or error}")
    performed = [result for result in session.results if result.outcome is not Outcome.SKIPPED]
    if not performed:
        raise typer.Exit(EXIT_BAD_INPUT)
    failed = bool(session.problem) or any(result.outcome is Outcome.DIFFERS for result in performed)
    raise typer.Exit(1 if failed else 0)


def document(url: str, session: Session) -> dict[str, Any]:
    """The results as JSON data."""
    return {
        "url": url,
        "autopilot": session.catalogue.family.value,
        "recorded": session.catalogue.recorded,
        "system_id": session.dialogue.system_id,
        "problem": session.problem,
        "results": [
            {
                "id": result.entry.id,
                "source": result.entry.source,
                "state": result.entry.state.value,
                "outcome": result.outcome.value,
                "reason": result.reason,
                "slowest_s": result.slowest_s,
            }
            for result in session.results
        ],
    }


def _perform(url: str, plan: Plan, family: Any, system: int | None, progress: Any) -> Session:
    import asyncio

    from gcs.conformance_run import ConformanceError, perform
    from sim_bridge.conformance import load_catalogue
    from sim_bridge.conformance.simulated import run_simulated

    if url.startswith(_SIMULATED):
        return run_simulated(load_catalogue(family), plan, watch=progress.update)
    try:
        return asyncio.run(perform(url, plan, family, system, progress.update))
    except ConformanceError as error:
        refuse(f"arvi conformance: {error}")


def _simulated_family(url: str, family: Any) -> Any:
    from sim_bridge.conformance import Family

    name = url.removeprefix(_SIMULATED)
    if name not in list(Family):
        refuse(f"arvi conformance: {url}: simulated:px4 and simulated:ardupilot there are")
    if family not in (None, Family(name)):
        refuse(f"arvi conformance: --autopilot {family}: {url} is another one")
    return Family(name)
