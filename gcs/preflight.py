"""What a scenario's schema cannot see is tried before any process starts."""

from __future__ import annotations

from pathlib import Path

from gcs.errors import GroundError
from onboard.config import Scenario
from onboard.protocol.signing_files import read_key
from sim_bridge.bridge import build_bridge
from sim_bridge.errors import BridgeError
from sim_bridge.ports import find_ports

__all__ = ["check_signing", "check_simulation"]


def check_signing(scenario: Scenario) -> None:
    """Read the team's key, if the scenario names one, as every process of a flight will.

    Raises:
        SigningError: It is not there, others can read it, or it is none; the text names the file and what to do.
    """
    if scenario.signing is not None:
        read_key(Path(scenario.signing.key_file))


def check_simulation(config: Path, scenario: Scenario, seed: int | None) -> None:
    """Build what the scenario simulates, and throw it away: its robots have room, its parameters exist.

    Args:
        config: Its file, for the error.
        scenario: One without a ``simulation`` section passes.
        seed: Decides where robots start; None takes the scenario's.

    Raises:
        GroundError: It cannot be simulated; the text says what is wrong and where.
    """
    if scenario.simulation is None:
        return
    try:
        build_bridge(scenario, seed, 0.0)
        find_ports(scenario)
    except BridgeError as error:
        raise GroundError(f"{config}: {error}") from None
