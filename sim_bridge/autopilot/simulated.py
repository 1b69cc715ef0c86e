"""A vehicle with a simulated autopilot on it, without sockets or clocks: messages and time go in, messages come out.

Which firmware it behaves like is a choice; both keep the parameters over a reboot, and a crashed one stays silent.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping

import numpy as np

from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.behaviour import Behaviour, Halt
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.setpoint import SetpointStatistics
from sim_bridge.autopilot.firmwares import FIRMWARES, Firmware
from sim_bridge.autopilot.links import LinkName
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["SimulatedAutopilot"]

_MOTORS_OFF = VelocityCommand()

_log = logging.getLogger(__name__)


class SimulatedAutopilot:
    """One vehicle's autopilot.

    Args:
        system_id: MAVLink system id.
        vehicle: What it flies; advanced by :meth:`step`.
        firmware: Whose behaviour it shows.
        origin: Where the mission frame is on Earth: what GPS tells; a PX4 knows it without GPS, too. None leaves it
            to SET_GPS_GLOBAL_ORIGIN.
        parameters: The firmware's parameters that differ from their defaults. The indoor parameters leave motion
            capture as the only position source.
        rng: Source of the sensors' errors.
        boot_time_s: When it was switched on, s; a time in the past has it booted and aligned at the first step.
        alignment_s: From the boot until tilt and heading are known, s; in software-in-the-loop a PX4 takes 30 to 36,
            an ArduPilot 6.

    Attributes:
        system_id: MAVLink system id.
        vehicle: The truth.
        parameters: The firmware's parameters.
        statistics: Setpoints received while they were flown.
        crashed: Whether the firmware has crashed.

    Raises:
        ParameterError: The firmware has no such parameter.
    """

    def __init__(
        self,
        system_id: int,
        vehicle: Vehicle,
        *,
        origin: OriginConfig | None,
        parameters: Mapping[str, int | float],
        rng: np.random.Generator,
        boot_time_s: float,
        alignment_s: float = 3.0,
        firmware: Firmware = "px4",
    ) -> None:
        self.system_id = system_id
        self.vehicle = vehicle
        self.statistics = SetpointStatistics()
        self.crashed = False
        kind = FIRMWARES[firmware]
        self.parameters = kind.load_parameters({kind.system_id_parameter: system_id, **parameters})
        self._boot: Callable[[float], Behaviour] = lambda time_s: kind.boot(
            system_id,
            vehicle,
            origin=origin,
            parameters=self.parameters,
            rng=rng,
            boot_s=time_s,
            alignment_s=alignment_s,
            statistics=self.statistics,
        )
        self._behaviour = self._boot(boot_time_s)
        self._restart_s: float | None = None

    @property
    def platform(self) -> Platform:
        """Its state: estimate, battery, home, origin."""
        return self._behaviour.platform

    @property
    def behaviour(self) -> Behaviour:
        """The run of the firmware that is under way, or that has ended."""
        return self._behaviour

    @property
    def mode(self) -> int:
        """The active flight mode: HEARTBEAT.custom_mode."""
        return self._behaviour.mode

    @property
    def armed(self) -> bool:
        """Whether the motors run."""
        return self._behaviour.armed

    @property
    def landed(self) -> bool:
        """What the land detector says."""
        return self._behaviour.landed

    @property
    def runs(self) -> bool:
        """Whether the firmware runs: it neither boots nor has it crashed."""
        return self._restart_s is None and not self.crashed

    def receive(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        """Take a decoded message from a link."""
        if self.runs:
            self._behaviour.platform.clock.advance(time_s)
            self._behaviour.receive(message, link)

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture, in a message that the firmware takes, at the time of the last call."""
        if self.runs:
            self._behaviour.receive_mocap(message)

    def drain_battery(self, remaining: float) -> None:
        """Leave so much charge, 0…1, in the battery."""
        self._behaviour.platform.battery.drain(remaining)

    def step(self, time_s: float, dt_s: float) -> None:
        """Advance the autopilot and its vehicle.

        Args:
            time_s: Time at the end of the step, s.
            dt_s: Length of the step, s.
        """
        if self._restart_s is not None and time_s >= self._restart_s:
            self._restart_s = None
            self._behaviour = self._boot(time_s - dt_s)
        if not self.runs:
            self.vehicle.step(dt_s, _MOTORS_OFF)
            return
        self._behaviour.step(time_s, dt_s)
        if self._behaviour.halt is Halt.REBOOT:
            self._restart_s = time_s + self._behaviour.reboot_s
            _log.info("vehicle %d: the autopilot boots again", self.system_id)
        elif self._behaviour.halt is Halt.CRASH:
            self.crashed = True
            _log.error("vehicle %d: the autopilot has crashed and falls silent", self.system_id)

    def outbox(self) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """Take what is to be sent, in order."""
        return self._behaviour.platform.outbox.take()

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is none now."""
        return self.runs and self._behaviour.send_requested(link, message_id)
