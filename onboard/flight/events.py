"""What flight tells the operator, and why it does not obey."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.flight.failsafes import Condition

__all__ = ["Event", "Refusal"]


@dataclass(frozen=True, slots=True)
class Event:
    """Something the operator should know.

    Attributes:
        severity: MAV_SEVERITY.
        text: One line.
        condition: What has come to a reaction of the failsafe ladder with it; None for anything else.
    """

    severity: int
    text: str
    condition: Condition | None = None


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why a command is not obeyed.

    Attributes:
        result: MAV_RESULT to answer with.
        reason: One line for the operator.
    """

    result: int
    reason: str
