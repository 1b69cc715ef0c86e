"""Reads what a plan needs of the autopilot's parameters, and judges it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

from onboard.flight.requirements import Requirement, Severity
from onboard.protocol.parameters import Parameter, ParameterClient

__all__ = ["Finding", "Preflight", "Verdict"]

REREAD_S = 5.0
"""Somebody may mend a violation from a ground station meanwhile."""


class Verdict(Enum):
    """How a parameter is."""

    GOOD = "ok"
    ADVICE = "advice"
    """Should be otherwise."""
    WRONG = "wrong"
    """Refuses the start."""
    UNKNOWN = "unknown"
    """The autopilot has no such parameter, or did not answer."""


@dataclass(frozen=True, slots=True)
class Finding:
    """A requirement held against the autopilot.

    Attributes:
        requirement: What was asked.
        parameter: What was answered; None if nothing.
        verdict: How it is.
    """

    requirement: Requirement
    parameter: Parameter | None
    verdict: Verdict

    def __str__(self) -> str:
        wanted, unit = self.requirement.wanted, self.requirement.unit
        if self.parameter is None:
            return f"{self.requirement.name} is not known to it"
        space = f" {unit}" if unit else ""
        return f"{self.parameter.name} is {self.parameter.value:g}{space}, should be {wanted}: {self.requirement.why}"


class Preflight:
    """The check of one autopilot.

    Args:
        client: Its parameters.
        requirements: What is needed of them.
    """

    def __init__(self, client: ParameterClient, requirements: tuple[Requirement, ...]) -> None:
        self._client = client
        self._requirements = requirements
        self._read_s = -math.inf

    def poll(self, time_s: float) -> None:
        """Read what is not known, and again what is wrong."""
        if self._client.busy or 0.0 <= time_s - self._read_s < REREAD_S:
            return
        names = [
            name
            for finding in self.findings()
            if finding.verdict is Verdict.WRONG or finding.parameter is None
            for name in finding.requirement.names
            if finding.parameter is None or name == finding.parameter.name
        ]
        # What is unknown stays so, unless nothing was ever answered.
        if self._client.values:
            names = [name for name in names if name not in self._client.unknown]
        self._read_s = time_s
        self._client.read(names)

    @property
    def done(self) -> bool:
        """Whether everything was answered, or will not be."""
        client = self._client
        return all(
            any(name in client.values for name in requirement.names)
            or all(name in client.unknown for name in requirement.names)
            for requirement in self._requirements
        )

    @property
    def answered(self) -> bool:
        """Whether the autopilot answers at all."""
        return not self._requirements or bool(self._client.values)

    def findings(self) -> list[Finding]:
        """Every requirement, in its order."""
        return [self._judge(requirement) for requirement in self._requirements]

    def violations(self) -> list[Finding]:
        """Those that refuse the start."""
        return [finding for finding in self.findings() if finding.verdict is Verdict.WRONG]

    def _judge(self, requirement: Requirement) -> Finding:
        known = (self._client.values.get(name) for name in requirement.names)
        parameter = next((parameter for parameter in known if parameter is not None), None)
        if parameter is None:
            return Finding(requirement, None, Verdict.UNKNOWN)
        if requirement.wanted.holds(parameter.value):
            return Finding(requirement, parameter, Verdict.GOOD)
        wrong = requirement.severity is Severity.MUST
        return Finding(requirement, parameter, Verdict.WRONG if wrong else Verdict.ADVICE)
