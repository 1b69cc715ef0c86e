"""What Copter's flight modes need, and how HEARTBEAT shows them (measured)."""

from __future__ import annotations

from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.core.available_modes import AvailableMode

__all__ = ["LISTED_MODES", "SINKS_WITHOUT_STICKS", "base_mode", "is_armable", "is_known", "needs_position"]

SINKS_WITHOUT_STICKS = frozenset(
    {
        CopterMode.STABILIZE,
        CopterMode.ACRO,
        CopterMode.ALT_HOLD,
        CopterMode.DRIFT,
        CopterMode.SPORT,
        CopterMode.FLIP,
        CopterMode.AUTOTUNE,
        CopterMode.FLOWHOLD,
        CopterMode.SYSTEMID,
        CopterMode.AUTOROTATE,
        CopterMode.TURTLE,
        CopterMode.GUIDED_NOGPS,
    }
)
"""Modes that a pilot flies. There is no remote control here: in the air they sink."""

LISTED_MODES = tuple(
    AvailableMode(mode, mode.name.replace("AUTO_RTL", "AUTO RTL").replace("SMART_RTL", "SMARTRTL"))
    for mode in (
        CopterMode.AUTO_RTL,
        CopterMode.AUTO,
        CopterMode.ACRO,
        CopterMode.STABILIZE,
        CopterMode.ALT_HOLD,
        CopterMode.CIRCLE,
        CopterMode.LOITER,
        CopterMode.GUIDED,
        CopterMode.LAND,
        CopterMode.RTL,
        CopterMode.DRIFT,
        CopterMode.SPORT,
        CopterMode.FLIP,
        CopterMode.AUTOTUNE,
        CopterMode.POSHOLD,
        CopterMode.BRAKE,
        CopterMode.THROW,
        CopterMode.AVOID_ADSB,
        CopterMode.GUIDED_NOGPS,
        CopterMode.SMART_RTL,
        CopterMode.FLOWHOLD,
        CopterMode.FOLLOW,
        CopterMode.ZIGZAG,
        CopterMode.SYSTEMID,
    )
)
"""The modes of a multirotor in SITL, in ArduPilot's order."""

_KNOWN = frozenset(mode.custom_mode for mode in LISTED_MODES)
_NOT_ARMABLE = frozenset(
    {CopterMode.LAND, CopterMode.RTL, CopterMode.SMART_RTL, CopterMode.BRAKE, CopterMode.CIRCLE, CopterMode.AUTO_RTL}
)

_ARMED = 128
_PILOT_BASE_MODE = 81
_AUTOPILOT_BASE_MODE = 89


def is_known(custom_mode: int) -> bool:
    """Whether a vehicle has this mode."""
    return custom_mode in _KNOWN


def needs_position(mode: CopterMode) -> bool:
    """Whether a mode needs an estimate of the position."""
    return mode not in SINKS_WITHOUT_STICKS and mode is not CopterMode.LAND and mode is not CopterMode.THROW


def is_armable(mode: CopterMode) -> bool:
    """Whether one can arm in a mode."""
    return mode not in _NOT_ARMABLE


def base_mode(mode: CopterMode, *, armed: bool) -> int:
    """HEARTBEAT.base_mode."""
    flags = _PILOT_BASE_MODE if mode in SINKS_WITHOUT_STICKS else _AUTOPILOT_BASE_MODE
    return flags | _ARMED if armed else flags
