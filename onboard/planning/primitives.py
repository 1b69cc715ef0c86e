"""Motion primitives: a speed and a yaw rate held for one step (paper, eq. 12)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from onboard.geometry import Pose, wrap_angle

__all__ = ["Primitive", "advance", "sinc"]


def sinc(z: float) -> float:
    """``sin(z)/z``, 1 at 0."""
    return math.sin(z) / z if abs(z) > 1e-9 else 1.0


@dataclass(frozen=True, slots=True)
class Primitive:
    """One control ``(ν, ω)``.

    Attributes:
        speed_m_s: Forward speed ν, m/s; 0 turns on the spot or hovers.
        yaw_rate_rad_s: Yaw rate ω about down, rad/s, positive clockwise seen from above.
    """

    speed_m_s: float
    yaw_rate_rad_s: float


def advance(pose: Pose, primitive: Primitive, duration_s: float) -> Pose:
    """The pose after holding a primitive for some time: eq. (12), exact for any duration.

    The displacement is the chord of the arc, ``duration·ν·sinc(ω·duration/2)`` along ``θ + ω·duration/2``. The paper's
    print forgets the duration in it.
    """
    half_turn = 0.5 * primitive.yaw_rate_rad_s * duration_s
    chord = duration_s * primitive.speed_m_s * sinc(half_turn)
    return Pose(
        pose.north_m + chord * math.cos(pose.yaw_rad + half_turn),
        pose.east_m + chord * math.sin(pose.yaw_rad + half_turn),
        wrap_angle(pose.yaw_rad + 2.0 * half_turn),
    )
