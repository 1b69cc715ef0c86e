"""What is expected of a team when something goes wrong, as far as a referee can see it.

A reaction is looked for in the record of a flight; what it gives is how long after the fault's beginning it came.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise

from onboard.flight.failsafes import Condition
from onboard.messages import FlightState
from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.reliability.flight import Flight

__all__ = [
    "ANYTHING",
    "CARRIES_ON",
    "COMES_TO_REST",
    "FAILS_SAFE",
    "FLIES_IN_THE_END",
    "GOES_HOME",
    "HOLDS",
    "LANDS_HERE",
    "SAFE_ALONE",
    "STAYS_DOWN",
    "Evidence",
    "Reaction",
    "all_of",
    "disturbance",
    "others_say",
    "reacts_to",
    "says",
    "somebody_says",
    "within",
]

_IN_AIR_M = 0.15
_LAND_MODES = (Px4Mode.LAND, CopterMode.LAND)
_REST_M_S = 0.2


@dataclass(frozen=True, slots=True)
class Evidence:
    """A flight, what happened to whom, and until when it was watched.

    Attributes:
        flight: The record.
        victims: Those whom the fault concerns.
        fault_s: When it began, UNIX time, s.
        end_s: When watching ended and the ground called everybody home, UNIX time, s.
    """

    flight: Flight
    victims: tuple[int, ...]
    fault_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Reaction:
    """Something that is expected.

    Attributes:
        text: For the table.
        seen: When it came after the fault's beginning, s; None if it did not.
    """

    text: str
    seen: Callable[[Evidence], float | None]


def says(pattern: str) -> Reaction:
    """Each victim tells the ground."""

    def seen(evidence: Evidence) -> float | None:
        return _by_all(
            evidence,
            lambda victim: (
                said.time_s
                for said in evidence.flight.said
                if said.system == victim and said.time_s > evidence.fault_s and re.search(pattern, said.text)
            ),
        )

    return Reaction(f'says "{pattern}"', seen)


def others_say(pattern: str) -> Reaction:
    """At least one of those whom the fault does not concern tells the ground."""
    return Reaction(
        f'another says "{pattern}"',
        lambda evidence: _first(evidence, pattern, lambda system: system not in evidence.victims),
    )


def somebody_says(pattern: str) -> Reaction:
    """At least one vehicle tells the ground."""
    return Reaction(f'somebody says "{pattern}"', lambda evidence: _first(evidence, pattern, lambda system: True))


def _first(evidence: Evidence, pattern: str, by: Callable[[int], bool]) -> float | None:
    for said in evidence.flight.said:
        if said.time_s > evidence.fault_s and by(said.system) and re.search(pattern, said.text):
            return said.time_s - evidence.fault_s
    return None


def within(limit_s: float, reaction: Reaction) -> Reaction:
    """A reaction that counts only if it comes in time, for those that have a deadline of their own."""

    def seen(evidence: Evidence) -> float | None:
        time_s = reaction.seen(evidence)
        return time_s if time_s is not None and time_s <= limit_s else None

    return Reaction(f"{reaction.text} within {limit_s:g} s", seen)


def reacts_to(condition: Condition) -> Reaction:
    """Each victim's failsafe ladder reacts, whether or not the ground hears of it."""

    def seen(evidence: Evidence) -> float | None:
        return _by_all(
            evidence,
            lambda victim: (
                told.time_s
                for told in evidence.flight.told
                if told.system == victim and told.time_s > evidence.fault_s and told.condition is condition
            ),
        )

    return Reaction(f"notices: {condition.value}", seen)


def all_of(*reactions: Reaction) -> Reaction:
    """Several reactions; the last one counts."""

    def seen(evidence: Evidence) -> float | None:
        times = [reaction.seen(evidence) for reaction in reactions]
        found = [time for time in times if time is not None]
        return max(found) if len(found) == len(times) else None

    return Reaction(", ".join(reaction.text for reaction in reactions), seen)


def disturbance(evidence: Evidence, vehicle_id: int) -> str:
    """What disturbed a vehicle while it was watched, in words; empty if it did what it was commanded."""
    watched = [s for s in evidence.flight.samples if evidence.fault_s < s.time_s <= evidence.end_s]
    for sample in watched:
        state = sample.states[vehicle_id]
        if state is None or state is FlightState.RELEASED:
            return "its process is gone" if state is None else "it let go of the vehicle"
    for beat in evidence.flight.heartbeats:
        if beat.system == vehicle_id and evidence.fault_s < beat.time_s <= evidence.end_s and beat.failsafe:
            return "its autopilot failed safe"
    if watched:
        last = watched[-1].states[vehicle_id]
        flown = evidence.end_s > evidence.flight.start_s + 2.0
        landing = any(s.states[vehicle_id] in (FlightState.RETURN, FlightState.LAND) for s in watched)
        if flown and not landing and last is not FlightState.TRACK:
            return f"it ended in {last.name if last is not None else 'nothing'} instead of TRACK"
    return ""


def _carries_on(evidence: Evidence) -> float | None:
    return None if any(disturbance(evidence, victim) for victim in evidence.victims) else 0.0


def _flies_in_the_end(evidence: Evidence) -> float | None:
    last = [sample for sample in evidence.flight.samples if sample.time_s <= evidence.end_s][-1]
    return 0.0 if all(last.states[victim] is FlightState.TRACK for victim in evidence.victims) else None


def _stays_down(evidence: Evidence) -> float | None:
    flown = any(
        sample.positions[victim][2] < -_IN_AIR_M for sample in evidence.flight.samples for victim in evidence.victims
    )
    return None if flown else 0.0


def _fails_safe(evidence: Evidence) -> float | None:
    return _by_all(
        evidence,
        lambda victim: (
            beat.time_s
            for beat in evidence.flight.heartbeats
            if beat.system == victim and beat.time_s > evidence.fault_s and beat.failsafe
        ),
    )


def _safe_alone(evidence: Evidence) -> float | None:
    """Each victim stands, lands by itself, or fails safe."""

    def safe_s(victim: int) -> Iterator[float]:
        for beat in evidence.flight.heartbeats:
            safe = beat.failsafe or not beat.armed or beat.mode in _LAND_MODES
            if beat.system == victim and beat.time_s > evidence.fault_s and safe:
                yield beat.time_s

    return _by_all(evidence, safe_s)


def _in_state(*states: FlightState) -> Callable[[Evidence], float | None]:
    def seen(evidence: Evidence) -> float | None:
        return _by_all(
            evidence,
            lambda victim: (
                sample.time_s
                for sample in evidence.flight.samples
                if sample.time_s > evidence.fault_s and sample.states[victim] in states
            ),
        )

    return seen


def _comes_to_rest(evidence: Evidence) -> float | None:
    """Each victim stops over the ground and stays there while it is watched."""
    watched = [s for s in evidence.flight.samples if evidence.fault_s < s.time_s <= evidence.end_s]

    def rests_s(victim: int) -> Iterator[float]:
        since_s = None
        for before, after in pairwise(watched):
            moved_m = math.dist(before.positions[victim][:2], after.positions[victim][:2])
            moves = moved_m > _REST_M_S * (after.time_s - before.time_s)
            since_s = None if moves else since_s or after.time_s
        if since_s is not None:
            yield since_s

    return _by_all(evidence, rests_s)


def _by_all(evidence: Evidence, times: Callable[[int], Iterator[float]]) -> float | None:
    """When the last of the victims did something first."""
    firsts = []
    for victim in evidence.victims:
        first = next(times(victim), None)
        if first is None:
            return None
        firsts.append(first - evidence.fault_s)
    return max(firsts, default=0.0)


CARRIES_ON = Reaction("carries on", _carries_on)
COMES_TO_REST = Reaction("comes to rest", _comes_to_rest)
FLIES_IN_THE_END = Reaction("flies with the others in the end", _flies_in_the_end)
STAYS_DOWN = Reaction("stays on the ground", _stays_down)
FAILS_SAFE = Reaction("autopilot fails safe, ground hears it", _fails_safe)
SAFE_ALONE = Reaction("stands, lands or fails safe by itself, ground hears it", _safe_alone)
HOLDS = Reaction("holds", _in_state(FlightState.HOLD))
GOES_HOME = Reaction("goes home", _in_state(FlightState.RETURN, FlightState.LAND))
LANDS_HERE = Reaction("lands where it is", _in_state(FlightState.LAND))
ANYTHING = Reaction("whatever it does", lambda _: 0.0)
