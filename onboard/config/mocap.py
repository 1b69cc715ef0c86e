"""The section ``mocap``: a real motion capture system, and how its axes and units become the mission frame's."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field, field_validator

from onboard.config.base import NonNegative, Positive, Section
from onboard.config.patterns import ProviderName

__all__ = ["AXES", "Axes", "RealMocapConfig"]

Axis = Literal["x", "-x", "y", "-y", "z", "-z"]
Axes = tuple[Axis, Axis, Axis]

AXES = {"x": (1, 0, 0), "y": (0, 1, 0), "z": (0, 0, 1), "-x": (-1, 0, 0), "-y": (0, -1, 0), "-z": (0, 0, -1)}
"""The direction of each axis in the frame that names it."""


class RealMocapConfig(Section):
    """A motion capture system that is read with the library motioncapture, on the machine of the bridge."""

    provider: ProviderName = Field(
        description="as the library names it: vicon, optitrack, qualisys, vrpn or another that it was built with"
    )
    host: Annotated[str, Field(min_length=1, max_length=253)] = "localhost"
    options: dict[str, str | int | float | bool] = Field(
        default_factory=dict, description="what else the library takes for this provider, e.g. interface_ip"
    )
    bodies: dict[Annotated[str, Field(min_length=1, max_length=100)], Annotated[int, Field(ge=1, le=200)]] = Field(
        min_length=1, description="which vehicle (system id) each rigid body is, by its name in the system"
    )
    unit: Literal["m", "mm"] = "m"
    axes: Axes = Field(default=("x", "-y", "-z"), description="the system's axes that point north, east and down")
    body_axes: Axes = Field(
        default=("x", "-y", "-z"), description="a rigid body's axes that point forward, right and down"
    )
    yaw_deg: float = Field(default=0.0, description="from the mission's north to the axis called north, clockwise")
    origin_m: tuple[float, float, float] = Field(
        default=(0.0, 0.0, 0.0), description="[north, east, down] of the system's origin in the mission frame"
    )
    rate_hz: Annotated[float, Field(ge=1.0, le=1000.0)] = Field(default=100.0, description="what it should deliver")
    send_rate_hz: Annotated[float, Field(ge=1.0, le=200.0)] = Field(
        default=50.0, description="at most this often a pose goes on to an autopilot"
    )
    latency_s: Annotated[float, Field(ge=0.0, le=0.5)] = Field(
        default=0.01, description="from the cameras' exposure to the arrival here"
    )
    position_std_m: Positive = 0.002
    yaw_std_deg: Positive = 0.5
    jump_m: NonNegative = Field(default=0.3, description="a step from one frame to the next that no vehicle can fly")

    @field_validator("axes", "body_axes")
    @classmethod
    def _axes_are_right_handed(cls, axes: Axes) -> Axes:
        determinant = round(float(np.linalg.det(np.array([AXES[axis] for axis in axes], dtype=float))))
        if determinant != 1:
            problem = "are a left-handed frame" if determinant == -1 else "name an axis twice"
            raise ValueError(f"{list(axes)} {problem}; z up is [x, -y, -z], y up is [x, z, -y]")
        return axes

    @field_validator("bodies")
    @classmethod
    def _one_body_each(cls, bodies: dict[str, int]) -> dict[str, int]:
        for vehicle_id in bodies.values():
            names = [name for name, owner in bodies.items() if owner == vehicle_id]
            if len(names) > 1:
                raise ValueError(f"{' and '.join(names)} are both vehicle {vehicle_id}; every vehicle has one body")
        return bodies
