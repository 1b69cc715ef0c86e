"""Problem files: what is right is read, and what is wrong is named with its key."""

import json
import math
from importlib import resources
from pathlib import Path

import numpy as np
import pytest

from onboard.planning.problem_file import ProblemFileError, load_problem, parse_problem, problem_schema

OWN = Path(__file__).parents[3] / "benchmarks" / "problems"


def document(**changes):
    target = {
        "id": 1,
        "model": "double_integrator",
        "noise": 0.001,
        "mean": [1.0, 2.0, 0.0, 0.0],
        "covariance": np.diag([1.0, 1.0, 0.1, 0.1]).tolist(),
    }
    sensor = {"range_std_m": 0.15, "bearing_std_deg": 5.0, "max_range_m": 10.0, "fov_deg": 94.0}
    data = {
        "format": "arvi-problem/1",
        "pose": [0.0, 0.0, 4.0],
        "step_s": 0.5,
        "horizon": 2,
        "primitives": [[1.0, 0.0], [1, 3]],
        "sensor": sensor,
        "targets": [target],
        "teammates": [],
    }
    for path, value in changes.items():
        *parents, last = path.split("__")
        place = data
        for key in parents:
            place = place[int(key) if key.isdigit() else key]
        place[int(last) if last.isdigit() else last] = value
    return json.dumps(data)


def test_a_problem_is_read():
    problem = parse_problem(document())
    assert problem.pose.yaw_rad == pytest.approx(4.0 - math.tau)
    assert problem.sensor.fov_rad == pytest.approx(math.radians(94.0))
    assert problem.sensor.noise_floor == 0.1
    assert problem.primitives[1].yaw_rate_rad_s == 3.0
    assert problem.blocks[0].covariance.shape == (4, 4)
    assert problem.fence is None


@pytest.mark.parametrize("path", sorted(OWN.glob("*.json")), ids=lambda path: path.stem)
def test_the_projects_own_problems_have_feasible_plans(path, planner):
    from onboard.planning.plan import Budget

    plan = planner.plan(load_problem(path), Budget(nodes=20_000))
    assert plan.feasible


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"colour": "red"}, "colour: unknown key"),
        ({"sensor__zoom": 2}, "sensor.zoom: unknown key"),
        ({"format": "arvi-problem/2"}, "format: "),
        ({"pose": [0.0, 0.0]}, "pose.2: missing"),
        ({"step_s": 0.0}, "step_s: "),
        ({"step_s": math.nan}, "step_s: "),
        ({"step_s": "0.5"}, "step_s: "),
        ({"horizon": 0}, "horizon: "),
        ({"horizon": 2.5}, "horizon: "),
        ({"horizon": 101}, "horizon: "),
        ({"primitives": []}, "primitives: "),
        ({"primitives": [[1.0]]}, "primitives.0.1: missing"),
        ({"primitives": [[math.inf, 0.0]]}, "primitives.0.0: "),
        ({"sensor__fov_deg": 361.0}, "sensor.fov_deg: "),
        ({"sensor__noise_floor": 0.0}, "sensor.noise_floor: "),
        ({"sensor__max_range_m": -1.0}, "sensor.max_range_m: "),
        ({"targets__0__mean": [1.0, 2.0]}, "targets.0: mean: double_integrator has 4 states"),
        ({"targets__0__mean__2": math.nan}, "targets.0.mean.2: "),
        ({"targets__0__model": "helicopter"}, "targets.0.model: "),
        ({"targets__0__noise": -0.1}, "targets.0.noise: "),
        ({"targets__0__covariance": [[1.0, 0.0], [0.0, 1.0]]}, "targets.0: covariance: a 4 × 4 matrix"),
        ({"targets__0__covariance__0__1": 0.5}, "targets.0: covariance: must be symmetric"),
        (
            {"targets__0__covariance": np.diag([1.0, 1.0, 0.1, -0.1]).tolist()},
            "targets.0: covariance: must be positive",
        ),
        ({"targets__0__covariance": np.diag([1.0, 1.0, 0.1, 0.0]).tolist()}, "targets.0: covariance: must be positive"),
        ({"targets": [{}] * 1001}, "targets: "),
        ({"teammates": [{"poses": [[0.0, 0.0, 0.0]]}]}, "teammates.0.poses: one pose for each of 2 steps"),
        ({"teammates": [{"poses": [[0.0, 0.0, 0.0]] * 2, "separation_m": -1}]}, "teammates.0.separation_m: "),
        ({"fence": [[0, 0], [1, 1]]}, "fence: "),
        ({"fence": [[0, 0], [1, 1], [1, 0], [0, 1]]}, "fence: must be a polygon that does not cross itself"),
        ({"fence": [[0, 0], [1, 1], [2, 2]]}, "fence: must be a polygon"),
        (
            {"obstacles": {"blocked": [[0], [0, 1]], "origin_north_m": 0, "origin_east_m": 0, "cell_m": 1}},
            "obstacles: blocked",
        ),
    ],
)
def test_what_is_wrong_is_named(changes, message):
    with pytest.raises(ProblemFileError) as caught:
        parse_problem(document(**changes))
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_two_targets_with_one_id_are_refused():
    target = json.loads(document())["targets"][0]
    with pytest.raises(ProblemFileError, match="every id must be different"):
        parse_problem(document(targets=[target, target]))


@pytest.mark.parametrize("text", ["", "{", "[1, 2]", "null", '{"format": NaN}', "[" * 100_000])
def test_no_problem_at_all(text):
    with pytest.raises(ProblemFileError):
        parse_problem(text)


def test_unreadable_files_say_so(tmp_path):
    with pytest.raises(ProblemFileError, match="No such file"):
        load_problem(tmp_path / "none.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(ProblemFileError, match="UTF-8"):
        load_problem(tmp_path / "binary.json")
    with (tmp_path / "huge.json").open("wb") as file:
        file.truncate(200_000_000)
    with pytest.raises(ProblemFileError, match="bytes"):
        load_problem(tmp_path / "huge.json")


def test_the_schema_that_is_shipped_is_the_one_that_is_checked():
    shipped = resources.files("onboard.planning").joinpath("arvi-problem-1.schema.json").read_text()
    assert json.loads(shipped) == problem_schema()
