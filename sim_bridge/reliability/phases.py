"""Phases of a flight in which a fault begins."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["AIR", "Phase"]


class Phase(StrEnum):
    """When a fault begins."""

    GROUND = "ground"
    """Ready, before the start command."""
    ARMING = "arming"
    """Just after the start command."""
    TAKEOFF = "takeoff"
    """On the way up."""
    TRACKING = "tracking"
    """Flying plans."""
    PAUSED = "paused"
    """Holding, by command."""
    RETURNING = "returning"
    """On the way home."""
    LANDING = "landing"
    """Descending in the autopilot's own landing mode."""


AIR = (Phase.TAKEOFF, Phase.TRACKING, Phase.PAUSED, Phase.RETURNING)
"""In the air under the stack's command."""
