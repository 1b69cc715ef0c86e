"""A whole run over a catalogue: messages and time in, messages and results out.

The same session runs in virtual time against a simulated autopilot and over a socket against a live one.
"""

from __future__ import annotations

import fnmatch
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.catalogue import Catalogue, Entry, Family, Link, Position, State
from sim_bridge.conformance.dialogue import Dialogue, Outgoing, Script, Wait
from sim_bridge.conformance.mocap_feed import MocapFeed
from sim_bridge.conformance.parameters import ParameterKeeper
from sim_bridge.conformance.pilot import StateNotReachedError, make_pilot
from sim_bridge.conformance.steps import DifferenceError, Performance

__all__ = ["Outcome", "Plan", "Result", "Session", "family_of", "select"]

_FIRST_HEARTBEAT_S = 30.0
_HEARTBEAT_LOST_S = 4.0
_SILENCE_S = 10.0
_AUTOPILOTS = {mavlink.MAV_AUTOPILOT_PX4: Family.PX4, mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA: Family.ARDUPILOT}


class Outcome(StrEnum):
    """What became of an entry."""

    HOLDS = "holds"
    DIFFERS = "differs"
    SKIPPED = "skipped"


@dataclass(frozen=True, slots=True)
class Result:
    """What became of an entry, and why.

    Attributes:
        entry: The entry.
        outcome: Whether it holds.
        reason: Why not; empty if it holds.
        slowest_s: The longest time that an expected answer took, s; None if none was expected.
    """

    entry: Entry
    outcome: Outcome
    reason: str = ""
    slowest_s: float | None = None


@dataclass(frozen=True, slots=True)
class Plan:
    """Which entries to perform.

    Attributes:
        link: Which of the autopilot's links is spoken to.
        position: Where the vehicle's position comes from; of a vehicle without GPS its simulator has to tell the truth.
        only: Patterns of ids (as of a shell); none for all.
        fly: Whether motors may run.
        dangerous: Whether entries that crash an autopilot may be performed.
        latency_s: What the link may add to the answers' times, s.
    """

    link: Link = Link.ONBOARD
    position: Position = Position.GPS
    only: tuple[str, ...] = ()
    fly: bool = False
    dangerous: bool = False
    latency_s: float = 0.0


def family_of(heartbeat: mavlink.MAVLink_heartbeat_message) -> Family | None:
    """The family of an autopilot; None for one that has no catalogue."""
    return _AUTOPILOTS.get(heartbeat.autopilot)


def select(catalogue: Catalogue, plan: Plan) -> list[tuple[Entry, str]]:
    """The entries that the patterns name, in the order in which they are performed, each with why it is not, if so."""
    states = list(State)
    chosen = [entry for entry in catalogue.entries if entry.position is plan.position and entry.link is plan.link]
    chosen = [entry for entry in chosen if not plan.only or _matches(entry.id, plan.only)]
    chosen.sort(key=lambda entry: (entry.dangerous, states.index(entry.state)))
    return [(entry, _hindrance(entry, plan)) for entry in chosen]


def _matches(name: str, patterns: Iterable[str]) -> bool:
    return any(fnmatch.fnmatchcase(name, pattern) or name.startswith(f"{pattern}/") for pattern in patterns)


def _hindrance(entry: Entry, plan: Plan) -> str:
    if entry.dangerous and not plan.dangerous:
        return "may crash the autopilot: needs --dangerous"
    if entry.flies and not plan.fly:
        return "may start motors: needs --fly"
    return ""


class Session:
    """Drives one autopilot through a catalogue.

    Args:
        catalogue: What is asked and expected.
        plan: Which entries.

    Attributes:
        results: What became of the entries so far, in order.
        current: The entry being performed.
        finished: Whether all is done, the vehicle on the ground.
        problem: Why the session ended early, or could not clean up; empty if it did not.
    """

    def __init__(self, catalogue: Catalogue, plan: Plan) -> None:
        self.catalogue = catalogue
        self.plan = plan
        self.results: list[Result] = []
        self.current: Entry | None = None
        self.finished = False
        self.problem = ""
        self.dialogue = Dialogue()
        if plan.position is Position.MOCAP:
            self.dialogue.feed = MocapFeed(catalogue.family)
        self._pilot = make_pilot(catalogue.family, self.dialogue, catalogue.modes)
        self._keeper = ParameterKeeper(self.dialogue, catalogue.family)
        self._script: Script[None] = self._run(select(catalogue, plan))
        self._wait: Wait | None = None

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message of the autopilot."""
        self.dialogue.receive(message, time_s)
        self._resume()

    def advance(self, time_s: float) -> None:
        """Let time pass; call at least a hundred times a second."""
        self.dialogue.tick(time_s)
        self._resume()

    def outbox(self) -> list[Outgoing]:
        """Take what is to be sent, in order."""
        return self.dialogue.outbox()

    def abort(self) -> None:
        """Perform no more entries: land, put parameters back, end."""
        self._script.close()
        self.problem = "aborted"
        self._script = self._end()
        self._wait = None
        self._resume()

    def _resume(self) -> None:
        while not self.finished:
            satisfied = False
            if self._wait is not None:
                satisfied = self._wait.condition()
                if not satisfied and self.dialogue.time_s < self._wait.until_s:
                    return
            try:
                self._wait = next(self._script) if self._wait is None else self._script.send(satisfied)
            except StopIteration:
                self.finished = True

    def _run(self, entries: Sequence[tuple[Entry, str]]) -> Script[None]:
        dialogue = self.dialogue
        if not (yield from dialogue.wait(lambda: dialogue.heartbeat is not None, _FIRST_HEARTBEAT_S)):
            self.problem = f"no heartbeat of an autopilot within {_FIRST_HEARTBEAT_S:g} s"
            return
        for entry, hindrance in entries:
            if hindrance:
                self.results.append(Result(entry, Outcome.SKIPPED, hindrance))
                continue
            if not (yield from dialogue.wait(self._heard_lately, _SILENCE_S)):
                self.results.append(Result(entry, Outcome.SKIPPED, "the autopilot has fallen silent"))
                self.problem = "the autopilot has fallen silent"
                continue
            self.current = entry
            self.results.append((yield from self._perform(entry)))
            self.current = None
        yield from self._end()

    def _heard_lately(self) -> bool:
        return self.dialogue.time_s - self.dialogue.heartbeat_s < _HEARTBEAT_LOST_S

    def _perform(self, entry: Entry) -> Script[Result]:
        dialogue = self.dialogue
        try:
            yield from self._pilot.reach(entry.state)
        except StateNotReachedError as error:
            return Result(entry, Outcome.SKIPPED, f"state {entry.state} not reached: {error}")
        steps = entry.steps_for(dialogue.release)
        if not steps:
            return Result(entry, Outcome.SKIPPED, "not so in this release")
        dialogue.forget()
        performance = Performance(dialogue, self.catalogue, self._keeper, self._pilot.anchor, self.plan.latency_s)
        result = Result(entry, Outcome.HOLDS)
        try:
            yield from performance.perform(steps)
        except DifferenceError as difference:
            result = replace(result, outcome=Outcome.DIFFERS, reason=str(difference))
        dialogue.end_stream()
        failed = yield from self._keeper.restore()
        if failed:
            reason = f"{result.reason}; parameters not put back: {', '.join(failed)}".removeprefix("; ")
            result = replace(result, outcome=Outcome.DIFFERS, reason=reason)
        return replace(result, slowest_s=max(performance.delays_s, default=None))

    def _end(self) -> Script[None]:
        if not self._heard_lately():
            return
        failed = yield from self._keeper.restore()
        if failed:
            self.problem = f"parameters not put back: {', '.join(failed)}"
        try:
            yield from self._pilot.clean_up()
        except StateNotReachedError as error:
            self.problem = str(error)
