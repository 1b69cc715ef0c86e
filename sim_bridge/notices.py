"""What the bridge tells its operator."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.protocol import dialect as mavlink

__all__ = ["Notice"]


@dataclass(frozen=True, slots=True)
class Notice:
    """Something that an operator should know.

    Attributes:
        text: One line.
        severity: MAV_SEVERITY.
    """

    text: str
    severity: int = mavlink.MAV_SEVERITY_WARNING
