"""The fuzzer itself: it finds what is planted, and the project's targets survive a fixed number of inputs."""

import itertools
import time
from pathlib import Path

import pytest

from fuzzing.__main__ import main
from fuzzing.engine import mutations, run
from fuzzing.seeds import seeds_of
from fuzzing.targets import TARGETS

RUNS = {"codec": 3000, "ground": 300, "onboard": 600, "problem": 400, "scenario": 200, "signing": 3000}


@pytest.mark.parametrize("name", TARGETS)
def test_a_target_survives(name: str) -> None:
    finding = run(TARGETS[name](), seeds_of(name), RUNS[name], seed=7)
    assert finding is None, finding.text


def test_a_planted_defect_is_found_with_the_input_that_shows_it() -> None:
    def target(data: bytes) -> None:
        if b"\xff\xff" in data:
            raise ValueError("planted")

    finding = run(target, [b"harmless"], 10_000, seed=1)
    assert finding is not None
    assert "planted" in finding.text
    assert b"\xff\xff" in finding.data


def test_a_stall_is_a_finding() -> None:
    def target(data: bytes) -> None:
        deadline = time.monotonic() + 60.0
        while time.monotonic() < deadline:
            pass

    finding = run(target, [b"x"], 1, seed=1, stall_s=0.05)
    assert finding is not None
    assert "no answer for 0.05 s" in finding.text


def test_the_same_seed_gives_the_same_inputs() -> None:
    first, second = (list(itertools.islice(mutations([b"abc", b"defg"], 3), 200)) for _ in range(2))
    assert first == second
    assert len(set(first)) > 150


def test_the_command_keeps_what_was_not_survived(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken() -> object:
        return lambda data: 1 // 0

    monkeypatch.chdir(tmp_path)
    monkeypatch.setitem(TARGETS, "codec", broken)
    assert main(["codec", "--runs", "3"]) == 1
    (kept,) = tmp_path.iterdir()
    assert str(kept.name) in capsys.readouterr().out
    with pytest.raises(ZeroDivisionError):
        main(["codec", "--replay", str(kept)])
