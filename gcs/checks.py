"""What a pre-flight check says: each thing that was looked at, and whether to go."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from enum import Enum
from typing import Any

__all__ = ["Check", "Outcome", "check_document", "is_go"]


class Outcome(Enum):
    """How a thing is."""

    PASS = "pass"
    WARN = "warn"
    """Not as it should be; flying is possible."""
    FAIL = "fail"
    """No flight."""


@dataclass(frozen=True, slots=True)
class Check:
    """One thing that was looked at.

    Attributes:
        name: What.
        outcome: How it is.
        found: What was seen.
        wanted: What would be right; empty where it is.
    """

    name: str
    outcome: Outcome
    found: str
    wanted: str = ""

    @classmethod
    def of(cls, name: str, outcome: Outcome, found: str, wanted: str) -> Check:
        """A check that says what would be right only where it is not."""
        return cls(name, outcome, found, "" if outcome is Outcome.PASS else wanted)


def is_go(checks: Iterable[Check]) -> bool:
    """Whether nothing forbids to fly."""
    return all(check.outcome is not Outcome.FAIL for check in checks)


def check_document(check: Check) -> dict[str, Any]:
    """A check as JSON data."""
    return {
        "name": check.name,
        "outcome": check.outcome.value,
        "found": check.found,
        "wanted": check.wanted or None,
    }
