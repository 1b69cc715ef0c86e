"""Conformance: does an autopilot, simulated or real, answer as the recorded ones did?"""

from sim_bridge.conformance.catalogue import (
    Catalogue,
    CatalogueError,
    Entry,
    Family,
    Link,
    Position,
    State,
    load_catalogue,
)
from sim_bridge.conformance.session import Outcome, Plan, Result, Session, family_of, select

__all__ = [
    "Catalogue",
    "CatalogueError",
    "Entry",
    "Family",
    "Link",
    "Outcome",
    "Plan",
    "Position",
    "Result",
    "Session",
    "State",
    "family_of",
    "load_catalogue",
    "select",
]
