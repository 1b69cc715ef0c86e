"""A four-cell battery that drains slowly while the motors run."""

from __future__ import annotations

__all__ = ["Battery"]

HOVER_CURRENT_A = 12.0
IDLE_CURRENT_A = 0.6
FULL_V = 16.2
EMPTY_V = 14.4
LOAD_DROP_V = 0.25


class Battery:
    """Charge by the ampere-hours taken from it, voltage linear in charge.

    Args:
        capacity_mah: Of a full one, mAh.

    Attributes:
        consumed_mah: Charge taken so far, mAh.
        current_a: Current now, A.
    """

    def __init__(self, capacity_mah: float) -> None:
        self._capacity_mah = capacity_mah
        self.consumed_mah = 0.0
        self.current_a = IDLE_CURRENT_A

    @property
    def remaining(self) -> float:
        """Charge left, 0…1."""
        return max(1.0 - self.consumed_mah / self._capacity_mah, 0.0)

    @property
    def voltage_v(self) -> float:
        """Voltage at the terminals, V."""
        drop_v = LOAD_DROP_V if self.current_a > IDLE_CURRENT_A else 0.0
        return EMPTY_V + (FULL_V - EMPTY_V) * self.remaining - drop_v

    def drain(self, remaining: float) -> None:
        """Leave so much charge, 0…1."""
        self.consumed_mah = (1.0 - remaining) * self._capacity_mah

    def step(self, dt_s: float, *, motors_on: bool) -> None:
        """Draw current for a time, s."""
        self.current_a = HOVER_CURRENT_A if motors_on else IDLE_CURRENT_A
        self.consumed_mah += self.current_a * dt_s / 3.6
