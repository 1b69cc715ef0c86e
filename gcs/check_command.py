"""``arvi check``: is a scenario written as it should be?"""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from gcs.exit_codes import EXIT_BAD_INPUT

__all__ = ["check"]


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
