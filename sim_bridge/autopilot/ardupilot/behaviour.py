"""ArduPilot Copter on its vehicle: messages and time go in, messages come out.

What is sent and what has to be asked for, what is accepted and refused, when it arms, takes off, follows setpoints,
fails safe, lands and disarms is that of Copter 4.7-dev as it shows on MAVLink.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.autopilot.ardupilot.arming import Readiness
from sim_bridge.autopilot.ardupilot.autonomous import Autonomous
from sim_bridge.autopilot.ardupilot.commands import CopterCommands
from sim_bridge.autopilot.ardupilot.control import CopterControl
from sim_bridge.autopilot.ardupilot.copter import Copter
from sim_bridge.autopilot.ardupilot.guided import Guided
from sim_bridge.autopilot.ardupilot.parameters import RHYTHM
from sim_bridge.autopilot.ardupilot.sensor_telemetry import SensorTelemetry
from sim_bridge.autopilot.ardupilot.setpoints import DeadlySetpointError, Pose3, parse_setpoint
from sim_bridge.autopilot.ardupilot.streams import DEFAULT_RATES_HZ, FIRST_US, STREAM_GROUPS
from sim_bridge.autopilot.ardupilot.telemetry import CopterTelemetry
from sim_bridge.autopilot.ardupilot.vision import CopterVision
from sim_bridge.autopilot.core.behaviour import Halt
from sim_bridge.autopilot.core.commands import CommandReceiver
from sim_bridge.autopilot.core.geodesy import GlobalOrigin
from sim_bridge.autopilot.core.motion_telemetry import MotionTelemetry
from sim_bridge.autopilot.core.parameter_service import ParameterService
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.raw_messages import PlainText
from sim_bridge.autopilot.core.services import Services
from sim_bridge.autopilot.core.setpoint import SetpointStatistics
from sim_bridge.autopilot.core.status_telemetry import StatusTelemetry
from sim_bridge.autopilot.core.streams import StreamSchedule
from sim_bridge.autopilot.links import LINKS, LinkName
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["ArduPilot"]

FIRST_HEARTBEAT_S = 1.0
INITIALISED_S = 2.4
"""From the boot to the first heartbeat, and until commands are carried out."""

POSITION_TIMEOUT_S = 6.7
"""Without a position for this long the estimate is given up."""

ACCELEROMETER_ERROR_STD_M_S2 = 0.025
"""Two seconds without positions cost 7 cm at most."""

GPS_LOCKED, GPS_FUSED = 2.0, 5.0
"""When GPS tells where the local origin is, and when the estimate uses it, in times of the alignment."""

_MILESTONES = 3
_MOTORS_OFF = VelocityCommand()
_IDLING = VelocityCommand(motors_on=True)

_BANNER = "\r\n\r\nInit ArduCopter V4.7.0-dev\r\n\r\n"
_VERSION_TEXTS = ("ArduCopter V4.7.0-dev (2598e9d4)", "3d1219c7c4c5404aaa1f6d2a48adfda4", "Frame: QUAD/PLUS")

Handler = Callable[[Any, LinkName], None]


class ArduPilot:
    """One run of Copter, from a boot to the next (implements ``Behaviour``).

    Args:
        system_id: MAVLink system id.
        vehicle: What it flies; advanced by :meth:`step`.
        origin: What GPS says of the mission frame's place on Earth; without GPS it is SET_GPS_GLOBAL_ORIGIN that tells.
        parameters: ArduPilot's parameters.
        rng: Source of the sensors' errors.
        boot_s: When it is switched on, s.
        alignment_s: From the boot until tilt and heading are known, s; in software-in-the-loop it takes 6. What GPS
            gives comes later: ``GPS_LOCKED``, ``GPS_FUSED``.
        statistics: Where setpoints are counted that arrive while armed and in GUIDED.

    Attributes:
        platform: What it works on.
        copter: Armed or not, mode, landed, failsafes.
        guided: What GUIDED does.
        vision: Motion capture.
        streams: What each link carries.
        halt: Why it no longer runs; None while it does.
    """

    reboot_s = 0.5

    def __init__(
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
    ) -> None:
        self.platform = platform = Platform(
            system_id,
            vehicle,
            parameters,
            rng,
            boot_s=boot_s,
            alignment_s=alignment_s,
            gps_s=GPS_FUSED * alignment_s,
            position_timeout_s=POSITION_TIMEOUT_S,
            accelerometer_error_std_m_s2=ACCELEROMETER_ERROR_STD_M_S2,
            gps_enabled=lambda: parameters["GPS1_TYPE"] != 0,
            origin=None,
            statistics=statistics,
        )
        self.halt: Halt | None = None
        self._gps_origin = None if origin is None else GlobalOrigin.of(origin)
        self._companions: set[tuple[int, int]] = set()
        self._greeted = False
        self._milestone = 0
        self._gps_locked_s = boot_s + GPS_LOCKED * alignment_s
        self.vision = CopterVision(platform)
        self.copter = Copter(parameters, platform.outbox.say, self._readiness, self._on_mode)
        self._control = CopterControl(parameters, platform.estimator, vehicle)
        self.guided = Guided(parameters, platform.estimator, self._control)
        self._autonomous = Autonomous(platform)
        status = StatusTelemetry(platform, home_has_heading=False)
        self._builders = {
            **status.builders,
            **SensorTelemetry(platform).builders,
            **CopterTelemetry(platform, self, MotionTelemetry(platform)).builders,
        }
        del self._builders[mavlink.MAVLINK_MSG_ID_PING]
        start_us = round(1e6 * FIRST_HEARTBEAT_S)
        self.streams = {link: StreamSchedule(self._builders, DEFAULT_RATES_HZ, start_us, FIRST_US) for link in LINKS}
        self._receiver = CommandReceiver(
            platform.outbox,
            CopterCommands(self, platform.outbox, self.streams).handlers,
            self._is_for_us,
        )
        self._parameter_service = ParameterService(parameters, platform.outbox, RHYTHM, self._is_for_us)
        self._services = Services(platform.outbox, platform.clock, platform.is_for_us)
        self._handlers = self._build_handlers()

    @property
    def mode(self) -> CopterMode:
        """The flight mode."""
        return self.copter.mode

    @property
    def armed(self) -> bool:
        """Whether the motors run."""
        return self.copter.armed

    @property
    def landed(self) -> bool:
        """What the land detector says."""
        return self.copter.landed

    @property
    def initialised(self) -> bool:
        """Whether the firmware has started up."""
        return self.platform.clock.up_s >= INITIALISED_S

    @property
    def message_ids(self) -> frozenset[int]:
        """All messages that it can send on request."""
        return frozenset(self._builders)

    def receive(self, message: mavlink.MAVLink_message, link: LinkName) -> None:
        """Take a message, at the time of the platform's clock."""
        handler = self._handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, link)

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture, from whatever link."""
        handler = self.vision.handlers.get(message.get_msgId())
        if handler is not None:
            handler(message)

    def step(self, time_s: float, dt_s: float) -> None:
        """Advance Copter and its vehicle by ``dt_s`` to ``time_s``."""
        platform, vehicle, copter = self.platform, self.platform.vehicle, self.copter
        platform.clock.advance(time_s)
        if not self._greeted:
            self._greeted = True
            for link in LINKS:
                platform.outbox.send(link, PlainText(_BANNER))
        platform.sense(time_s, dt_s)
        if self._milestone < _MILESTONES:
            self._start_up(time_s)
        guided = copter.mode is CopterMode.GUIDED
        lifts_off = copter.armed and guided and self.guided.lifts_off(time_s)
        copter.step(time_s, on_ground=vehicle.on_ground, lifts_off=lifts_off, position=platform.position_valid)
        command = self._fly(time_s, dt_s, lifts_off=lifts_off) if copter.armed else _MOTORS_OFF
        if not copter.armed:
            platform.statistics.pause()
        vehicle.step(dt_s, command)
        platform.battery.step(dt_s, motors_on=command.motors_on)
        now_us = platform.clock.boot_us
        self._parameter_service.step(now_us)
        for link, schedule in self.streams.items():
            for message in schedule.due(now_us):
                platform.outbox.send(link, message)

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind, if it can be told now; False if there is no such message."""
        builder = self._builders.get(message_id)
        if builder is None:
            return False
        message = builder()
        if message is not None:
            self.platform.outbox.send(link, message)
        return True

    def request_mode(self, custom_mode: int) -> bool:
        """Change the mode if Copter would."""
        return self.copter.request_mode(custom_mode)

    def arm(self, *, force: bool) -> bool:
        """Arm if Copter would; home is set where it is armed."""
        if self.copter.armed:
            return True
        if not self.copter.arm(self.platform.clock.time_s, force=force):
            return False
        self.set_home_here()
        self._control.reset()
        if self.copter.mode is CopterMode.GUIDED:
            self.guided.enter()
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm if Copter would."""
        return self.copter.disarm(force=force)

    def take_off(self, height_m: float) -> bool:
        """Climb to a height above home, m: armed, in GUIDED, on the ground."""
        copter, platform = self.copter, self.platform
        if not copter.armed or copter.mode is not CopterMode.GUIDED or not copter.landed:
            return False
        down_m = platform.home_position[2] - height_m
        self.guided.take_off(down_m, platform.clock.time_s, copter.armed_s)
        return True

    def reboot(self) -> bool:
        """Boot again, unless it is armed."""
        if self.copter.armed:
            return False
        self.halt = Halt.REBOOT
        return True

    def set_home_here(self) -> bool:
        """Make this place home, if it is known where it is."""
        if self.platform.origin is None:
            return False
        self.platform.set_home()
        self._tell_origin_and_home()
        return True

    def _start_up(self, time_s: float) -> None:
        """Say how the start-up goes on, and take the origin from GPS."""
        platform = self.platform
        if platform.origin is None and platform.gps.enabled and time_s >= self._gps_locked_s:
            self._set_origin(self._gps_origin)
        source = "external nav data" if platform.vision.active(time_s) else "GPS"
        for text, reached in (
            ("ArduPilot Ready", self.initialised),
            ("EKF3 IMU0 tilt alignment complete", platform.aligned),
            (f"EKF3 IMU0 is using {source}", platform.position_valid),
        )[self._milestone :]:
            if not reached:
                break
            self._milestone += 1
            platform.outbox.say(mavlink.MAV_SEVERITY_INFO, text)

    def _fly(self, time_s: float, dt_s: float, *, lifts_off: bool) -> VelocityCommand:
        copter, vehicle = self.copter, self.platform.vehicle
        if vehicle.on_ground and not lifts_off:
            # Whatever is wanted, only a takeoff leaves the ground.
            self._control.reset()
            return _IDLING
        guided = copter.mode is CopterMode.GUIDED
        wish = self.guided.wish(time_s) if guided else self._autonomous.wish(copter.mode, time_s)
        return self._control.command(wish, dt_s)

    def _on_mode(self) -> None:
        """The mode has changed: start it here, and say so in an extra heartbeat."""
        if self.copter.mode is CopterMode.GUIDED:
            self.guided.enter()
        else:
            self._autonomous.enter(self.copter.mode)
        for link in LINKS:
            self.send_requested(link, mavlink.MAVLINK_MSG_ID_HEARTBEAT)

    def _readiness(self) -> Readiness:
        platform = self.platform
        return Readiness(
            initialised=self.initialised,
            attitude=platform.aligned,
            origin=platform.origin is not None,
            position=platform.position_valid,
            vision_wanted=self.vision.wanted,
            vision_healthy=self.vision.healthy(platform.clock.time_s),
            gcs_failsafe=self.copter.gcs_failsafe,
        )

    def _is_for_us(self, system: int, component: int) -> bool:
        """Broadcasts are, too; and so is any component of its own that has not been heard of on a link."""
        return system in (0, self.platform.system_id) and (system, component) not in self._companions

    def _set_origin(self, origin: GlobalOrigin | None) -> None:
        platform = self.platform
        if origin is None or platform.origin is not None:
            return
        platform.origin = origin
        for core in (0, 1):
            platform.outbox.say(mavlink.MAV_SEVERITY_INFO, f"EKF3 IMU{core} origin set")
        platform.set_home()
        self._tell_origin_and_home()

    def _tell_origin_and_home(self) -> None:
        for link in LINKS:
            self.send_requested(link, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
            self.send_requested(link, mavlink.MAVLINK_MSG_ID_HOME_POSITION)

    def _build_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG: self._receiver.receive_long,
            mavlink.MAVLINK_MSG_ID_COMMAND_INT: self._receiver.receive_int,
            mavlink.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            mavlink.MAVLINK_MSG_ID_REQUEST_DATA_STREAM: self._on_request_data_stream,
            **dict.fromkeys(self.vision.handlers, self._on_vision),
            mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._on_set_origin,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._services.timesync,
            **self._services.mission,
            **self._parameter_service.handlers,
            mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST: self._on_param_list,
        }

    def _on_heartbeat(self, message: mavlink.MAVLink_heartbeat_message, link: LinkName) -> None:
        system, component = message.get_srcSystem(), message.get_srcComponent()
        self._companions.add((system, component))
        self.platform.outbox.text_links.add(link)
        if system == self.platform.parameters["MAV_GCS_SYSID"]:
            self.copter.hear_ground_station(self.platform.clock.time_s)

    def _on_setpoint(self, message: mavlink.MAVLink_set_position_target_local_ned_message, _: LinkName) -> None:
        platform, copter = self.platform, self.copter
        if message.target_system not in (0, platform.system_id):
            return
        if not copter.armed or copter.mode is not CopterMode.GUIDED:
            platform.statistics.pause()
            return
        estimator = platform.estimator
        here = Pose3((estimator.north_m, estimator.east_m, estimator.down_m), estimator.yaw_rad)
        try:
            setpoint = parse_setpoint(message, here)
        except DeadlySetpointError:
            self.halt = Halt.CRASH
            return
        platform.statistics.count(platform.clock.time_s)
        self.guided.receive(setpoint, platform.clock.time_s)

    def _on_set_mode(self, message: mavlink.MAVLink_set_mode_message, _: LinkName) -> None:
        """SET_MODE works, and is never acknowledged."""
        if message.target_system in (0, self.platform.system_id) and message.base_mode & 1:
            self.copter.request_mode(message.custom_mode)

    def _on_request_data_stream(self, message: mavlink.MAVLink_request_data_stream_message, link: LinkName) -> None:
        if not self._is_for_us(message.target_system, message.target_component):
            return
        stream, rate_hz = message.req_stream_id, message.req_message_rate if message.start_stop else 0
        groups = STREAM_GROUPS.values() if stream == 0 else [STREAM_GROUPS.get(stream, ())]
        for message_id in (message_id for group in groups for message_id in group):
            self.streams[link].set_interval(message_id, 1e6 / rate_hz if rate_hz else -1.0)

    def _on_vision(self, message: mavlink.MAVLink_message, _: LinkName) -> None:
        self.receive_mocap(message)

    def _on_set_origin(self, message: mavlink.MAVLink_set_gps_global_origin_message, _: LinkName) -> None:
        if message.target_system in (0, self.platform.system_id):
            self._set_origin(GlobalOrigin.from_message(message))

    def _on_param_list(self, message: mavlink.MAVLink_param_request_list_message, link: LinkName) -> None:
        if self._is_for_us(message.target_system, message.target_component):
            for text in _VERSION_TEXTS:
                self.platform.outbox.say(mavlink.MAV_SEVERITY_INFO, text)
        self._parameter_service.handlers[mavlink.MAVLINK_MSG_ID_PARAM_REQUEST_LIST](message, link)
