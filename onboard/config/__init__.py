"""Configuration: one YAML file per scenario, validated strictly."""

from onboard.config.loader import ConfigError, load_scenario
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig

__all__ = ["ConfigError", "Scenario", "VehicleConfig", "load_scenario"]
