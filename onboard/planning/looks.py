"""What one look tells about a position: the information matrix of eq. (13)–(15), compiled.

``M = a·u uᵀ + b·t tᵀ``, u the line of sight, t its normal, ``a = 1/(V_r + σ_p²)``, ``b = 1/(r²·V_α + σ_p²)`` with the
uncertainty σ_p of the robot's own place, and its yaw's in V_α. It is linear in the two numbers a and b, and with
constant noise neither needs an angle nor a square root.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from onboard.estimation.sensor import RangeBearingSensor
from onboard.planning.jit import inlined_kernel

__all__ = ["PackedSensor", "is_seen", "look_weights", "pack_sensor"]


class PackedSensor(NamedTuple):
    """A :class:`RangeBearingSensor` as the kernels want it; attributes in m, m², rad."""

    max_range_m: float
    max_range_squared: float
    min_range_squared: float
    all_round: bool
    signed_cosine_squared: float
    half_fov_rad: float
    range_variance: float
    bearing_variance: float
    noise_floor: float
    position_variance: float
    yaw_variance: float


def pack_sensor(sensor: RangeBearingSensor) -> PackedSensor:
    """The sensor as the kernels want it."""
    cosine = math.cos(min(0.5 * sensor.fov_rad, math.pi))
    return PackedSensor(
        max_range_m=float(sensor.max_range_m),
        max_range_squared=float(sensor.max_range_m) ** 2,
        min_range_squared=float(sensor.min_range_m) ** 2,
        all_round=bool(sensor.sees_all_round),
        signed_cosine_squared=cosine * abs(cosine),
        half_fov_rad=0.5 * float(sensor.fov_rad),
        range_variance=float(sensor.range_std_m) ** 2,
        bearing_variance=float(sensor.bearing_std_rad) ** 2,
        noise_floor=float(sensor.noise_floor),
        position_variance=float(sensor.position_std_m) ** 2,
        yaw_variance=float(sensor.yaw_std_rad) ** 2,
    )


@inlined_kernel
def is_seen(sensor: PackedSensor, north: float, east: float, cosine: float, sine: float) -> bool:
    """Whether a point is seen: ``r < r_sense`` and ``|α| < φ/2``, without an angle.

    ``cos α > cos(φ/2)`` is compared as signed squares, ``c·|c|`` being monotone.

    Args:
        sensor: The sensor.
        north: Of the point, relative to the robot, m.
        east: Of the point, relative to the robot, m.
        cosine: Of the robot's yaw.
        sine: Of the robot's yaw.
    """
    squared = north * north + east * east
    if squared >= sensor.max_range_squared:
        return False
    if sensor.all_round or squared == 0.0:
        return True
    ahead = north * cosine + east * sine
    return ahead * abs(ahead) > sensor.signed_cosine_squared * squared


@inlined_kernel
def look_weights(
    sensor: PackedSensor, north: float, east: float, cosine: float, sine: float
) -> tuple[float, float, float, float]:
    """The parts of M for a point that is seen; arguments as in :func:`is_seen`.

    Returns:
        ``a/r²`` and ``b/r²`` with the line of sight not normalised (m⁻⁴), and that line's north and east (m):
        ``M = [a n² + b e², (a−b) n e; ·, a e² + b n²]``.
    """
    squared = north * north + east * east
    if squared == 0.0:  # exactly below: the line of sight is taken along the yaw
        north, east, unit = cosine, sine, 1.0
    else:
        unit = 1.0 / squared
    range_variance, bearing_variance = sensor.range_variance, sensor.bearing_variance
    if sensor.noise_floor < 1.0:
        grows = 1.0 - sensor.noise_floor
        range_variance *= sensor.noise_floor + grows * math.sqrt(squared) / sensor.max_range_m
        bearing = abs(math.atan2(east * cosine - north * sine, north * cosine + east * sine)) if squared > 0.0 else 0.0
        bearing_variance *= sensor.noise_floor + grows * min(bearing / sensor.half_fov_rad, 1.0)
    across_variance = max(squared, sensor.min_range_squared) * (bearing_variance + sensor.yaw_variance)
    along = unit / (range_variance + sensor.position_variance)
    return along, unit / (across_variance + sensor.position_variance), north, east
