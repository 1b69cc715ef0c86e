"""The sections of a scenario that say how the team senses, estimates, explores and plans."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field, model_validator

from onboard.config.base import NonNegative, Positive, Section
from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion

__all__ = ["EstimationConfig", "ExplorationConfig", "PlannerConfig", "SensorConfig", "TargetsConfig"]


class SensorConfig(Section):
    """The range-bearing sensor of every vehicle."""

    range_std_m: Positive
    bearing_std_deg: Positive
    max_range_m: Positive
    fov_deg: Annotated[float, Field(gt=0.0, le=360.0)] = 360.0
    noise_floor: Annotated[float, Field(gt=0.0, le=1.0)] = 0.1
    min_range_m: Positive = 0.1
    position_std_m: NonNegative = Field(
        default=0.01, description="of the vehicle's own position per axis; 0 if it is known exactly"
    )
    yaw_std_deg: Annotated[float, Field(ge=0.0, le=180.0)] = Field(default=0.0, description="of the vehicle's own yaw")

    def build(self) -> RangeBearingSensor:
        """The sensor model, with angles in radians."""
        return RangeBearingSensor(
            range_std_m=self.range_std_m,
            bearing_std_rad=math.radians(self.bearing_std_deg),
            max_range_m=self.max_range_m,
            fov_rad=math.radians(self.fov_deg),
            noise_floor=self.noise_floor,
            min_range_m=self.min_range_m,
            position_std_m=self.position_std_m,
            yaw_std_rad=math.radians(self.yaw_std_deg),
        )


class TargetsConfig(Section):
    """What is assumed of the targets."""

    model: Literal["double_integrator", "random_walk", "static"]
    noise: NonNegative = Field(description="q: m²/s³ for a double integrator, m²/s for a random walk")
    initial_speed_std_m_s: Positive = 1.0

    def build(self) -> TargetMotion:
        """The motion model."""
        return TargetMotion(TargetModel(self.model), self.noise)


class EstimationConfig(Section):
    """The distributed filter."""

    max_message_age_steps: Annotated[int, Field(ge=0, le=100)] = 4
    neighbour_timeout_s: Positive = 1.5


class ExplorationConfig(Section):
    """The visibility grid and its landmarks."""

    cell_m: Annotated[float, Field(ge=0.01, le=65.0)] = 0.25
    forget_after_s: Annotated[float, Field(gt=0.0, lt=6553.5)] | None = Field(
        default=None, description="what nobody has looked at for so long is unknown again; null never forgets"
    )
    max_landmarks: Annotated[int, Field(ge=0, le=64)] = 6
    landmark_sigma_m: Positive = 1.0
    landmark_patience_s: Positive = Field(default=60.0, description="after which an unseen landmark gives up its place")


class PlannerConfig(Section):
    """The search."""

    use: Annotated[str, Field(min_length=1, max_length=200)] = Field(
        default="arvi", description="a planner that comes with the project, or package.module:Class"
    )
    options: dict[str, bool | int | float | str] = Field(default_factory=dict, description="for that planner")
    node_limit: Annotated[int, Field(ge=1000, le=50_000_000)] = Field(default=1_000_000, description="memory bound")
    yaw_weight_m_rad: Positive = 1.0

    @model_validator(mode="before")
    @classmethod
    def _name_alone(cls, given: object) -> object:
        """``planner: greedy`` says the same as ``planner: {use: greedy}``."""
        return {"use": given} if isinstance(given, str) else given
