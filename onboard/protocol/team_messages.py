"""The dialect's team messages to values and back (fields and units: ``arvi.xml``).

What comes from a radio is checked here for shape and range, before anything else sees it; whether a matrix is positive
definite is the filter's business.
"""

from __future__ import annotations

import math
import zlib
from collections.abc import Iterable, Sequence

import numpy as np
from numpy.typing import NDArray

from onboard.clock import MissionClock, unix_s, usec
from onboard.errors import OnboardError
from onboard.estimation.target_models import TargetModel
from onboard.geometry import Pose
from onboard.messages import Belief, Detection, ExploredTile, FlightState, LostTeammate, PeerPlan, PeerStatus
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink

__all__ = [
    "MessageError",
    "encode_belief",
    "encode_detection",
    "encode_landmarks",
    "encode_lost_teammate",
    "encode_plan",
    "encode_tile",
    "primitives_checksum",
    "read_belief",
    "read_detection",
    "read_landmarks",
    "read_lost_teammate",
    "read_plan",
    "read_status",
    "read_tile",
]

_MODELS = (TargetModel.DOUBLE_INTEGRATOR, TargetModel.RANDOM_WALK, TargetModel.STATIC)
_GRID_TOLERANCE = 0.02
MAX_CONTROLS = 64
MAX_LANDMARKS = 24
MAX_UNSURE_M = 10.0
MAX_WAY_M = 100.0
"""Of what is said of a lost teammate: longer than a vehicle flies on for, and it would ban all from everywhere."""


class MessageError(OnboardError):
    """A message whose content cannot be used; the text says which field and why."""


def primitives_checksum(primitives: Sequence[Primitive]) -> int:
    """16-bit checksum of a primitive table; plans only make sense between robots that share one."""
    table = np.array([(p.speed_m_s, p.yaw_rate_rad_s) for p in primitives], dtype="<f4")
    return zlib.crc32(table.tobytes()) & 0xFFFF


def encode_belief(belief: Belief, clock: MissionClock) -> mavlink.MAVLink_target_belief_message:
    """``TARGET_BELIEF`` of a belief."""
    size = belief.model.state_size
    vector = np.zeros(4)
    vector[:size] = belief.information_vector
    upper = np.zeros(10)
    packed = belief.information_matrix[np.triu_indices(size)]
    upper[: packed.size] = packed
    return mavlink.MAVLink_target_belief_message(
        usec(clock.time_of(belief.step)),
        vector.tolist(),
        upper.tolist(),
        belief.target_id,
        _MODELS.index(belief.model),
        belief.degree,
    )


def read_belief(message: mavlink.MAVLink_target_belief_message, clock: MissionClock) -> Belief:
    """The belief in a ``TARGET_BELIEF``.

    Raises:
        MessageError: Unknown model, a value that is not finite, or a time that is no step of this mission.
    """
    if message.model >= len(_MODELS):
        raise MessageError(f"TARGET_BELIEF.model = {message.model} is no ARVI_TARGET_MODEL (0..{len(_MODELS) - 1})")
    model = _MODELS[message.model]
    size = model.state_size
    vector = np.array(message.information_vector[:size], dtype=np.float64)
    matrix = _unpack_symmetric(message.information_matrix, size)
    if not (np.isfinite(vector).all() and np.isfinite(matrix).all()):
        raise MessageError(f"TARGET_BELIEF of target {message.target_id} has values that are not finite")
    return Belief(
        sender=message.get_srcSystem(),
        step=_step(message.time_usec, clock, "TARGET_BELIEF"),
        target_id=message.target_id,
        model=model,
        degree=message.degree,
        information_vector=vector,
        information_matrix=matrix,
    )


def encode_detection(detection: Detection) -> mavlink.MAVLink_target_detection_message:
    """``TARGET_DETECTION`` of a detection."""
    return mavlink.MAVLink_target_detection_message(
        usec(detection.time_s), detection.range_m, detection.bearing_rad, detection.target_id
    )


def read_detection(message: mavlink.MAVLink_target_detection_message) -> Detection:
    """The detection in a ``TARGET_DETECTION``.

    Raises:
        MessageError: Range or bearing is not finite, the range is negative, or the bearing outside ±2π.
    """
    if not (math.isfinite(message.range) and message.range >= 0.0):
        raise MessageError(f"TARGET_DETECTION.range = {message.range} m; it is finite and not negative")
    if not (math.isfinite(message.bearing) and abs(message.bearing) <= math.tau):
        raise MessageError(f"TARGET_DETECTION.bearing = {message.bearing} rad; it is within ±2π")
    return Detection(message.time_usec * 1e-6, message.target_id, message.range, message.bearing)


def encode_plan(plan: PeerPlan, clock: MissionClock, checksum: int) -> mavlink.MAVLink_arvi_plan_message:
    """``ARVI_PLAN`` of a plan."""
    controls = list(plan.controls) + [0] * (MAX_CONTROLS - len(plan.controls))
    flags = mavlink.ARVI_PLAN_FLAGS_FEASIBLE * plan.feasible + mavlink.ARVI_PLAN_FLAGS_COMPLETE * plan.complete
    if math.isfinite(plan.epsilon):
        flags += mavlink.ARVI_PLAN_FLAGS_BOUND
    return mavlink.MAVLink_arvi_plan_message(
        usec(clock.time_of(plan.step)),
        plan.start.north_m,
        plan.start.east_m,
        plan.start.yaw_rad,
        plan.cost,
        plan.lower_bound,
        plan.epsilon,
        plan.delta,
        plan.planning_time_s,
        plan.budget_s,
        min(plan.nodes, 0xFFFFFFFF),
        min(plan.width or 0, 0xFFFFFFFF),
        checksum,
        controls,
        len(plan.controls),
        flags,
    )


def read_plan(
    message: mavlink.MAVLink_arvi_plan_message, clock: MissionClock, checksum: int, primitive_count: int
) -> PeerPlan:
    """The plan in an ``ARVI_PLAN``.

    Raises:
        MessageError: It refers to another primitive table, starts at no step of this mission or at no finite place, or
            holds an index that the table does not have.
    """
    if message.primitives_crc != checksum:
        raise MessageError(
            f"ARVI_PLAN of vehicle {message.get_srcSystem()} refers to another primitive table "
            f"(checksum {message.primitives_crc:#06x}, ours {checksum:#06x}); the team flies one configuration"
        )
    if not all(math.isfinite(value) for value in (message.north, message.east, message.yaw)):
        raise MessageError("ARVI_PLAN starts at no finite place")
    if not 1 <= message.horizon <= MAX_CONTROLS:
        raise MessageError(f"ARVI_PLAN.horizon = {message.horizon}; it is 1..{MAX_CONTROLS}")
    controls = tuple(message.controls[: message.horizon])
    if not all(-1 <= control < primitive_count for control in controls):
        raise MessageError(f"ARVI_PLAN.controls holds an index outside -1..{primitive_count - 1}")
    return PeerPlan(
        sender=message.get_srcSystem(),
        step=_step(message.time_usec, clock, "ARVI_PLAN"),
        start=Pose(message.north, message.east, message.yaw),
        controls=controls,
        cost=message.cost,
        lower_bound=message.lower_bound,
        epsilon=message.epsilon,
        delta=message.delta,
        width=message.width or None,
        planning_time_s=message.planning_time,
        budget_s=message.budget,
        nodes=message.nodes,
        feasible=bool(message.flags & mavlink.ARVI_PLAN_FLAGS_FEASIBLE),
        complete=bool(message.flags & mavlink.ARVI_PLAN_FLAGS_COMPLETE),
    )


def encode_tile(tile: ExploredTile) -> mavlink.MAVLink_explored_tile_message:
    """``EXPLORED_TILE`` of a tile."""
    return mavlink.MAVLink_explored_tile_message(
        tile.tile_north, tile.tile_east, tile.cell_mm, list(tile.explored), tile.age_ds
    )


def read_tile(message: mavlink.MAVLink_explored_tile_message) -> ExploredTile:
    """The tile in an ``EXPLORED_TILE``; the map checks its place and age, and all its 16 bits of age are one."""
    return ExploredTile(message.tile_north, message.tile_east, message.cell, bytes(message.explored), message.age)


def encode_landmarks(time_s: float, places: Iterable[tuple[float, float]]) -> mavlink.MAVLink_arvi_landmarks_message:
    """``ARVI_LANDMARKS`` of places, north m and east m, at a step's UNIX time; the first 24 of them."""
    given = list(places)[:MAX_LANDMARKS]
    spare = [0.0] * (MAX_LANDMARKS - len(given))
    north_m, east_m = [*(north for north, _ in given), *spare], [*(east for _, east in given), *spare]
    return mavlink.MAVLink_arvi_landmarks_message(usec(time_s), north_m, east_m, len(given))


def read_landmarks(message: mavlink.MAVLink_arvi_landmarks_message) -> tuple[tuple[float, float], ...]:
    """North m and east m of the landmarks in an ``ARVI_LANDMARKS``.

    Raises:
        MessageError: More than it has room for, or a place that is not finite.
    """
    if message.count > MAX_LANDMARKS:
        raise MessageError(f"ARVI_LANDMARKS.count = {message.count}; there is room for {MAX_LANDMARKS}")
    places = tuple(zip(message.north[: message.count], message.east[: message.count], strict=True))
    if not all(math.isfinite(value) for place in places for value in place):
        raise MessageError("ARVI_LANDMARKS has a place that is not finite")
    return places


def read_status(message: mavlink.MAVLink_planner_status_message) -> PeerStatus:
    """What peers act on in a ``PLANNER_STATUS``.

    Raises:
        MessageError: Unknown flight state, or a position that is not finite.
    """
    try:
        state = FlightState(message.state)
    except ValueError:
        raise MessageError(f"PLANNER_STATUS.state = {message.state} is no ARVI_FLIGHT_STATE") from None
    position, velocity = (message.north, message.east, message.down), (message.velocity_north, message.velocity_east)
    if not all(math.isfinite(value) for value in (*position, *velocity, message.yaw)):
        raise MessageError(f"PLANNER_STATUS of vehicle {message.get_srcSystem()} has a pose that is not finite")
    return PeerStatus(
        sender=message.get_srcSystem(),
        mission_start_s=unix_s(message.mission_start_usec) if message.mission_start_usec else None,
        state=state,
        position=position,
        yaw_rad=message.yaw,
        neighbours=tuple(neighbour for neighbour in message.neighbours if neighbour),
        over_home=bool(message.over_home),
        time_s=message.time_usec * 1e-6,
        velocity=velocity,
        adrift=bool(message.adrift),
    )


def encode_lost_teammate(lost: LostTeammate) -> mavlink.MAVLink_teammate_lost_message:
    """``TEAMMATE_LOST`` of a lost teammate."""
    return mavlink.MAVLink_teammate_lost_message(
        lost.silence_s, *lost.begin, lost.down_m, *lost.end, lost.unsure_m, lost.peer
    )


def read_lost_teammate(message: mavlink.MAVLink_teammate_lost_message) -> LostTeammate:
    """The lost teammate in a ``TEAMMATE_LOST``.

    Raises:
        MessageError: A value that is not finite, a negative silence, or a way that no vehicle flies on for.
    """
    begin, end = (message.north, message.east), (message.north_end, message.east_end)
    if not all(math.isfinite(value) for value in (*begin, *end, message.down)):
        raise MessageError(f"TEAMMATE_LOST of vehicle {message.vehicle} has a place that is not finite")
    if not 0.0 <= message.silence < math.inf:
        raise MessageError(f"TEAMMATE_LOST.silence = {message.silence} s; it is finite and not negative")
    if not (0.0 <= message.unsure <= MAX_UNSURE_M and math.dist(begin, end) <= MAX_WAY_M):
        raise MessageError(
            f"TEAMMATE_LOST of vehicle {message.vehicle}: a way of {math.dist(begin, end):g} m give or take "
            f"{message.unsure:g} m; at most {MAX_WAY_M:g} m and {MAX_UNSURE_M:g} m"
        )
    return LostTeammate(message.vehicle, message.silence, begin, end, message.unsure, message.down)


def _step(time_usec: int, clock: MissionClock, name: str) -> int:
    """The mission step at a UNIX time, which must lie on the mission's grid."""
    steps = (time_usec * 1e-6 - clock.start_s) / clock.step_s
    if abs(steps - round(steps)) > _GRID_TOLERANCE:
        raise MessageError(f"{name}.time_usec = {time_usec} is no step of this mission (multiples of {clock.step_s} s)")
    return round(steps)


def _places(size: int) -> NDArray[np.intp]:
    """(size, size): where each entry of a symmetric matrix is in its packed upper triangle."""
    places = np.zeros((size, size), dtype=np.intp)
    rows, columns = np.triu_indices(size)
    places[rows, columns] = places[columns, rows] = np.arange(rows.size)
    return places


_PLACES = {model.state_size: _places(model.state_size) for model in _MODELS}


def _unpack_symmetric(packed: Sequence[float], size: int) -> NDArray[np.float64]:
    """A symmetric matrix from its upper triangle, row by row."""
    return np.array(packed, dtype=np.float64)[_PLACES[size]]
