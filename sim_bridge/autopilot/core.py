"""A PX4 autopilot with its vehicle, without sockets or clocks: messages and time go in, messages come out.

Its behaviour is that of PX4 1.15 as it shows on its two MAVLink links: what is streamed, what is accepted and refused,
when it arms, takes off, follows setpoints, fails safe, lands and disarms. The numbers were measured on PX4 in
software-in-the-loop.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from onboard.config.simulation import OriginConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.battery import Battery
from sim_bridge.autopilot.commander import Commander, StatusText
from sim_bridge.autopilot.commands import COMPONENT_ID, CommandService
from sim_bridge.autopilot.estimator import Estimator
from sim_bridge.autopilot.flight_tasks import FlightTasks
from sim_bridge.autopilot.geodesy import GlobalOrigin
from sim_bridge.autopilot.links import LINKS, LinkName
from sim_bridge.autopilot.modes import Health
from sim_bridge.autopilot.motion_telemetry import MotionTelemetry
from sim_bridge.autopilot.offboard import OffboardInput, SetpointStatistics
from sim_bridge.autopilot.parameters import ParameterStore
from sim_bridge.autopilot.position_control import PositionControl
from sim_bridge.autopilot.position_sources import ExternalVision, Gps
from sim_bridge.autopilot.services import Services
from sim_bridge.autopilot.setpoints import IDLE, Setpoint, SetpointRefusedError, parse_setpoint
from sim_bridge.autopilot.status_telemetry import StatusTelemetry
from sim_bridge.autopilot.streams import StreamSchedule
from sim_bridge.autopilot.takeoff import LandDetector, TakeoffPhase, TakeoffRamp
from sim_bridge.vehicle import Vehicle, VelocityCommand

__all__ = ["SimulatedAutopilot"]

FIRST_HEARTBEAT_S = 1.6
"""From the boot to the first message."""

_NAN3 = (float("nan"),) * 3
_MOTORS_OFF = VelocityCommand()
_STATUS_TEXT_BYTES = 50
_CRUISE_MODES = frozenset({Px4Mode.TAKEOFF, Px4Mode.LOITER, Px4Mode.LAND, Px4Mode.RTL})
_TAKEOFF_MARGIN_M = 0.1

Handler = Callable[[Any, LinkName], None]


class SimulatedAutopilot:
    """One vehicle's autopilot.

    Args:
        system_id: MAVLink system id.
        vehicle: What it flies; advanced by :meth:`step`.
        origin: Where its local frame, the mission frame, is on Earth; None until SET_GPS_GLOBAL_ORIGIN tells.
        parameters: PX4 parameters that differ from their defaults. ``INDOOR_PARAMETERS`` leave motion capture as the
            only position source.
        rng: Source of the sensors' errors.
        boot_time_s: When it was switched on, s; a time in the past has it booted and aligned at the first step.
        alignment_s: From the boot until tilt and heading are known, s; a PX4 in software-in-the-loop takes 30 to 36.

    Attributes:
        system_id: MAVLink system id.
        vehicle: The truth.
        time_s: Time of the last call, s.
        parameters: PX4's parameters.
        estimator: What the autopilot knows of its motion.
        vision: Motion capture as it comes in.
        gps: The GPS receiver.
        battery: The battery.
        offboard: The stream of setpoints.
        commander: Armed or not, mode, failsafe.
        streams: What each link carries.
        origin: Where the local frame is on Earth; None while unknown.
        home: Home position: north m, east m, down m.
        home_yaw_rad: Heading at home, rad.
        home_set: Whether home is known.
        setpoint: What the active mode asks for.

    Raises:
        ParameterError: PX4 has no such parameter.
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
    ) -> None:
        self.system_id = system_id
        self.vehicle = vehicle
        self.time_s = boot_time_s
        self._boot_time_s = boot_time_s
        self._alignment_s = alignment_s
        self._outbox: list[tuple[LinkName, mavlink.MAVLink_message]] = []
        self._ground_links: set[LinkName] = set()
        self._text_id = 0
        self.parameters = ParameterStore({"MAV_SYS_ID": system_id, **parameters})
        self.estimator = Estimator(vehicle, rng)
        self.vision = ExternalVision(self.parameters, self.estimator)
        self.gps = Gps(self.parameters, vehicle, self.estimator, rng)
        self.battery = Battery()
        self.offboard = OffboardInput()
        self.commander = Commander(self.parameters, self.say)
        self.origin = (
            None if origin is None else GlobalOrigin(origin.latitude_deg, origin.longitude_deg, origin.altitude_m)
        )
        self.home = (vehicle.north_m, vehicle.east_m, vehicle.down_m)
        self.home_yaw_rad = vehicle.yaw_rad
        self.home_set = False
        self.setpoint = IDLE
        self._ramp = TakeoffRamp(self.parameters)
        self._land_detector = LandDetector(self.parameters)
        self._tasks = FlightTasks(self.parameters, self.estimator, self.offboard)
        self._control = PositionControl(self.parameters, self.estimator, vehicle)
        self._commands = CommandService(self)
        self._services = Services(self)
        self._builders = {**StatusTelemetry(self).builders, **MotionTelemetry(self).builders}
        start_us = round(1e6 * (FIRST_HEARTBEAT_S + 0.4 * float(rng.random())))
        self.streams = {link: StreamSchedule(link, self._builders, start_us) for link in LINKS}
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
    def statistics(self) -> SetpointStatistics:
        """Setpoints received while armed and in OFFBOARD."""
        return self.offboard.statistics

    @property
    def boot_us(self) -> int:
        """Time since the boot, µs."""
        return max(round(1e6 * (self.time_s - self._boot_time_s)), 0)

    @property
    def boot_ms(self) -> int:
        """Time since the boot, ms, as far as 32 bits go."""
        return self.boot_us // 1000 & 0xFFFFFFFF

    @property
    def aligned(self) -> bool:
        """Whether tilt and heading are known."""
        return self.time_s - self._boot_time_s >= self._alignment_s

    @property
    def local_position_valid(self) -> bool:
        """Whether the estimate holds."""
        return self.aligned and self.estimator.position_valid(self.time_s)

    @property
    def velocity_setpoint(self) -> tuple[float, float, float]:
        """What position control asks for: north, east, down m/s, NaN where it does not."""
        return _NAN3 if self.setpoint is IDLE else self._control.velocity

    def altitude_amsl_m(self, down_m: float) -> float:
        """Altitude above mean sea level of a local height, m; above the local origin while that is unknown."""
        return -down_m if self.origin is None else self.origin.altitude_m - down_m

    def health(self) -> Health:
        """What the modes' requirements are about, now."""
        valid = self.local_position_valid
        return Health(
            attitude=self.aligned,
            local_position=valid,
            global_position=valid and self.origin is not None,
            home=self.home_set,
            offboard_signal=self.offboard.alive(self.time_s, self.parameters["COM_OF_LOSS_T"]),
        )

    def receive(self, message: mavlink.MAVLink_message, link: LinkName, time_s: float) -> None:
        """Take a decoded message from a link."""
        self.time_s = max(self.time_s, time_s)
        handler = self._handlers.get(message.get_msgId())
        if handler is not None:
            handler(message, link)

    def receive_mocap(self, odometry: mavlink.MAVLink_odometry_message) -> None:
        """Take ODOMETRY of type VISION in local NED from the motion capture, at the time of the last call."""
        self.vision.receive_odometry(odometry, self.time_s)

    def drain_battery(self, remaining: float) -> None:
        """Leave so much charge, 0…1, in the battery."""
        self.battery.drain(remaining)

    def step(self, time_s: float, dt_s: float) -> None:
        """Advance the autopilot and its vehicle.

        Args:
            time_s: Time at the end of the step, s.
            dt_s: Length of the step, s.
        """
        self.time_s = time_s
        self.estimator.predict(time_s, dt_s)
        if self.gps.enabled and self.aligned and not self.vision.active(time_s):
            self.gps.step(time_s)
        self.commander.step(time_s, self.health(), landed=self._land_detector.landed)
        if self.commander.armed:
            command = self._fly(time_s)
        else:
            self._idle(time_s)
            command = _MOTORS_OFF
        self.vehicle.step(dt_s, command)
        self._land_detector.step(time_s, on_ground=self.vehicle.on_ground, armed=self.commander.armed, ramp=self._ramp)
        self.battery.step(dt_s, motors_on=command.motors_on)
        self._services.step(dt_s)
        now_us = self.boot_us
        for link, schedule in self.streams.items():
            for message in schedule.due(now_us):
                self._outbox.append((link, message))

    def outbox(self) -> list[tuple[LinkName, mavlink.MAVLink_message]]:
        """Take what is to be sent, in order."""
        messages, self._outbox = self._outbox, []
        return messages

    def send(self, link: LinkName, message: mavlink.MAVLink_message) -> None:
        """Queue a message."""
        self._outbox.append((link, message))

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is none now."""
        builder = self._builders.get(message_id)
        message = builder() if builder is not None else None
        if message is None:
            return False
        self.send(link, message)
        return True

    def say(self, text: StatusText) -> None:
        """Send STATUSTEXT to the links on which a ground station was heard, in chunks."""
        data = text.text.encode()
        chunks = [data[i : i + _STATUS_TEXT_BYTES] for i in range(0, len(data), _STATUS_TEXT_BYTES)]
        self._text_id = self._text_id % 0xFFFF + 1
        for link in LINKS:
            if link in self._ground_links:
                for index, chunk in enumerate(chunks):
                    text_id = self._text_id if len(chunks) > 1 else 0
                    self.send(link, mavlink.MAVLink_statustext_message(text.severity, chunk, text_id, index))

    def request_mode(self, mode: Px4Mode) -> bool:
        """Change the mode if PX4 would."""
        if not self.commander.request_mode(mode, self.health()):
            return False
        self.offboard.leave()
        return True

    def arm(self, *, force: bool) -> bool:
        """Arm if PX4 would; home is set where it is armed."""
        if self.commander.armed:
            return True
        if not self.commander.arm(self.time_s, self.health(), force=force):
            return False
        self._set_home()
        return True

    def disarm(self, *, force: bool) -> bool:
        """Disarm if PX4 would."""
        return self.commander.disarm(landed=self._land_detector.landed, force=force)

    def set_takeoff_altitude(self, altitude_m: float | None) -> None:
        """Altitude above mean sea level for TAKEOFF, m; None for MIS_TAKEOFF_ALT above home."""
        if altitude_m is None:
            self.say(
                StatusText(
                    mavlink.MAV_SEVERITY_INFO,
                    f"Using default takeoff altitude: {self.parameters['MIS_TAKEOFF_ALT']:.1f} m",
                )
            )
            self._tasks.set_takeoff_down(None)
        else:
            self._tasks.set_takeoff_down(self.altitude_amsl_m(0.0) - altitude_m)

    def _idle(self, time_s: float) -> None:
        self.setpoint = IDLE
        self.offboard.leave()
        self._ramp.step(time_s, armed=False, landed=self._land_detector.landed, wants_takeoff=False)
        if not self.home_set and self.origin is not None and (self.local_position_valid or self.gps.enabled):
            self._set_home()

    def _fly(self, time_s: float) -> VelocityCommand:
        mode, landed = self.commander.mode, self._land_detector.landed
        setpoint = self._tasks.setpoint(mode, self.home, on_ground=landed)
        self._ramp.step(time_s, armed=True, landed=landed, wants_takeoff=self._wants_takeoff(mode, setpoint))
        grounded = self._ramp.phase in (TakeoffPhase.SPOOLUP, TakeoffPhase.READY)
        self.setpoint = IDLE if grounded or self._land_detector.contact else setpoint
        command = self._control.command(setpoint, self._ramp.max_climb_m_s, cruise=mode in _CRUISE_MODES)
        if mode is Px4Mode.TAKEOFF and not landed and self._tasks.takeoff_complete:
            self.commander.finish_takeoff()
        return command

    def _wants_takeoff(self, mode: Px4Mode, setpoint: Setpoint) -> bool:
        if mode is Px4Mode.TAKEOFF:
            return True
        if mode is not Px4Mode.OFFBOARD:
            return False
        climbs = setpoint.velocity[2] < 0.0 or setpoint.acceleration[2] < 0.0
        return climbs or setpoint.position[2] < self.estimator.down_m - _TAKEOFF_MARGIN_M

    def _set_home(self) -> None:
        """Home is here; from the receiver itself while there is no estimate."""
        estimator = self.estimator
        self.home = self.gps.position
        if self.local_position_valid:
            self.home = (estimator.north_m, estimator.east_m, estimator.down_m)
        self.home_yaw_rad = estimator.yaw_rad
        self.home_set = True

    def _build_handlers(self) -> dict[int, Handler]:
        return {
            mavlink.MAVLINK_MSG_ID_HEARTBEAT: self._on_heartbeat,
            mavlink.MAVLINK_MSG_ID_SET_POSITION_TARGET_LOCAL_NED: self._on_setpoint,
            mavlink.MAVLINK_MSG_ID_COMMAND_LONG: self._commands.receive_long,
            mavlink.MAVLINK_MSG_ID_COMMAND_INT: self._commands.receive_int,
            mavlink.MAVLINK_MSG_ID_SET_MODE: self._commands.set_mode,
            mavlink.MAVLINK_MSG_ID_ODOMETRY: self._on_odometry,
            mavlink.MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE: self._on_vision_position,
            mavlink.MAVLINK_MSG_ID_SET_GPS_GLOBAL_ORIGIN: self._on_set_origin,
            **self._services.handlers,
        }

    def _on_heartbeat(self, message: mavlink.MAVLink_heartbeat_message, link: LinkName) -> None:
        if message.type == mavlink.MAV_TYPE_GCS:
            self._ground_links.add(link)

    def _on_setpoint(self, message: mavlink.MAVLink_set_position_target_local_ned_message, _link: LinkName) -> None:
        if message.target_system not in (0, self.system_id) or message.target_component not in (0, COMPONENT_ID):
            return
        try:
            setpoint = parse_setpoint(message, self.estimator.yaw_rad)
        except SetpointRefusedError as refusal:
            self.say(StatusText(mavlink.MAV_SEVERITY_CRITICAL, str(refusal)))
            return
        in_offboard = self.commander.mode is Px4Mode.OFFBOARD
        self.offboard.receive(
            setpoint, self.time_s, flying_offboard=in_offboard and self.commander.armed, in_offboard=in_offboard
        )

    def _on_odometry(self, message: mavlink.MAVLink_odometry_message, _link: LinkName) -> None:
        self.vision.receive_odometry(message, self.time_s)

    def _on_vision_position(self, message: mavlink.MAVLink_vision_position_estimate_message, _link: LinkName) -> None:
        self.vision.receive_position(message, self.time_s)

    def _on_set_origin(self, message: mavlink.MAVLink_set_gps_global_origin_message, link: LinkName) -> None:
        if (
            message.target_system == self.system_id
            and abs(message.latitude) <= 90e7
            and abs(message.longitude) <= 180e7
        ):
            self.origin = GlobalOrigin(message.latitude * 1e-7, message.longitude * 1e-7, message.altitude * 1e-3)
            self.send_requested(link, mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN)
