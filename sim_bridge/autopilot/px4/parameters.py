"""PX4's parameters (https://docs.px4.io/main/en/advanced_config/parameter_reference.html).

Names, types and values are those of a PX4 1.15 in software-in-the-loop. Ground stations ask for many of them; the
simulated vehicle acts on few: arming and failsafe delays, takeoff and landing speeds, gains and limits, the estimator's
sources.
"""

from __future__ import annotations

import functools
import json
import math
import struct
import zlib
from collections.abc import Mapping
from importlib import resources

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.parameter_service import ParameterRhythm
from sim_bridge.autopilot.core.parameters import NO_INDEX, ParameterStore, as_float

__all__ = ["HASH_CHECK", "INDOOR_PARAMETERS", "RHYTHM", "hash_check", "load_parameters"]

HASH_CHECK = "_HASH_CHECK"
"""Not a parameter: its value is a hash over all of them, so that a ground station may reuse its copy."""

INDOOR_PARAMETERS: Mapping[str, int | float] = {
    "SYS_HAS_GPS": 0,
    "SENS_EN_GPSSIM": 0,
    "EKF2_GPS_CTRL": 0,
    "EKF2_EV_CTRL": 11,
    "EKF2_HGT_REF": 3,
    "EKF2_MAG_TYPE": 5,
    "EKF2_BARO_CTRL": 1,  # as configs/px4: else it does not come down when motion capture falls silent
    "EKF2_RNG_CTRL": 0,
    "EKF2_ACC_NOISE": 1.0,
}
"""Position, height and heading from motion capture, the barometer for when it is silent.

15 for ``EKF2_EV_CTRL`` also fuses its velocity.
"""

RHYTHM = ParameterRhythm(period_us=10_000, batch=10, reads_wait=False, index_in_answers=True)
"""Reads are answered at once; the list of 898 takes 0.9 s."""


def load_parameters(overrides: Mapping[str, int | float]) -> ParameterStore:
    """PX4's parameters with some values changed.

    Raises:
        ParameterError: One that PX4 does not have, or a fraction for an integer.
    """
    values = _defaults()
    types = {
        name: mavlink.MAV_PARAM_TYPE_INT32 if isinstance(value, int) else mavlink.MAV_PARAM_TYPE_REAL32
        for name, value in values.items()
    }
    return ParameterStore("PX4", values, types, bytewise=True, overrides=overrides)


def hash_check(parameters: ParameterStore) -> mavlink.MAVLink_param_value_message:
    """PARAM_VALUE of the hash over all parameters."""
    digest = 0
    for name in parameters:
        value = parameters[name]
        digest = zlib.crc32(name.encode(), digest)
        digest = zlib.crc32(struct.pack("<i" if isinstance(value, int) else "<f", value), digest)
    # A pattern that is a signalling NaN would not survive a float: such hashes give up one bit.
    if not math.isfinite(as_float("<I", digest)):
        digest &= ~0x0080_0000
    return mavlink.MAVLink_param_value_message(
        HASH_CHECK.encode(), as_float("<I", digest), mavlink.MAV_PARAM_TYPE_UINT32, len(parameters), NO_INDEX
    )


@functools.cache
def _defaults() -> Mapping[str, int | float]:
    text = resources.files(__package__).joinpath("data", "px4_parameters.json").read_text(encoding="utf-8")
    values: dict[str, int | float] = json.loads(text)
    return values
