"""A simulated autopilot's faults: its link to the onboard computer, its refusals, its battery, and reboots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from onboard.config.faults import Component, FaultType
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.links import ONBOARD, LinkName
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.faults.stream import FaultyStream, Way
from sim_bridge.models import AutopilotModel, SetpointStatistics

__all__ = ["FaultyAutopilot"]

Spoken = tuple[LinkName, mavlink.MAVLink_message]

_SET_MODE = frozenset(
    {
        mavlink.MAV_CMD_DO_SET_MODE,
        mavlink.MAV_CMD_NAV_LAND,
        mavlink.MAV_CMD_NAV_TAKEOFF,
        mavlink.MAV_CMD_NAV_RETURN_TO_LAUNCH,
    }
)


class FaultyAutopilot:
    """An autopilot as the bridge knows it, with what goes wrong with it.

    Args:
        vehicle_id: Whose.
        boot: Switches the autopilot on at a UNIX time, s; its vehicle stays where and as fast as it is.
        faults: What is wrong when.
        rng: Decides what happens by chance.
        time_s: UNIX time at which it is switched on first, s.

    Raises:
        ParameterError: From ``boot``.
    """

    def __init__(
        self,
        vehicle_id: int,
        boot: Callable[[float], AutopilotModel],
        faults: FaultSchedule,
        rng: np.random.Generator,
        time_s: float,
    ) -> None:
        self._vehicle_id = vehicle_id
        self._boot = boot
        self._faults = faults
        self._autopilot = boot(time_s)
        self._heard = _Link(vehicle_id, faults, rng)
        self._said = _Link(vehicle_id, faults, rng)
        self._answers: list[Spoken] = []
        self._done: set[Fault] = set()
        self._time_s = time_s

    @property
    def statistics(self) -> SetpointStatistics:
        """Setpoint accounting since the last boot."""
        return self._autopilot.statistics

    def receive(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        """Take a message from one of its links."""
        if link != ONBOARD:
            self._obey(message, link, time_s)
            return
        self._heard.push((link, message), time_s)
        self._listen(time_s)

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture."""
        self._autopilot.receive_mocap(message)

    def drain_battery(self, remaining: float) -> None:
        """Leave so much charge, 0 to 1, in its battery."""
        self._autopilot.drain_battery(remaining)

    def step(self, time_s: float, dt_s: float) -> None:
        """Move on by ``dt_s`` to ``time_s``."""
        self._time_s = time_s
        for fault in self._begun(Component.AUTOPILOT, time_s):
            if fault.config.type is FaultType.OFF:
                self._autopilot = self._boot(time_s)
        for fault in self._begun(Component.BATTERY, time_s):
            self._autopilot.drain_battery(fault.value("remaining"))
        self._listen(time_s)
        self._autopilot.step(time_s, dt_s)

    def outbox(self) -> list[Spoken]:
        """Take out the messages to send, each with its link."""
        said, self._answers = [*self._answers, *self._autopilot.outbox()], []
        if not self._faults.active(Component.AUTOPILOT_LINK, self._time_s) and self._said.next_due_s is None:
            return said
        for spoken in said:
            if spoken[0] == ONBOARD:
                self._said.push(spoken, self._time_s)
        return [spoken for spoken in said if spoken[0] != ONBOARD] + self._said.pop_due(self._time_s)

    def _begun(self, component: Component, time_s: float) -> list[Fault]:
        """Faults that have begun since the last step."""
        begun = [fault for fault in self._faults.active(component, time_s, self._vehicle_id) if fault not in self._done]
        self._done.update(begun)
        return begun

    def _listen(self, time_s: float) -> None:
        for link, message in self._heard.pop_due(time_s):
            self._obey(message, link, time_s)

    def _obey(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        refused = self._refused_command(message, link, time_s)
        if refused is None:
            self._autopilot.receive(message, link, time_s)
            return
        system, component = message.get_srcSystem(), message.get_srcComponent()
        result = mavlink.MAV_RESULT_TEMPORARILY_REJECTED
        self._answers.append((link, mavlink.MAVLink_command_ack_message(refused, result, 0, 0, system, component)))

    def _refused_command(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> int | None:
        """The MAV_CMD that a fault makes it refuse."""
        faults = self._faults.active(Component.AUTOPILOT, time_s, self._vehicle_id)
        kinds = {fault.config.type for fault in faults}
        if not kinds or not isinstance(
            message, (mavlink.MAVLink_command_long_message, mavlink.MAVLink_command_int_message)
        ):
            return None
        command: int = message.command
        arms = command == mavlink.MAV_CMD_COMPONENT_ARM_DISARM and message.param1 == 1.0
        refuses_mode = FaultType.STUCK in kinds and link == ONBOARD and command in _SET_MODE
        return command if refuses_mode or (FaultType.WRONG in kinds and arms) else None


class _Link(FaultyStream[Spoken]):
    def __init__(self, vehicle_id: int, faults: FaultSchedule, rng: np.random.Generator) -> None:
        super().__init__(Component.AUTOPILOT_LINK, faults, rng)
        self._vehicle_id = vehicle_id

    def _concerns(self, fault: Fault, item: Spoken) -> bool:
        return fault.concerns(self._vehicle_id)

    def _alter(self, fault: Fault, item: Spoken, due_s: float) -> Way[Spoken]:
        raise AssertionError(fault.config.type)
