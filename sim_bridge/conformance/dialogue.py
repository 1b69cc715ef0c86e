"""The talk with one autopilot: what was heard, what is to be sent, and waiting for the one after the other.

Scripts are generators: they yield a :class:`Wait` and are resumed when its condition holds (True) or its time is over
(False). So a script reads as a sequence, and neither sleeps nor owns a socket.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Generator
from dataclasses import dataclass, field
from typing import TypeVar

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.mocap_feed import MocapFeed
from sim_bridge.conformance.step_data import Capture

__all__ = [
    "COMPANION",
    "GROUND",
    "Dialogue",
    "Heard",
    "Outgoing",
    "Script",
    "SetpointStream",
    "Wait",
]

AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
COMPANION = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
GROUND = (255, mavlink.MAV_COMP_ID_MISSIONPLANNER)

_HEARTBEAT_S = 1.0
_MOTION_MEMORY_S = 5.0
_READINESS_S = 1.1
"""ArduPilot makes its checks anew once a second."""

_PREARM = mavlink.MAV_SYS_STATUS_PREARM_CHECK
_NAN3 = (math.nan, math.nan, math.nan)


@dataclass(frozen=True, slots=True)
class Outgoing:
    """A message to send.

    Attributes:
        message: What.
        source: System and component that it comes from.
    """

    message: mavlink.MAVLink_message
    source: tuple[int, int]


@dataclass(frozen=True, slots=True)
class Heard:
    """A message of the autopilot.

    Attributes:
        time_s: When it arrived, s.
        message: What.
    """

    time_s: float
    message: mavlink.MAVLink_message


@dataclass(frozen=True, slots=True)
class Wait:
    """What a script waits for.

    Attributes:
        until_s: When it gives up, s.
        condition: What it waits for.
    """

    until_s: float
    condition: Callable[[], bool] = lambda: False


Vector = tuple[float, float, float]
"""North, east, down."""

T = TypeVar("T")
Script = Generator[Wait, bool, T]
"""A sequence of sending and waiting that ends with a value."""


@dataclass(slots=True)
class SetpointStream:
    """A setpoint that is sent again and again.

    Attributes:
        message: The setpoint.
        interval_s: How often, s.
        remaining: How many more; None for no end.
    """

    message: mavlink.MAVLink_set_position_target_local_ned_message
    interval_s: float
    remaining: int | None = None
    next_s: float = -math.inf


@dataclass(frozen=True, slots=True)
class _Sample:
    time_s: float
    position: Vector
    velocity: Vector
    yaw_rad: float
    yaw_rate_rad_s: float


@dataclass(slots=True)
class Lookout:
    """A condition that a wanted message has come; looks at each message once.

    Attributes:
        found: The first that was wanted.
    """

    _heard: list[Heard]
    _place: int
    _earliest_s: float
    _wanted: Callable[[mavlink.MAVLink_message], bool]
    found: Heard | None = None

    def __call__(self) -> bool:
        """Whether it has come."""
        while self.found is None and self._place < len(self._heard):
            heard = self._heard[self._place]
            self._place += 1
            if heard.time_s >= self._earliest_s and self._wanted(heard.message):
                self.found = heard
        return self.found is not None


@dataclass(slots=True)
class Dialogue:
    """Both directions of one link.

    Attributes:
        system_id: The vehicle's system id; 0 until its heartbeat was heard.
        time_s: Now, s.
        heard: All messages of the autopilot since the last :meth:`forget`.
        sent_s: When something was last sent on purpose (heartbeats aside), s.
        sent_at: How many messages had been heard then.
        stream: The setpoint that is being streamed.
        feed: Motion capture for a vehicle without GPS.
        ground: Whether heartbeats of a ground station are sent, too.
        heartbeat: The autopilot's last heartbeat.
        landed: From EXTENDED_SYS_STATE; None before the first.
        said: The autopilot's last warning, from STATUSTEXT.
        release: Major and minor version, from AUTOPILOT_VERSION; None before the first.
        last_s: When a message of each id last came, s.
        heartbeat_s: When that came, s.
    """

    system_id: int = 0
    time_s: float = -math.inf
    heard: list[Heard] = field(default_factory=list)
    sent_s: float = -math.inf
    sent_at: int = 0
    stream: SetpointStream | None = None
    feed: MocapFeed | None = None
    ground: bool = False
    heartbeat: mavlink.MAVLink_heartbeat_message | None = None
    heartbeat_s: float = -math.inf
    landed: bool | None = None
    said: str = ""
    release: tuple[int, int] | None = None
    last_s: dict[int, float] = field(default_factory=dict)
    _healthy: bool | None = None
    _healthy_s: float = -math.inf
    _mode_since_s: float = -math.inf
    _streamed: tuple[float, int] = (-math.inf, 0)
    _out: list[Outgoing] = field(default_factory=list)
    _samples: deque[_Sample] = field(default_factory=deque)
    _next_heartbeat_s: float = -math.inf
    _yaw: tuple[float, float] = (math.nan, math.nan)

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message; those of other systems and components are not for us."""
        self.time_s = time_s
        if message.get_srcComponent() != AUTOPILOT:
            return
        if self.system_id == 0:
            if not isinstance(message, mavlink.MAVLink_heartbeat_message):
                return
            self.system_id = message.get_srcSystem()
        if message.get_srcSystem() != self.system_id:
            return
        self.heard.append(Heard(time_s, message))
        self.last_s[message.get_msgId()] = time_s
        if self.feed is not None:
            self.feed.receive(message, time_s)
        self._learn(message)

    def _learn(self, message: mavlink.MAVLink_message) -> None:
        """What a message tells of the vehicle."""
        time_s = self.time_s
        match message:
            case mavlink.MAVLink_heartbeat_message():
                if message.custom_mode != self.custom_mode:
                    self._mode_since_s = time_s
                self.heartbeat, self.heartbeat_s = message, time_s
            case mavlink.MAVLink_sys_status_message():
                self._healthy = bool(message.onboard_control_sensors_health & _PREARM)
                self._healthy_s = time_s
            case mavlink.MAVLink_statustext_message() if message.severity <= mavlink.MAV_SEVERITY_WARNING:
                self.said = message.text
            case mavlink.MAVLink_extended_sys_state_message():
                self.landed = message.landed_state == mavlink.MAV_LANDED_STATE_ON_GROUND
            case mavlink.MAVLink_attitude_message():
                self._yaw = (message.yaw, message.yawspeed)
            case mavlink.MAVLink_autopilot_version_message():
                self.release = (message.flight_sw_version >> 24 & 0xFF, message.flight_sw_version >> 16 & 0xFF)
            case mavlink.MAVLink_local_position_ned_message():
                self._remember(message)
            case mavlink.MAVLink_timesync_message() if message.tc1 == 0:
                self._out.append(
                    Outgoing(mavlink.MAVLink_timesync_message(round(time_s * 1e9), message.ts1), self.companion)
                )

    def tick(self, time_s: float) -> None:
        """Send what is due: heartbeats, the stream."""
        self.time_s = time_s
        if time_s >= self._next_heartbeat_s and self.system_id:
            self._next_heartbeat_s = time_s + _HEARTBEAT_S
            self._beat(mavlink.MAV_TYPE_ONBOARD_CONTROLLER, self.companion)
            if self.ground:
                self._beat(mavlink.MAV_TYPE_GCS, GROUND)
        if self.feed is not None:
            self._out += [Outgoing(message, self.companion) for message in self.feed.due(time_s)]
        stream = self.stream
        if stream is not None and time_s >= stream.next_s:
            late = time_s - stream.next_s > stream.interval_s
            stream.next_s = time_s + stream.interval_s if late else stream.next_s + stream.interval_s
            self._out.append(Outgoing(stream.message, self.companion))
            self._streamed = (time_s, len(self.heard))
            if stream.remaining is not None:
                stream.remaining -= 1
                if stream.remaining <= 0:
                    self.stream = None

    @property
    def companion(self) -> tuple[int, int]:
        """System and component that a companion of this vehicle sends from."""
        return self.system_id, COMPANION

    @property
    def armed(self) -> bool:
        """From the last heartbeat."""
        return self.heartbeat is not None and bool(self.heartbeat.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)

    @property
    def custom_mode(self) -> int | None:
        """From the last heartbeat."""
        return None if self.heartbeat is None else self.heartbeat.custom_mode

    @property
    def ready(self) -> bool | None:
        """SYS_STATUS's pre-arm health bit; None before the first, and until it can be about the present mode."""
        return self._healthy if self._healthy_s >= self._mode_since_s + _READINESS_S else None

    @property
    def position(self) -> Vector:
        """North, east, down, m; NaN before the first."""
        return self._samples[-1].position if self._samples else _NAN3

    @property
    def yaw_rad(self) -> float:
        """Heading, rad; NaN before the first."""
        return self._yaw[0]

    def mean(self, over_s: float) -> tuple[Vector, Vector, float, float] | None:
        """Position m, velocity m/s, yaw rad (the last) and yaw rate rad/s over the last while; None if unknown."""
        recent = [sample for sample in self._samples if sample.time_s >= self.time_s - over_s]
        if not recent:
            return None
        count = len(recent)

        def average(part: Callable[[_Sample], Vector]) -> Vector:
            sums = [sum(part(sample)[axis] for sample in recent) for axis in range(3)]
            return sums[0] / count, sums[1] / count, sums[2] / count

        rate = sum(sample.yaw_rate_rad_s for sample in recent) / count
        return average(lambda s: s.position), average(lambda s: s.velocity), recent[-1].yaw_rad, rate

    def send(self, message: mavlink.MAVLink_message, source: tuple[int, int] | None = None) -> None:
        """Send something on purpose; times of what is expected count from here."""
        self._out.append(Outgoing(message, self.companion if source is None else source))
        self._mark(self.time_s, len(self.heard))

    def begin_stream(self, stream: SetpointStream) -> None:
        """Send the first setpoint of a stream now, and the others when they are due."""
        self.stream = stream
        self._mark(self.time_s, len(self.heard))
        self.tick(self.time_s)

    def feed_mocap(self, capture: Capture | None) -> None:
        """Send this motion capture from now on, or none; times of what is expected count from here."""
        if self.feed is not None:
            self.feed.capture = capture
            self._mark(self.time_s, len(self.heard))

    def end_stream(self) -> None:
        """Stop streaming; times of what is expected count from the last setpoint."""
        self.stream = None
        if self._streamed[0] > self.sent_s:
            self._mark(*self._streamed)

    def command(self, command: int, *params: float) -> None:
        """Send COMMAND_LONG to the autopilot."""
        filled = [*params, *[0.0] * (7 - len(params))]
        self.send(mavlink.MAVLink_command_long_message(self.system_id, AUTOPILOT, command, 0, *filled))

    def outbox(self) -> list[Outgoing]:
        """Take what is to be sent, in order."""
        out, self._out = self._out, []
        return out

    def forget(self) -> None:
        """A new entry begins: what was heard before is no answer to it."""
        self.heard.clear()
        self._mark(self.time_s, 0)
        self._streamed = (-math.inf, 0)

    def look_for(self, wanted: Callable[[mavlink.MAVLink_message], bool], after_s: float = 0.0) -> Lookout:
        """A lookout for the first wanted message after what was sent last, that came not before a time after that."""
        return Lookout(self.heard, self.sent_at, self.sent_s + after_s, wanted)

    def wait(self, condition: Callable[[], bool], within_s: float) -> Script[bool]:
        """Wait until a condition holds; whether it does."""
        return (yield Wait(self.time_s + within_s, condition))

    def sleep(self, duration_s: float) -> Script[None]:
        """Let time pass."""
        yield Wait(self.time_s + duration_s)

    def answered(self, command: int, within_s: float) -> Script[int | None]:
        """Wait for the COMMAND_ACK of a command that was sent just now; its MAV_RESULT, None if there is none."""

        def acknowledges(message: mavlink.MAVLink_message) -> bool:
            return isinstance(message, mavlink.MAVLink_command_ack_message) and message.command == command

        lookout = self.look_for(acknowledges)
        yield from self.wait(lookout, within_s)
        ack = None if lookout.found is None else lookout.found.message
        return ack.result if isinstance(ack, mavlink.MAVLink_command_ack_message) else None

    def _mark(self, sent_s: float, sent_at: int) -> None:
        self.sent_s, self.sent_at = sent_s, sent_at

    def _remember(self, message: mavlink.MAVLink_local_position_ned_message) -> None:
        sample = _Sample(
            self.time_s, (message.x, message.y, message.z), (message.vx, message.vy, message.vz), *self._yaw
        )
        self._samples.append(sample)
        while self._samples[0].time_s < self.time_s - _MOTION_MEMORY_S:
            self._samples.popleft()

    def _beat(self, kind: int, source: tuple[int, int]) -> None:
        active = mavlink.MAV_STATE_ACTIVE
        message = mavlink.MAVLink_heartbeat_message(kind, mavlink.MAV_AUTOPILOT_INVALID, 0, 0, active, 3)
        self._out.append(Outgoing(message, source))
