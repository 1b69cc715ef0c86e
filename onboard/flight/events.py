"""What flight tells the operator, and why it does not obey."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Event", "Refusal"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something the operator should know.

    Attributes:
        severity: MAV_SEVERITY.
        text: One line.
    """

    severity: int
    text: str


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a command is not obeyed.

    Attributes:
        result: MAV_RESULT to answer with.
        reason: One line for the operator.
    """

    result: int
    reason: str
