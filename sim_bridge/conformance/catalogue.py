"""The catalogue: what was asked of real autopilots, and what they answered, as plain data.

One YAML file for each autopilot family. Its entries say where their facts come from, in which state the vehicle has to
be, what is sent, and what has to come back within which time. :mod:`sim_bridge.conformance.session` performs them.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from enum import StrEnum
from importlib import resources
from typing import Annotated, Any, Literal

import yaml
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from onboard.protocol import dialect as mavlink
from sim_bridge.errors import BridgeError

__all__ = [
    "TIME_CLASSES_S",
    "Capture",
    "Catalogue",
    "CatalogueError",
    "Entry",
    "Family",
    "Link",
    "Position",
    "State",
    "Step",
    "load_catalogue",
    "parse_catalogue",
]

TIME_CLASSES_S: Mapping[str, float] = {"immediate": 0.05, "quick": 0.5, "heartbeat": 1.3}
"""Names of how long an answer may take, s; ``heartbeat`` is what shows in the next HEARTBEAT."""

Within = float | Literal["immediate", "quick", "heartbeat"]
Value = float | int | str | list[Any]
Target = Annotated[str, Field(pattern=r"^(own|other|all|self|\d+)/(all|\d+)$")]
"""System and component: ``own`` is the vehicle's system, ``other`` nobody's, ``all`` is 0."""

Range = tuple[float, float]
Vector = tuple[float, float, float]


class CatalogueError(BridgeError):
    """A catalogue that cannot be used; the text says which entry and why."""


class Family(StrEnum):
    """Autopilots by their behaviour."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


class Link(StrEnum):
    """Which of an autopilot's links is spoken to; PX4 serves them differently."""

    ONBOARD = "onboard"
    GCS = "gcs"


class Position(StrEnum):
    """Where the vehicle's position comes from."""

    GPS = "gps"
    MOCAP = "mocap"


class State(StrEnum):
    """What an entry presupposes; a session goes through them in this order."""

    CONNECTED = "connected"
    """Nothing but a heartbeat was heard, and nothing was asked for yet."""
    UNREADY = "unready"
    """On the ground, and not yet able to be armed."""
    READY = "ready"
    """On the ground, disarmed, could be armed."""
    ARMED = "armed"
    """On the ground, armed."""
    AIR = "air"
    """In the air, holding its place without setpoints."""
    STREAMING = "streaming"
    """In the air, holding a place by a stream of setpoints."""


FLYING = frozenset({State.ARMED, State.AIR, State.STREAMING})
"""States in which motors run."""


class _Data(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class Send(_Data):
    """Send a message; fields that are left out are 0, targets the vehicle's autopilot."""

    send: str
    fields: dict[str, Value] = {}
    source: Literal["companion", "ground"] = "companion"


class Command(_Data):
    """Send COMMAND_LONG, or COMMAND_INT; parameters that are left out are 0."""

    command: str | int
    params: list[float | str] = []
    to: Target = "own/1"
    as_int: bool = False
    confirmation: int = 0


class Setpoint(_Data):
    """Stream SET_POSITION_TARGET_LOCAL_NED; it goes on until ``quiet``, another setpoint, or the entry's end.

    Positions are relative to the place that the session holds when it streams.
    """

    setpoint: int
    """type_mask."""
    frame: int = 1
    position: Vector = (0.0, 0.0, 0.0)
    velocity: Vector = (0.0, 0.0, 0.0)
    acceleration: Vector = (0.0, 0.0, 0.0)
    yaw: float = 0.0
    yaw_rate: float = 0.0
    to: Target = "own/1"
    rate_hz: float = 20.0
    for_s: float = Field(default=0.0, alias="for")
    count: int | None = None
    """So many only, instead of a stream."""


class Quiet(_Data):
    """End the stream of setpoints; times that follow count from its last one."""

    quiet: Literal[True]


class Wait(_Data):
    """Let time pass, s."""

    wait: float


class Ack(_Data):
    """Expect COMMAND_ACK with one of these results, for the last command or the one that is named."""

    ack: str | list[str]
    of: str | int | None = None
    within: Within = "immediate"


class Expect(_Data):
    """Expect a message with these field values, not before and not after a time since the last thing that was sent."""

    expect: str
    fields: dict[str, Value] = {}
    within: Within = "quick"
    after: float = 0.0


class Never(_Data):
    """Expect that no such message comes."""

    never: str
    fields: dict[str, Value] = {}
    for_s: float = Field(alias="for")


class Vehicle(_Data):
    """Expect a HEARTBEAT that shows this."""

    mode: str | None = None
    armed: bool | None = None
    base_mode: int | None = None
    status: int | None = None


class Shows(_Data):
    """Expect the vehicle to show a mode, to be armed or not, a status."""

    shows: Vehicle
    within: Within = "heartbeat"
    after: float = 0.0


class Keeps(_Data):
    """Expect that every HEARTBEAT of a time shows this; at least one comes."""

    keeps: Vehicle
    for_s: float = Field(alias="for")


class Motion(_Data):
    """Expect a motion, averaged over the last while: velocities in m/s, yaw rad, yaw rate rad/s.

    Places are in m: ``north`` and so on relative to the entry's start, ``at_north`` to the place held by streaming.
    """

    vn: Range | None = None
    ve: Range | None = None
    vd: Range | None = None
    north: Range | None = None
    east: Range | None = None
    down: Range | None = None
    at_north: Range | None = None
    at_east: Range | None = None
    at_down: Range | None = None
    yaw: Range | None = None
    yaw_rate: Range | None = None


class Moves(_Data):
    """Expect the vehicle to move like this now."""

    moves: Motion
    over_s: float = Field(default=0.5, alias="over")


class Rate(_Data):
    """Expect a message so often."""

    rate: str
    hz: Range
    for_s: float = Field(alias="for")


class Text(_Data):
    """Expect a STATUSTEXT that matches a regular expression."""

    text: str
    within: Within = "quick"


class Ready(_Data):
    """Expect SYS_STATUS's pre-arm health bit to be so."""

    ready: bool
    within: Within = "heartbeat"


class Parameter(_Data):
    """Set parameters for the rest of the entry; the session puts the old values back."""

    parameter: dict[str, float | int]


class Capture(_Data):
    """What a motion capture system sends.

    Attributes:
        kind: ODOMETRY, VISION_POSITION_ESTIMATE or ATT_POS_MOCAP.
        estimator: MAV_ESTIMATOR_TYPE of ODOMETRY; 2 is vision, 6 motion capture.
        offset: Added to the true position: north, east, down, m.
    """

    kind: Literal["odometry", "vision", "attitude-position"] = "odometry"
    estimator: int = 2
    offset: Vector = (0.0, 0.0, 0.0)


class Mocap(_Data):
    """From now on send this motion capture, or none; times that follow count from here."""

    mocap: Capture | None


class Ground(_Data):
    """Send heartbeats of a ground station, too, from now on."""

    ground: Literal[True]


Step = (
    Send
    | Command
    | Setpoint
    | Quiet
    | Wait
    | Ack
    | Expect
    | Never
    | Shows
    | Keeps
    | Moves
    | Rate
    | Text
    | Ready
    | Parameter
    | Mocap
    | Ground
)


class Entry(_Data):
    """One exchange, and where it was seen.

    Attributes:
        id: Name, unique in the catalogue; before the slash the group.
        source: Recording and its time, s, or a paragraph of protocol.md.
        state: What has to be so before.
        link: Which link it is about.
        position: Where the vehicle's position has to come from.
        dangerous: Whether it may crash a real autopilot.
        since: What releases from this one on do instead, e.g. ``"1.16"``; nothing where it is no longer so.
        unlike: Why the simulated autopilot differs, if it does.
        steps: What is done and expected, in this order.
    """

    id: Annotated[str, Field(pattern=r"^[a-z0-9-]+/[a-z0-9-]+$")]
    source: str
    state: State
    link: Link = Link.ONBOARD
    position: Position = Position.GPS
    dangerous: bool = False
    since: dict[Annotated[str, Field(pattern=r"^\d+\.\d+$")], list[Step]] = {}
    unlike: str | None = None
    steps: Annotated[list[Step], Field(min_length=1)]

    @property
    def flies(self) -> bool:
        """Whether its motors run."""
        return self.state in FLYING or self.dangerous or any(_arms(step) for step in self.steps)

    def steps_for(self, release: tuple[int, int] | None) -> list[Step]:
        """What a release is expected to do: major and minor version; None for an unknown one."""
        known = sorted((_release(text), steps) for text, steps in self.since.items())
        newer = [steps for first, steps in known if release is not None and release >= first]
        return newer[-1] if newer else self.steps


class Catalogue(_Data):
    """All entries of one family.

    Attributes:
        family: Whose behaviour it is.
        recorded: The release that was recorded.
        modes: custom_mode by name.
        entries: In the file's order.
    """

    family: Family
    recorded: str
    modes: dict[str, int]
    entries: list[Entry]

    def mode_name(self, custom_mode: int) -> str:
        """A mode's name, or its number if it has none here."""
        return next((name for name, number in self.modes.items() if number == custom_mode), f"{custom_mode:#x}")


def load_catalogue(family: Family) -> Catalogue:
    """The catalogue of a family, as carried by the package.

    Raises:
        CatalogueError: The file is wrong.
    """
    name = f"{family}.yaml"
    text = resources.files(__package__).joinpath(name).read_text(encoding="utf-8")
    return parse_catalogue(text, name)


def parse_catalogue(text: str, name: str) -> Catalogue:
    """A catalogue from YAML.

    Raises:
        CatalogueError: It is no catalogue; the text says what is wrong, and in which entry.
    """
    try:
        catalogue = Catalogue.model_validate(yaml.safe_load(text))
    except yaml.YAMLError as error:
        raise CatalogueError(f"{name}: {error}") from None
    except ValidationError as error:
        first = error.errors()[0]
        place = ".".join(str(part) for part in first["loc"])
        raise CatalogueError(f"{name}: {place}: {first['msg']}") from None
    seen: set[str] = set()
    for entry in catalogue.entries:
        if entry.id in seen:
            raise CatalogueError(f"{name}: {entry.id}: there are two entries of this name")
        seen.add(entry.id)
        for steps in (entry.steps, *entry.since.values()):
            for number, step in enumerate(steps, 1):
                mistake = _mistake(step, catalogue)
                if mistake is not None:
                    raise CatalogueError(f"{name}: {entry.id}: step {number}: {mistake}")
    return catalogue


def _release(text: str) -> tuple[int, int]:
    major, minor = text.split(".")
    return int(major), int(minor)


def _mistake(step: Step, catalogue: Catalogue) -> str | None:
    """What a schema cannot tell: names of messages, commands and modes that do not exist."""
    match step:
        case Send(send=message) | Expect(expect=message) | Never(never=message) | Rate(rate=message):
            if not hasattr(mavlink, f"MAVLINK_MSG_ID_{message}"):
                return f"{message}: the dialect has no such message"
        case Command(command=command) | Ack(of=command) if isinstance(command, str):
            if not hasattr(mavlink, f"MAV_CMD_{command}"):
                return f"{command}: the dialect has no such command"
        case Shows(shows=Vehicle(mode=mode)) | Keeps(keeps=Vehicle(mode=mode)):
            if mode is not None and mode not in catalogue.modes:
                return f"{mode}: not among the catalogue's modes"
        case Text(text=pattern):
            try:
                re.compile(pattern)
            except re.error as error:
                return f"{pattern!r}: {error}"
    return None


def _arms(step: Step) -> bool:
    """Whether a step starts motors if all goes as it should not."""
    return isinstance(step, Command) and step.command == "COMPONENT_ARM_DISARM" and step.params[:1] == [1.0]
