"""What a plan needs of an autopilot's parameters, as plain data.

The tables are in ``px4_requirements.py`` and ``ardupilot_requirements.py``; the same ones are checked on board before a
start and by ``arvi preflight``. Texts are ASCII: STATUSTEXT carries them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from enum import Enum
from typing import Protocol

from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig

__all__ = ["Bits", "Needs", "OneOf", "Requirement", "Severity", "Wanted", "Within"]


MAX_CORRECTION_M_S = 1.0
"""Of position control, unless configured: no autopilot's is larger."""


@dataclass(frozen=True, slots=True)
class Needs:
    """What flying a scenario asks of a vehicle.

    Attributes:
        speed_m_s: Fastest primitive.
        correction_m_s: What position control may add.
        yaw_rate_rad_s: Fastest turn.
        yaw_acceleration_rad_s2: That reverses the fastest turn within two thirds of a step.
        acceleration_m_s2: Sideways, in the tightest curve: the largest ν·|ω|.
        jerk_m_s3: Of the tightest curve: the largest ν·ω².
        climb_m_s: Up and down.
        mocap: Whether motion capture is the source of positions; else GPS.
    """

    speed_m_s: float
    correction_m_s: float
    yaw_rate_rad_s: float
    yaw_acceleration_rad_s2: float
    acceleration_m_s2: float
    jerk_m_s3: float
    climb_m_s: float
    mocap: bool

    @classmethod
    def of(cls, scenario: Scenario, vehicle: VehicleConfig) -> Needs:
        """What a vehicle of a scenario needs."""
        primitives = scenario.primitives
        correction_m_s = scenario.flight.max_correction_m_s
        yaw_rate_rad_s = max(abs(rate) for _, rate in primitives)
        return cls(
            speed_m_s=max(*(speed for speed, _ in primitives), scenario.flight.return_speed_m_s),
            correction_m_s=correction_m_s if correction_m_s is not None else MAX_CORRECTION_M_S,
            yaw_rate_rad_s=yaw_rate_rad_s,
            yaw_acceleration_rad_s2=2.0 * yaw_rate_rad_s / (2.0 / 3.0 * scenario.mission.step_s),
            acceleration_m_s2=max(speed * abs(rate) for speed, rate in primitives),
            jerk_m_s3=max(speed * rate * rate for speed, rate in primitives),
            climb_m_s=scenario.flight.climb_m_s,
            mocap=scenario.mission.position_source == "mocap",
        )


class Wanted(Protocol):
    """A condition on a parameter's value, which may be anything that arrives: NaN and infinity fulfil none."""

    def holds(self, value: float) -> bool:
        """Whether a value fulfils it."""
        ...

    def nearest(self, value: float) -> float:
        """The value to set instead."""
        ...


@dataclass(frozen=True, slots=True)
class Within:
    """A range, its ends included.

    Attributes:
        low: Lowest.
        high: Highest.
        off: A value outside it that turns the thing off, which is as good.
        step: Ends are rounded inwards to multiples of it for the value to set.
    """

    low: float = -math.inf
    high: float = math.inf
    off: float | None = None
    step: float = 1.0

    def holds(self, value: float) -> bool:
        """Whether the value is in the range."""
        if not math.isfinite(value):
            return False
        # A parameter is a single; half a digit of that is no violation.
        slack = 1e-6 * max(abs(value), 1.0)
        return self.low - slack <= value <= self.high + slack or value == self.off

    def nearest(self, value: float) -> float:
        """The nearer end, rounded inwards; the only one there is where one is open."""
        if value < self.low or math.isinf(self.high):
            return min(math.ceil(self.low / self.step - 1e-9) * self.step, self.high)
        return max(math.floor(self.high / self.step + 1e-9) * self.step, self.low)

    def __str__(self) -> str:
        low, high = f"{self.low:.6g}", f"{self.high:.6g}"
        if math.isinf(self.high):
            text = f"at least {low}"
        elif math.isinf(self.low):
            text = f"at most {high}"
        else:
            text = f"{low} to {high}"
        return text if self.off is None else f"{text}, or {self.off:g}"


@dataclass(frozen=True, slots=True)
class OneOf:
    """One of some values; the first is the one to set."""

    values: tuple[float, ...]

    def holds(self, value: float) -> bool:
        """Whether the value is one of them."""
        return value in self.values

    def nearest(self, value: float) -> float:
        """The first."""
        return self.values[0]

    def __str__(self) -> str:
        return " or ".join(f"{value:g}" for value in self.values)


@dataclass(frozen=True, slots=True)
class Bits:
    """Bits that are set, whatever the others are."""

    mask: int

    def holds(self, value: float) -> bool:
        """Whether all are set."""
        return math.isfinite(value) and int(value) & self.mask == self.mask

    def nearest(self, value: float) -> float:
        """The same with them set."""
        return float(self.mask | (int(value) if math.isfinite(value) else 0))

    def __str__(self) -> str:
        return f"with bits {self.mask}"


class Severity(Enum):
    """What a violation means."""

    MUST = "must"
    """No start."""
    SHOULD = "should"
    """Advice."""


@dataclass(frozen=True, slots=True)
class Requirement:
    """One condition on one parameter.

    Attributes:
        name: The parameter.
        wanted: What its value should be.
        why: For the operator, in a few words.
        severity: Whether a violation refuses the start.
        unit: Of the value.
        aliases: Its names in other releases.
        reboot: Whether it takes effect after a reboot only.
    """

    name: str
    wanted: Wanted
    why: str
    severity: Severity = Severity.MUST
    unit: str = ""
    aliases: tuple[str, ...] = field(default=())
    reboot: bool = False

    @property
    def names(self) -> tuple[str, ...]:
        """All names that it may have."""
        return (self.name, *self.aliases)
