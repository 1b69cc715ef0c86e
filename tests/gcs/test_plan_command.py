"""``arvi plan``: JSON on standard output, one clear line and exit code 2 for what is wrong."""

import json
from pathlib import Path

import pytest
import typer
from typer.testing import CliRunner

from gcs.plan_command import plan
from onboard.planning.evaluation import evaluate
from onboard.planning.problem_file import load_problem

PROBLEM = Path(__file__).parents[1] / "data" / "problems" / "m04_s0.json"
KEYS = {
    "controls", "poses", "cost", "lower_bound", "epsilon", "delta", "complete", "nodes_generated", "nodes_expanded",
    "elapsed_s", "history",
}  # fmt: skip


@pytest.fixture
def run():
    app = typer.Typer()
    app.command()(plan)

    def invoke(*arguments):
        return CliRunner().invoke(app, [str(argument) for argument in arguments])

    return invoke


def test_prints_the_plan_as_json(run):
    result = run(PROBLEM, "--nodes", 20_000)
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    assert document.keys() >= KEYS
    assert document["cost"] == pytest.approx(evaluate(load_problem(PROBLEM), document["controls"]), rel=1e-9)
    assert len(document["controls"]) == len(document["poses"]) == 12
    assert document["epsilon"] is None  # no bound was reached: there is no ∞ in JSON
    assert document["history"][-1]["cost"] == document["cost"]


@pytest.mark.parametrize(
    ("algorithm", "options"), [("rvi", ["--epsilon", 0.1, "--delta", 0.5]), ("fvi", []), ("arvi", [])]
)
def test_every_algorithm(run, tmp_path, algorithm, options):
    data = json.loads(PROBLEM.read_text())
    data["horizon"] = 3
    small = tmp_path / "small.json"
    small.write_text(json.dumps(data))
    result = run(small, "--algorithm", algorithm, *options)
    assert result.exit_code == 0
    document = json.loads(result.stdout)
    if algorithm == "rvi":
        assert (document["epsilon"], document["delta"]) == (0.1, 0.5)
    else:
        assert document["complete"]


def test_a_deadline_is_accepted(run):
    assert json.loads(run(PROBLEM, "--time", 0.02).stdout)["nodes_generated"] > 0


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_draws_a_picture(run, tmp_path, suffix):
    picture = tmp_path / f"plan.{suffix}"
    assert run(PROBLEM, "--nodes", 2000, "--plot", picture).exit_code == 0
    start = picture.read_bytes()[:200]
    assert start.startswith(b"\x89PNG") or b"<?xml" in start


@pytest.mark.parametrize(
    "arguments",
    [
        ("missing.json",),
        (PROBLEM, "--time", "0"),
        (PROBLEM, "--time", "nan"),
        (PROBLEM, "--nodes", "0"),
        (PROBLEM, "--epsilon", "0.1"),
        (PROBLEM, "--algorithm", "rvi", "--epsilon", "-1"),
        (PROBLEM, "--plot", "plan.txt"),
        (PROBLEM, "--algorithm", "astar"),
    ],
)
def test_bad_input_exits_with_2_and_says_why(run, arguments):
    result = run(*arguments)
    assert result.exit_code == 2
    assert result.stdout == ""
    assert result.stderr.strip()
    assert "Traceback" not in result.stderr


def test_a_malformed_problem_exits_with_2_and_one_line(run, tmp_path):
    broken = tmp_path / "broken.json"
    broken.write_text(PROBLEM.read_text().replace('"horizon": 12', '"horizon": 0'))
    result = run(broken)
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) == 1
    assert "horizon" in result.stderr
