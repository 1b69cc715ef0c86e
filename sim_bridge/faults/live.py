"""Faults by command: MAV_CMD_INJECT_FAILURE (https://mavlink.io/en/messages/common.html#MAV_CMD_INJECT_FAILURE).

Its first three parameters are MAVLink's: unit, type, and instance, which here is a vehicle's system id or 0 for all.
The fourth is how long it lasts in seconds (0: until FAILURE_TYPE_OK), the fifth how bad it is: the first of the
fault's parameters (0: its default).
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from types import MappingProxyType

from pydantic import ValidationError

from onboard.config.faults import VOCABULARY, Component, FaultConfig, FaultType
from onboard.protocol import dialect as mavlink
from sim_bridge.faults.schedule import FaultSchedule

__all__ = ["TYPES", "UNITS", "LiveFaults"]

UNITS: Mapping[int, Component] = MappingProxyType(
    {
        mavlink.FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL: Component.RADIO,
        mavlink.FAILURE_UNIT_SENSOR_VIO: Component.MOCAP,
        mavlink.FAILURE_UNIT_SENSOR_DISTANCE_SENSOR: Component.DETECTOR,
        mavlink.FAILURE_UNIT_SYSTEM_BATTERY: Component.BATTERY,
        mavlink.FAILURE_UNIT_ARVI_AUTOPILOT: Component.AUTOPILOT,
        mavlink.FAILURE_UNIT_ARVI_AUTOPILOT_LINK: Component.AUTOPILOT_LINK,
    }
)
"""FAILURE_UNIT of each component that can be made to fail by command."""

TYPES: Mapping[int, FaultType] = MappingProxyType(
    {
        mavlink.FAILURE_TYPE_OFF: FaultType.OFF,
        mavlink.FAILURE_TYPE_STUCK: FaultType.STUCK,
        mavlink.FAILURE_TYPE_GARBAGE: FaultType.GARBAGE,
        mavlink.FAILURE_TYPE_WRONG: FaultType.WRONG,
        mavlink.FAILURE_TYPE_SLOW: FaultType.SLOW,
        mavlink.FAILURE_TYPE_DELAYED: FaultType.DELAYED,
        mavlink.FAILURE_TYPE_INTERMITTENT: FaultType.INTERMITTENT,
    }
)
"""FAILURE_TYPE of each kind; FAILURE_TYPE_OK ends all faults of a component."""


class LiveFaults:
    """Obeys, or denies, commands that inject faults.

    Args:
        faults: Where they are injected.
        vehicles: System ids that there are.
        allowed: Whether the scenario allows them.
    """

    def __init__(self, faults: FaultSchedule, vehicles: Collection[int], *, allowed: bool) -> None:
        self._faults = faults
        self._vehicles = frozenset(vehicles)
        self._allowed = allowed

    def obey(self, message: mavlink.MAVLink_command_long_message, time_s: float) -> tuple[int, str]:
        """Do what a MAV_CMD_INJECT_FAILURE asks for.

        Returns:
            MAV_RESULT, and why it is not ACCEPTED, for the operator.
        """
        try:
            self._obey(message, time_s)
        except _RefusedError as refusal:
            return refusal.result, f"fault refused: {refusal}"
        return mavlink.MAV_RESULT_ACCEPTED, ""

    def _obey(self, message: mavlink.MAVLink_command_long_message, time_s: float) -> None:
        if not self._allowed:
            raise _RefusedError("the scenario has no simulation.allow_live_faults: true")
        unit, kind, vehicle = (_whole(number) for number in (message.param1, message.param2, message.param3))
        component = UNITS.get(unit)
        if component is None:
            known = ", ".join(f"{number} ({name})" for number, name in UNITS.items())
            raise _RefusedError(f"unit {unit} is none of {known}", mavlink.MAV_RESULT_UNSUPPORTED)
        if vehicle and vehicle not in self._vehicles:
            raise _RefusedError(f"there is no vehicle {vehicle}")
        vehicles = (vehicle,) if vehicle else ()
        if kind == mavlink.FAILURE_TYPE_OK:
            self._faults.clear(component, vehicles, time_s)
            return
        length_s, magnitude = (number if math.isfinite(number) else 0.0 for number in (message.param4, message.param5))
        self._faults.inject(_fault(component, kind, vehicles, length_s, magnitude), time_s)


class _RefusedError(Exception):
    def __init__(self, reason: str, result: int = mavlink.MAV_RESULT_DENIED) -> None:
        super().__init__(reason)
        self.result = result


def _whole(number: float) -> int:
    if not math.isfinite(number):
        raise _RefusedError("unit, type and instance should be numbers")
    return round(number)


def _fault(
    component: Component, kind: int, vehicles: tuple[int, ...], length_s: float, magnitude: float
) -> FaultConfig:
    fault_type = TYPES.get(kind)
    effect = VOCABULARY.get((component, fault_type)) if fault_type is not None else None
    if fault_type is None or effect is None:
        raise _RefusedError(f"{component} has no type {kind}", mavlink.MAV_RESULT_UNSUPPORTED)
    try:
        return FaultConfig(
            component=component,
            type=fault_type,
            vehicles=vehicles,
            from_s=0.0,
            until_s=length_s or None,
            parameters={next(iter(effect.parameters)): magnitude} if magnitude and effect.parameters else {},
        )
    except ValidationError as error:
        raise _RefusedError(error.errors()[0]["msg"].removeprefix("Value error, ")) from None
