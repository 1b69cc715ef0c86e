"""What Copter's flight modes need, and how HEARTBEAT shows them (measured)."""

from __future__ import annotations

from onboard.protocol.ardupilot_modes import CopterMode

__all__ = ["SINKS_WITHOUT_STICKS", "base_mode", "is_armable", "is_known", "needs_position"]

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

_NOT_BUILT = frozenset({CopterMode.AUTOROTATE, CopterMode.TURTLE, CopterMode.SYSTEMID})
_NOT_ARMABLE = frozenset(
    {CopterMode.LAND, CopterMode.RTL, CopterMode.SMART_RTL, CopterMode.BRAKE, CopterMode.CIRCLE, CopterMode.AUTO_RTL}
)

_ARMED = 128
_PILOT_BASE_MODE = 81
_AUTOPILOT_BASE_MODE = 89


def is_known(custom_mode: int) -> bool:
    """Whether a vehicle has this mode."""
    return custom_mode in CopterMode.__members__.values() and CopterMode(custom_mode) not in _NOT_BUILT


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
