"""What every configuration section shares: strict types, no unknown keys, finite numbers, frozen values."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["NonNegative", "Positive", "Probability", "Section", "SystemId"]

Positive = Annotated[float, Field(gt=0.0)]
NonNegative = Annotated[float, Field(ge=0.0)]
Probability = Annotated[float, Field(ge=0.0, le=1.0)]
SystemId = Annotated[int, Field(ge=1, le=255)]


class Section(BaseModel):
    """A mapping of the configuration file."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, allow_inf_nan=False)
