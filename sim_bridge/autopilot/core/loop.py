"""A proportional-integral controller."""

from __future__ import annotations

import math

__all__ = ["Loop"]


class Loop:
    """One controlled quantity.

    Attributes:
        integral: What the integrator has learnt, in units of the output.
    """

    __slots__ = ("integral",)

    def __init__(self) -> None:
        self.integral = 0.0

    def output(self, error: float, gains: tuple[float, float], limit: float, dt_s: float) -> float:
        """The controller's output.

        Args:
            error: Setpoint less value.
            gains: Proportional; integral per second.
            limit: Of the integral.
            dt_s: Time since the last one, s.
        """
        integral = self.integral + gains[1] * error * dt_s
        # An integral that is no number (a gain that is none) is none.
        self.integral = integral = min(max(integral, -limit), limit) if abs(integral) < math.inf else 0.0
        return gains[0] * error + integral
