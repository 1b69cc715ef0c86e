"""What the commands of ``arvi`` share: the scenario's argument, and how they end when what was given cannot be used."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NoReturn

import typer

from gcs.exit_codes import EXIT_BAD_INPUT

if TYPE_CHECKING:
    from onboard.config import Scenario

__all__ = ["Config", "Headless", "load", "refuse", "vehicles_of"]

Config = Annotated[Path, typer.Argument(metavar="CONFIG", help="Scenario file, e.g. configs/lab.yaml.")]
Headless = Annotated[bool, typer.Option("--headless", help="Lines of text instead of the live picture.")]


def load(config: Path) -> Scenario:
    """The scenario in a file; ends the command when there is none."""
    from onboard.config import ConfigError, load_scenario  # noqa: PLC0415 - heavy: help comes at once

    try:
        return load_scenario(config)
    except ConfigError as error:
        refuse(str(error))


def vehicles_of(scenario: Scenario, config: Path, wanted: Sequence[int]) -> list[int]:
    """The vehicles that somebody named, all of the scenario's for none; ends the command for one that is unknown."""
    known = [vehicle.id for vehicle in scenario.vehicles]
    for vehicle in wanted:
        if vehicle not in known:
            refuse(f"--vehicle {vehicle}: no such vehicle in {config}; it has {', '.join(map(str, known))}")
    return list(dict.fromkeys(wanted or known))


def refuse(text: str) -> NoReturn:
    """End because of what the user gave us."""
    sys.stderr.write(f"{text}\n")
    raise typer.Exit(EXIT_BAD_INPUT)
