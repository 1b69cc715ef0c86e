"""The pieces of Foxglove's scene messages as plain dictionaries: entities, primitives, poses, colours, times.

Field by field: https://docs.foxglove.dev/docs/sdk/schemas/scene-update. Lengths are in metres, angles in radians.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Any

__all__ = [
    "about_z",
    "colour",
    "entity",
    "label",
    "line",
    "nanoseconds",
    "pose",
    "scene_update",
    "solid",
    "timestamp",
    "transform",
    "xyz",
]


def scene_update(now_s: float, entities: Iterable[dict[str, Any]]) -> dict[str, Any]:
    """All of a topic: what was there before goes."""
    return {"deletions": [{"timestamp": timestamp(now_s), "type": 1, "id": ""}], "entities": list(entities)}


def entity(
    name: str,
    frame: str,
    now_s: float,
    *,
    locked: bool = False,
    metadata: dict[str, Any] | None = None,
    **primitives: list[dict[str, Any]],
) -> dict[str, Any]:
    """A named group of primitives.

    Args:
        name: Replaces the entity of the same name.
        frame: That its coordinates are given in.
        now_s: UNIX time.
        locked: Whether it moves along with the frame.
        metadata: Shown when it is selected.
        primitives: Lists by kind: arrows, cubes, spheres, cylinders, lines, triangles, texts, models.
    """
    kinds = ("arrows", "cubes", "spheres", "cylinders", "lines", "triangles", "texts", "models")
    return {
        "timestamp": timestamp(now_s),
        "frame_id": frame,
        "id": name,
        "lifetime": {"sec": 0, "nsec": 0},
        "frame_locked": locked,
        "metadata": [{"key": key, "value": str(value)} for key, value in (metadata or {}).items()],
        **{kind: primitives.get(kind, []) for kind in kinds},
    }


def line(
    points: Iterable[tuple[float, float, float]], rgba: dict[str, float], pixels: float, *, loop: bool = False
) -> dict[str, Any]:
    """A line strip through points, its thickness in pixels; a loop goes back to the first point."""
    return {
        "type": int(loop),
        "pose": pose((0.0, 0.0, 0.0)),
        "thickness": pixels,
        "scale_invariant": True,
        "points": [xyz(point) for point in points],
        "color": rgba,
        "colors": [],
        "indices": [],
    }


def label(text: str, place: tuple[float, float, float], code: str) -> dict[str, Any]:
    """A text that faces the camera."""
    return {
        "pose": pose(place),
        "billboard": True,
        "font_size": 14.0,
        "scale_invariant": True,
        "color": colour(code, 1.0),
        "text": text,
    }


def solid(
    centre: tuple[float, float, float], size: tuple[float, float, float], rgba: dict[str, float], yaw: float = 0.0
) -> dict[str, Any]:
    """A cube, sphere or cylinder: its centre, its size along each axis, and its yaw."""
    return {"pose": pose(centre, yaw), "size": xyz(size), "color": rgba}


def transform(
    parent: str, child: str, now_s: float, place: tuple[float, float, float], turn: tuple[float, float, float, float]
) -> dict[str, Any]:
    """Where a child frame is in its parent; ``turn`` is a quaternion x, y, z, w."""
    return {
        "timestamp": timestamp(now_s),
        "parent_frame_id": parent,
        "child_frame_id": child,
        "translation": xyz(place),
        "rotation": dict(zip("xyzw", turn, strict=True)),
    }


def pose(place: tuple[float, float, float], yaw: float = 0.0) -> dict[str, Any]:
    """A place, and a turn about z."""
    return {"position": xyz(place), "orientation": dict(zip("xyzw", about_z(yaw), strict=True))}


def about_z(angle: float) -> tuple[float, float, float, float]:
    """The quaternion x, y, z, w of a turn about z."""
    return 0.0, 0.0, round(math.sin(0.5 * angle), 6), round(math.cos(0.5 * angle), 6)


def xyz(values: tuple[float, float, float]) -> dict[str, float]:
    """Three coordinates, to a tenth of a millimetre."""
    return {name: round(value, 4) for name, value in zip("xyz", values, strict=True)}


def colour(code: str, alpha: float) -> dict[str, float]:
    """``#rrggbb`` and an opacity from 0 to 1."""
    red, green, blue = (round(int(code[i : i + 2], 16) / 255, 3) for i in (1, 3, 5))
    return {"r": red, "g": green, "b": blue, "a": alpha}


def timestamp(time_s: float) -> dict[str, int]:
    """A UNIX time in s as Foxglove's time."""
    sec, nsec = divmod(nanoseconds(time_s), 1_000_000_000)
    return {"sec": sec, "nsec": nsec}


def nanoseconds(time_s: float) -> int:
    """A UNIX time in ns, so exact that dividing by 10⁹ gives it back."""
    return int(time_s) * 1_000_000_000 + round(time_s % 1.0 * 1e9)
