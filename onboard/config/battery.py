"""The section ``flight.battery``: at which charge something is said and done."""

from __future__ import annotations

from typing import Annotated, Self

from pydantic import Field, model_validator

from onboard.config.base import Section

__all__ = ["BatteryConfig"]

Charge = Annotated[float, Field(ge=0.0, lt=1.0)]


class BatteryConfig(Section):
    """Charge left, 0 to 1, as the autopilot tells it; 0 switches a level off unless the battery is flat."""

    low: Charge = Field(default=0.2, description="the operator is told")
    critical: Charge = Field(default=0.1, description="the vehicle goes home; it does not start")
    empty: Charge = Field(default=0.05, description="the vehicle lands where it is")

    @model_validator(mode="after")
    def _in_order(self) -> Self:
        if not self.low >= self.critical >= self.empty:
            raise ValueError(
                f"low: {self.low:g}, critical: {self.critical:g}, empty: {self.empty:g}; none is above the one before"
            )
        return self
