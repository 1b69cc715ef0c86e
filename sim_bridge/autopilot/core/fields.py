"""Numbers in the units and within the ranges of MAVLink's integer fields."""

from __future__ import annotations

__all__ = ["centi", "milli"]


def centi(value: float) -> int:
    """In hundredths, within 16 bits."""
    return min(max(round(100.0 * value), -32768), 32767)


def milli(value: float) -> int:
    """In thousandths, within 32 bits."""
    return min(max(round(1000.0 * value), -(2**31)), 2**31 - 1)
