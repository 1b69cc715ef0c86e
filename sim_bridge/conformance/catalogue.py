"""The catalogue: what was asked of real autopilots, and what they answered, as plain data.

One YAML file for each autopilot family. Its entries say where their facts come from, in which state the vehicle has to
be, what is sent, and what has to come back within which time. :mod:`sim_bridge.conformance.session` performs them.
"""

from __future__ import annotations

import re
from enum import StrEnum
from importlib import resources
from typing import Annotated

import yaml
from pydantic import Field, ValidationError

from onboard.protocol import dialect as mavlink
from sim_bridge.conformance.step_data import (
    Ack,
    Command,
    Data,
    Expect,
    Keeps,
    Never,
    Rate,
    Send,
    Shows,
    Step,
    Text,
    Vehicle,
)
from sim_bridge.errors import BridgeError

__all__ = [
    "Catalogue",
    "CatalogueError",
    "Entry",
    "Family",
    "Link",
    "Position",
    "State",
    "load_catalogue",
    "parse_catalogue",
]


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


class Entry(Data):
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
    since: dict[Annotated[str, Field(pattern=r"^\d+\.\d+$")], list[Step]] = Field(default={})
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


class Catalogue(Data):
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
