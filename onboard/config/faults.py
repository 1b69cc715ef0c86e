"""Faults on a script: what goes wrong with what, from when to when, and by how much.

The words are PX4's (https://docs.px4.io/main/en/debug/failure_injection.html): a component is off, stuck, garbage,
wrong, slow, delayed or intermittent. What each of these means for a component, and its parameters, is in
:data:`VOCABULARY`; validation, documentation and live injection all read it there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from types import MappingProxyType
from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from onboard.config.base import NonNegative, Positive, Section, SystemId

__all__ = ["VOCABULARY", "Component", "Effect", "FaultConfig", "FaultType", "Parameter", "Place", "clock_offset_s"]


class Component(StrEnum):
    """What can fail."""

    RADIO = "radio"
    MOCAP = "mocap"
    DETECTOR = "detector"
    AUTOPILOT = "autopilot"
    AUTOPILOT_LINK = "autopilot_link"
    BATTERY = "battery"
    GROUND_LINK = "ground_link"
    PROCESS = "process"
    BRIDGE = "bridge"
    PLANNER = "planner"
    CLOCK = "clock"


class FaultType(StrEnum):
    """How it can fail: PX4's FAILURE_TYPE."""

    OFF = "off"
    STUCK = "stuck"
    GARBAGE = "garbage"
    WRONG = "wrong"
    SLOW = "slow"
    DELAYED = "delayed"
    INTERMITTENT = "intermittent"


class Place(StrEnum):
    """Who makes it happen, and so where it is to be had."""

    BRIDGE = "bridge"
    """The bridge: in virtual time, in real processes, and live by command."""
    LAUNCHER = "launcher"
    """``arvi fly``, since the processes are its own; in virtual time, too."""
    ONBOARD = "onboard"
    """The onboard process itself; in virtual time, too."""
    VIRTUAL = "virtual"
    """Virtual time only."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """A number that says how bad it is.

    Attributes:
        meaning: With its unit.
        default: What it is unless given.
        low: Smallest value.
        high: Largest value.
    """

    meaning: str
    default: float
    low: float = 0.0
    high: float = 1e6


@dataclass(frozen=True, slots=True)
class Effect:
    """What a fault does.

    Attributes:
        meaning: One sentence without a full stop.
        place: Who makes it happen.
        parameters: By name; the first one is the magnitude of a live command.
    """

    meaning: str
    place: Place
    parameters: Mapping[str, Parameter] = field(default_factory=dict)


def _loss(default: float) -> Parameter:
    return Parameter("probability that one is lost", default, 0.0, 1.0)


_DELAY = Parameter("added delay, s", 0.1, 0.0, 60.0)
_JITTER = Parameter("uniform jitter on top, s", 0.0, 0.0, 60.0)
_POSITION = {
    "north_m": Parameter("offset north, m", 0.5, -1e3, 1e3),
    "east_m": Parameter("offset east, m", 0.0, -1e3, 1e3),
    "down_m": Parameter("offset down, m", 0.0, -1e3, 1e3),
}
_SHARE = Parameter("share of the time in which it runs", 0.2, 0.01, 1.0)

_C, _T = Component, FaultType
VOCABULARY: Mapping[tuple[Component, FaultType], Effect] = MappingProxyType(
    {
        (_C.RADIO, _T.OFF): Effect(
            "the vehicles neither reach anybody nor hear anybody",
            Place.BRIDGE,
            {"among_themselves": Parameter("1: a partition, they still hear each other", 0.0, 0.0, 1.0)},
        ),
        (_C.RADIO, _T.STUCK): Effect("each link repeats the last datagram that it carried", Place.BRIDGE),
        (_C.RADIO, _T.GARBAGE): Effect(
            "bits are flipped", Place.BRIDGE, {"probability": Parameter("of a damaged datagram", 0.3, 0.0, 1.0)}
        ),
        (_C.RADIO, _T.WRONG): Effect(
            "datagrams come twice or overtake each other",
            Place.BRIDGE,
            {
                "duplicated": Parameter("probability of a second copy", 0.3, 0.0, 1.0),
                "reordered": Parameter("probability of being held back", 0.3, 0.0, 1.0),
                "within_s": Parameter("how late the copy, or the one held back, comes at most, s", 0.2, 0.0, 60.0),
            },
        ),
        (_C.RADIO, _T.SLOW): Effect(
            "each link carries only so much; what would wait longer than 1 s is lost",
            Place.BRIDGE,
            {"bytes_per_s": Parameter("throughput of a link, bytes/s", 1000.0, 1.0, 1e9)},
        ),
        (_C.RADIO, _T.DELAYED): Effect("datagrams come late", Place.BRIDGE, {"delay_s": _DELAY, "jitter_s": _JITTER}),
        (_C.RADIO, _T.INTERMITTENT): Effect("datagrams are lost", Place.BRIDGE, {"loss": _loss(0.3)}),
        (_C.MOCAP, _T.OFF): Effect("the vehicles are not seen", Place.BRIDGE),
        (_C.MOCAP, _T.STUCK): Effect(
            "poses stay what they were, with new times",
            Place.BRIDGE,
            {"std_m": Parameter("of noise on each coordinate, which makes them look alive, m", 0.0, 0.0, 1e3)},
        ),
        (_C.MOCAP, _T.GARBAGE): Effect(
            "poses scatter", Place.BRIDGE, {"std_m": Parameter("of each coordinate, m", 0.5, 0.0, 1e3)}
        ),
        (_C.MOCAP, _T.WRONG): Effect("poses are off: the bodies jump", Place.BRIDGE, _POSITION),
        (_C.MOCAP, _T.SLOW): Effect(
            "fewer poses", Place.BRIDGE, {"rate_hz": Parameter("how often, Hz", 5.0, 0.1, 500.0)}
        ),
        (_C.MOCAP, _T.DELAYED): Effect("poses come late", Place.BRIDGE, {"delay_s": _DELAY, "jitter_s": _JITTER}),
        (_C.MOCAP, _T.INTERMITTENT): Effect("poses are lost", Place.BRIDGE, {"loss": _loss(0.5)}),
        (_C.DETECTOR, _T.OFF): Effect("nothing is detected", Place.BRIDGE),
        (_C.DETECTOR, _T.STUCK): Effect(
            "each detection has the range and bearing of the target's first one", Place.BRIDGE
        ),
        (_C.DETECTOR, _T.GARBAGE): Effect(
            "ghosts: a detection is of another target, anywhere in range",
            Place.BRIDGE,
            {
                "probability": Parameter("that a ghost comes with a detection", 0.5, 0.0, 1.0),
                "range_m": Parameter("largest range of a ghost, m", 1.0, 0.0, 1e3),
            },
        ),
        (_C.DETECTOR, _T.WRONG): Effect(
            "ranges are false", Place.BRIDGE, {"range_m": Parameter("added to each range, m", 0.5, -1e3, 1e3)}
        ),
        (_C.DETECTOR, _T.SLOW): Effect(
            "only one look in so many is reported", Place.BRIDGE, {"looks": Parameter("how many", 4.0, 1.0, 1000.0)}
        ),
        (_C.DETECTOR, _T.DELAYED): Effect(
            "detections come late", Place.BRIDGE, {"delay_s": Parameter("added delay, s", 0.5, 0.0, 60.0)}
        ),
        (_C.DETECTOR, _T.INTERMITTENT): Effect("detections are lost", Place.BRIDGE, {"loss": _loss(0.5)}),
        (_C.AUTOPILOT, _T.OFF): Effect(
            "it reboots, and its motors stop",
            Place.BRIDGE,
        ),
        (_C.AUTOPILOT, _T.STUCK): Effect(
            "it refuses every change of mode that the onboard link asks for", Place.BRIDGE
        ),
        (_C.AUTOPILOT, _T.WRONG): Effect("it refuses to arm", Place.BRIDGE),
        (_C.AUTOPILOT_LINK, _T.OFF): Effect("nothing passes between autopilot and onboard computer", Place.BRIDGE),
        (_C.AUTOPILOT_LINK, _T.DELAYED): Effect(
            "what passes between autopilot and onboard computer comes late",
            Place.BRIDGE,
            {"delay_s": _DELAY, "jitter_s": _JITTER},
        ),
        (_C.AUTOPILOT_LINK, _T.INTERMITTENT): Effect(
            "messages between autopilot and onboard computer are lost", Place.BRIDGE, {"loss": _loss(0.3)}
        ),
        (_C.BATTERY, _T.WRONG): Effect(
            "its charge drops to what is left",
            Place.BRIDGE,
            {"remaining": Parameter("charge left, 0 to 1: 0.15 is low, 0.07 critical, 0.05 empty", 0.15, 0.0, 1.0)},
        ),
        (_C.GROUND_LINK, _T.OFF): Effect("onboard computer and ground do not hear each other", Place.VIRTUAL),
        (_C.GROUND_LINK, _T.DELAYED): Effect(
            "what passes between onboard computer and ground comes late",
            Place.VIRTUAL,
            {"delay_s": _DELAY, "jitter_s": _JITTER},
        ),
        (_C.GROUND_LINK, _T.INTERMITTENT): Effect(
            "frames between onboard computer and ground are lost", Place.VIRTUAL, {"loss": _loss(0.3)}
        ),
        (_C.PROCESS, _T.OFF): Effect(
            "the onboard process is killed (SIGKILL), and started anew when the fault ends", Place.LAUNCHER
        ),
        (_C.PROCESS, _T.STUCK): Effect(
            "the onboard process is stopped (SIGSTOP), and continued when the fault ends", Place.LAUNCHER
        ),
        (_C.PROCESS, _T.SLOW): Effect(
            "the onboard process gets little processor time", Place.LAUNCHER, {"share": _SHARE}
        ),
        (_C.BRIDGE, _T.OFF): Effect(
            "the bridge's process is killed (SIGKILL), and with it all that it simulates", Place.LAUNCHER
        ),
        (_C.BRIDGE, _T.STUCK): Effect(
            "the bridge's process is stopped (SIGSTOP), and continued when the fault ends", Place.LAUNCHER
        ),
        (_C.BRIDGE, _T.SLOW): Effect(
            "the bridge's process gets little processor time", Place.LAUNCHER, {"share": _SHARE}
        ),
        (_C.PLANNER, _T.OFF): Effect("the planner fails (raises) each time", Place.VIRTUAL),
        (_C.PLANNER, _T.STUCK): Effect("the planner does not come back while the fault lasts", Place.VIRTUAL),
        (_C.PLANNER, _T.WRONG): Effect("the planner finds no feasible plan: a stop", Place.VIRTUAL),
        (_C.PLANNER, _T.DELAYED): Effect(
            "plans come late", Place.VIRTUAL, {"delay_s": Parameter("after the slot's end, s", 0.3, 0.0, 60.0)}
        ),
        (_C.CLOCK, _T.WRONG): Effect(
            "the onboard computer's clock is off",
            Place.ONBOARD,
            {
                "offset_s": Parameter("ahead of the true time, s", 0.5, -1e6, 1e6),
                "drift_ppm": Parameter("what is gained on top, µs/s", 0.0, -1e6, 1e6),
            },
        ),
    }
)
"""Which faults there are."""

MAX_TIMES = 1000

_WITHOUT_VEHICLES = frozenset({Component.BRIDGE})


class FaultConfig(Section):
    """One entry of the script."""

    component: Component
    type: FaultType
    vehicles: tuple[SystemId, ...] = Field(default=(), description="system ids; empty means all")
    since: Literal["takeoff", "boot"] = Field(
        default="takeoff",
        description="from when times count: the moment at which the first vehicle leaves the ground, or the start of "
        "the process that makes it happen",
    )
    from_s: NonNegative = Field(description="when it begins, s")
    until_s: Positive | None = Field(default=None, description="when it ends, s; null never")
    times: Annotated[int, Field(ge=1, le=MAX_TIMES)] = Field(default=1, description="how often it happens")
    every_s: Positive | None = Field(default=None, description="from one beginning to the next, s, where times > 1")
    parameters: dict[Annotated[str, Field(min_length=1, max_length=40)], float] = Field(
        default_factory=dict, description="how bad it is"
    )

    @property
    def occurrences(self) -> tuple[FaultConfig, ...]:
        """Each time that it happens, as a fault that happens once."""
        if self.every_s is None or self.until_s is None:
            return (self,)
        shifts_s = [index * self.every_s for index in range(self.times)]
        once = {"times": 1, "every_s": None}
        return tuple(
            self.model_copy(update={"from_s": self.from_s + shift_s, "until_s": self.until_s + shift_s, **once})
            for shift_s in shifts_s
        )

    @property
    def effect(self) -> Effect:
        """What it does."""
        return VOCABULARY[self.component, self.type]

    @field_validator("type", mode="before")
    @classmethod
    def _off_is_a_word(cls, given: object) -> object:
        """YAML 1.1 takes ``off`` for false."""
        return FaultType.OFF.value if given is False else given

    @model_validator(mode="after")
    def _is_in_the_vocabulary(self) -> Self:
        if (self.component, self.type) not in VOCABULARY:
            known = ", ".join(kind for component, kind in VOCABULARY if component is self.component)
            raise ValueError(f"type: a fault of {self.component} is one of {known}, not {self.type}")
        known_parameters = self.effect.parameters
        for name, value in self.parameters.items():
            parameter = known_parameters.get(name)
            if parameter is None:
                known = ", ".join(known_parameters) or "none"
                raise ValueError(f"parameters: unknown {name}; {self.component} {self.type} has {known}")
            if not parameter.low <= value <= parameter.high:
                raise ValueError(
                    f"parameters.{name}: {value:g} should be {parameter.low:g} to {parameter.high:g} "
                    f"({parameter.meaning})"
                )
        return self

    @model_validator(mode="after")
    def _times_make_sense(self) -> Self:
        if self.until_s is not None and self.until_s <= self.from_s:
            raise ValueError(f"until_s: {self.until_s:g} is not after from_s = {self.from_s:g}")
        if (self.times > 1) != (self.every_s is not None):
            raise ValueError("every_s: goes together with times of more than one")
        if self.every_s is not None and (self.until_s is None or self.every_s < self.until_s - self.from_s):
            raise ValueError("every_s: a fault that comes again ends before; until_s - from_s is at most every_s")
        if self.component is Component.CLOCK and self.since != "boot":
            raise ValueError("since: a clock's faults count from boot; an onboard computer knows no other beginning")
        if self.component in _WITHOUT_VEHICLES and self.vehicles:
            raise ValueError(f"vehicles: {self.component} is nobody's in particular; leave them out")
        return self

    def concerns(self, vehicle_id: int) -> bool:
        """Whether it happens to this vehicle."""
        return not self.vehicles or vehicle_id in self.vehicles

    def value(self, name: str) -> float:
        """A parameter, as given or by default."""
        return self.parameters.get(name, self.effect.parameters[name].default)

    def clock_offset_s(self, since_begin_s: float) -> float:
        """Of a clock's fault: how far the clock is ahead so long after the fault's begin, s."""
        return self.value("offset_s") + 1e-6 * self.value("drift_ppm") * since_begin_s


def clock_offset_s(faults: tuple[FaultConfig, ...], vehicle_id: int, since_boot_s: float) -> float:
    """How far the clock of a vehicle's onboard computer is ahead, s.

    Args:
        faults: The script.
        vehicle_id: Whose clock.
        since_boot_s: Since the process began, s.
    """
    return sum(
        fault.clock_offset_s(since_boot_s - fault.from_s)
        for fault in faults
        if fault.component is Component.CLOCK
        and fault.concerns(vehicle_id)
        and fault.from_s <= since_boot_s < (math.inf if fault.until_s is None else fault.until_s)
    )
