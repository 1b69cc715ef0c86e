"""From standing to climbing: the autopilot's launch steps, one after the other, each asked for until it is done.

A step is done while the telemetry shows it, or was accepted a moment ago, since heartbeats are late. So an autopilot
that disarms by itself while it waits is armed again.
"""

from __future__ import annotations

import math

from onboard.flight.autopilot import AutopilotLink
from onboard.flight.behaviour import LaunchStep
from onboard.protocol.commands import CommandOutcome

__all__ = ["HEARTBEAT_LAG_S", "Launch"]

COMMAND_RETRY_S = 1.0
HEARTBEAT_LAG_S = 2.5
"""A new mode or arming shows in the next heartbeat, up to 1 s late; one may be lost."""


class Launch:
    """One attempt to get into the air.

    Args:
        steps: What the autopilot wants, in order.
        begin_s: UNIX time before which nothing is asked for, s: the stream runs first.
    """

    def __init__(self, steps: tuple[LaunchStep, ...], begin_s: float) -> None:
        self._steps = steps
        self._accepted_s = [-math.inf] * len(steps)
        self._begin_s = begin_s
        self._asked_s = -math.inf
        self._current = 0

    def advance(self, link: AutopilotLink, time_s: float) -> bool:
        """Ask for the first step that is not done when it is time; whether all are done."""
        current = self._first_undone(link, time_s)
        if current is None:
            return True
        if current != self._current:
            self._current = current
            self._asked_s = -math.inf
        step = self._steps[current]
        due = time_s >= self._begin_s and not 0.0 <= time_s - self._asked_s < COMMAND_RETRY_S
        if due and not step.lacks(link.heard) and not link.busy(step.request.command):
            self._asked_s = time_s
            link.ask(step.request, time_s)
        return False

    def accepted(self, outcome: CommandOutcome, time_s: float) -> None:
        """The autopilot does what a step asked for."""
        if outcome.command == self._steps[self._current].request.command:
            self._accepted_s[self._current] = time_s

    def waits_for(self, link: AutopilotLink) -> str:
        """What it is at, in words."""
        step = self._steps[self._current]
        lacks = step.lacks(link.heard)
        return f"{step.name}: {lacks}" if lacks else step.name

    def _first_undone(self, link: AutopilotLink, time_s: float) -> int | None:
        for index, (step, accepted_s) in enumerate(zip(self._steps, self._accepted_s, strict=True)):
            if not step.shown(link.heard) and time_s - accepted_s > HEARTBEAT_LAG_S:
                return index
        return None
