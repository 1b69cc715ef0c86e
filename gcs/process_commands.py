"""``arvi onboard`` and ``arvi bridge``: one process of a team."""
# ruff: noqa: PLC0415  # heavy parts are imported inside the commands, so that help comes at once

from __future__ import annotations

from typing import Annotated

import typer

from gcs.arguments import Config, load, vehicles_of

__all__ = ["bridge", "onboard"]


def onboard(
    config: Config,
    vehicle: Annotated[int, typer.Option(metavar="N", help="System id of the vehicle to fly.")],
) -> None:
    """Run the onboard process of one vehicle, as on its companion computer.

    It waits for its autopilot, then for the ground station's start. SIGTERM or Ctrl-C lands the vehicle and ends it.

    **Example**: `arvi onboard configs/lab.yaml --vehicle 2`
    """
    vehicles_of(load(config), config, [vehicle])
    from onboard.__main__ import run

    raise typer.Exit(run(config, vehicle))


def bridge(
    config: Config,
    seed: Annotated[int | None, typer.Option(metavar="N", min=0, help="Instead of simulation.seed.")] = None,
) -> None:
    """Run the simulation alone: vehicles with their autopilots, motion capture, targets, detector and radio.

    **Example**: `arvi bridge configs/lab.yaml --seed 7`, then connect QGroundControl or MAVSDK to UDP 14540.
    """
    load(config)
    from sim_bridge.__main__ import main as run_bridge

    raise typer.Exit(run_bridge([str(config), *([] if seed is None else ["--seed", str(seed)])]))
