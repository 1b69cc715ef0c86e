"""Bringing a vehicle into the state that an entry presupposes, from whatever state it is in.

What differs between the families is the order of mode, arming and takeoff, and how a place is held: see
:class:`Px4Pilot` and :class:`ArduPilotPilot`.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.catalogue import Family, State
from sim_bridge.conformance.dialogue import AUTOPILOT, Dialogue, Script, SetpointStream
from sim_bridge.conformance.mocap_feed import truth_message
from sim_bridge.conformance.step_data import Capture

__all__ = ["TAKEOFF_HEIGHT_M", "Pilot", "StateNotReachedError", "make_pilot"]

TAKEOFF_HEIGHT_M = 3.0

_READY_S = 120.0
_READY_AGAIN_S = 5.0
"""For an autopilot that did not get ready the last time."""

_ARM_S = 15.0
_LAND_S = 60.0
_TAKEOFF_S = 40.0
_HOLD_S = 25.0
_HEARTBEAT_S = 2.5
_ACK_S = 2.0
_STALE_S = 1.0
_SETTLE_S = 1.2
_ORIGIN_S = 5.0
_SOMEWHERE = (473977420, 85455940, 0)
"""Latitude and longitude, 1e-7 deg, altitude, mm: without GPS, PX4 moves its local height by any other one than 0 when
motion capture comes back after a silence, and climbs away."""

_TRUTH_HZ = 50.0
_HOLD_YAW_RAD = 0.3
_POSITION_AND_YAW = 0x9F8
_ACCEPTED = mavlink.MAV_RESULT_ACCEPTED


class StateNotReachedError(Exception):
    """The vehicle does not get into a state; the text says what it did not do. No error of the program."""


@dataclass(slots=True)
class Pilot:
    """Flies the vehicle between the entries.

    Attributes:
        dialogue: The talk with the autopilot.
        base_mode: Mode to be in on the ground and in the air between entries: custom_mode.
        land_mode: The mode in which it lands: custom_mode.
        anchor: Where it holds when it streams setpoints: north, east, down, m; from its first takeoff.
    """

    dialogue: Dialogue
    base_mode: int
    land_mode: int
    anchor: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _anchored: bool = False
    _patience_s: float = _READY_S
    _origin_told: bool = False

    def reach(self, state: State) -> Script[None]:
        """Get into a state.

        Raises:
            StateNotReachedError: It does not get there.
        """
        if state is not State.STREAMING:
            self.dialogue.end_stream()
        if state is State.CONNECTED:
            return
        yield from self._ask_for_messages()
        if state is State.UNREADY:
            if not self.dialogue.armed and self.dialogue.custom_mode != self.base_mode:
                yield from self._set_mode(self.base_mode)
                yield from self.dialogue.sleep(_SETTLE_S)
            yield from self.dialogue.wait(lambda: self.dialogue.ready is not None, _HEARTBEAT_S)
            if self.dialogue.ready or self.dialogue.armed:
                raise StateNotReachedError("it is ready already; start the autopilot anew to see this")
            return
        if self.dialogue.feed is not None:
            self.dialogue.feed.capture = Capture()
        if state in (State.READY, State.ARMED):
            yield from self._ground()
            if state is State.ARMED:
                yield from self._arm()
            return
        yield from self._air()
        if state is State.STREAMING:
            yield from self._hold()

    def clean_up(self) -> Script[None]:
        """Land and disarm.

        Raises:
            StateNotReachedError: It does not land.
        """
        self.dialogue.end_stream()
        if self.dialogue.system_id and self.dialogue.armed:
            yield from self._down()

    # What the families do differently.

    _RATES_HZ: ClassVar[Mapping[int, float]] = {}
    """What has to be asked for, since it is not sent by itself."""

    _HOLD: ClassVar[tuple[float, float]]
    """How near to a place, m, and how slow, m/s, it is held: what the recorded vehicle managed."""

    def _set_mode(self, custom_mode: int) -> Script[bool]:
        raise NotImplementedError

    def _take_off(self) -> Script[None]:
        raise NotImplementedError

    def _stream_accepted(self) -> Script[bool]:
        """Have the setpoints that are being streamed followed."""
        raise NotImplementedError

    # What they have in common.

    def _ask_for_messages(self) -> Script[None]:
        """Ask for what is needed and does not come, be it that an entry turned it off."""
        dialogue = self.dialogue
        if dialogue.release is None:
            yield from self._accepted(mavlink.MAV_CMD_REQUEST_MESSAGE, mavlink.MAVLINK_MSG_ID_AUTOPILOT_VERSION)
            yield from dialogue.wait(lambda: dialogue.release is not None, _ACK_S)
        rates_hz = dict(self._RATES_HZ)
        if dialogue.feed is not None:
            rates_hz[truth_message(dialogue.feed.family)] = _TRUTH_HZ
        for message_id, rate_hz in rates_hz.items():
            if dialogue.time_s - dialogue.last_s.get(message_id, -math.inf) > _STALE_S:
                yield from self._accepted(mavlink.MAV_CMD_SET_MESSAGE_INTERVAL, message_id, 1e6 / rate_hz)
        yield from dialogue.wait(lambda: dialogue.ready is not None, _HEARTBEAT_S)

    def _accepted(self, command: int, *params: float) -> Script[bool]:
        self.dialogue.command(command, *params)
        return (yield from self.dialogue.answered(command, _ACK_S)) == _ACCEPTED

    def _shows(self, custom_mode: int, *, armed: bool) -> bool:
        return self.dialogue.custom_mode == custom_mode and self.dialogue.armed == armed

    def _ground(self) -> Script[None]:
        dialogue = self.dialogue
        if dialogue.armed:
            yield from self._down()
        give_up_s = dialogue.time_s + self._patience_s
        while not dialogue.ready or not self._shows(self.base_mode, armed=False):
            if dialogue.time_s >= give_up_s:
                said = f"; it said: {dialogue.said}" if dialogue.said else ""
                patience_s, self._patience_s = self._patience_s, _READY_AGAIN_S
                raise StateNotReachedError(f"not ready to arm within {patience_s:g} s{said}")
            if dialogue.custom_mode != self.base_mode:
                yield from self._set_mode(self.base_mode)
                yield from dialogue.sleep(_SETTLE_S)  # what is ready depends on the mode
            elif dialogue.feed is not None and not self._origin_told:
                yield from self._tell_origin()
            else:
                yield from dialogue.wait(lambda: bool(dialogue.ready), _SETTLE_S)
        self._patience_s = _READY_S

    def _tell_origin(self) -> Script[None]:
        """Without GPS the autopilot does not know where on Earth its frame is, and some modes want to."""
        dialogue = self.dialogue
        yield from dialogue.sleep(_ORIGIN_S)  # first its estimator takes to the motion capture
        latitude, longitude, altitude_mm = _SOMEWHERE
        dialogue.send(
            mavlink.MAVLink_set_gps_global_origin_message(dialogue.system_id, latitude, longitude, altitude_mm)
        )
        kind = mavlink.MAVLINK_MSG_ID_GPS_GLOBAL_ORIGIN
        answer = dialogue.look_for(lambda message: message.get_msgId() == kind)
        self._origin_told = yield from dialogue.wait(answer, _ACK_S)

    def _down(self) -> Script[None]:
        dialogue = self.dialogue
        disarm = mavlink.MAV_CMD_COMPONENT_ARM_DISARM
        if dialogue.landed and (yield from self._accepted(disarm, 0.0)):
            yield from dialogue.wait(lambda: not dialogue.armed, _HEARTBEAT_S)
            return
        yield from self._set_mode(self.land_mode)
        yield from dialogue.wait(lambda: not dialogue.armed or bool(dialogue.landed), _LAND_S)
        if dialogue.armed:
            yield from dialogue.wait(lambda: not dialogue.armed, 5.0)
        if dialogue.armed:
            yield from self._accepted(disarm, 0.0)
            yield from dialogue.wait(lambda: not dialogue.armed, _HEARTBEAT_S)
        if dialogue.armed:
            raise StateNotReachedError(f"not landed and disarmed within {_LAND_S:g} s")

    def _arm(self) -> Script[None]:
        dialogue = self.dialogue
        give_up_s = dialogue.time_s + _ARM_S
        while not (yield from self._accepted(mavlink.MAV_CMD_COMPONENT_ARM_DISARM, 1.0)):
            if dialogue.time_s >= give_up_s:
                said = f"; it said: {dialogue.said}" if dialogue.said else ""
                raise StateNotReachedError(f"arming is refused for {_ARM_S:g} s{said}")
            # It told so a while ago; an estimate may be unsteady for seconds after a change of its source.
            yield from dialogue.sleep(_SETTLE_S)
        if not (yield from dialogue.wait(lambda: dialogue.armed, _HEARTBEAT_S)):
            raise StateNotReachedError("it says that it arms, but its heartbeat does not show it")

    def _air(self) -> Script[None]:
        dialogue = self.dialogue
        if not dialogue.armed or dialogue.landed:
            yield from self._ground()
            yield from self._arm()
            if not self._anchored:
                north_m, east_m, down_m = dialogue.position
                self.anchor = (north_m, east_m, down_m - TAKEOFF_HEIGHT_M)
                self._anchored = True
            yield from self._take_off()
        elif dialogue.custom_mode != self.base_mode:
            yield from self._set_mode(self.base_mode)
            if not (yield from dialogue.wait(lambda: self._shows(self.base_mode, armed=True), _HEARTBEAT_S)):
                raise StateNotReachedError("it does not hold its place in the air")

    def _hold(self) -> Script[None]:
        dialogue = self.dialogue
        hold = mavlink.MAVLink_set_position_target_local_ned_message(
            0, dialogue.system_id, AUTOPILOT, 1, _POSITION_AND_YAW, *self.anchor, *[0.0] * 8
        )
        dialogue.begin_stream(SetpointStream(hold, 0.05))
        yield from dialogue.sleep(0.2)
        if not (yield from self._stream_accepted()):
            raise StateNotReachedError("it does not follow setpoints")
        if not (yield from dialogue.wait(self._is_held, _HOLD_S)):
            raise StateNotReachedError(f"it does not hold its place within {_HOLD_S:g} s")

    def _is_held(self) -> bool:
        mean = self.dialogue.mean(0.6)
        if mean is None:
            return False
        position, velocity, yaw_rad, _ = mean
        radius_m, speed_m_s = self._HOLD
        near = math.dist(position, self.anchor) < radius_m
        return near and math.hypot(*velocity) < speed_m_s and abs(yaw_rad) < _HOLD_YAW_RAD


class Px4Pilot(Pilot):
    """Arm in LOITER, take off with NAV_TAKEOFF, which ends in LOITER; setpoints first, then OFFBOARD."""

    __slots__ = ()

    _HOLD = (0.6, 0.35)
    _OFFBOARD = 6 << 16
    _TAKEOFF = 4 << 16 | 2 << 24

    def _set_mode(self, custom_mode: int) -> Script[bool]:
        main, sub = custom_mode >> 16 & 0xFF, custom_mode >> 24 & 0xFF
        return (yield from self._accepted(mavlink.MAV_CMD_DO_SET_MODE, 1, main, sub))

    def _take_off(self) -> Script[None]:
        dialogue = self.dialogue
        nan = math.nan
        if not (yield from self._accepted(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, nan, nan, nan, nan)):
            raise StateNotReachedError("takeoff is refused")
        yield from dialogue.wait(lambda: self._shows(self._TAKEOFF, armed=True), _HEARTBEAT_S)
        held = yield from dialogue.wait(
            lambda: not dialogue.landed and self._shows(self.base_mode, armed=True), _TAKEOFF_S
        )
        if not held:
            raise StateNotReachedError(f"the takeoff does not end in hold within {_TAKEOFF_S:g} s")

    def _stream_accepted(self) -> Script[bool]:
        if self.dialogue.custom_mode == self._OFFBOARD:
            return True
        yield from self._set_mode(self._OFFBOARD)
        return (yield from self.dialogue.wait(lambda: self._shows(self._OFFBOARD, armed=True), _HEARTBEAT_S))


class ArduPilotPilot(Pilot):
    """GUIDED first, then arm, then NAV_TAKEOFF, which any setpoint would cancel; GUIDED follows setpoints."""

    __slots__ = ()

    _HOLD = (0.2, 0.1)
    _RATES_HZ = {  # noqa: RUF012 - typed where it is declared
        mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED: 25.0,
        mavlink.MAVLINK_MSG_ID_ATTITUDE: 25.0,
        mavlink.MAVLINK_MSG_ID_POSITION_TARGET_LOCAL_NED: 25.0,
        mavlink.MAVLINK_MSG_ID_SYS_STATUS: 5.0,
        mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE: 5.0,
    }

    def _set_mode(self, custom_mode: int) -> Script[bool]:
        return (yield from self._accepted(mavlink.MAV_CMD_DO_SET_MODE, 1, custom_mode))

    def _take_off(self) -> Script[None]:
        dialogue = self.dialogue
        target_m = dialogue.position[2] - TAKEOFF_HEIGHT_M  # above home, which is where it was armed
        if not (yield from self._accepted(mavlink.MAV_CMD_NAV_TAKEOFF, 0, 0, 0, 0, 0, 0, TAKEOFF_HEIGHT_M)):
            raise StateNotReachedError("takeoff is refused")
        if not (yield from dialogue.wait(lambda: abs(dialogue.position[2] - target_m) < 0.15, _TAKEOFF_S)):
            raise StateNotReachedError(f"the takeoff does not end within {_TAKEOFF_S:g} s")
        yield from dialogue.sleep(1.5)

    def _stream_accepted(self) -> Script[bool]:
        return True
        yield  # a script, as for the other family


def make_pilot(family: Family, dialogue: Dialogue, modes: dict[str, int]) -> Pilot:
    """The pilot of a family."""
    if family is Family.PX4:
        return Px4Pilot(dialogue, modes["LOITER"], modes["LAND"])
    return ArduPilotPilot(dialogue, modes["GUIDED"], modes["LAND"])
