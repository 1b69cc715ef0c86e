"""Time as an autopilot counts it: from its boot."""

from __future__ import annotations

__all__ = ["BootClock"]


class BootClock:
    """Seconds of the world outside, microseconds and milliseconds since the boot inside.

    Args:
        boot_s: When it was switched on, s.

    Attributes:
        boot_s: When it was switched on, s.
        time_s: Now, s.
        boot_us: Time since the boot, µs.
    """

    __slots__ = ("boot_s", "boot_us", "time_s")

    def __init__(self, boot_s: float) -> None:
        self.boot_s = boot_s
        self.time_s = boot_s
        self.boot_us = 0

    @property
    def boot_ms(self) -> int:
        """Time since the boot, ms, as far as 32 bits go."""
        return self.boot_us // 1000 & 0xFFFFFFFF

    @property
    def up_s(self) -> float:
        """Time since the boot, s."""
        return self.time_s - self.boot_s

    def advance(self, time_s: float) -> None:
        """It is later now; never earlier."""
        if time_s > self.time_s:
            self.time_s = time_s
            self.boot_us = max(round(1e6 * (time_s - self.boot_s)), 0)
