"""Phases of a flight in which a fault begins."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["AIR", "HELD", "ORDINARY", "Phase"]


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
    TOGETHER = "together"
    """Holding, by command, after a teammate has come well within reach."""
    RETURNING = "returning"
    """On the way home."""
    LANDING = "landing"
    """Descending in the autopilot's own landing mode."""


HELD = (Phase.PAUSED, Phase.TOGETHER)
"""Holding, until the ground lets them go on."""

AIR = (Phase.TAKEOFF, Phase.TRACKING, Phase.PAUSED, Phase.RETURNING)
"""In the air under the stack's command."""

ORDINARY = tuple(phase for phase in Phase if phase is not Phase.TOGETHER)
"""Those that every flight goes through, or may."""
