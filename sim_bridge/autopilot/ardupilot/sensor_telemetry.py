"""The messages about sensors and radio control that ground stations ask ArduPilot for in groups."""

from __future__ import annotations

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.fields import centi
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.streams import Builder
from sim_bridge.vehicle.dynamics import GRAVITY_M_S2

__all__ = ["SensorTelemetry"]

_SEA_LEVEL_HPA = 1013.25
_HPA_PER_M = 0.12
_CENTI_CELSIUS = 3500
_CHANNELS = (1500, 1500, 1000, 1500, 1800, 1000, 1000, 1800, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0)
"""The radio control that SITL pretends to receive: throttle down, everything else at rest."""


class SensorTelemetry:
    """Builds messages.

    Args:
        platform: Whose sensors.

    Attributes:
        builders: By message id.
    """

    def __init__(self, platform: Platform) -> None:
        self._platform = platform
        self._clock = platform.clock
        self.builders: dict[int, Builder] = {
            mavlink.MAVLINK_MSG_ID_RAW_IMU: self.raw_imu,
            mavlink.MAVLINK_MSG_ID_SCALED_IMU2: self.scaled_imu2,
            mavlink.MAVLINK_MSG_ID_SCALED_PRESSURE: self.scaled_pressure,
            mavlink.MAVLINK_MSG_ID_RC_CHANNELS: self.rc_channels,
            mavlink.MAVLINK_MSG_ID_POWER_STATUS: self.power_status,
            mavlink.MAVLINK_MSG_ID_NAV_CONTROLLER_OUTPUT: self.nav_controller_output,
        }

    def raw_imu(self) -> mavlink.MAVLink_message:
        """RAW_IMU: mg, mrad/s, mgauss."""
        return mavlink.MAVLink_raw_imu_message(self._clock.boot_us, *self._imu())

    def scaled_imu2(self) -> mavlink.MAVLink_message:
        """SCALED_IMU2: the second sensor measures the same."""
        return mavlink.MAVLink_scaled_imu2_message(self._clock.boot_ms, *self._imu())

    def scaled_pressure(self) -> mavlink.MAVLink_message:
        """SCALED_PRESSURE."""
        altitude_m = self._platform.altitude_amsl_m(self._platform.vehicle.down_m)
        return mavlink.MAVLink_scaled_pressure_message(
            self._clock.boot_ms, _SEA_LEVEL_HPA - _HPA_PER_M * altitude_m, 0.0, _CENTI_CELSIUS
        )

    def rc_channels(self) -> mavlink.MAVLink_message:
        """RC_CHANNELS."""
        return mavlink.MAVLink_rc_channels_message(self._clock.boot_ms, 16, *_CHANNELS, 255)

    def power_status(self) -> mavlink.MAVLink_message:
        """POWER_STATUS."""
        return mavlink.MAVLink_power_status_message(5000, 0, 0)

    def nav_controller_output(self) -> mavlink.MAVLink_message:
        """NAV_CONTROLLER_OUTPUT: where the nose points; there is no route."""
        yaw_deg = round(centi(self._platform.estimator.yaw_rad * 57.29578) / 100)
        return mavlink.MAVLink_nav_controller_output_message(0.0, 0.0, yaw_deg, 0, 0, 0.0, 0.0, 0.0)

    def _imu(self) -> tuple[int, ...]:
        """Accelerations, turn rates and magnetic field, level."""
        vehicle = self._platform.vehicle
        lift_mg = round(-1000.0 * (GRAVITY_M_S2 - vehicle.acceleration_down_m_s2) / GRAVITY_M_S2)
        turning_mrad_s = round(1000.0 * vehicle.yaw_rate_rad_s)
        return (0, 0, max(min(lift_mg, 32767), -32768), 0, 0, turning_mrad_s, 210, 0, 430)
