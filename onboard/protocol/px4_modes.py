"""PX4's flight modes in HEARTBEAT.custom_mode and MAV_CMD_DO_SET_MODE (https://docs.px4.io/main/en/flight_modes/).

``custom_mode`` is ``main << 16 | sub << 24``.
"""

from __future__ import annotations

from enum import IntEnum

__all__ = ["Px4Mode"]


def _custom_mode(main: int, sub: int = 0) -> int:
    return main << 16 | sub << 24


class Px4Mode(IntEnum):
    """The modes that a companion or a ground station meets; the value is ``custom_mode``."""

    MANUAL = _custom_mode(1)
    ALTCTL = _custom_mode(2)
    POSCTL = _custom_mode(3)
    READY = _custom_mode(4, 1)
    TAKEOFF = _custom_mode(4, 2)
    LOITER = _custom_mode(4, 3)
    MISSION = _custom_mode(4, 4)
    RTL = _custom_mode(4, 5)
    LAND = _custom_mode(4, 6)
    FOLLOW = _custom_mode(4, 8)
    PRECLAND = _custom_mode(4, 9)
    ACRO = _custom_mode(5)
    OFFBOARD = _custom_mode(6)
    STABILIZED = _custom_mode(7)

    @property
    def main(self) -> int:
        """Main mode: param2 of MAV_CMD_DO_SET_MODE."""
        return self.value >> 16 & 0xFF

    @property
    def sub(self) -> int:
        """Sub mode: param3 of MAV_CMD_DO_SET_MODE."""
        return self.value >> 24 & 0xFF

    @classmethod
    def name_of(cls, custom_mode: int) -> str:
        """The mode's name, or its number in hexadecimal when it is none of these."""
        try:
            return cls(custom_mode).name
        except ValueError:
            return f"{custom_mode:#010x}"
