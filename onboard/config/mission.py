"""The section ``mission``: the clockwork and the area it plays in."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from onboard.config.base import NonNegative, Positive, Section
from onboard.config.polygon import is_simple, overlap
from onboard.config.simulation import OriginConfig

__all__ = ["MissionConfig", "Polygon"]


Polygon = Annotated[tuple[tuple[float, float], ...], Field(max_length=256)]
"""Corners [north m, east m]."""


class MissionConfig(Section):
    """The clockwork of Algorithm 3 and the area it plays in."""

    step_s: Positive = Field(default=0.5, description="τ")
    horizon: Annotated[int, Field(ge=1, le=64)] = Field(default=12, description="T, steps")
    replan_steps: Annotated[int, Field(ge=1, le=64)] = Field(
        default=2, description="n: steps from one epoch to the next"
    )
    planning_time_s: Positive = Field(default=0.5, description="T_ARVI of the whole group")
    planning_lead_s: NonNegative = Field(default=0.03, description="from the last planning slot to the epoch's start")
    publishing_time_s: NonNegative = Field(default=0.03, description="kept of each slot for publishing the plan")
    measuring_delay_s: NonNegative = Field(default=0.08, description="from a step to its update: detections travel")
    takeoff_time_s: Positive = Field(default=12.0, description="from the start command to step 0, to reach the layers")
    position_source: Literal["mocap", "gps"] = Field(
        default="mocap",
        description="mocap: the autopilots' local frames are the mission frame; gps: each is related to origin",
    )
    origin: OriginConfig = Field(default=OriginConfig(), description="of the mission frame on Earth")
    fence: Polygon = Field(description="corners [north m, east m] of the mission area")
    obstacles: tuple[Polygon, ...] = Field(
        default=(),
        max_length=200,
        description="polygons as tall as anything flies; they hide what is behind them, and nobody flies into them",
    )
    obstacle_clearance_m: NonNegative = Field(default=0.3, description="kept from obstacles by plans")
    separation_m: NonNegative = Field(
        default=0.8, description="horizontal distance on one layer; layers closer are one"
    )
    layer_separation_m: NonNegative = Field(default=0.6, description="height difference from which layers are apart")

    @field_validator("fence")
    @classmethod
    def _fence_is_a_polygon(cls, fence: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
        if not is_simple(fence):
            raise ValueError("a fence has at least three different corners and does not cross itself")
        return fence

    @model_validator(mode="after")
    def _obstacles_are_in_the_way(self) -> Self:
        for index, obstacle in enumerate(self.obstacles):
            if not is_simple(obstacle):
                raise ValueError(
                    f"obstacles[{index}]: an obstacle has at least three different corners and does not cross itself"
                )
            if not overlap(self.fence, obstacle):
                raise ValueError(f"obstacles[{index}]: lies outside the fence; corners are [north m, east m]")
        return self

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.replan_steps > self.horizon:
            raise ValueError(f"replan_steps: {self.replan_steps} is beyond the horizon of {self.horizon} steps")
        if self.planning_time_s + self.planning_lead_s > self.epoch_s:
            raise ValueError(
                f"planning_time_s: {self.planning_time_s:g} and planning_lead_s = {self.planning_lead_s:g} do not fit "
                f"between epochs, replan_steps x step_s = {self.epoch_s:g} s"
            )
        return self

    @property
    def epoch_s(self) -> float:
        """Time from one replanning to the next, s."""
        return self.replan_steps * self.step_s
