"""Groups of flight states."""

from __future__ import annotations

from onboard.messages import FlightState

__all__ = ["AIRBORNE", "COMMANDED", "FLOWN", "IDLE"]

IDLE = (FlightState.WAIT, FlightState.STANDBY)
"""On the ground, and nobody has asked for a flight."""

FLOWN = (FlightState.HOLD, FlightState.TRACK, FlightState.RETURN)
"""At the layer, on a trajectory of ours."""

COMMANDED = (FlightState.TAKEOFF, *FLOWN)
"""In the air, where this stack wants the vehicle to be."""

AIRBORNE = (*COMMANDED, FlightState.LAND)
"""In the air, or about to be."""
