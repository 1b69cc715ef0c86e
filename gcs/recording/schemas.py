"""JSON schemas of the MCAP channels: Foxglove's well-known ones, which its viewers know by name, and our own.

Foxglove's are described at https://docs.foxglove.dev/docs/sdk/schemas; a viewer knows a message by its schema's name,
and the schema tells it the fields' types (which strings are bytes in base64).
"""

from __future__ import annotations

from typing import Any

__all__ = ["FRAME_TRANSFORMS", "GRID", "LOG", "SCENE_UPDATE", "TARGETS", "TEAM", "VEHICLE", "Schema"]

Schema = dict[str, Any]

_NUMBER: Schema = {"type": "number"}
_STRING: Schema = {"type": "string"}
_BOOLEAN: Schema = {"type": "boolean"}
_COUNT: Schema = {"type": "integer", "minimum": 0}


def _object(title: str, **properties: Schema) -> Schema:
    return {"title": title, "type": "object", "properties": properties, "required": list(properties)}


def _list(items: Schema) -> Schema:
    return {"type": "array", "items": items}


def _choice(title: str, *names: str) -> Schema:
    return {"title": title, "oneOf": [{"title": name, "const": value} for value, name in enumerate(names)]}


def _known(title: str, **properties: Schema) -> Schema:
    """An object of ours, from which is left out what nobody knows; viewers want one type for each field."""
    return {"title": title, "type": "object", "properties": properties, "required": ["timestamp"]}


_TIME = _object("time", sec=_COUNT, nsec={**_COUNT, "maximum": 999_999_999})
_DURATION = _object("duration", sec={"type": "integer"}, nsec={**_COUNT, "maximum": 999_999_999})
_VECTOR_2 = _object("foxglove.Vector2", x=_NUMBER, y=_NUMBER)
_VECTOR_3 = _object("foxglove.Vector3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_POINT_3 = _object("foxglove.Point3", x=_NUMBER, y=_NUMBER, z=_NUMBER)
_QUATERNION = _object("foxglove.Quaternion", x=_NUMBER, y=_NUMBER, z=_NUMBER, w=_NUMBER)
_POSE = _object("foxglove.Pose", position=_VECTOR_3, orientation=_QUATERNION)
_COLOR = _object("foxglove.Color", r=_NUMBER, g=_NUMBER, b=_NUMBER, a=_NUMBER)
_KEY_VALUE = _object("foxglove.KeyValuePair", key=_STRING, value=_STRING)

_ARROW = _object(
    "foxglove.ArrowPrimitive", pose=_POSE, shaft_length=_NUMBER, shaft_diameter=_NUMBER, head_length=_NUMBER,
    head_diameter=_NUMBER, color=_COLOR,
)  # fmt: skip
_SOLID = {"pose": _POSE, "size": _VECTOR_3, "color": _COLOR}
_CUBE = _object("foxglove.CubePrimitive", **_SOLID)
_SPHERE = _object("foxglove.SpherePrimitive", **_SOLID)
_CYLINDER = _object("foxglove.CylinderPrimitive", **_SOLID, bottom_scale=_NUMBER, top_scale=_NUMBER)
_LINE = _object(
    "foxglove.LinePrimitive", type=_choice("foxglove.LineType", "LINE_STRIP", "LINE_LOOP", "LINE_LIST"), pose=_POSE,
    thickness=_NUMBER, scale_invariant=_BOOLEAN, points=_list(_POINT_3), color=_COLOR, colors=_list(_COLOR),
    indices=_list(_COUNT),
)  # fmt: skip
_TRIANGLES = _object(
    "foxglove.TriangleListPrimitive", pose=_POSE, points=_list(_POINT_3), color=_COLOR, colors=_list(_COLOR),
    indices=_list(_COUNT),
)  # fmt: skip
_TEXT = _object(
    "foxglove.TextPrimitive", pose=_POSE, billboard=_BOOLEAN, font_size=_NUMBER, scale_invariant=_BOOLEAN,
    color=_COLOR, text=_STRING,
)  # fmt: skip
_MODEL = _object(
    "foxglove.ModelPrimitive", pose=_POSE, scale=_VECTOR_3, color=_COLOR, override_color=_BOOLEAN, url=_STRING,
    media_type=_STRING, data={"type": "string", "contentEncoding": "base64"},
)  # fmt: skip
_ENTITY = _object(
    "foxglove.SceneEntity", timestamp=_TIME, frame_id=_STRING, id=_STRING, lifetime=_DURATION, frame_locked=_BOOLEAN,
    metadata=_list(_KEY_VALUE), arrows=_list(_ARROW), cubes=_list(_CUBE), spheres=_list(_SPHERE),
    cylinders=_list(_CYLINDER), lines=_list(_LINE), triangles=_list(_TRIANGLES), texts=_list(_TEXT),
    models=_list(_MODEL),
)  # fmt: skip
_DELETION = _object(
    "foxglove.SceneEntityDeletion",
    timestamp=_TIME,
    type=_choice("foxglove.SceneEntityDeletionType", "MATCHING_ID", "ALL"),
    id=_STRING,
)

SCENE_UPDATE = _object("foxglove.SceneUpdate", deletions=_list(_DELETION), entities=_list(_ENTITY))
FRAME_TRANSFORMS = _object(
    "foxglove.FrameTransforms",
    transforms=_list(
        _object(
            "foxglove.FrameTransform", timestamp=_TIME, parent_frame_id=_STRING, child_frame_id=_STRING,
            translation=_VECTOR_3, rotation=_QUATERNION,
        )
    ),
)  # fmt: skip
GRID = _object(
    "foxglove.Grid", timestamp=_TIME, frame_id=_STRING, pose=_POSE, column_count=_COUNT, cell_size=_VECTOR_2,
    row_stride=_COUNT, cell_stride=_COUNT,
    fields=_list(
        _object(
            "foxglove.PackedElementField", name=_STRING, offset=_COUNT,
            type=_choice(
                "foxglove.NumericType", "UNKNOWN", "UINT8", "INT8", "UINT16", "INT16", "UINT32", "INT32", "FLOAT32",
                "FLOAT64",
            ),
        )
    ),
    data={"type": "string", "contentEncoding": "base64"},
)  # fmt: skip
LOG = _object(
    "foxglove.Log", timestamp=_TIME,
    level=_choice("foxglove.LogLevel", "UNKNOWN", "DEBUG", "INFO", "WARNING", "ERROR", "FATAL"),
    message=_STRING, name=_STRING, file=_STRING, line=_COUNT,
)  # fmt: skip
"""``file`` holds the MAV_SEVERITY by name, which is finer than the level."""

TEAM = _known(
    "arvi.Team", timestamp=_TIME, phase=_STRING, time_left_s=_NUMBER, discovered=_NUMBER, target_count=_NUMBER,
    rmse_m=_NUMBER, rmse_mean_m=_NUMBER, entropy_nats=_NUMBER, entropy_mean_nats=_NUMBER, explored_share=_NUMBER,
    behind_s=_NUMBER,
)  # fmt: skip
VEHICLE = _known(
    "arvi.Vehicle", timestamp=_TIME, id=_NUMBER, flight_state=_STRING, mode=_STRING, armed=_BOOLEAN, battery=_NUMBER,
    north_m=_NUMBER, east_m=_NUMBER, height_m=_NUMBER, yaw_rad=_NUMBER, speed_m_s=_NUMBER, autopilot_age_s=_NUMBER,
    onboard_age_s=_NUMBER, plan_age_s=_NUMBER, planning_time_s=_NUMBER, planning_budget_s=_NUMBER, plans=_NUMBER,
    deadline_misses=_NUMBER, setpoint_rate_hz=_NUMBER, tracking_error_m=_NUMBER, neighbours=_NUMBER,
    targets=_NUMBER, cost=_NUMBER, lower_bound=_NUMBER, epsilon=_NUMBER, delta_m=_NUMBER, width=_NUMBER,
    nodes=_NUMBER, link_loss=_NUMBER, radio_loss_max=_NUMBER, delay_s=_NUMBER,
)  # fmt: skip
TARGETS = _object(
    "arvi.Targets", timestamp=_TIME,
    targets=_list(
        _known(
            "arvi.Target", timestamp=_TIME, id=_NUMBER, robot=_NUMBER, north_m=_NUMBER, east_m=_NUMBER,
            position_std_m=_NUMBER, entropy_nats=_NUMBER, known_by=_NUMBER, truth_north_m=_NUMBER,
            truth_east_m=_NUMBER, error_m=_NUMBER,
        )
    ),
)  # fmt: skip
