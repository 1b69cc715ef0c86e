"""``python -m sim_bridge CONFIG [--seed N]``: run the bridge alone."""

from __future__ import annotations

import argparse
import logging
import sys
from pathlib import Path

from onboard.config import ConfigError, load_scenario
from sim_bridge.process import run_bridge

__all__ = ["main"]


def main(arguments: list[str]) -> int:
    """Run the bridge of the configuration named on the command line; the exit code."""
    parser = argparse.ArgumentParser(
        prog="python -m sim_bridge", description="simulate everything physical of a scenario"
    )
    parser.add_argument("config", type=Path, help="scenario file (YAML)")
    parser.add_argument("--seed", type=int, default=None, help="instead of the scenario's simulation.seed")
    options = parser.parse_args(arguments)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s bridge %(levelname)s %(message)s")
    if options.seed is not None and options.seed < 0:
        parser.error(f"--seed {options.seed}: a seed is not negative")
    try:
        scenario = load_scenario(options.config)
    except ConfigError as error:
        sys.stderr.write(f"{error}\n")
        return 2
    return run_bridge(scenario, seed=options.seed)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
