"""What travels between robots and inside one: plain values in mission time, before and after MAVLink.

Steps count from the start of the mission in units of τ. ``onboard.protocol.team_messages`` makes messages of these, and
back.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from numpy.typing import NDArray

from onboard.estimation.target_models import TargetModel
from onboard.geometry import Pose

__all__ = ["Belief", "Detection", "ExploredTile", "FlightState", "LostTeammate", "PeerPlan", "PeerStatus"]


class FlightState(IntEnum):
    """What an onboard process is doing with its vehicle; the values are ``ARVI_FLIGHT_STATE``'s."""

    WAIT = 0
    STANDBY = 1
    ARM = 2
    TAKEOFF = 3
    HOLD = 4
    TRACK = 5
    RETURN = 6
    LAND = 7
    LANDED = 8
    RELEASED = 9


@dataclass(frozen=True, slots=True)
class Detection:
    """One look of one's own sensor at one target (``TARGET_DETECTION``).

    Attributes:
        time_s: UNIX time of the look, s.
        target_id: Which target.
        range_m: Measured horizontal distance, m.
        bearing_rad: Measured direction relative to yaw, rad.
    """

    time_s: float
    target_id: int
    range_m: float
    bearing_rad: float


@dataclass(frozen=True)
class Belief:
    """A robot's posterior of one target in information form (``TARGET_BELIEF``).

    Attributes:
        sender: System id.
        step: Mission step that it holds at.
        target_id: Which target.
        model: Target model; gives the size n.
        degree: How many neighbours the sender has, for Metropolis weights.
        information_vector: ω = Ω·mean, (n,).
        information_matrix: Ω, (n, n), symmetric positive definite.
    """

    sender: int
    step: int
    target_id: int
    model: TargetModel
    degree: int
    information_vector: NDArray[np.float64]
    information_matrix: NDArray[np.float64]


@dataclass(frozen=True)
class PeerPlan:
    """A robot's plan for an epoch (``ARVI_PLAN``).

    Attributes:
        sender: System id.
        step: Mission step at which it starts.
        start: Where it starts.
        controls: Primitive indices; −1 is the stop primitive.
        cost: J.
        lower_bound: Certified lower bound of the optimal J.
        epsilon: ε of the bound that holds; ∞ if none.
        delta: δ that goes with it, m.
        width: W of the last pass; None for no limit.
        planning_time_s: Time that planning took, s.
        budget_s: Time that it was given, s.
        nodes: Successors generated.
        feasible: Keeps fence, obstacles, separations.
        complete: Proven optimal.
    """

    sender: int
    step: int
    start: Pose
    controls: tuple[int, ...]
    cost: float
    lower_bound: float
    epsilon: float
    delta: float
    width: int | None
    planning_time_s: float
    budget_s: float
    nodes: int
    feasible: bool
    complete: bool


@dataclass(frozen=True, slots=True)
class ExploredTile:
    """What a robot has explored of one tile of 32 × 32 cells (``EXPLORED_TILE``).

    Attributes:
        tile_north: Tile index; its southern edge is at ``tile_north × 32 × cell``.
        tile_east: Tile index; its western edge is at ``tile_east × 32 × cell``.
        cell_mm: Side of a cell, mm.
        explored: 128 bytes; bit i (least significant first) of byte 4r + k is row r from the south, column 8k + i from
            the west.
        age_ds: Tenths of a second before this was said in which the cells were last looked at, at most, 0 to 65535; 0
            for what the sender sees now, and in a team that never forgets.
    """

    tile_north: int
    tile_east: int
    cell_mm: int
    explored: bytes
    age_ds: int = 0


@dataclass(frozen=True, slots=True)
class LostTeammate:
    """Where a teammate fell silent in the air, as somebody says who had heard it (``TEAMMATE_LOST``).

    Attributes:
        peer: System id.
        silence_s: Since anything of it was heard last, s.
        begin: North m, east m, where it was then.
        end: North m, east m, to where it may have flown on, straight.
        unsure_m: How far off this way it may be.
        down_m: How high it was, NED.
    """

    peer: int
    silence_s: float
    begin: tuple[float, float]
    end: tuple[float, float]
    unsure_m: float
    down_m: float


@dataclass(frozen=True, slots=True)
class PeerStatus:
    """What a peer says of itself once a step (``PLANNER_STATUS``, the part that peers act on).

    Attributes:
        sender: System id.
        mission_start_s: UNIX time of step 0, s; None if it has not been started.
        state: Flight state.
        position: North m, east m, down m.
        yaw_rad: Heading, rad.
        neighbours: System ids that it hears.
        over_home: Whether it is above its home at its layer, or on the ground.
        time_s: UNIX time at which all this was so, by the sender's clock, s.
        velocity: North m/s, east m/s.
        adrift: Whether it is in the air and not flown by its onboard process, as far as that knows.
    """

    sender: int
    mission_start_s: float | None
    state: FlightState
    position: tuple[float, float, float]
    yaw_rad: float
    neighbours: tuple[int, ...]
    over_home: bool
    time_s: float
    velocity: tuple[float, float] = (0.0, 0.0)
    adrift: bool = False
