"""Simulated autopilots: PX4's behaviour without PX4."""

from sim_bridge.autopilot.core import SimulatedAutopilot
from sim_bridge.autopilot.links import GCS, LINKS, ONBOARD, LinkName
from sim_bridge.autopilot.offboard import SetpointStatistics
from sim_bridge.autopilot.parameters import INDOOR_PARAMETERS, ParameterError

__all__ = [
    "GCS",
    "INDOOR_PARAMETERS",
    "LINKS",
    "ONBOARD",
    "LinkName",
    "ParameterError",
    "SetpointStatistics",
    "SimulatedAutopilot",
]
