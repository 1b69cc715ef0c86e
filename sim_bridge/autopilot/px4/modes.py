"""What PX4's flight modes need, and how HEARTBEAT shows them (PX4 ``mode_requirements``, measured on 1.15)."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.protocol.px4_modes import Px4Mode

__all__ = ["DESCENDS_WITHOUT_STICKS", "Health", "base_mode", "can_arm", "can_run", "prevents_arming"]

DESCENDS_WITHOUT_STICKS = frozenset({Px4Mode.MANUAL, Px4Mode.ALTCTL, Px4Mode.POSCTL, Px4Mode.ACRO, Px4Mode.STABILIZED})
"""The manual modes. There is no remote control here: as a failsafe they sink and land, by choice they cannot run."""

_NEVER = DESCENDS_WITHOUT_STICKS | {Px4Mode.READY, Px4Mode.MISSION, Px4Mode.FOLLOW, Px4Mode.PRECLAND}
_NEEDS_GLOBAL_POSITION = frozenset({Px4Mode.LOITER, Px4Mode.RTL})
_PREVENTS_ARMING = frozenset({Px4Mode.LAND, Px4Mode.RTL, Px4Mode.PRECLAND})

_ARMED = 128
_AUTO_BASE_MODE = 29
_MANUAL_BASE_MODE = 81


@dataclass(frozen=True, slots=True)
class Health:
    """What the modes' requirements are about.

    Attributes:
        attitude: Tilt and heading are known.
        local_position: Position in the local frame is known.
        global_position: So is the origin of the local frame.
        home: The home position is set.
        offboard_signal: Setpoints arrive.
    """

    attitude: bool
    local_position: bool
    global_position: bool
    home: bool
    offboard_signal: bool


def can_run(mode: Px4Mode, health: Health) -> bool:
    """Whether the requirements of a mode are met."""
    if mode in _NEVER or not health.attitude or not health.local_position:
        return False
    if mode is Px4Mode.OFFBOARD:
        return health.offboard_signal
    if mode in _NEEDS_GLOBAL_POSITION:
        return health.global_position and (mode is not Px4Mode.RTL or health.home)
    return True


def prevents_arming(mode: Px4Mode) -> bool:
    """Whether one cannot arm in a mode even though it could run."""
    return mode in _PREVENTS_ARMING


def can_arm(mode: Px4Mode, health: Health) -> bool:
    """Whether the vehicle may be armed in a mode."""
    return can_run(mode, health) and not prevents_arming(mode)


def base_mode(mode: Px4Mode, *, armed: bool, setpoint_seen: bool) -> int:
    """HEARTBEAT.base_mode; OFFBOARD counts as stabilized once setpoints say what is controlled."""
    if mode is Px4Mode.OFFBOARD:
        flags = 17 if setpoint_seen else 1
    elif mode is Px4Mode.ACRO:
        flags = 65
    elif mode in DESCENDS_WITHOUT_STICKS:
        flags = _MANUAL_BASE_MODE
    else:
        flags = _AUTO_BASE_MODE
    return flags | _ARMED if armed else flags
