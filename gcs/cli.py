"""The command ``arvi``.

Heavy parts (kernels, the MAVLink dialect) are imported inside the commands, so that help comes at once.
"""

from __future__ import annotations

from typing import Annotated

import typer

from gcs.check_command import check
from gcs.conformance_command import conformance
from gcs.experiment_command import experiment
from gcs.flight_commands import fly, gcs
from gcs.joining_commands import command, monitor
from gcs.keygen_command import keygen
from gcs.mocap_command import mocap
from gcs.plan_command import plan
from gcs.preflight_command import preflight
from gcs.process_commands import bridge, onboard
from gcs.recording_commands import compare, replay, report
from gcs.version import program_version

__all__ = ["app", "main"]

_OURS = ("gcs", "sim_bridge", "onboard")

app = typer.Typer(
    name="arvi",
    help="Fly teams of robots that plan together where to look (MAVLink: PX4, ArduPilot).",
    epilog="Start with: arvi fly configs/lab.yaml",
    no_args_is_help=True,
    rich_markup_mode="markdown",
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Run the command line: 0 fine, 1 something failed in flight, 2 bad input."""
    try:
        app()
    except ModuleNotFoundError as error:
        if error.name is None or error.name.partition(".")[0] in _OURS:
            raise
        typer.echo(
            f"arvi: this command needs {error.name}, which is not installed here. Vehicles are installed without the "
            "ground station's parts (requirements/vehicle.lock); install the whole project where this is to run: "
            "`pip install .`",
            err=True,
        )
        raise SystemExit(2) from None


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


_COMMANDS = (
    fly,
    onboard,
    bridge,
    gcs,
    monitor,
    command,
    check,
    plan,
    preflight,
    experiment,
    mocap,
    keygen,
    conformance,
    replay,
    report,
    compare,
)
"""In the order in which help lists them."""

for _command in _COMMANDS:
    app.command()(_command)


if __name__ == "__main__":
    main()
