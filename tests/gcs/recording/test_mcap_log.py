"""The MCAP file, opened by readers that nobody here wrote: mcap's, and Foxglove's own message classes."""

import base64
import json
import math

import pytest
from foxglove_schemas_protobuf.FrameTransforms_pb2 import FrameTransforms
from foxglove_schemas_protobuf.Grid_pb2 import Grid
from foxglove_schemas_protobuf.Log_pb2 import Log
from foxglove_schemas_protobuf.SceneUpdate_pb2 import SceneUpdate
from google.protobuf import json_format
from mcap.reader import make_reader

from gcs.recording.mcap_log import read_mcap
from gcs.recording.recorder import MCAP_NAME

FOXGLOVE = {
    "foxglove.SceneUpdate": SceneUpdate,
    "foxglove.FrameTransforms": FrameTransforms,
    "foxglove.Grid": Grid,
    "foxglove.Log": Log,
}


def protobuf_json(value):
    """Foxglove's JSON as protobuf's: a time is a text there."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nsec"}:
            return None if value["sec"] == 0 else f"{value['sec'] * 10**9 + value['nsec']}"
        return {key: protobuf_json(item) for key, item in value.items() if protobuf_json(item) is not None}
    return [protobuf_json(item) for item in value] if isinstance(value, list) else value


def without_times(value):
    if isinstance(value, dict):
        kept = {key: item for key, item in value.items() if key not in ("timestamp", "lifetime")}
        return {key: without_times(item) for key, item in kept.items()}
    return [without_times(item) for item in value] if isinstance(value, list) else value


def check_schema(value, schema, where="message"):
    """Every field is in the schema and of its type, every required one is there."""
    if "oneOf" in schema:
        assert value in [choice["const"] for choice in schema["oneOf"]], where
        return
    match schema["type"]:
        case "object":
            assert isinstance(value, dict), where
            assert value.keys() <= schema["properties"].keys(), where
            assert set(schema["required"]) <= value.keys(), where
            for key, item in value.items():
                check_schema(item, schema["properties"][key], f"{where}.{key}")
        case "array":
            for item in value:
                check_schema(item, schema["items"], f"{where}[]")
        case "number":
            assert isinstance(value, int | float), where
            assert math.isfinite(value), where
        case "integer":
            assert isinstance(value, int), where
        case kind:
            assert isinstance(value, {"string": str, "boolean": bool}[kind]), where


def test_the_plain_reader_finds_every_topic_with_content_that_fits_its_schema(flown):
    with (flown.folder / MCAP_NAME).open("rb") as file:
        reader = make_reader(file)
        counts = reader.get_summary().statistics.channel_message_counts
        seen = {}
        for schema, channel, message in reader.iter_messages():
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            content = json.loads(message.data)
            check_schema(content, json.loads(schema.data), channel.topic)
            seen[channel.topic] = seen.get(channel.topic, 0) + 1
            if schema.name in FOXGLOVE and seen[channel.topic] <= 20:
                json_format.ParseDict(without_times(content), FOXGLOVE[schema.name]())
        attachments = {attachment.name: attachment.data for attachment in reader.iter_attachments()}
    assert sum(counts.values()) == sum(seen.values())
    shown = len(flown.states)
    assert seen["/tf"] == pytest.approx(shown / 2, rel=0.1), "five moments a second"
    assert seen["/events"] == len(flown.events)
    assert seen["/arena"] == 1
    scenes = {"/vehicles", "/trails", "/plans", "/estimates", "/radio", "/truth", "/explored", "/landmarks"}
    assert seen.keys() == scenes | {"/tf", "/arena", "/events", "/team", "/targets"} | {
        f"/vehicle_{vehicle.id}" for vehicle in flown.scenario.vehicles
    }
    assert attachments.keys() == {"scenario.yaml", "flight.json"}
    assert attachments["scenario.yaml"] == (flown.folder / "scenario.yaml").read_bytes()


def test_values_agree_with_what_the_operator_saw_and_with_the_summary(flown):
    last = {}
    for message in read_mcap(flown.folder / MCAP_NAME):
        last[message.topic] = message.content
    by_time = {round(state.time_s, 3): state for state in flown.states}
    stamp = last["/team"]["timestamp"]
    state = by_time[round(stamp["sec"] + stamp["nsec"] * 1e-9, 3)]
    assert last["/team"]["discovered"] == state.discovered == flown.summary["discovered"]
    assert last["/team"]["rmse_mean_m"] == pytest.approx(flown.summary["rmse_m"], abs=1e-3)
    assert last["/team"]["entropy_mean_nats"] == pytest.approx(flown.summary["entropy_nats"], abs=1e-3)
    for vehicle in flown.summary["vehicles"]:
        numbers = last[f"/vehicle_{vehicle['id']}"]
        assert (numbers["plans"], numbers["deadline_misses"]) == (vehicle["plans"], vehicle["deadline_misses"])
        assert numbers["armed"] is False


def test_mission_ned_turns_into_a_map_with_north_up_east_right_and_z_up(flown):
    """p' = q p q* with the quaternion of the file, worked out by hand."""
    first = next(read_mcap(flown.folder / MCAP_NAME, frozenset({"/tf"}))).content["transforms"][0]
    assert (first["parent_frame_id"], first["child_frame_id"]) == ("map", "mission_ned")
    x, y, z, w = (first["rotation"][axis] for axis in "xyzw")
    rotation = [
        [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
        [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
        [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
    ]
    north, east, down = ([row[i] for row in rotation] for i in range(3))
    assert north == pytest.approx([0.0, 1.0, 0.0], abs=1e-9)
    assert east == pytest.approx([1.0, 0.0, 0.0], abs=1e-9)
    assert down == pytest.approx([0.0, 0.0, -1.0], abs=1e-9)


def test_vehicles_targets_and_explored_cells_are_where_the_team_has_them(flown):
    scenes = {"/tf": [], "/estimates": [], "/explored": []}
    for message in read_mcap(flown.folder / MCAP_NAME, frozenset(scenes)):
        scenes[message.topic].append(message)
    by_time = {round(state.time_s, 3): state for state in flown.states}
    message = scenes["/tf"][len(scenes["/tf"]) // 2]
    state = by_time[round(message.time_s, 3)]
    for transform in message.content["transforms"][1:]:
        vehicle = state.vehicle(int(transform["child_frame_id"].removeprefix("vehicle_")))
        place = [transform["translation"][axis] for axis in "xyz"]
        assert place == pytest.approx([vehicle.north_m, vehicle.east_m, -vehicle.height_m], abs=2e-3)
        assert 2 * math.atan2(transform["rotation"]["z"], transform["rotation"]["w"]) % (2 * math.pi) == pytest.approx(
            vehicle.yaw_rad % (2 * math.pi), abs=1e-3
        )
    message = next(found for found in reversed(scenes["/estimates"]) if found.content["entities"])
    state = by_time[round(message.time_s, 3)]
    best = {f"target {target.id}": target.best for target in state.targets if target.best is not None}
    assert message.content["entities"]
    for entity in message.content["entities"]:
        estimate, (disc,) = best[entity["id"]], entity["cylinders"]
        # The disc's axes give back the covariance: Σ = R diag(a², b²)/4χ² Rᵀ with χ² = −2 ln 0.05.
        yaw = 2 * math.atan2(disc["pose"]["orientation"]["z"], disc["pose"]["orientation"]["w"])
        a, b = (disc["size"][axis] ** 2 / (4 * -2 * math.log(0.05)) for axis in "xy")
        c, s = math.cos(yaw), math.sin(yaw)
        covariance = [a * c * c + b * s * s, (a - b) * s * c, a * s * s + b * c * c]
        assert covariance == pytest.approx(estimate.covariance_m2, rel=1e-2, abs=1e-3)
    grid = scenes["/explored"][-1]
    area = by_time[round(grid.time_s, 3)].explored
    pixels = base64.b64decode(grid.content["data"])
    assert sum(alpha > 0 for alpha in pixels[3::4]) == int(area.cells.sum()) > 0
    assert grid.content["column_count"] == area.cells.shape[1]


def test_a_file_cut_anywhere_reads_as_far_as_its_last_whole_chunk(flown, tmp_path):
    whole = (flown.folder / MCAP_NAME).read_bytes()
    messages = list(read_mcap(flown.folder / MCAP_NAME))
    cut = tmp_path / "cut.mcap"
    before = 0
    for i in range(25):
        cut.write_bytes(whole[: len(whole) * i // 24])
        read = list(read_mcap(cut))
        assert read == messages[: len(read)]
        assert len(read) >= before
        before = len(read)
    assert before == len(messages)
    cut.write_bytes(whole[: len(whole) // 2] + b"\xff" * 500 + whole[len(whole) // 2 + 500 :])
    damaged = list(read_mcap(cut))
    assert 0 < len(damaged) < len(messages)
    assert damaged == messages[: len(damaged)]
