"""The commands that the ground gives, and how their outcome reads to an operator.

Repeating until acknowledged, with ``confirmation`` counting up, is :class:`onboard.protocol.commands.CommandClient`'s.
"""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.commands import Command, CommandOutcome, result_name
from onboard.protocol.px4_modes import Px4Mode
from onboard.protocol.start_order import encode_start

__all__ = [
    "AUTOPILOT",
    "ONBOARD",
    "component_name",
    "describe",
    "hold_command",
    "kill_command",
    "land_command",
    "pause_command",
    "return_command",
    "start_command",
]

AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
"""Component id of a vehicle's autopilot."""

ONBOARD = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
"""Component id of a vehicle's onboard process."""

_FORCE = 21196.0
"""MAV_CMD_COMPONENT_ARM_DISARM's param2 that disarms in flight, too."""

_COMPONENT_NAMES = {AUTOPILOT: "autopilot", ONBOARD: "onboard process"}


def start_command(vehicle_id: int, start_s: float) -> Command:
    """MAV_CMD_ARVI_START to the onboard process: take off and fly the mission whose step 0 is at this UNIX time."""
    return encode_start(vehicle_id, ONBOARD, start_s)


def land_command(vehicle_id: int, component: int) -> Command:
    """MAV_CMD_NAV_LAND: to the onboard process, return home and land; to the autopilot, land where it is.

    Latitude and longitude are NaN: the current position (https://mavlink.io/en/messages/common.html#MAV_CMD_NAV_LAND).
    """
    nan = float("nan")
    return mavlink.MAVLink_command_long_message(
        vehicle_id, component, mavlink.MAV_CMD_NAV_LAND, 0, 0.0, 0.0, 0.0, nan, nan, nan, 0.0
    )


def pause_command(vehicle_id: int, *, resume: bool) -> Command:
    """MAV_CMD_DO_PAUSE_CONTINUE to the onboard process: hold its place, or fly its plans again.

    https://mavlink.io/en/messages/common.html#MAV_CMD_DO_PAUSE_CONTINUE
    """
    return mavlink.MAVLink_command_long_message(
        vehicle_id, ONBOARD, mavlink.MAV_CMD_DO_PAUSE_CONTINUE, 0, float(resume), 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    )


def hold_command(vehicle_id: int, autopilot: int) -> Command:
    """MAV_CMD_DO_SET_MODE to the autopilot: PX4's LOITER, ArduPilot's BRAKE, which both hold the place.

    Args:
        vehicle_id: System id.
        autopilot: MAV_AUTOPILOT.
    """
    main, sub = float(Px4Mode.LOITER.main), float(Px4Mode.LOITER.sub)
    if autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA:
        main, sub = float(CopterMode.BRAKE), 0.0
    custom = float(mavlink.MAV_MODE_FLAG_CUSTOM_MODE_ENABLED)
    return _long(vehicle_id, mavlink.MAV_CMD_DO_SET_MODE, custom, main, sub)


def return_command(vehicle_id: int) -> Command:
    """MAV_CMD_NAV_RETURN_TO_LAUNCH to the autopilot."""
    return _long(vehicle_id, mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH)


def kill_command(vehicle_id: int) -> Command:
    """MAV_CMD_COMPONENT_ARM_DISARM to the autopilot: motors off, at once and wherever it is."""
    return _long(vehicle_id, mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 0.0, _FORCE)


def _long(vehicle_id: int, command: int, param1: float = 0.0, param2: float = 0.0, param3: float = 0.0) -> Command:
    return mavlink.MAVLink_command_long_message(
        vehicle_id, AUTOPILOT, command, 0, param1, param2, param3, 0.0, 0.0, 0.0, 0.0
    )


def component_name(component: int) -> str:
    """What an operator calls a component of a vehicle."""
    return _COMPONENT_NAMES.get(component, f"component {component}")


def describe(outcome: CommandOutcome) -> str:
    """A sentence about how a command ended."""
    entry = mavlink.enums["MAV_CMD"].get(outcome.command)
    name = entry.name.removeprefix("MAV_CMD_") if entry is not None else f"command {outcome.command}"
    who = component_name(outcome.target[1])
    if outcome.result is None:
        return f"{who} did not answer {name}"
    if outcome.accepted:
        return f"{who} took {name}"
    return f"{who} refused {name}: {result_name(outcome.result)}"
