"""Problem files, format ``arvi-problem/1``: JSON, checked strictly.

The schema is ``arvi-problem-1.schema.json`` beside this module. What it cannot say (a covariance is positive definite,
a fence does not cross itself, sizes agree) is checked here as well.
"""

from __future__ import annotations

import json
import math
from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from onboard.estimation.sensor import RangeBearingSensor
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.geometry import Pose, wrap_angle
from onboard.planning.primitives import Primitive
from onboard.planning.problem import Block, Obstacles, Problem, Teammate

__all__ = ["FORMAT", "ProblemFileError", "load_problem", "parse_problem", "problem_schema"]

FORMAT = "arvi-problem/1"

_MAX_BYTES = 16_000_000
_MAX_ERRORS = 5
_MESSAGES = {"extra_forbidden": "unknown key", "missing": "missing"}

Finite = Annotated[float, Field(allow_inf_nan=False, ge=-1e9, le=1e9)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1e9)]
NotNegative = Annotated[float, Field(allow_inf_nan=False, ge=0.0, le=1e9)]
Position = tuple[Finite, Finite]
PoseRow = tuple[Finite, Finite, Finite]


class ProblemFileError(ValueError):
    """A problem file that cannot be used; the message says what is wrong, where, and what would be right."""


class _Model(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True, frozen=True)


class _Sensor(_Model):
    range_std_m: Positive
    bearing_std_deg: Positive
    max_range_m: Positive
    min_range_m: Positive = 0.1
    fov_deg: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=360.0)]
    noise_floor: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=1.0)] = 0.1


class _Target(_Model):
    id: int
    model: Literal["double_integrator", "random_walk", "static"]
    noise: NotNegative = 0.0
    mean: Annotated[list[Finite], Field(min_length=2, max_length=4)]
    covariance: Annotated[list[Annotated[list[Finite], Field(min_length=2, max_length=4)]], Field(min_length=2)]

    @model_validator(mode="after")
    def _sizes_and_definiteness(self) -> _Target:
        size = TargetModel(self.model).state_size
        if len(self.mean) != size:
            raise ValueError(f"mean: {self.model} has {size} states, got {len(self.mean)} numbers")
        if len(self.covariance) != size or any(len(row) != size for row in self.covariance):
            raise ValueError(f"covariance: a {size} × {size} matrix is needed for {self.model}")
        matrix = np.array(self.covariance)
        if not np.allclose(matrix, matrix.T, rtol=1e-9, atol=1e-12):
            raise ValueError("covariance: must be symmetric")
        smallest, largest = np.linalg.eigvalsh(matrix)[[0, -1]]
        if not smallest > 1e-12 * largest:
            raise ValueError(f"covariance: must be positive definite, its smallest eigenvalue is {smallest:.3g}")
        return self


class _Teammate(_Model):
    poses: Annotated[list[PoseRow], Field(min_length=1, max_length=100)]
    separation_m: NotNegative = 0.0


class _Obstacles(_Model):
    blocked: Annotated[
        list[Annotated[list[Annotated[int, Field(ge=0, le=1)]], Field(min_length=1, max_length=2000)]],
        Field(min_length=1, max_length=2000),
    ]
    origin_north_m: Finite
    origin_east_m: Finite
    cell_m: Positive

    @model_validator(mode="after")
    def _rectangular(self) -> _Obstacles:
        if len({len(row) for row in self.blocked}) != 1:
            raise ValueError("blocked: all rows need the same length")
        return self


class _Problem(_Model):
    format: Literal["arvi-problem/1"]
    name: str = ""
    pose: PoseRow
    step_s: Annotated[float, Field(allow_inf_nan=False, gt=0.0, le=60.0)]
    horizon: Annotated[int, Field(ge=1, le=100)]
    primitives: Annotated[list[Position], Field(min_length=1, max_length=1000)]
    sensor: _Sensor
    targets: Annotated[list[_Target], Field(max_length=1000)]
    teammates: Annotated[list[_Teammate], Field(max_length=100)] = []
    fence: Annotated[list[Position], Field(min_length=3, max_length=200)] | None = None
    obstacles: _Obstacles | None = None

    @model_validator(mode="after")
    def _agreement(self) -> _Problem:
        for index, teammate in enumerate(self.teammates):
            if len(teammate.poses) != self.horizon:
                raise ValueError(
                    f"teammates.{index}.poses: one pose for each of {self.horizon} steps is needed, "
                    f"got {len(teammate.poses)}"
                )
        ids = [target.id for target in self.targets]
        if len(set(ids)) != len(ids):
            raise ValueError("targets: every id must be different")
        if self.fence is not None and not _is_simple(self.fence):
            raise ValueError("fence: must be a polygon that does not cross itself")
        return self


def problem_schema() -> dict[str, Any]:
    """The JSON schema of the format."""
    schema = _Problem.model_json_schema(mode="validation")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **schema, "title": FORMAT}


def load_problem(path: Path) -> Problem:
    """Read a problem file.

    Raises:
        ProblemFileError: If the file cannot be read, is not JSON, or does not follow the format.
    """
    try:
        size = path.stat().st_size
        if size > _MAX_BYTES:
            raise ProblemFileError(f"{path}: has {size} bytes, at most {_MAX_BYTES} are allowed")
        text = path.read_text(encoding="utf-8")
    except OSError as error:
        raise ProblemFileError(f"{path}: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ProblemFileError(f"{path}: not UTF-8 text") from error
    try:
        return parse_problem(text)
    except ProblemFileError as error:
        raise ProblemFileError(f"{path}: {error}") from error


def parse_problem(text: str) -> Problem:
    """Read a problem from JSON text.

    Raises:
        ProblemFileError: If it is not JSON or does not follow the format.
    """
    try:
        data = json.loads(text)
    except (ValueError, RecursionError) as error:
        raise ProblemFileError(f"not valid JSON: {error}") from error
    if not isinstance(data, dict):
        raise ProblemFileError(f"a JSON object is needed, got {type(data).__name__}")
    try:
        # Validated as JSON text: there a list is a tuple, which strict mode would refuse in Python data.
        model = _Problem.model_validate_json(text)
    except ValidationError as error:
        raise ProblemFileError(_explain(error)) from error
    return _to_problem(model)


def _explain(error: ValidationError) -> str:
    """All complaints in one line, each with the path of its key."""
    details = error.errors(include_url=False, include_input=False, include_context=False)
    parts = []
    for detail in details[:_MAX_ERRORS]:
        path = ".".join(str(part) for part in detail["loc"])
        message = _MESSAGES.get(detail["type"], detail["msg"].removeprefix("Value error, "))
        parts.append(f"{path}: {message}" if path else message)
    if len(details) > _MAX_ERRORS:
        parts.append(f"and {len(details) - _MAX_ERRORS} more")
    return "; ".join(parts)


def _is_simple(corners: list[tuple[float, float]]) -> bool:
    """Whether a polygon has an area and no two of its sides meet except at their common corner."""
    count = len(corners)
    if len(set(corners)) != count:
        return False
    area = sum(a[0] * b[1] - a[1] * b[0] for a, b in zip(corners, corners[1:] + corners[:1], strict=True))
    sides = [(corners[i], corners[(i + 1) % count]) for i in range(count)]
    return area != 0.0 and not any(
        _meet(*sides[i], *sides[j]) for i, j in combinations(range(count), 2) if j - i > 1 and j - i < count - 1
    )


def _meet(a: tuple[float, float], b: tuple[float, float], c: tuple[float, float], d: tuple[float, float]) -> bool:
    def side(p: tuple[float, float], q: tuple[float, float], r: tuple[float, float]) -> float:
        return (q[0] - p[0]) * (r[1] - p[1]) - (q[1] - p[1]) * (r[0] - p[0])

    return side(a, b, c) * side(a, b, d) <= 0.0 and side(c, d, a) * side(c, d, b) <= 0.0


def _to_problem(model: _Problem) -> Problem:
    sensor = model.sensor
    return Problem(
        pose=Pose(model.pose[0], model.pose[1], wrap_angle(model.pose[2])),
        step_s=model.step_s,
        horizon=model.horizon,
        primitives=tuple(Primitive(speed, yaw_rate) for speed, yaw_rate in model.primitives),
        sensor=RangeBearingSensor(
            range_std_m=sensor.range_std_m,
            bearing_std_rad=math.radians(sensor.bearing_std_deg),
            max_range_m=sensor.max_range_m,
            fov_rad=math.radians(sensor.fov_deg),
            noise_floor=sensor.noise_floor,
            min_range_m=sensor.min_range_m,
        ),
        blocks=tuple(
            Block(
                target.id,
                TargetMotion(TargetModel(target.model), target.noise),
                np.array(target.mean, dtype=np.float64),
                np.array(target.covariance, dtype=np.float64),
            )
            for target in model.targets
        ),
        teammates=tuple(
            Teammate(np.array(teammate.poses, dtype=np.float64), teammate.separation_m) for teammate in model.teammates
        ),
        fence=None if model.fence is None else np.array(model.fence, dtype=np.float64),
        obstacles=None
        if model.obstacles is None
        else Obstacles(
            np.array(model.obstacles.blocked, dtype=np.bool_),
            model.obstacles.origin_north_m,
            model.obstacles.origin_east_m,
            model.obstacles.cell_m,
        ),
    )
