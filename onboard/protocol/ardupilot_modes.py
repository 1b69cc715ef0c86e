"""ArduPilot Copter's flight modes in HEARTBEAT.custom_mode and MAV_CMD_DO_SET_MODE's param2.

https://ardupilot.org/copter/docs/flight-modes.html; the numbers are those of
https://mavlink.io/en/messages/ardupilotmega.html#COPTER_MODE. Unlike PX4's, ``custom_mode`` is the mode's number.
"""

from __future__ import annotations

from enum import IntEnum

__all__ = ["CopterMode"]


class CopterMode(IntEnum):
    """The modes; the value is ``custom_mode``."""

    STABILIZE = 0
    ACRO = 1
    ALT_HOLD = 2
    AUTO = 3
    GUIDED = 4
    LOITER = 5
    RTL = 6
    CIRCLE = 7
    LAND = 9
    DRIFT = 11
    SPORT = 13
    FLIP = 14
    AUTOTUNE = 15
    POSHOLD = 16
    BRAKE = 17
    THROW = 18
    AVOID_ADSB = 19
    GUIDED_NOGPS = 20
    SMART_RTL = 21
    FLOWHOLD = 22
    FOLLOW = 23
    ZIGZAG = 24
    SYSTEMID = 25
    AUTOROTATE = 26
    AUTO_RTL = 27
    TURTLE = 28

    @classmethod
    def name_of(cls, custom_mode: int) -> str:
        """The mode's name, or its number when it is none of these."""
        try:
            return cls(custom_mode).name
        except ValueError:
            return f"mode {custom_mode}"
