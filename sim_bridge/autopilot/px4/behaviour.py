"""PX4 on its vehicle: messages and time go in, messages come out.

What is streamed, what is accepted and refused, when it arms, takes off, follows setpoints, fails safe, lands and
disarms is that of PX4 1.15 as it shows on its two MAVLink links.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.core.behaviour import Halt
from sim_bridge.autopilot.core.commands import CommandReceiver
from sim_bridge.autopilot.core.geodesy import GlobalOrigin
from sim_bridge.autopilot.core.motion_telemetry import MotionTelemetry
from sim_bridge.autopilot.core.parameter_service import ParameterService
from sim_bridge.autopilot.core.parameters import ParameterStore
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.core.services import Services
from sim_bridge.autopilot.core.setpoint import FREE, IDLE, Setpoint, SetpointStatistics, Vector
from sim_bridge.autopilot.core.status_telemetry import StatusTelemetry
from sim_bridge.autopilot.core.streams import StreamSchedule
from sim_bridge.autopilot.links import LINKS, LinkName
from sim_bridge.autopilot.px4.commander import Commander
from sim_bridge.autopilot.px4.commands import Px4Commands
from sim_bridge.autopilot.px4.component_telemetry import ComponentTelemetry
from sim_bridge.autopilot.px4.events import EventLog
from sim_bridge.autopilot.px4.flight_tasks import FlightTasks
from sim_bridge.autopilot.px4.modes import Health
from sim_bridge.autopilot.px4.offboard import OffboardInput
from sim_bridge.autopilot.px4.parameters import HASH_CHECK, RHYTHM, hash_check
from sim_bridge.autopilot.px4.position_control import PositionControl
from sim_bridge.autopilot.px4.setpoints import SetpointRefusedError, parse_setpoint
from sim_bridge.autopilot.px4.streams import DEFAULT_RATES_HZ
from sim_bridge.autopilot.px4.takeoff import LandDetector, TakeoffPhase, TakeoffRamp
from sim_bridge.autopilot.px4.telemetry import Px4Telemetry
from sim_bridge.autopilot.px4.timesync import TimeSync
from sim_bridge.autopilot.px4.vision import Px4Vision
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["Px4"]

FIRST_HEARTBEAT_S = 1.6
"""From the boot to the first message."""

POSITION_TIMEOUT_S = 4.65
"""Without a position for this long the estimate is invalid (EKF2_NOAID_TOUT, as it shows from outside)."""

ACCELEROMETER_ERROR_STD_M_S2 = 0.2
"""Without positions it is metres off after 8 s."""

MIN_TAKEOFF_S = 1.0
"""TAKEOFF in the air, at its height already, is over after so long."""

_MOTORS_OFF = VelocityCommand()
_CRUISE_MODES = frozenset({Px4Mode.TAKEOFF, Px4Mode.LOITER, Px4Mode.LAND, Px4Mode.RTL})
_TAKEOFF_MARGIN_M = 0.1

Handler = Callable[[Any, LinkName], None]


class Px4:
    """One run of PX4, from a boot to the next (implements ``Behaviour``).

    Args:
        system_id: MAVLink system id.
        vehicle: What it flies; advanced by :meth:`step`.
        origin: Where its local frame, the mission frame, is on Earth; None until SET_GPS_GLOBAL_ORIGIN tells.
        parameters: PX4's parameters.
        rng: Source of the sensors' errors.
        boot_s: When it is switched on, s.
        alignment_s: From the boot until tilt and heading are known, s; in software-in-the-loop it takes 30 to 36.
        statistics: Where setpoints are counted that arrive while armed and in OFFBOARD.

    Attributes:
        platform: What it works on.
        commander: Armed or not, mode, failsafe.
        streams: What each link carries.
        setpoint: What the active mode asks for.
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
            gps_s=alignment_s,
            position_timeout_s=POSITION_TIMEOUT_S,
            accelerometer_error_std_m_s2=ACCELEROMETER_ERROR_STD_M_S2,
            gps_enabled=lambda: parameters["SYS_HAS_GPS"] != 0 and parameters["EKF2_GPS_CTRL"] != 0,
            origin=None if origin is None else GlobalOrigin.of(origin),
            statistics=statistics,
        )
        self.halt: Halt | None = None
        self.setpoint = IDLE
        self._events = EventLog(platform.outbox, platform.clock)
        self.commander = Commander(parameters, platform.outbox.say, self._events)
        self._offboard = OffboardInput(statistics)
        self._timesync = {link: TimeSync() for link in LINKS}
        self._vision = Px4Vision(platform, self._timesync)
        self._flown_mode: Px4Mode | None = None
        self._flown_since_s = boot_s
        self._ramp = TakeoffRamp(parameters)
        self._land_detector = LandDetector(parameters)
        self._tasks = FlightTasks(parameters, platform.estimator, self._offboard)
        self._control = PositionControl(parameters, platform.estimator, vehicle)
        self._component = ComponentTelemetry(platform.clock, self.commander)
        self._builders = {
            **StatusTelemetry(platform, home_has_heading=True).builders,
            **self._component.builders,
            **MotionTelemetry(platform).builders,
            **Px4Telemetry(platform, self).builders,
        }
        start_us = round(1e6 * (FIRST_HEARTBEAT_S + 0.4 * float(rng.random())))
        self.streams = {link: StreamSchedule(self._builders, DEFAULT_RATES_HZ[link], start_us) for link in LINKS}
        self._commands = Px4Commands(self, platform.outbox, self.streams)
        # PX4 answers commands to other systems and components, too, where MAVLink asks for silence.
        self._receiver = CommandReceiver(
            platform.outbox, self._commands.handlers, platform.is_for_us, result_for_others=mavlink.MAV_RESULT_FAILED
        )
        self._parameter_service = ParameterService(
            parameters, platform.outbox, RHYTHM, platform.is_for_us, {HASH_CHECK: lambda: hash_check(parameters)}
        )
        self._services = Services(platform.outbox, platform.clock, platform.is_for_us)
        self._handlers = self._build_handlers()

    @property
    def mode(self) -> Px4Mode:
        """The active mode."""
        return self.commander.mode

    @property
    def armed(self) -> bool:
        """Whether the motors run."""
        return self.commander.armed

    @property
    def landed(self) -> bool:
        """What the land detector says."""
        return self._land_detector.landed

    @property
    def setpoint_seen(self) -> bool:
        """Whether any setpoint was ever accepted."""
        return self._offboard.seen

    @property
    def velocity_setpoint(self) -> Vector:
        """What position control asks for: north, east, down m/s, NaN where it does not."""
        return FREE if self.setpoint is IDLE else self._control.velocity

    @property
    def message_ids(self) -> frozenset[int]:
        """All messages that it can send on request."""
        return frozenset(self._builders)

    def health(self) -> Health:
        """What the modes' requirements are about, now."""
        platform = self.platform
        valid = platform.position_valid
        return Health(
            attitude=platform.aligned,
            local_position=valid,
            global_position=valid and platform.origin is not None,
            home=platform.home is not None,
            offboard_signal=self._offboard.alive(platform.clock.time_s, platform.parameters["COM_OF_LOSS_T"]),
        )

    def receive(self, message: mavlink.MAVLink_message, link: LinkName) -> None:
        """Take a message, at the time of the platform's clock."""
        handler = self._handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, link)

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture, from a link of its own, on which nobody answers TIMESYNC."""
        if isinstance(message, mavlink.MAVLink_odometry_message):
            self._vision.receive_odometry(message, None)
        elif isinstance(message, mavlink.MAVLink_vision_position_estimate_message):
            self._vision.receive_position(message, None)

    def step(self, time_s: float, dt_s: float) -> None:
        """Advance PX4 and its vehicle by ``dt_s`` to ``time_s``."""
        platform, vehicle = self.platform, self.platform.vehicle
        platform.clock.advance(time_s)
        platform.estimator.barometer = platform.parameters["EKF2_BARO_CTRL"] != 0
        platform.sense(time_s, dt_s)
        landed = self._land_detector.landed
        self.commander.step(time_s, self.health, landed=landed)
        if self.commander.armed:
            command = self._fly(time_s, dt_s)
        else:
            self._idle(time_s)
            command = _MOTORS_OFF
        vehicle.step(dt_s, command)
        self._land_detector.step(time_s, on_ground=vehicle.on_ground, armed=self.commander.armed, ramp=self._ramp)
        platform.battery.step(dt_s, motors_on=command.motors_on)
        now_us = platform.clock.boot_us
        self._parameter_service.step(now_us)
        for link, schedule in self.streams.items():
            for message in schedule.due(now_us):
                platform.outbox.send(link, message)

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is none now."""
        builder = self._builders.get(message_id)
        message = builder() if builder is not None else None
        if message is None:
            return False
        self.platform.outbox.send(link, message)
        return True

    def send_available_modes(self, link: LinkName, index: int) -> bool:
        """Queue AVAILABLE_MODES, all of them for 0; False if there is no such mode."""
        messages = self._component.available_modes(index)
        for message in messages:
            self.platform.outbox.send(link, message)
        return bool(messages)

    def request_mode(self, mode: Px4Mode) -> bool:
        """Change the mode if PX4 would."""
        if not self.commander.request_mode(mode, self.health()):
            return False
        self._offboard.leave()
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm if PX4 would; home is set where it is armed."""
        if self.commander.armed:
            return True
        if not self.commander.arm(self.platform.clock.time_s, self.health(), force=force):
            return False
        self.platform.set_home()
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm if PX4 would."""
        return self.commander.disarm(landed=self._land_detector.landed, force=force)

    def reboot(self) -> bool:
        """Boot again, unless it is armed."""
        if self.commander.armed:
            return False
        self.halt = Halt.REBOOT
        return True

    def set_takeoff_altitude(self, altitude_m: float | None) -> None:
        """Altitude above mean sea level for TAKEOFF, m; None for MIS_TAKEOFF_ALT above home."""
        platform = self.platform
        if altitude_m is None:
            default_m = platform.parameters["MIS_TAKEOFF_ALT"]
            platform.outbox.say(mavlink.MAV_SEVERITY_INFO, f"Using default takeoff altitude: {default_m:.1f} m")
            self._tasks.set_takeoff_down(None)
        else:
            self._tasks.set_takeoff_down(platform.altitude_amsl_m(0.0) - altitude_m)

    def _idle(self, time_s: float) -> None:
        platform = self.platform
        self.setpoint = IDLE
        self._offboard.leave()
        self._control.reset()
        self._ramp.step(time_s, armed=False, landed=self._land_detector.landed, wants_takeoff=False)
        if platform.home is None and platform.origin is not None and (platform.position_valid or platform.gps.enabled):
            platform.set_home()

    def _fly(self, time_s: float, dt_s: float) -> VelocityCommand:
        mode, landed = self.commander.mode, self._land_detector.landed
        if mode is not self._flown_mode:
            self._flown_mode, self._flown_since_s = mode, time_s
        setpoint = self._tasks.setpoint(mode, self.platform.home_position, on_ground=landed)
        self._ramp.step(time_s, armed=True, landed=landed, wants_takeoff=self._wants_takeoff(mode, setpoint))
        grounded = self._ramp.phase in (TakeoffPhase.SPOOLUP, TakeoffPhase.READY)
        self.setpoint = IDLE if grounded or self._land_detector.contact else setpoint
        if self.platform.vehicle.on_ground:
            self._control.reset()
        command = self._control.command(setpoint, self._ramp.max_climb_m_s, dt_s, cruise=mode in _CRUISE_MODES)
        lasted = time_s - self._flown_since_s >= MIN_TAKEOFF_S
        if mode is Px4Mode.TAKEOFF and not landed and lasted and self._tasks.takeoff_complete:
            self.commander.finish_takeoff()
        return command

    def _wants_takeoff(self, mode: Px4Mode, setpoint: Setpoint) -> bool:
        if mode is Px4Mode.TAKEOFF:
            return True
        if mode is not Px4Mode.OFFBOARD:
            return False
        climbs = setpoint.velocity[2] < 0.0 or setpoint.acceleration[2] < 0.0
        return climbs or setpoint.position[2] < self.platform.estimator.down_m - _TAKEOFF_MARGIN_M

    def _build_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG: self._receiver.receive_long,
            mavlink.MAVLINK_MSG_ID_COMMAND_INT: self._receiver.receive_int,
            mavlink.MAVLINK_MSG_ID_SET_MODE: self._on_set_mode,
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self._vision.receive_odometry,
            mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: self._vision.receive_position,
            mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._on_set_origin,
            mavlink.MAVLINK_MSG_ID_TIMESYNC: self._on_timesync,
            mavlink.MAVLINK_MSG_ID_PING: self._services.ping,
            **self._services.mission,
            **self._parameter_service.handlers,
        }

    def _on_heartbeat(self, message: mavlink.MAVLink_heartbeat_message, link: LinkName) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self.platform.outbox.text_links.add(link)

    def _on_setpoint(self, message: mavlink.MAVLink_set_position_target_local_ned_message, _: LinkName) -> None:
        platform = self.platform
        if message.target_system not in (0, platform.system_id) or message.target_component not in (0, 1):
            return
        try:
            setpoint = parse_setpoint(message, platform.estimator.yaw_rad)
        except SetpointRefusedError as refusal:
            platform.outbox.say(mavlink.MAV_SEVERITY_CRITICAL, str(refusal))
            self._events.setpoint_refused(refusal.frame, forced=refusal.forced)
            return
        in_offboard = self.commander.mode is Px4Mode.OFFBOARD
        self._offboard.receive(
            setpoint,
            platform.clock.time_s,
            flying_offboard=in_offboard and self.commander.armed,
            in_offboard=in_offboard,
        )

    def _on_set_mode(self, message: mavlink.MAVLink_set_mode_message, link: LinkName) -> None:
        if message.target_system == self.platform.system_id:
            place = len(self.platform.outbox)
            result = self._commands.set_mode(message)
            self._receiver.acknowledge(place, message, mavlink.MAV_CMD_DO_SET_MODE, result, link)

    def _on_timesync(self, message: mavlink.MAVLink_timesync_message, link: LinkName) -> None:
        if message.tc1 == 0:
            self._services.timesync(message, link)
        else:
            self._timesync[link].receive(message, self.platform.clock.boot_us)

    def _on_set_origin(self, message: mavlink.MAVLink_set_gps_global_origin_message, link: LinkName) -> None:
        origin = GlobalOrigin.from_message(message)
        if message.target_system == self.platform.system_id and origin is not None:
            self.platform.origin = origin
            self.send_requested(link, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
