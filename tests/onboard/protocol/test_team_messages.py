"""The dialect's team messages: what goes in comes out, what is absurd is refused by name."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from onboard.clock import MissionClock
from onboard.estimation.target_models import TargetModel
from onboard.geometry import Pose
from onboard.messages import Belief, Detection, ExploredTile, FlightState, LostTeammate, PeerPlan
from onboard.planning.primitives import Primitive
from onboard.protocol import dialect as mavlink
from onboard.protocol import team_messages as team
from onboard.protocol.codec import Codec

CLOCK = MissionClock(1_790_000_000.0, 0.5)
PRIMITIVES = (Primitive(1.0, 0.0), Primitive(1.0, 3.0))
CHECKSUM = team.primitives_checksum(PRIMITIVES)


def wire(message: mavlink.MAVLink_message, sender: int = 2) -> mavlink.MAVLink_message:
    (received,) = Codec(1, 191).decode(Codec(sender, 191).encode(message))
    return received


def plan(**changes: object) -> PeerPlan:
    values: dict[str, object] = {
        "sender": 2,
        "step": 40,
        "start": Pose(1.5, -2.25, 0.5),
        "controls": (0, 1, -1),
        "cost": -12.5,
        "lower_bound": -13.0,
        "epsilon": math.inf,
        "delta": math.inf,
        "width": None,
        "planning_time_s": 0.125,
        "budget_s": 0.15,
        "nodes": 1000,
        "feasible": True,
        "complete": False,
    }
    return PeerPlan(**(values | changes))  # type: ignore[arg-type]


@pytest.mark.parametrize("model", list(TargetModel))
def test_a_belief_keeps_its_values_to_single_precision(model: TargetModel) -> None:
    rng = np.random.default_rng(3)
    size = model.state_size
    root = rng.normal(size=(size, size))
    sent = Belief(2, 17, 9, model, 3, rng.normal(size=size), root @ root.T + np.eye(size))
    received = team.read_belief(wire(team.encode_belief(sent, CLOCK)), CLOCK)  # type: ignore[arg-type]
    assert (received.sender, received.step, received.target_id, received.model, received.degree) == (2, 17, 9, model, 3)
    np.testing.assert_allclose(received.information_matrix, sent.information_matrix, rtol=1e-6)
    np.testing.assert_allclose(received.information_vector, sent.information_vector, rtol=1e-6)
    np.testing.assert_array_equal(received.information_matrix, received.information_matrix.T)


@pytest.mark.parametrize("bad", [math.nan, math.inf])
def test_a_belief_that_is_not_finite_is_refused(bad: float) -> None:
    message = mavlink.MAVLink_target_belief_message(1_790_000_000_000_000, [bad, 0, 0, 0], [1.0] * 10, 1, 1, 0)
    with pytest.raises(team.MessageError, match="not finite"):
        team.read_belief(message, CLOCK)


def test_an_unknown_model_is_refused() -> None:
    message = mavlink.MAVLink_target_belief_message(1_790_000_000_000_000, [0.0] * 4, [1.0] * 10, 1, 7, 0)
    with pytest.raises(team.MessageError, match=r"model = 7"):
        team.read_belief(message, CLOCK)


def test_a_belief_between_two_steps_is_of_another_mission() -> None:
    message = mavlink.MAVLink_target_belief_message(1_790_000_000_200_000, [0.0] * 4, [1.0] * 10, 1, 1, 0)
    with pytest.raises(team.MessageError, match="no step of this mission"):
        team.read_belief(message, CLOCK)


@given(st.lists(st.integers(-1, 1), min_size=1, max_size=64), st.booleans(), st.booleans())
def test_a_plan_keeps_its_controls_and_flags(controls: list[int], feasible: bool, complete: bool) -> None:
    sent = plan(controls=tuple(controls), feasible=feasible, complete=complete)
    received = team.read_plan(wire(team.encode_plan(sent, CLOCK, CHECKSUM)), CLOCK, CHECKSUM, 2)  # type: ignore[arg-type]
    assert received == sent.__class__(**(sent.__dict__ | {"budget_s": pytest.approx(0.15)}))


def test_a_plan_for_another_primitive_table_is_refused() -> None:
    other = team.primitives_checksum((Primitive(1.0, 0.0), Primitive(1.0, 2.0)))
    message = team.encode_plan(plan(), CLOCK, other)
    with pytest.raises(team.MessageError, match="another primitive table"):
        team.read_plan(message, CLOCK, CHECKSUM, 2)


@pytest.mark.parametrize(
    ("field", "value", "text"),
    [("north", math.nan, "no finite place"), ("horizon", 0, "horizon = 0"), ("horizon", 65, "horizon = 65")],
)
def test_an_absurd_plan_is_refused(field: str, value: float, text: str) -> None:
    message = team.encode_plan(plan(), CLOCK, CHECKSUM)
    setattr(message, field, value)
    with pytest.raises(team.MessageError, match=text):
        team.read_plan(message, CLOCK, CHECKSUM, 2)


def test_a_control_outside_the_table_is_refused() -> None:
    message = team.encode_plan(plan(controls=(0, 2)), CLOCK, CHECKSUM)
    with pytest.raises(team.MessageError, match=r"outside -1\.\.1"):
        team.read_plan(message, CLOCK, CHECKSUM, 2)


def test_a_detection_and_a_tile_survive_the_wire() -> None:
    detection = Detection(1_790_000_000.5, 4, 0.75, -1.25)
    assert team.read_detection(wire(team.encode_detection(detection))) == detection  # type: ignore[arg-type]
    for age_ds in (0, 1, 65535):
        tile = ExploredTile(-3, 2, 250, bytes(range(128)), age_ds)
        assert team.read_tile(wire(team.encode_tile(tile))) == tile  # type: ignore[arg-type]


def test_a_tile_of_age_0_is_the_frame_of_those_who_know_no_ages() -> None:
    """An extension of zeros is not sent and not in the checksum: old and new read each other's."""
    frames = [Codec(2, 191).encode(team.encode_tile(ExploredTile(0, 0, 250, b"\xff" * 128, age))) for age in (0, 7)]
    assert [len(frame) for frame in frames] == [12 + 134, 12 + 135]


@pytest.mark.parametrize("count", [0, 1, 24, 30])
def test_landmarks_survive_the_wire_as_far_as_there_is_room(count: int) -> None:
    places = [(0.5 * i, -0.25 * i) for i in range(count)]
    message = team.encode_landmarks(1_790_000_000.5, places)
    assert team.read_landmarks(wire(message)) == tuple(places[:24])  # type: ignore[arg-type]


@pytest.mark.parametrize(("count", "north"), [(25, 0.0), (1, math.nan), (2, math.inf)])
def test_absurd_landmarks_are_refused(count: int, north: float) -> None:
    with pytest.raises(team.MessageError, match="ARVI_LANDMARKS"):
        team.read_landmarks(mavlink.MAVLink_arvi_landmarks_message(1, [north] * 24, [0.0] * 24, count))


LOST = LostTeammate(3, 4.5, (1.0, -2.0), (2.5, -2.0), 0.25, -1.5)


def test_a_lost_teammate_survives_the_wire() -> None:
    assert team.read_lost_teammate(wire(team.encode_lost_teammate(LOST))) == LOST  # type: ignore[arg-type]


@pytest.mark.parametrize(
    "changes",
    [
        {"silence_s": -1.0},
        {"silence_s": math.nan},
        {"silence_s": math.inf},
        {"begin": (math.nan, 0.0)},
        {"end": (2.5, math.inf)},
        {"end": (200.0, 0.0)},
        {"unsure_m": 1e6},
        {"unsure_m": -0.1},
        {"unsure_m": math.nan},
        {"down_m": math.nan},
    ],
    ids=str,
)
def test_an_absurd_lost_teammate_is_refused(changes: dict[str, Any]) -> None:
    with pytest.raises(team.MessageError, match="TEAMMATE_LOST"):
        team.read_lost_teammate(wire(team.encode_lost_teammate(replace(LOST, **changes))))  # type: ignore[arg-type]


@pytest.mark.parametrize(("distance", "bearing"), [(-1.0, 0.0), (math.nan, 0.0), (1.0, math.nan), (1.0, 7.0)])
def test_an_absurd_detection_is_refused(distance: float, bearing: float) -> None:
    with pytest.raises(team.MessageError, match="TARGET_DETECTION"):
        team.read_detection(mavlink.MAVLink_target_detection_message(1, distance, bearing, 1))


def status(**changes: object) -> mavlink.MAVLink_message:
    values: dict[str, object] = dict.fromkeys(mavlink.MAVLink_planner_status_message.fieldnames, 0)
    values |= {
        "neighbours": [3, 1] + [0] * 30,
        "neighbour_loss": [255] * 32,
        "mission_start_usec": 1_790_000_000_000_000,
        "state": 5,
        "down": -1.5,
        "velocity_east": 0.5,
        "adrift": 1,
    }
    return wire(mavlink.MAVLink_planner_status_message(**(values | changes)))  # type: ignore[arg-type]


def test_a_status_tells_who_is_where_and_whom_it_hears() -> None:
    received = team.read_status(status())  # type: ignore[arg-type]
    assert received.sender == 2
    assert received.neighbours == (3, 1)
    assert received.mission_start_s == 1_790_000_000.0
    assert received.state is FlightState.TRACK
    assert received.position == (0.0, 0.0, -1.5)
    assert received.velocity == (0.0, 0.5)
    assert received.adrift


@pytest.mark.parametrize(
    ("changes", "text"),
    [({"state": 77}, "state = 77"), ({"north": math.inf}, "not finite"), ({"velocity_east": math.nan}, "not finite")],
)
def test_an_absurd_status_is_refused(changes: dict[str, object], text: str) -> None:
    with pytest.raises(team.MessageError, match=text):
        team.read_status(status(**changes))  # type: ignore[arg-type]
