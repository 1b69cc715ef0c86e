"""One external autopilot, as the bridge meets it on a link of its own, without sockets.

It asks for the messages that tell where the vehicle is, answers TIMESYNC with the time that its own messages are
stamped with, and hands motion capture on. What the autopilot does is the onboard process's affair.
"""

from __future__ import annotations

import math

from onboard.config import Scenario, VehicleConfig
from onboard.config.external import ExternalConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.external.observer import Observer
from sim_bridge.external.sources import GlobalEstimate, HomeFrame, LocalEstimate, MocapPoses, SimulatorTruth, Source
from sim_bridge.mocap.pose import ENCODERS, MocapPose
from sim_bridge.notices import Notice
from sim_bridge.truth import VehicleTruth

__all__ = ["ExternalAutopilot", "build_external"]

COMPONENT = mavlink.MAV_COMP_ID_AUTOPILOT1
RATE_HZ = 100.0
"""At which the pose is asked for."""

_FRESH_S = 0.5
"""A pose older than this is unknown."""
_ENOUGH = 0.6
"""Of the rate, below which it is asked for again."""
_PATIENCE_S = 10.0
_HEARTBEAT_S = 1.0
"""Between the bridge's heartbeats, and between its looks whether all that it needs arrives."""


class ExternalAutopilot:
    """What is known of one external vehicle, and what is sent to its autopilot.

    Args:
        vehicle: Which one.
        source: Where its pose is read from.
        time_s: UNIX time at which the bridge starts, s.

    Attributes:
        vehicle_id: MAVLink system id.
        heard_s: UNIX time of its last heartbeat, s.
    """

    def __init__(self, vehicle: VehicleConfig, source: Source, time_s: float) -> None:
        self.vehicle_id = vehicle.id
        self.heard_s = -math.inf
        self._url = vehicle.external_url
        self._encode = ENCODERS[vehicle.autopilot]
        self._source = source
        self._observer = Observer(vehicle.id)
        self._time_s = time_s
        self._next_s = time_s
        self._started_s = time_s
        self._heard_since_s = math.inf
        self._received = 0
        self._silence_told = False
        self._blindness_told = False
        self._out: list[mavlink.MAVLink_message] = []
        self._notices: list[Notice] = []

    def truth(self) -> VehicleTruth | None:
        """Where the vehicle is now; None while nobody knows."""
        if self._time_s - self._observer.time_s > _FRESH_S:
            return None
        return self._observer.at(self._time_s)

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message that arrived on the bridge's link; what others forwarded to it is not for us."""
        if message.get_srcSystem() != self.vehicle_id or message.get_srcComponent() != COMPONENT:
            return
        match message:
            case mavlink.MAVLink_heartbeat_message():
                if time_s - self.heard_s > _PATIENCE_S:
                    self._heard_since_s = time_s
                self.heard_s = time_s
            case mavlink.MAVLink_timesync_message() if message.tc1 == 0:
                self._out.append(mavlink.MAVLink_timesync_message(round(time_s * 1e9), message.ts1))
            case _:
                reading = self._source.read(message)
                if reading is not None:
                    self._received += 1
                    self._observer.update(time_s, reading)

    def receive_mocap(self, pose: MocapPose) -> None:
        """Hand a pose of motion capture to the autopilot, once it was heard."""
        if self.heard_s > -math.inf:
            self._out.append(self._encode(pose))
        if isinstance(self._source, MocapPoses):
            self._observer.update(pose.time_s, self._source.measure(pose))

    def step(self, time_s: float) -> None:
        """Let time pass."""
        self._time_s = time_s
        if time_s < self._next_s:
            return
        self._next_s = max(self._next_s + _HEARTBEAT_S, time_s)
        received, self._received = self._received, 0
        self._watch(time_s)
        if time_s - self.heard_s > 3.0 * _HEARTBEAT_S:
            return
        self._out.append(
            mavlink.MAVLink_heartbeat_message(
                mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                mavlink.MAV_AUTOPILOT_INVALID,
                0,
                0,
                mavlink.MAV_STATE_ACTIVE,
                3,
            )
        )
        if self._source.wanted and received < _ENOUGH * RATE_HZ * _HEARTBEAT_S:
            for message_id in self._source.wanted:
                self._request(message_id, RATE_HZ)

    def outbox(self) -> list[mavlink.MAVLink_message]:
        """Take out what is to be sent."""
        taken, self._out = self._out, []
        return taken

    def notices(self) -> list[Notice]:
        """Take out what an operator should know."""
        taken, self._notices = self._notices, []
        return taken

    def _watch(self, time_s: float) -> None:
        """Say once what a user has forgotten: to start the autopilot, or to have its simulator tell the truth."""
        name = f"vehicle {self.vehicle_id}"
        silent_s = time_s - max(self.heard_s, self._started_s)
        if silent_s > _PATIENCE_S and not self._silence_told:
            self._silence_told = True
            self._say(mavlink.MAV_SEVERITY_ERROR, f"{name}: no autopilot heard on the bridge's link {self._url}")
        elif self.heard_s > time_s - _PATIENCE_S and self._silence_told:
            self._silence_told = False
            self._say(mavlink.MAV_SEVERITY_NOTICE, f"{name}: autopilot heard on the bridge's link")
        blind = self.truth() is None and time_s - self._heard_since_s > _PATIENCE_S and not self._silence_told
        if blind and not self._blindness_told:
            self._blindness_told = True
            self._say(mavlink.MAV_SEVERITY_ERROR, f"{name}: nobody knows where it is, for {self._source.lacking}")
        elif self.truth() is not None and self._blindness_told:
            self._blindness_told = False
            self._say(mavlink.MAV_SEVERITY_NOTICE, f"{name}: its place is known")

    def _say(self, severity: int, text: str) -> None:
        self._notices.append(Notice(text, severity))

    def _request(self, message_id: int, rate_hz: float) -> None:
        self._out.append(
            mavlink.MAVLink_command_long_message(
                self.vehicle_id,
                COMPONENT,
                mavlink.MAV_CMD_SET_MESSAGE_INTERVAL,
                0,
                message_id,
                1e6 / rate_hz,
                0,
                0,
                0,
                0,
                0,
            )
        )


def build_external(scenario: Scenario, vehicle: VehicleConfig, time_s: float) -> ExternalAutopilot:
    """The external vehicle that a scenario says.

    Args:
        scenario: Says where positions come from.
        vehicle: One of its vehicles, with ``external``.
        time_s: UNIX time at which the bridge starts, s.
    """
    external, origin = vehicle.external or ExternalConfig(), scenario.mission.origin
    indoors = scenario.mission.position_source == "mocap"
    source: Source
    match external.pose:
        case "truth":
            home = HomeFrame(vehicle.home) if indoors else None
            source = SimulatorTruth(vehicle.autopilot, origin, home)
        case "mocap":
            source = MocapPoses()
        case "estimate":
            source = LocalEstimate() if indoors else GlobalEstimate(origin)
    return ExternalAutopilot(vehicle, source, time_s)
