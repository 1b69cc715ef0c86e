"""Groups of flight states."""

from __future__ import annotations

from onboard.messages import FlightState

__all__ = ["AIRBORNE", "COMMANDED", "FLOWN", "IDLE", "PLANNING", "UNDER_WAY"]

IDLE = (FlightState.WAIT, FlightState.STANDBY)
"""On the ground, and nobody has asked for a flight."""

PLANNING = (FlightState.HOLD, FlightState.TRACK)
"""At the layer, flying plans or waiting for one."""

FLOWN = (*PLANNING, FlightState.RETURN)
"""At the layer, on a trajectory of ours."""

COMMANDED = (FlightState.TAKEOFF, *FLOWN)
"""In the air, where this stack wants the vehicle to be."""

UNDER_WAY = (FlightState.ARM, *COMMANDED)
"""From the start to the landing: nobody else is to have the vehicle."""

AIRBORNE = (*COMMANDED, FlightState.LAND)
"""In the air, or about to be."""
