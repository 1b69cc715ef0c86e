"""Configuration: one YAML file per scenario, validated strictly."""

from onboard.config.loader import ConfigError, load_scenario
from onboard.config.schema import Scenario, VehicleConfig

__all__ = ["ConfigError", "Scenario", "VehicleConfig", "load_scenario"]
