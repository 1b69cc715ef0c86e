"""Vehicles that the bridge does not simulate: other simulators fly them, or they are real."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BeforeValidator, Field

from onboard.config.base import Section
from onboard.config.patterns import LinkUrl

__all__ = ["External", "ExternalConfig", "PoseSource"]

PoseSource = Literal["truth", "estimate", "mocap"]


class ExternalConfig(Section):
    """How the bridge meets the autopilot of a vehicle that it does not simulate."""

    link: LinkUrl | None = Field(
        default=None,
        description="the bridge's own link to the autopilot, beside the onboard process's; null takes the one that "
        "docs/simulators.md starts the autopilot with",
    )
    pose: PoseSource = Field(
        default="truth",
        description="where the bridge knows the pose from: its simulator's truth, the autopilot's own estimate, or "
        "the real motion capture of the section mocap",
    )


def _from_switch(given: object) -> object:
    """``external: true`` says the same as ``external: {}``."""
    if given is True:
        return {}
    return None if given is False else given


External = Annotated[ExternalConfig | None, BeforeValidator(_from_switch)]
