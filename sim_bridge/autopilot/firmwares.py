"""The firmwares that a simulated autopilot can behave like."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal, Protocol

import numpy as np

from onboard.config.simulation import OriginConfig
from sim_bridge.autopilot.ardupilot import parameters as ardupilot_parameters
from sim_bridge.autopilot.ardupilot.behaviour import ArduPilot
from sim_bridge.autopilot.core.behaviour import Behaviour
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.setpoint import SetpointStatistics
from sim_bridge.autopilot.px4 import parameters as px4_parameters
from sim_bridge.autopilot.px4.behaviour import Px4
from sim_bridge.vehicle import Vehicle

__all__ = ["FIRMWARES", "Firmware", "FirmwareKind"]

Firmware = Literal["px4", "ardupilot"]


class Boot(Protocol):
    """Starts a run of a firmware."""

    def __call__(
        self,
        system_id: int,
        vehicle: Vehicle,
        *,
        origin: OriginConfig | None,
        parameters: ParameterStore,
        rng: np.random.Generator,
        boot_s: float,
        alignment_s: float,
        statistics: SetpointStatistics,
    ) -> Behaviour:
        """The run that begins at ``boot_s``."""


@dataclass(frozen=True, slots=True)
class FirmwareKind:
    """One firmware.

    Attributes:
        title: Its name, for people.
        boot: Starts a run.
        load_parameters: Its parameters, some of them changed.
        system_id_parameter: The parameter that holds the system id.
        indoor_parameters: What makes motion capture the only source of positions.
        mocap_delay_parameter: The parameter that tells how late motion capture is, ms.
    """

    title: str
    boot: Boot
    load_parameters: Callable[[Mapping[str, int | float]], ParameterStore]
    system_id_parameter: str
    indoor_parameters: Mapping[str, int | float]
    mocap_delay_parameter: str

    def indoors(self, mocap_delay_s: float) -> dict[str, int | float]:
        """The parameters for flying on motion capture alone that is late by a known time, s."""
        return {**self.indoor_parameters, self.mocap_delay_parameter: round(1e3 * mocap_delay_s)}


FIRMWARES: Mapping[Firmware, FirmwareKind] = {
    "px4": FirmwareKind(
        title="PX4",
        boot=Px4,
        load_parameters=px4_parameters.load_parameters,
        system_id_parameter="MAV_SYS_ID",
        indoor_parameters=px4_parameters.INDOOR_PARAMETERS,
        mocap_delay_parameter="EKF2_EV_DELAY",
    ),
    "ardupilot": FirmwareKind(
        title="ArduPilot",
        boot=ArduPilot,
        load_parameters=ardupilot_parameters.load_parameters,
        system_id_parameter="MAV_SYSID",
        indoor_parameters=ardupilot_parameters.INDOOR_PARAMETERS,
        mocap_delay_parameter="VISO_DELAY_MS",
    ),
}
