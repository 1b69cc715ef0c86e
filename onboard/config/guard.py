"""The section ``flight.guard``: the last resort that keeps vehicles apart, off obstacles and inside the fence."""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from onboard.config.base import NonNegative, Positive, Section

__all__ = ["GuardConfig"]


class GuardConfig(Section):
    """How the setpoints' velocities are limited near danger, below all planning."""

    enabled: bool = True
    separation_share: Annotated[float, Field(gt=0.0, le=1.0)] = Field(
        default=0.75, description="of mission.separation_m; plans keep all of it, so that the guard rarely acts"
    )
    fence_margin_m: NonNegative = Field(
        default=0.15, description="beyond the fence, and within the obstacles' clearance, which plans may touch"
    )
    brake_m_s2: Positive = Field(default=1.5, description="how hard the vehicle brakes")
    reaction_s: NonNegative = Field(default=0.3, description="until it begins to")
    peer_delay_s: NonNegative = Field(default=0.2, description="later reaction to a peer, whose word takes time")
    retreat_m_s: Positive = Field(default=0.5, description="fastest way back from where it must not be")
    retreat_gain_per_s: Positive = 2.0
    silence_s: Positive = Field(default=5.0, description="how long a peer that fell silent is still kept off")
    stray_s: Positive = Field(
        default=20.0, description="how long a teammate that fell silent nearby is kept off in all layers"
    )
    drift_m: NonNegative = Field(default=0.6, description="how far off at most a silent peer is taken to have moved")
