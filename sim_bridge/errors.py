"""The root of every error that this package raises on purpose, and the one that many parts raise."""

from __future__ import annotations

from onboard.config import Scenario
from onboard.config.simulation import SimulationConfig

__all__ = ["BridgeError", "require_simulation"]


class BridgeError(Exception):
    """Something the caller can act on; its text says what was wrong, where, and what would be right."""


def require_simulation(scenario: Scenario) -> SimulationConfig:
    """The scenario's ``simulation`` section.

    Raises:
        BridgeError: It has none.
    """
    if scenario.simulation is None:
        raise BridgeError(f"scenario {scenario.name} has no section simulation: there is nothing to simulate")
    return scenario.simulation
