"""ArduPilot's parameters (https://ardupilot.org/copter/docs/parameters.html).

Names, types and values are those of a Copter 4.7-dev in software-in-the-loop. The simulated vehicle acts on few: delays
and failsafes, speeds, accelerations, jerk and gains, the estimator's sources.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Mapping
from importlib import resources

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.parameter_service import ParameterRhythm
from sim_bridge.autopilot.core.parameters import ParameterStore

__all__ = ["EXTERNAL_NAV", "INDOOR_PARAMETERS", "RHYTHM", "load_parameters"]

EXTERNAL_NAV = 6
"""Value of EK3_SRC1_POSXY and its kin: motion capture."""

INDOOR_PARAMETERS: Mapping[str, int | float] = {
    "VISO_TYPE": 1,
    "GPS1_TYPE": 0,
    "EK3_SRC1_POSXY": EXTERNAL_NAV,
    "EK3_SRC1_POSZ": EXTERNAL_NAV,
    "EK3_SRC1_YAW": EXTERNAL_NAV,
    "EK3_SRC1_VELXY": 0,
    "EK3_SRC1_VELZ": 0,
    "COMPASS_ENABLE": 0,
}
"""Position, height and heading from motion capture alone; 6 for the two velocities fuses its velocity, too."""

RHYTHM = ParameterRhythm(period_us=100_000, batch=221, reads_wait=True, index_in_answers=False)
"""Ten times a second: a read takes up to 0.1 s, the list of 1349 takes 0.7 s. Sets are echoed at once."""

_WITH_VISION = {"VISO_DELAY_MS": 10}
"""Parameters that exist only where VISO_TYPE was not 0 at the start, with their defaults; all INT16."""


def load_parameters(overrides: Mapping[str, int | float]) -> ParameterStore:
    """ArduPilot's parameters with some values changed.

    Raises:
        ParameterError: One that ArduPilot does not have, or a fraction for an integer.
    """
    values, types = _defaults()
    if overrides.get("VISO_TYPE", 0) != 0:
        values = {**values, **_WITH_VISION}
        types = {**types, **dict.fromkeys(_WITH_VISION, mavlink.MAV_PARAM_TYPE_INT16)}
    return ParameterStore("ArduPilot", values, types, bytewise=False, overrides=overrides)


@functools.cache
def _defaults() -> tuple[dict[str, int | float], dict[str, int]]:
    """Values and MAV_PARAM_TYPEs; the file holds one digit for each type, in the order of the values."""
    text = resources.files(__package__).joinpath("data", "ardupilot_parameters.json").read_text(encoding="utf-8")
    data = json.loads(text)
    values: dict[str, int | float] = {}
    types: dict[str, int] = {}
    for (name, value), digit in zip(data["values"].items(), data["types"], strict=True):
        types[name] = int(digit)
        values[name] = float(value) if types[name] == mavlink.MAV_PARAM_TYPE_REAL32 else value
    return values, types
