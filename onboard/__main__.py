"""``python -m onboard CONFIG --vehicle N``: the onboard process of one vehicle."""

from __future__ import annotations

import argparse
import asyncio
import logging
import sys
from pathlib import Path

from onboard.config import load_scenario
from onboard.errors import OnboardError

__all__ = ["main"]


def main(arguments: list[str] | None = None) -> int:
    """Fly one vehicle; the exit code: 0 when stopped, 2 for bad input."""
    parser = argparse.ArgumentParser(prog="python -m onboard", description="The onboard process of one vehicle.")
    parser.add_argument("config", type=Path, help="scenario, e.g. configs/lab.yaml")
    parser.add_argument("--vehicle", type=int, required=True, metavar="N", help="system id of the vehicle to fly")
    options = parser.parse_args(arguments)
    return run(options.config, options.vehicle)


def run(config: Path, vehicle_id: int) -> int:
    """Fly a vehicle of the scenario in a file; the exit code."""
    logging.basicConfig(level=logging.INFO, format=f"%(asctime)s vehicle {vehicle_id}: %(message)s", datefmt="%H:%M:%S")
    try:
        scenario = load_scenario(config)
        scenario.vehicle(vehicle_id)
        from onboard.process import fly  # noqa: PLC0415 - numba loads for a second; bad input is said before that

        asyncio.run(fly(scenario, vehicle_id))
    except (OnboardError, KeyError) as error:
        sys.stderr.write(f"{error.args[0] if error.args else error}\n")
        return 2
    return 0


if __name__ == "__main__":
    sys.exit(main())
