"""Simulated autopilots: the behaviour of PX4 and of ArduPilot Copter without either."""

from sim_bridge.autopilot.core.parameters import ParameterError
from sim_bridge.autopilot.core.setpoint import SetpointStatistics
from sim_bridge.autopilot.firmwares import FIRMWARES, Firmware, FirmwareKind
from sim_bridge.autopilot.links import GCS, LINKS, ONBOARD, LinkName
from sim_bridge.autopilot.simulated import SimulatedAutopilot

__all__ = [
    "FIRMWARES",
    "GCS",
    "LINKS",
    "ONBOARD",
    "Firmware",
    "FirmwareKind",
    "LinkName",
    "ParameterError",
    "SetpointStatistics",
    "SimulatedAutopilot",
]
