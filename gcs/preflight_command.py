"""``arvi preflight``: are the autopilots' parameters what the scenario's plans need?"""

from __future__ import annotations

import asyncio
import json
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

if TYPE_CHECKING:
    from rich.console import RenderableType

    from gcs.parameter_check import VehicleReport
    from onboard.flight.preflight import Finding

__all__ = ["preflight", "report_document"]

_NO_GO = 1
_BAD_INPUT = 2


def preflight(
    config: Annotated[Path, typer.Argument(metavar="CONFIG", help="Scenario file, e.g. configs/lab.yaml.")],
    vehicle: Annotated[
        int | None, typer.Option(metavar="N", help="Only this vehicle; all of the scenario's otherwise.")
    ] = None,
    mend: Annotated[
        bool, typer.Option("--set", help="Set what is not as it should be, and read it back; never while armed.")
    ] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON instead of tables.")] = False,
) -> None:
    """Check the autopilots' parameters against what the plans need: a table, and go or no-go.

    It connects to each autopilot's link as the onboard process would, so that must not run at the same time. The
    onboard process makes the same check before every start, and never sets anything.

    **Examples**

    - `arvi preflight configs/lab.yaml`: reads and judges, while `arvi bridge configs/lab.yaml` runs

    - `arvi preflight configs/lab.yaml --vehicle 2 --set`: and mends what vehicle 2 has wrong

    Exits with 0 for go, 1 for no-go, 2 for bad input.
    """
    from gcs.parameter_check import check_vehicle  # noqa: PLC0415
    from gcs.preflight import check_signing  # noqa: PLC0415
    from onboard.config import load_scenario  # noqa: PLC0415
    from onboard.errors import OnboardError  # noqa: PLC0415

    try:
        scenario = load_scenario(config)
        check_signing(scenario)
    except OnboardError as error:
        typer.echo(str(error), err=True)
        raise typer.Exit(_BAD_INPUT) from None
    known = [configured.id for configured in scenario.vehicles]
    if vehicle is not None and vehicle not in known:
        ids = ", ".join(str(identity) for identity in known)
        typer.echo(f"--vehicle {vehicle}: no such vehicle in {config}; it has {ids}", err=True)
        raise typer.Exit(_BAD_INPUT)

    async def check_all() -> list[VehicleReport]:
        wanted = known if vehicle is None else [vehicle]
        return await asyncio.gather(*(check_vehicle(scenario, identity, mend=mend) for identity in wanted))

    reports = asyncio.run(check_all())
    if as_json:
        typer.echo(json.dumps([report_document(report) for report in reports], indent=1, allow_nan=False))
    else:
        from gcs.output import open_console  # noqa: PLC0415

        console = open_console()
        for report in reports:
            console.print(_render(report))
    raise typer.Exit(0 if all(report.go for report in reports) else _NO_GO)


def report_document(report: VehicleReport) -> dict[str, Any]:
    """A report as JSON data."""
    return {
        "vehicle": report.vehicle_id,
        "link": report.url,
        "autopilot": report.autopilot,
        "go": report.go,
        "problem": report.problem or None,
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


def _render(report: VehicleReport) -> RenderableType:
    from rich.box import SIMPLE_HEAD  # noqa: PLC0415
    from rich.console import Group  # noqa: PLC0415
    from rich.table import Table  # noqa: PLC0415
    from rich.text import Text  # noqa: PLC0415

    styles = {"ok": "green", "advice": "yellow", "wrong": "bold red", "unknown": "yellow"}
    title = f"vehicle {report.vehicle_id}: {report.autopilot or 'no autopilot'} on {report.url}"
    parts: list[RenderableType] = [Text(title, style="bold")]
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
                Text(verdict, style=styles[verdict]),
            )
        parts.append(table)
    for name, value in report.changed:
        parts.append(Text(f"set {name} to {value:g}"))
    if report.reboot:
        parts.append(Text("reboot the autopilot: some of these take effect only then", style="yellow"))
    if report.problem:
        parts.append(Text(report.problem, style="bold red"))
    parts.append(Text("go" if report.go else "no-go", style="bold green" if report.go else "bold red"))
    return Group(*parts, "")


def _name(finding: Finding) -> str:
    return finding.requirement.name if finding.parameter is None else finding.parameter.name
