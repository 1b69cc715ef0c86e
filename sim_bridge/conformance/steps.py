"""Performing an entry's steps: sending what they send, and judging what comes back."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.catalogue import Catalogue
from sim_bridge.conformance.dialogue import AUTOPILOT, GROUND, Dialogue, Script, SetpointStream
from sim_bridge.conformance.parameters import ParameterKeeper
from sim_bridge.conformance.step_data import (
    TIME_CLASSES_S,
    Ack,
    Command,
    Expect,
    Ground,
    Keeps,
    Mocap,
    Motion,
    Moves,
    Never,
    Parameter,
    Quiet,
    Rate,
    Ready,
    Send,
    Setpoint,
    Shows,
    Step,
    Text,
    Vehicle,
    Wait,
    Within,
)
from sim_bridge.conformance.values import build_message, command_number, enumerator, mismatch, number

__all__ = ["DifferenceError", "Performance"]

_PATIENCE_S = 2.0
"""How much longer than expected an answer is waited for, to tell a late one from none."""

Judge = Callable[[Any], str | None]
"""How a message of the right kind differs from what is wanted; None if it does not."""

_MOTION_FIELDS = ("vn", "ve", "vd", "north", "east", "down", "at_north", "at_east", "at_down", "yaw", "yaw_rate")


class DifferenceError(Exception):
    """The autopilot did something else than expected; the text says what. No error of the program."""


@dataclass(slots=True)
class Performance:
    """One entry being performed.

    Attributes:
        dialogue: The talk with the autopilot.
        catalogue: For the modes' names.
        keeper: Puts parameters back.
        anchor: Where streamed positions are relative to: north, east, down, m.
        latency_s: What the link itself may add to an answer's time, s.
        start: Where the vehicle was when the entry began: north, east, down, m.
        delays_s: How long the expected answers took, s.
    """

    dialogue: Dialogue
    catalogue: Catalogue
    keeper: ParameterKeeper
    anchor: tuple[float, float, float]
    latency_s: float
    start: tuple[float, float, float] = (0.0, 0.0, 0.0)
    delays_s: list[float] = field(default_factory=list)
    _command: int = 0

    def perform(self, steps: list[Step]) -> Script[None]:
        """All steps, one after the other.

        Raises:
            DifferenceError: At the first expectation that does not hold.
        """
        self.start = self.dialogue.position
        for place, step in enumerate(steps, 1):
            try:
                yield from self._perform(step)
            except DifferenceError as difference:
                raise DifferenceError(f"step {place}: {difference}") from None

    def _perform(self, step: Step) -> Script[None]:  # noqa: PLR0912 - a table of the vocabulary
        dialogue = self.dialogue
        match step:
            case Send(send=name, fields=fields, source=source):
                message = build_message(name, fields, dialogue.system_id, AUTOPILOT)
                dialogue.send(message, GROUND if source == "ground" else None)
            case Command():
                self._send_command(step)
            case Setpoint():
                dialogue.begin_stream(SetpointStream(self._setpoint(step), 1.0 / step.rate_hz, step.count))
                yield from dialogue.sleep(step.for_s)
            case Quiet():
                dialogue.end_stream()
            case Mocap(mocap=capture):
                dialogue.feed_mocap(capture)
            case Wait(wait=duration_s):
                yield from dialogue.sleep(duration_s)
            case Ack():
                yield from self._acknowledged(step)
            case Expect(expect=name, fields=fields, within=within, after=after_s):
                yield from self._expect(name, lambda message: mismatch(message, fields), within, after_s)
            case Never(never=name, fields=fields, for_s=duration_s):
                yield from self._never(name, fields, duration_s)
            case Shows(shows=vehicle, within=within, after=after_s):
                yield from self._expect("HEARTBEAT", lambda message: self._unlike(message, vehicle), within, after_s)
            case Keeps(keeps=vehicle, for_s=duration_s):
                yield from self._keeps(vehicle, duration_s)
            case Moves(moves=motion, over_s=over_s):
                self._moves(motion, over_s)
            case Rate(rate=name, hz=hz, for_s=duration_s):
                yield from self._rate(name, hz, duration_s)
            case Text(text=pattern, within=within):
                yield from self._expect("STATUSTEXT", lambda message: _says(message, pattern), within, 0.0)
            case Ready(ready=ready, within=within):
                yield from self._expect("SYS_STATUS", lambda message: _readiness(message, ready), within, 0.0)
            case Parameter(parameter=values):
                for name, value in values.items():
                    if not (yield from self.keeper.change(name, value)):
                        raise DifferenceError(f"parameter {name}: the autopilot does not take it")
            case Ground():
                dialogue.ground = True
                yield from dialogue.sleep(1.1)

    def _send_command(self, step: Command) -> None:
        system, component = self._target(step.to)
        self._command = command_number(step.command)
        params = [number(value) for value in step.params]
        params += [0.0] * (7 - len(params))
        if step.as_int:
            first, second, third, fourth, x, y, z = params
            message: mavlink.MAVLink_message = mavlink.MAVLink_command_int_message(
                system, component, 0, self._command, 0, 0, first, second, third, fourth, int(x), int(y), z
            )
        else:
            message = mavlink.MAVLink_command_long_message(system, component, self._command, step.confirmation, *params)
        self.dialogue.send(message)

    def _setpoint(self, step: Setpoint) -> mavlink.MAVLink_set_position_target_local_ned_message:
        position = step.position
        if step.frame == mavlink.MAV_FRAME_LOCAL_NED:
            north_m, east_m, down_m = self.anchor
            position = (position[0] + north_m, position[1] + east_m, position[2] + down_m)
        return mavlink.MAVLink_set_position_target_local_ned_message(
            0,
            *self._target(step.to),
            step.frame,
            step.setpoint,
            *position,
            *step.velocity,
            *step.acceleration,
            step.yaw,
            step.yaw_rate,
        )

    def _target(self, target: str) -> tuple[int, int]:
        system, component = target.split("/")
        own = self.dialogue.system_id
        systems = {"own": own, "other": own % 250 + 1, "all": 0}
        return (
            systems[system] if system in systems else int(system),
            0 if component == "all" else int(component),
        )

    def _acknowledged(self, step: Ack) -> Script[None]:
        command = self._command if step.of is None else command_number(step.of)
        results = [step.ack] if isinstance(step.ack, str) else step.ack

        def unlike(message: Any) -> str | None:
            if message.command != command:
                return f"it is for command {message.command}"
            result = enumerator(type(message), "result", message.result)
            if result not in results:
                return f"{result}, {' or '.join(results)} expected"
            if message.target_system not in (0, self.dialogue.system_id):
                return f"it is addressed to system {message.target_system}"
            return None

        yield from self._expect("COMMAND_ACK", unlike, step.within, 0.0)

    def _expect(self, name: str, unlike: Judge, within: Within, after_s: float) -> Script[None]:
        """Wait for a message that is not unlike what is wanted."""
        dialogue = self.dialogue
        limit_s = (TIME_CLASSES_S[within] if isinstance(within, str) else within) + self.latency_s

        def wanted(message: mavlink.MAVLink_message) -> bool:
            return message.get_type() == name and unlike(message) is None

        remaining_s = dialogue.sent_s + limit_s + _PATIENCE_S - dialogue.time_s
        lookout = dialogue.look_for(wanted)
        yield from dialogue.wait(lookout, max(remaining_s, 0.0))
        found = lookout.found
        if found is None:
            raise DifferenceError(self._instead(name, unlike, limit_s))
        delay_s = found.time_s - dialogue.sent_s
        if delay_s < after_s:
            raise DifferenceError(
                f"{name} as expected, but already after {delay_s:.2f} s instead of {after_s:g} s or more"
            )
        if delay_s > limit_s:
            raise DifferenceError(f"{name} as expected, but only after {delay_s:.2f} s instead of {limit_s:g} s")
        self.delays_s.append(delay_s)

    def _instead(self, name: str, unlike: Judge, limit_s: float) -> str:
        came = [heard for heard in self.dialogue.heard[self.dialogue.sent_at :] if heard.message.get_type() == name]
        if not came:
            return f"no {name} within {limit_s + _PATIENCE_S:g} s"
        return f"{name}: {unlike(came[-1].message)}"

    def _never(self, name: str, fields: dict[str, Any], duration_s: float) -> Script[None]:
        dialogue = self.dialogue

        def unwanted(message: mavlink.MAVLink_message) -> bool:
            return message.get_type() == name and mismatch(message, fields) is None

        lookout = dialogue.look_for(unwanted)
        yield from dialogue.wait(lookout, duration_s)
        found = lookout.found
        if found is not None:
            raise DifferenceError(f"{name} after {found.time_s - dialogue.sent_s:.2f} s, none expected")

    def _keeps(self, vehicle: Vehicle, duration_s: float) -> Script[None]:
        dialogue = self.dialogue
        begin = len(dialogue.heard)
        yield from dialogue.sleep(duration_s)
        beats = [heard for heard in dialogue.heard[begin:] if heard.message.get_type() == "HEARTBEAT"]
        if not beats:
            raise DifferenceError(f"no HEARTBEAT in {duration_s:g} s")
        for beat in beats:
            unlike = self._unlike(beat.message, vehicle)
            if unlike is not None:
                raise DifferenceError(f"HEARTBEAT: {unlike}")

    def _unlike(self, message: Any, vehicle: Vehicle) -> str | None:
        if vehicle.mode is not None and message.custom_mode != self.catalogue.modes[vehicle.mode]:
            return f"mode {self.catalogue.mode_name(message.custom_mode)}, {vehicle.mode} expected"
        armed = bool(message.base_mode & mavlink.MAV_MODE_FLAG_SAFETY_ARMED)
        if vehicle.armed is not None and armed != vehicle.armed:
            return "armed, disarmed expected" if armed else "disarmed, armed expected"
        if vehicle.base_mode is not None and message.base_mode != vehicle.base_mode:
            return f"base_mode {message.base_mode}, {vehicle.base_mode} expected"
        if vehicle.status is not None and message.system_status != vehicle.status:
            return f"system_status {message.system_status}, {vehicle.status} expected"
        return None

    def _moves(self, motion: Motion, over_s: float) -> None:
        mean = self.dialogue.mean(over_s)
        if mean is None:
            raise DifferenceError("no LOCAL_POSITION_NED lately")
        position, velocity, yaw_rad, yaw_rate_rad_s = mean
        moved = [now - then for now, then in zip(position, self.start, strict=True)]
        place = [now - there for now, there in zip(position, self.anchor, strict=True)]
        values = (*velocity, *moved, *place, yaw_rad, yaw_rate_rad_s)
        actual = dict(zip(_MOTION_FIELDS, values, strict=True))
        for name, wanted in motion:
            if wanted is None:
                continue
            value, (low, high) = actual[name], wanted
            if name == "yaw":  # 3.2 is -3.08
                middle = 0.5 * (low + high)
                value = middle + (value - middle + math.pi) % math.tau - math.pi
            if not low <= value <= high:
                raise DifferenceError(f"{name} is {value:.2f}, {low:g} to {high:g} expected")

    def _rate(self, name: str, hz: tuple[float, float], duration_s: float) -> Script[None]:
        dialogue = self.dialogue
        begin = len(dialogue.heard)
        yield from dialogue.sleep(duration_s)
        count = sum(heard.message.get_type() == name for heard in dialogue.heard[begin:])
        if not hz[0] <= count / duration_s <= hz[1]:
            raise DifferenceError(
                f"{name} came {count / duration_s:.1f} times a second, {hz[0]:g} to {hz[1]:g} expected"
            )


def _says(message: Any, pattern: str) -> str | None:
    return None if re.search(pattern, message.text) else f"{message.text!r}, {pattern!r} expected"


def _readiness(message: Any, ready: bool) -> str | None:
    is_ready = bool(message.onboard_control_sensors_health & mavlink.MAV_SYS_STATUS_PREARM_CHECK)
    return None if is_ready == ready else f"the pre-arm bit is {is_ready}, {ready} expected"
