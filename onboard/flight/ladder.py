"""The failsafe ladder: follows the conditions of the table in ``failsafes.py``, and says what they ask for.

A condition that is seen for long enough becomes active: it is told once, and it asks for an action. Of all active ones
the most drastic action is done, so holding comes first and landing when it lasts. A condition ends after it was not
seen for a while, which keeps the ladder from chattering, and its end is told, too.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from onboard.flight.events import Event
from onboard.flight.failsafes import RULES, Action, Condition, Rule, Severity

__all__ = ["Ladder"]


@dataclass(slots=True)
class _Course:
    """How far one condition has come.

    Attributes:
        since_s: When it was seen first.
        seen_s: When it was seen last.
        stages: How many stages have begun.
        detail: What was seen.
    """

    since_s: float
    seen_s: float
    stages: int
    detail: str


class Ladder:
    """What is wrong now, and what to do about it.

    Args:
        rules: The table.
    """

    def __init__(self, rules: Mapping[Condition, Rule] = RULES) -> None:
        self._rules = rules
        self._order = {condition: place for place, condition in enumerate(rules)}
        self._courses: dict[Condition, _Course] = {}
        self._events: list[Event] = []
        self._last_s = math.inf

    @property
    def active(self) -> tuple[Condition, ...]:
        """What has been told and is not over, the most drastic first."""
        begun = [condition for condition, course in self._courses.items() if course.stages]
        return tuple(sorted(begun, key=lambda condition: (-self._action_of(condition), self._order[condition])))

    @property
    def action(self) -> Action | None:
        """The most drastic action that is asked for; None if all is well."""
        active = self.active
        return self._action_of(active[0]) if active else None

    def update(self, seen: Mapping[Condition, str], time_s: float) -> Action | None:
        """Take what is seen at a UNIX time; the action that is asked for then.

        Args:
            seen: What is wrong or wanted now, each with its details in words.
            time_s: UNIX time, s; a clock that runs back begins all waiting anew.
        """
        if time_s < self._last_s:
            for course in self._courses.values():
                course.since_s = course.seen_s = time_s
        self._last_s = time_s
        for condition, detail in seen.items():
            course = self._courses.setdefault(condition, _Course(time_s, time_s, 0, detail))
            course.seen_s, course.detail = time_s, detail
        for condition, course in list(self._courses.items()):
            self._advance(condition, course, time_s, is_seen=condition in seen)
        return self.action

    def forget(self, *conditions: Condition) -> None:
        """These are over, without a word: a new flight begins."""
        for condition in conditions:
            self._courses.pop(condition, None)

    def events(self) -> list[Event]:
        """What the operator should know since the last call."""
        events, self._events = self._events, []
        return events

    def _advance(self, condition: Condition, course: _Course, time_s: float, *, is_seen: bool) -> None:
        rule = self._rules[condition]
        if not is_seen:
            if course.stages == 0:
                del self._courses[condition]
            elif time_s - course.seen_s >= rule.clears_s:
                del self._courses[condition]
                if rule.over:
                    self._events.append(Event(Severity.NOTICE, rule.over))
            return
        while course.stages < len(rule.stages) and time_s - course.since_s >= rule.stages[course.stages].after_s:
            told = rule.stages[course.stages].told.format(course.detail)
            self._events.append(Event(rule.severity, told, condition))
            course.stages += 1

    def _action_of(self, condition: Condition) -> Action:
        return self._rules[condition].stages[self._courses[condition].stages - 1].action
