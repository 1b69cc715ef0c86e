"""The steps of an entry, as plain data: what is done, and what has to come back. How, is in ``steps.py``."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field

__all__ = [
    "TIME_CLASSES_S",
    "Ack",
    "Capture",
    "Command",
    "Data",
    "Expect",
    "Ground",
    "Keeps",
    "Mocap",
    "Motion",
    "Moves",
    "Never",
    "Parameter",
    "Quiet",
    "Rate",
    "Ready",
    "Send",
    "Setpoint",
    "Shows",
    "Step",
    "Text",
    "Vector",
    "Vehicle",
    "Wait",
    "Within",
]

TIME_CLASSES_S: Mapping[str, float] = {"immediate": 0.05, "quick": 0.5, "heartbeat": 1.3}
"""Names of how long an answer may take, s; ``heartbeat`` is what shows in the next HEARTBEAT."""

Within = float | Literal["immediate", "quick", "heartbeat"]
Value = float | int | str | list[Any]
Target = Annotated[str, Field(pattern=r"^(own|other|all|self|\d+)/(all|\d+)$")]
"""System and component: ``own`` is the vehicle's system, ``other`` nobody's, ``all`` is 0."""

Range = tuple[float, float]
Vector = tuple[float, float, float]


class Data(BaseModel):
    """Frozen, and without keys that nobody reads."""

    model_config = ConfigDict(extra="forbid", frozen=True, populate_by_name=True)


class Send(Data):
    """Send a message; fields that are left out are 0, targets the vehicle's autopilot."""

    send: str
    fields: dict[str, Value] = {}
    source: Literal["companion", "ground"] = "companion"


class Command(Data):
    """Send COMMAND_LONG, or COMMAND_INT; parameters that are left out are 0."""

    command: str | int
    params: list[float | str] = []
    to: Target = "own/1"
    as_int: bool = False
    confirmation: int = 0


class Setpoint(Data):
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


class Quiet(Data):
    """End the stream of setpoints; times that follow count from its last one."""

    quiet: Literal[True]


class Wait(Data):
    """Let time pass, s."""

    wait: float


class Ack(Data):
    """Expect COMMAND_ACK with one of these results, for the last command or the one that is named."""

    ack: str | list[str]
    of: str | int | None = None
    within: Within = "immediate"


class Expect(Data):
    """Expect a message with these field values, not before and not after a time since the last thing that was sent."""

    expect: str
    fields: dict[str, Value] = {}
    within: Within = "quick"
    after: float = 0.0


class Never(Data):
    """Expect that no such message comes."""

    never: str
    fields: dict[str, Value] = {}
    for_s: float = Field(alias="for")


class Vehicle(Data):
    """Expect a HEARTBEAT that shows this."""

    mode: str | None = None
    armed: bool | None = None
    base_mode: int | None = None
    status: int | None = None


class Shows(Data):
    """Expect the vehicle to show a mode, to be armed or not, a status."""

    shows: Vehicle
    within: Within = "heartbeat"
    after: float = 0.0


class Keeps(Data):
    """Expect that every HEARTBEAT of a time shows this; at least one comes."""

    keeps: Vehicle
    for_s: float = Field(alias="for")


class Motion(Data):
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


class Moves(Data):
    """Expect the vehicle to move like this now."""

    moves: Motion
    over_s: float = Field(default=0.5, alias="over")


class Rate(Data):
    """Expect a message so often."""

    rate: str
    hz: Range
    for_s: float = Field(alias="for")


class Text(Data):
    """Expect a STATUSTEXT that matches a regular expression."""

    text: str
    within: Within = "quick"


class Ready(Data):
    """Expect SYS_STATUS's pre-arm health bit to be so."""

    ready: bool
    within: Within = "heartbeat"


class Parameter(Data):
    """Set parameters for the rest of the entry; the session puts the old values back."""

    parameter: dict[str, float | int]


class Capture(Data):
    """What a motion capture system sends.

    Attributes:
        kind: ODOMETRY, VISION_POSITION_ESTIMATE or ATT_POS_MOCAP.
        estimator: MAV_ESTIMATOR_TYPE of ODOMETRY; 2 is vision, 6 motion capture.
        offset: Added to the true position: north, east, down, m.
    """

    kind: Literal["odometry", "vision", "attitude-position"] = "odometry"
    estimator: int = 2
    offset: Vector = (0.0, 0.0, 0.0)


class Mocap(Data):
    """From now on send this motion capture, or none; times that follow count from here."""

    mocap: Capture | None


class Ground(Data):
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
