"""``arvi preflight``: may this team fly as it stands there?"""

from __future__ import annotations

import asyncio
import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from gcs.arguments import Config, load, vehicles_of
from gcs.checks import Check, Outcome, check_document, is_go
from gcs.exit_codes import EXIT_FAILED

if TYPE_CHECKING:
    from rich.console import RenderableType

    from gcs.mocap_command import MocapView
    from gcs.vehicle_check import VehicleReport
    from onboard.config import Scenario
    from onboard.flight.preflight import Finding

__all__ = ["PreflightReport", "preflight", "report_document"]

_MOCAP_S = 8.0
"""A reader needs a second or two to connect."""

_STYLES = {
    "pass": "green",
    "ok": "green",
    "warn": "yellow",
    "advice": "yellow",
    "unknown": "yellow",
    "fail": "bold red",
    "wrong": "bold red",
}


@dataclass(frozen=True)
class PreflightReport:
    """All that was looked at.

    Attributes:
        computer: This computer.
        mocap: The motion capture system; empty without one.
        vehicles: Each vehicle.
    """

    computer: tuple[Check, ...]
    mocap: tuple[Check, ...]
    vehicles: tuple[VehicleReport, ...]

    @property
    def go(self) -> bool:
        """Whether the team may fly."""
        return is_go((*self.computer, *self.mocap)) and all(report.go for report in self.vehicles)

    @property
    def faults(self) -> list[str]:
        """What keeps it from flying, one line each."""
        faults = [_fault("", check) for check in (*self.computer, *self.mocap) if check.outcome is Outcome.FAIL]
        for report in self.vehicles:
            head = f"vehicle {report.vehicle_id}: "
            unheard = any(check.name == "link" and check.outcome is Outcome.FAIL for check in report.checks)
            if report.problem and not unheard:
                faults.append(f"{head}{report.problem}")
            faults += [_fault(head, check) for check in report.checks if check.outcome is Outcome.FAIL]
            faults += [f"{head}{finding}" for finding in report.findings if finding.verdict.value == "wrong"]
        return faults


def preflight(
    config: Config,
    vehicle: Annotated[
        int | None,
        typer.Option(metavar="N", help="Only this vehicle, as on its companion; all of the scenario's otherwise."),
    ] = None,
    mend: Annotated[
        bool,
        typer.Option("--set", help="Set parameters that are not as they should be; never while armed."),
    ] = False,
    record: Annotated[Path, typer.Option(metavar="DIR", help="Where the flight will be recorded.")] = Path("flights"),
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Check everything that a flight needs: a table, and GO or NO-GO.

    Of this computer: clock, signing key, compiled kernels, disk, real-time priority. Of each vehicle: its link, message
    rates, TIMESYNC, position and place, battery, pre-arm checks, and its parameters against what the plans need. Of a
    motion capture system that the scenario names: whether it sees each body often and anew.

    It connects to each autopilot's link as the onboard process would, so that must not run at the same time. The
    onboard process checks the parameters again before every start, and never sets anything.

    **Examples**

    - `arvi preflight configs/lab.yaml`: reads and judges, while `arvi bridge configs/lab.yaml` runs

    - `arvi preflight team.yaml --vehicle 2 --set`: on vehicle 2's companion; mends its parameters

    Exits with 0 for go, 1 for no-go, 2 for bad input.
    """
    from gcs import host_checks  # noqa: PLC0415

    scenario = load(config)
    ids = vehicles_of(scenario, config, () if vehicle is None else (vehicle,))
    if not as_json:
        typer.echo(f"looking at this computer and {len(ids)} vehicle{'s' * (len(ids) > 1)}: about 15 s", err=True)
    # Compiling keeps a core busy and would spoil the rates that are measured meanwhile.
    computer = host_checks.judge(scenario, host_checks.look(scenario, record))
    mocap, vehicles = asyncio.run(_look_outside(scenario, ids, mend=mend))
    report = PreflightReport(tuple(computer), tuple(mocap), tuple(vehicles))
    if as_json:
        typer.echo(json.dumps(report_document(report), indent=1, allow_nan=False))
    else:
        from gcs.output import open_console  # noqa: PLC0415

        console = open_console()
        for part in _render(report):
            console.print(part)
    raise typer.Exit(0 if report.go else EXIT_FAILED)


async def _look_outside(
    scenario: Scenario, vehicles: list[int], *, mend: bool
) -> tuple[list[Check], list[VehicleReport]]:
    from gcs.mocap_command import look_at_mocap  # noqa: PLC0415
    from gcs.vehicle_check import check_vehicle  # noqa: PLC0415

    reports = asyncio.gather(*(check_vehicle(scenario, identity, mend=mend) for identity in vehicles))
    mocap: list[Check] = []
    if scenario.mocap is not None:
        notices: list[str] = []

        def show(view: MocapView) -> None:
            mocap[:] = view.checks(time.time())

        await look_at_mocap(scenario, _MOCAP_S, show, notices.append)
        if not mocap:
            said = "; ".join(notices) or "its reader ended"
            mocap.append(Check("motion capture", Outcome.FAIL, said, f"frames of the {scenario.mocap.provider} system"))
    return mocap, list(await reports)


def report_document(report: PreflightReport) -> dict[str, Any]:
    """A report as JSON data."""
    return {
        "go": report.go,
        "faults": report.faults,
        "computer": [check_document(check) for check in report.computer],
        "mocap": [check_document(check) for check in report.mocap],
        "vehicles": [_vehicle_document(vehicle) for vehicle in report.vehicles],
    }


def _vehicle_document(report: VehicleReport) -> dict[str, Any]:
    return {
        "vehicle": report.vehicle_id,
        "link": report.url,
        "autopilot": report.autopilot,
        "go": report.go,
        "problem": report.problem or None,
        "checks": [check_document(check) for check in report.checks],
        "parameters": [
            {
                "name": _name(finding),
                "value": None if finding.parameter is None else finding.parameter.value,
                "wanted": str(finding.requirement.wanted),
                "unit": finding.requirement.unit,
                "why": finding.requirement.why,
                "verdict": finding.verdict.value,
            }
            for finding in report.findings
        ],
        "set": dict(report.changed),
        "reboot": report.reboot,
    }


def _render(report: PreflightReport) -> list[RenderableType]:
    from rich.text import Text  # noqa: PLC0415

    parts: list[RenderableType] = [Text("this computer", style="bold"), _table(report.computer)]
    if report.mocap:
        parts += [Text("motion capture", style="bold"), _table(report.mocap)]
    for vehicle in report.vehicles:
        parts += _render_vehicle(vehicle)
    faults = report.faults
    parts += [Text(f"✗ {fault}", style="red") for fault in faults]
    parts.append(Text("GO", style="bold green") if report.go else Text(f"NO-GO: {len(faults)} wrong", style="bold red"))
    return parts


def _render_vehicle(report: VehicleReport) -> list[RenderableType]:
    from rich.box import SIMPLE_HEAD  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    title = f"vehicle {report.vehicle_id}: {report.autopilot or 'no autopilot'} on {report.url}"
    parts: list[RenderableType] = [Text(title, style="bold")]
    if report.checks:
        parts.append(_table(report.checks))
    if report.findings:
        table = Table(box=SIMPLE_HEAD, header_style="dim")
        table.add_column("parameter")
        table.add_column("is", justify="right")
        table.add_column("should be")
        table.add_column("why", overflow="fold")
        table.add_column("")
        for finding in report.findings:
            unit = f" {finding.requirement.unit}" if finding.requirement.unit else ""
            held = "–" if finding.parameter is None else f"{finding.parameter.value:.6g}{unit}"
            verdict = finding.verdict.value
            table.add_row(
                _name(finding),
                held,
                str(finding.requirement.wanted),
                finding.requirement.why,
                Text(verdict, style=_STYLES[verdict]),
            )
        parts.append(table)
    parts += [Text(f"set {name} to {value:g}") for name, value in report.changed]
    if report.reboot:
        parts.append(Text("reboot the autopilot: some of these take effect only then", style="yellow"))
    if report.problem:
        parts.append(Text(report.problem, style="bold red"))
    return parts


def _table(checks: tuple[Check, ...]) -> RenderableType:
    from rich.box import SIMPLE_HEAD  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    table = Table(box=SIMPLE_HEAD, header_style="dim")
    for name in ("check", "found", "should be"):
        table.add_column(name, overflow="fold")
    table.add_column("")
    for check in checks:
        verdict = check.outcome.value
        table.add_row(check.name, check.found, check.wanted, Text(verdict, style=_STYLES[verdict]))
    return table


def _fault(head: str, check: Check) -> str:
    return f"{head}{check.name}: {check.found}; should be: {check.wanted}"


def _name(finding: Finding) -> str:
    return finding.requirement.name if finding.parameter is None else finding.parameter.name
