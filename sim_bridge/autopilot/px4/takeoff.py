"""Leaving the ground and coming back to it: PX4's takeoff ramp and land detector."""

from __future__ import annotations

import math
from enum import Enum, auto

from sim_bridge.autopilot.core.parameters import ParameterStore

__all__ = ["LandDetector", "TakeoffPhase", "TakeoffRamp"]

RAMP_START_M_S = 2.35
"""Sink rate that the ramp starts at: the thrust then grows from idle, and nothing moves before it passes zero."""

THRUST_SHOWS_S = 0.6
"""After so much of the ramp the land detector reports a takeoff, still on the ground."""


class TakeoffPhase(Enum):
    """Where between the ground and flight."""

    DISARMED = auto()
    SPOOLUP = auto()
    READY = auto()
    RAMPUP = auto()
    FLIGHT = auto()


class TakeoffRamp:
    """Keeps the vehicle down until its motors have spun up, then lets the climb rate grow slowly.

    Attributes:
        phase: Where between the ground and flight.
        max_climb_m_s: Largest climb rate allowed now, m/s; negative while the vehicle is pressed down.
    """

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._since_s = 0.0
        self.phase = TakeoffPhase.DISARMED
        self.max_climb_m_s = -RAMP_START_M_S

    def step(self, time_s: float, *, armed: bool, landed: bool, wants_takeoff: bool) -> None:
        """Follow arming, the land detector and the setpoint."""
        phase = self.phase
        if not armed:
            self._enter(TakeoffPhase.DISARMED, time_s)
        elif phase is TakeoffPhase.DISARMED:
            self._enter(TakeoffPhase.SPOOLUP if landed else TakeoffPhase.FLIGHT, time_s)
        elif phase is TakeoffPhase.SPOOLUP:
            if time_s - self._since_s >= self._parameters["COM_SPOOLUP_TIME"]:
                self._enter(TakeoffPhase.READY, time_s)
        elif phase is TakeoffPhase.READY:
            if wants_takeoff:
                self._enter(TakeoffPhase.RAMPUP, time_s)
        elif phase is TakeoffPhase.RAMPUP:
            if not wants_takeoff and landed:
                self._enter(TakeoffPhase.READY, time_s)
            elif time_s - self._since_s >= self._parameters["MPC_TKO_RAMP_T"]:
                self._enter(TakeoffPhase.FLIGHT, time_s)
        elif landed:
            self._enter(TakeoffPhase.READY, time_s)
        self.max_climb_m_s = self._limit(time_s)

    def ramping_for_s(self, time_s: float) -> float:
        """How long the ramp has been going on, s; 0 outside of it."""
        return time_s - self._since_s if self.phase is TakeoffPhase.RAMPUP else 0.0

    def _enter(self, phase: TakeoffPhase, time_s: float) -> None:
        if phase is not self.phase:
            self.phase = phase
            self._since_s = time_s

    def _limit(self, time_s: float) -> float:
        if self.phase is TakeoffPhase.FLIGHT:
            return math.inf
        if self.phase is not TakeoffPhase.RAMPUP:
            return -RAMP_START_M_S
        ramp_s = max(self._parameters["MPC_TKO_RAMP_T"], 1e-3)
        share = min((time_s - self._since_s) / ramp_s, 1.0)
        return -RAMP_START_M_S + share * (self._parameters["MPC_TKO_SPEED"] + RAMP_START_M_S)


class LandDetector:
    """Says that the vehicle has landed once it has stood on the ground for LNDMC_TRIG_TIME.

    Attributes:
        landed: Whether it has.
        contact: Whether it touches the ground and does not take off.
    """

    def __init__(self, parameters: ParameterStore) -> None:
        self._parameters = parameters
        self._contact_since_s: float | None = None
        self.landed = True
        self.contact = True

    def step(self, time_s: float, *, on_ground: bool, armed: bool, ramp: TakeoffRamp) -> None:
        """Follow the ground contact."""
        ramping_s = ramp.ramping_for_s(time_s)
        self.contact = on_ground and ramping_s == 0.0
        if not on_ground or ramping_s > THRUST_SHOWS_S:
            self.landed = False
            self._contact_since_s = None
            return
        if self.landed or not self.contact:
            return
        if self._contact_since_s is None:
            self._contact_since_s = time_s
        if not armed or time_s - self._contact_since_s >= self._parameters["LNDMC_TRIG_TIME"]:
            self.landed = True
