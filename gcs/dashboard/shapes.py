"""Shapes of the map in bokeh's terms: x is east, y is north, angles run counter-clockwise from east."""

from __future__ import annotations

import math
from collections.abc import Sequence

from onboard.geometry import Pose
from onboard.messages import PeerPlan
from onboard.planning.primitives import Primitive, advance

__all__ = ["CHI2_95", "axis_angle", "ellipse_95", "planned_path"]

CHI2_95 = -2.0 * math.log(0.05)
"""95 % quantile of χ² with two degrees of freedom: a squared Mahalanobis radius."""

_STOP = Primitive(0.0, 0.0)
_POINTS_PER_STEP = 4


def axis_angle(yaw_rad: float) -> float:
    """A heading, clockwise from north, as an angle counter-clockwise from east, rad."""
    return 0.5 * math.pi - yaw_rad


def ellipse_95(covariance_m2: tuple[float, float, float]) -> tuple[float, float, float] | None:
    """The ellipse that holds the position with 95 % probability.

    Its semi-axes are ``√(χ² λ)`` along the covariance's eigenvectors.

    Args:
        covariance_m2: North-north, north-east, east-east, m².

    Returns:
        Length of the major axis, m; of the minor axis, m; angle of the major axis, rad. None for what is no covariance.
    """
    north, cross, east = covariance_m2
    mean, half = 0.5 * (east + north), 0.5 * (east - north)
    radius = math.hypot(half, cross)
    smallest = mean - radius
    if not (math.isfinite(mean + radius) and mean > 0.0 and smallest > -1e-9 * mean):
        return None
    major, minor = (2.0 * math.sqrt(CHI2_95 * value) for value in (mean + radius, max(smallest, 0.0)))
    return major, minor, 0.5 * math.atan2(2.0 * cross, 2.0 * half)


def planned_path(plan: PeerPlan, primitives: Sequence[Primitive], step_s: float) -> tuple[list[float], list[float]]:
    """East m and north m along a plan, from its start to its end: eq. (12) of the paper, four points a step."""
    pose = plan.start
    easts, norths = [pose.east_m], [pose.north_m]
    for control in plan.controls:
        primitive = primitives[control] if control >= 0 else _STOP
        for i in range(1, _POINTS_PER_STEP + 1):
            point: Pose = advance(pose, primitive, step_s * i / _POINTS_PER_STEP)
            easts.append(round(point.east_m, 3))
            norths.append(round(point.north_m, 3))
        pose = advance(pose, primitive, step_s)
    return easts, norths
