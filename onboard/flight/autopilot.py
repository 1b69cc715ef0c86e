"""The companion's side of an autopilot link, without sockets: what it hears, and what it asks for.

Which family of autopilots it speaks to is seen in the heartbeat; what differs between them is in ``px4.py`` and
``ardupilot.py``. Positions are in the mission frame here, and only here are they converted.
"""

from __future__ import annotations

from collections import deque

from onboard.config.simulation import OriginConfig
from onboard.flight.ardupilot import ArduPilot
from onboard.flight.behaviour import Behaviour, Request, setpoint_message
from onboard.flight.events import Event
from onboard.flight.motion_watch import MotionWatch
from onboard.flight.placement import Placement
from onboard.flight.pose_history import ClockOffset, PoseHistory
from onboard.flight.preflight import Preflight
from onboard.flight.px4 import Px4
from onboard.flight.requirements import Needs
from onboard.flight.setpoints import Setpoint
from onboard.flight.streams import StreamWatch
from onboard.flight.telemetry import Telemetry
from onboard.geometry import Pose
from onboard.protocol import dialect as mavlink
from onboard.protocol.commands import CommandClient, CommandOutcome
from onboard.protocol.parameters import ParameterClient
from onboard.protocol.status_text import StatusTextAssembler

__all__ = ["BEHAVIOURS", "AutopilotLink"]

COMPONENT: int = mavlink.MAV_COMP_ID_AUTOPILOT1
RECENT_TEXT_S = 3.0
"""Within which a text of the autopilot explains its refusal."""

BEHAVIOURS: dict[str, Behaviour] = {"px4": Px4(), "ardupilot": ArduPilot()}
"""By the name that a scenario gives them."""

_HOUSEKEEPING = (mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, mavlink.MAV_CMD_REQUEST_MESSAGE)
_MASK_32 = 0xFFFFFFFF


class AutopilotLink:
    """What is known of one autopilot, and what is under way to it.

    Args:
        system_id: The vehicle's system id.
        timeout_s: Silence of the heartbeat after which the autopilot counts as lost, s.
        expected: Which autopilot the scenario says it is: a key of ``BEHAVIOURS``.
        origin: Where the mission frame's origin is on Earth.
        related_by_gps: Whether the local frame has an origin of its own; else it is the mission frame.
        needs: What the plan asks of its parameters; None asks nothing.

    Attributes:
        heard: What the autopilot says of itself, in its local frame.
        behaviour: How it is flown; what is expected until the heartbeat tells.
        poses: Position and yaw of the last seconds, by UNIX time, in the mission frame.
        commands: Commands under way.
        parameters: Those that were read.
        preflight: What the plan needs of them.
        boots: How often the autopilot was seen to boot anew.
        motion: Whether the position agrees with the vehicle's tilt.
    """

    def __init__(
        self,
        system_id: int,
        timeout_s: float,
        *,
        expected: str = "px4",
        origin: OriginConfig | None = None,
        related_by_gps: bool = False,
        needs: Needs | None = None,
    ) -> None:
        self.heard = Telemetry()
        self.behaviour = BEHAVIOURS[expected]
        self.poses = PoseHistory()
        self.commands = CommandClient()
        self.parameters = ParameterClient((system_id, COMPONENT))
        self.preflight = Preflight(self.parameters, ())
        self.boots = 0
        self.motion = MotionWatch()
        self._needs = needs
        self._told_findings: list[str] = []
        self._expected = self.behaviour
        self._unknown_autopilot = False
        self._system_id = system_id
        self._timeout_s = timeout_s
        self._placement = Placement(origin or OriginConfig(), related_by_gps=related_by_gps)
        self._clock = ClockOffset()
        self._streams: StreamWatch | None = None
        self._was_heard = False
        self._unhealthy: tuple[str, ...] = ()
        self._assembler = StatusTextAssembler()
        self._recent_texts: deque[tuple[float, str]] = deque(maxlen=8)
        self._out: list[mavlink.MAVLink_message] = []
        self._events: list[Event] = []
        self._outcomes: list[CommandOutcome] = []

    # What it hears.

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message that arrived at a UNIX time; those of other systems and components are not for us."""
        if message.get_srcSystem() != self._system_id or message.get_srcComponent() != COMPONENT:
            return
        if self.heard.rebooted(message):
            self._begin_anew(time_s)
        self.heard.receive(message, time_s)
        if self._streams is not None:
            self._streams.count(message.get_msgId())
        match message:
            case mavlink.MAVLink_heartbeat_message():
                self._identify(message.autopilot, time_s)
            case mavlink.MAVLink_local_position_ned_message() | mavlink.MAVLink_attitude_message():
                self.motion.receive(message)
                self._remember(message, self._clock.unix(message.time_boot_ms, time_s))
            case mavlink.MAVLink_param_value_message():
                self.parameters.receive(message)
            case mavlink.MAVLink_gps_global_origin_message():
                self._placement.relate(message)
            case mavlink.MAVLink_statustext_message():
                self._read(message, time_s)
            case mavlink.MAVLink_command_ack_message():
                outcome = self.commands.receive(message, time_s)
                if outcome is not None:
                    self._end(outcome)
            case mavlink.MAVLink_timesync_message() if message.tc1 == 0:
                self._out.append(mavlink.MAVLink_timesync_message(round(time_s * 1e9), message.ts1))

    def alive(self, time_s: float) -> bool:
        """Whether its heartbeat is recent."""
        return time_s - self.heard.heartbeat_s <= self._timeout_s

    def lacks(self, time_s: float) -> str:
        """What is missing before it can be started, in words; empty when it is ready."""
        if not self.alive(time_s):
            return "no heartbeat"
        if self._unknown_autopilot:
            return f"autopilot {self.heard.autopilot} is neither PX4 nor ArduPilot"
        if self.behaviour is not self._expected:
            return f"it is {self.behaviour.name}, the scenario says {self._expected.name}"
        return self._parameters_lack() or self._position_lacks(time_s) or self.behaviour.lacks(self.heard)

    @property
    def mode_name(self) -> str:
        """The autopilot's mode in words."""
        return "unknown" if self.heard.mode is None else self.behaviour.mode_name(self.heard.mode)

    def has_position(self, time_s: float) -> bool:
        """Whether its place in the mission frame is known and recent."""
        return self._placement.frame is not None and self.heard.has_position(time_s)

    @property
    def position(self) -> tuple[float, float, float] | None:
        """North m, east m, down m in the mission frame; None before it is known."""
        frame = self._placement.frame
        if frame is None or self.heard.local_position is None:
            return None
        return frame.to_mission(self.heard.local_position)

    @property
    def down_m(self) -> float:
        """Down in the mission frame, m; 0 before it is known."""
        position = self.position
        return 0.0 if position is None else position[2]

    @property
    def velocity(self) -> tuple[float, float]:
        """North m/s, east m/s with the latest position; the local frame is turned by nothing."""
        return self.heard.local_velocity

    def pose(self) -> Pose | None:
        """The latest position and yaw; None before both were heard."""
        position = self.position
        if position is None or self.heard.yaw_rad is None:
            return None
        return Pose(position[0], position[1], self.heard.yaw_rad)

    # What it asks for.

    def stand_on_ground(self) -> None:
        """Where it stands is height 0, unless motion capture knows better."""
        if self.heard.local_position is not None:
            self._placement.stand_on_ground(self.heard.local_position[2])

    def stream(self, setpoint: Setpoint, time_s: float, boot_s: float) -> None:
        """Send a setpoint of the mission frame."""
        frame = self._placement.frame
        if frame is None:
            return
        boot_ms = round((time_s - boot_s) * 1e3) & _MASK_32
        local = setpoint.at_height(frame.down_to_local(setpoint.down_m))
        self._out.append(setpoint_message(local, self.behaviour.type_mask, boot_ms, self._system_id, COMPONENT))

    def ask(self, request: Request, time_s: float) -> None:
        """Give a command; it is repeated until it is answered."""
        filled = [*request.parameters, *[0.0] * (7 - len(request.parameters))]
        message = mavlink.MAVLink_command_long_message(self._system_id, COMPONENT, request.command, 0, *filled)
        self.commands.request(message, time_s)

    def busy(self, command: int) -> bool:
        """Whether this MAV_CMD waits for its acknowledgement."""
        return self.commands.pending(command, (self._system_id, COMPONENT))

    def poll(self, time_s: float) -> list[mavlink.MAVLink_message]:
        """What to send now."""
        self._watch(time_s)
        if self._was_heard and self._streams is not None:
            wanted = self._streams.request(time_s)
            if wanted is not None:
                self.ask(wanted, time_s)
            for group, rate_hz in self._streams.groups():
                request = mavlink.MAVLink_request_data_stream_message(self._system_id, COMPONENT, group, rate_hz, 1)
                self._out.append(request)
            self._events += self._streams.events()
            self._seek_origin(time_s)
            self.preflight.poll(time_s)
            self._tell_findings()
            self._out += self.parameters.poll(time_s)
        due, timed_out = self.commands.poll(time_s)
        for outcome in timed_out:
            self._end(outcome)
        out, self._out = [*self._out, *due], []
        return out

    def events(self) -> list[Event]:
        """What the operator should know, since the last call."""
        events, self._events = self._events, []
        return events

    def outcomes(self) -> list[CommandOutcome]:
        """Commands that ended since the last call, but for those that the link itself gave."""
        outcomes, self._outcomes = self._outcomes, []
        return outcomes

    def explanation(self, time_s: float) -> str:
        """What the autopilot said in the last seconds, as the reason of its refusal; empty if nothing."""
        return "; ".join(text for said_s, text in self._recent_texts if time_s - said_s <= RECENT_TEXT_S)

    # Within.

    def _say(self, severity: int, text: str) -> None:
        self._events.append(Event(severity, text))

    def _identify(self, autopilot: int, time_s: float) -> None:
        """Choose the behaviour by the heartbeat; a new one, or one after silence, is asked for its messages again."""
        known = next((known for known in BEHAVIOURS.values() if known.autopilot == autopilot), None)
        self._unknown_autopilot = known is None
        if known is None:
            return
        if known is not self.behaviour or self._streams is None:
            self.behaviour = known
            if known is not self._expected:
                self._say(mavlink.MAV_SEVERITY_ERROR, f"this is {known.name}; the scenario says {self._expected.name}")
            self._ask_anew(time_s)

    def _watch(self, time_s: float) -> None:
        """Say when the link comes, and which sensors fail and recover."""
        alive = self.alive(time_s)
        if alive != self._was_heard:
            self._was_heard = alive
            if alive:
                self._ask_anew(time_s)
                self._say(mavlink.MAV_SEVERITY_INFO, f"autopilot heard: {self.behaviour.name}")
        if self.heard.unhealthy != self._unhealthy and self.heard.armed:
            failed = [name for name in self.heard.unhealthy if name not in self._unhealthy]
            recovered = [name for name in self._unhealthy if name not in self.heard.unhealthy]
            if failed:
                self._say(mavlink.MAV_SEVERITY_WARNING, f"autopilot: {', '.join(failed)} unhealthy")
            if recovered:
                self._say(mavlink.MAV_SEVERITY_INFO, f"autopilot: {', '.join(recovered)} healthy again")
        self._unhealthy = self.heard.unhealthy

    def _begin_anew(self, time_s: float) -> None:
        """The autopilot has booted: its clock, its local frame, its message rates are new."""
        self.boots += 1
        self._say(mavlink.MAV_SEVERITY_WARNING, "autopilot rebooted; clock, position and message rates begin anew")
        heartbeat_s, autopilot = self.heard.heartbeat_s, self.heard.autopilot
        self.heard = Telemetry()
        self.heard.heartbeat_s, self.heard.autopilot = heartbeat_s, autopilot
        self.poses = PoseHistory()
        self.motion = MotionWatch()
        self._clock = ClockOffset()
        self._placement.forget()
        self._ask_anew(time_s)

    def _ask_anew(self, time_s: float) -> None:
        """For message rates and parameters: an autopilot that was away may have forgotten or changed them."""
        behaviour = self.behaviour
        self._streams = StreamWatch(behaviour.rates_hz, behaviour.data_streams, time_s)
        self.parameters.forget()
        self.parameters.bytewise = behaviour.integers_bytewise
        self.preflight = Preflight(self.parameters, () if self._needs is None else behaviour.requirements(self._needs))

    def _position_lacks(self, time_s: float) -> str:
        if not self.heard.has_position(time_s):
            return "no position estimate"
        return "its local origin is unknown (GPS_GLOBAL_ORIGIN)" if self._placement.frame is None else ""

    def _parameters_lack(self) -> str:
        if not self.preflight.done:
            return "its parameters are being read"
        if not self.preflight.answered:
            return "it does not answer for its parameters"
        violations = self.preflight.violations()
        if not violations:
            return ""
        more = f" and {len(violations) - 1} more" if len(violations) > 1 else ""
        return f"parameter {violations[0]}{more}; arvi preflight shows and mends them"

    def _tell_findings(self) -> None:
        """Say what is wrong with the parameters when they have been read, and whenever that changes."""
        if not self.preflight.done:
            return
        told = [str(finding) for finding in self.preflight.violations()]
        if told != self._told_findings:
            self._told_findings = told
            for text in told:
                self._say(mavlink.MAV_SEVERITY_ERROR, f"parameter {text}")

    def _remember(
        self,
        message: mavlink.MAVLink_local_position_ned_message | mavlink.MAVLink_attitude_message,
        stamp_s: float,
    ) -> None:
        if isinstance(message, mavlink.MAVLink_attitude_message):
            if self.heard.yaw_rad is not None:
                self.poses.add_yaw(stamp_s, self.heard.yaw_rad)
        elif (position := self.position) is not None:
            self.poses.add_position(stamp_s, position[0], position[1])

    def _read(self, message: mavlink.MAVLink_statustext_message, time_s: float) -> None:
        whole = self._assembler.receive(message)
        if whole is None:
            return
        severity, text = whole[0], whole[1].strip()
        self._say(severity, f"autopilot: {text}")
        if severity <= mavlink.MAV_SEVERITY_WARNING:
            self._recent_texts.append((time_s, text))

    def _seek_origin(self, time_s: float) -> None:
        message = self._placement.seek(self._system_id, COMPONENT, time_s)
        if isinstance(message, mavlink.MAVLink_command_long_message):
            self.commands.request(message, time_s)
        elif message is not None:
            self._out.append(message)

    def _end(self, outcome: CommandOutcome) -> None:
        if outcome.command not in _HOUSEKEEPING:
            self._outcomes.append(outcome)
        elif outcome.command == mavlink.MAV_CMD_SET_MESSAGE_INTERVAL and self._streams is not None:
            self._streams.ended(outcome)
