"""What a computer needs before a flight."""

from dataclasses import replace
from pathlib import Path

import pytest

from gcs.checks import Outcome
from gcs.host_checks import ClockState, HostFacts, judge, look, read_clock
from onboard.config import Scenario, load_scenario
from onboard.config.schema import SigningConfig
from onboard.protocol.signing_files import write_new_key

LAB = load_scenario(Path("configs/lab.yaml"))
REAL = LAB.model_copy(update={"simulation": None})
FACTS = HostFacts(
    clock=ClockState(True, 0.0004, 0.02),
    key_problem="",
    state_problem="",
    warm_s=1.2,
    disk_folder=Path("flights"),
    disk_free_bytes=5_000_000_000,
    urgent=True,
)


def signed(key: Path) -> Scenario:
    return REAL.model_copy(update={"signing": SigningConfig(key_file=str(key), state_folder=str(key.parent / "state"))})


def test_a_computer_that_is_ready_passes(tmp_path: Path) -> None:
    assert {check.outcome for check in judge(signed(tmp_path / "key"), FACTS)} == {Outcome.PASS}


@pytest.mark.parametrize(
    ("facts", "name", "outcome"),
    [
        (replace(FACTS, clock=None), "this computer's clock", Outcome.WARN),
        (replace(FACTS, clock=ClockState(False, 16.0, 16.0)), "this computer's clock", Outcome.FAIL),
        (replace(FACTS, clock=ClockState(True, 0.05, 0.2)), "this computer's clock", Outcome.WARN),
        (replace(FACTS, key_problem="others can read it"), "signing key", Outcome.FAIL),
        (replace(FACTS, state_problem="cannot be written to"), "signing key", Outcome.FAIL),
        (replace(FACTS, warm_s=None), "kernels", Outcome.FAIL),
        (replace(FACTS, warm_s=14.0), "kernels", Outcome.WARN),
        (replace(FACTS, disk_free_bytes=None), "disk", Outcome.WARN),
        (replace(FACTS, disk_free_bytes=1_500_000_000), "disk", Outcome.WARN),
        (replace(FACTS, disk_free_bytes=50_000_000), "disk", Outcome.FAIL),
        (replace(FACTS, urgent=False), "real-time priority", Outcome.WARN),
    ],
)
def test_each_thing_is_judged_by_itself(tmp_path: Path, facts: HostFacts, name: str, outcome: Outcome) -> None:
    checks = judge(signed(tmp_path / "key"), facts)
    assert {check.name: check.outcome for check in checks if check.outcome is not Outcome.PASS} == {name: outcome}
    assert all(check.wanted for check in checks if check.outcome is not Outcome.PASS)


def test_a_simulated_team_needs_neither_a_key_nor_a_disciplined_clock() -> None:
    facts = replace(FACTS, clock=ClockState(False, 16.0, 16.0), key_problem=None)
    outcomes = {check.name: check.outcome for check in judge(LAB, facts)}
    assert outcomes["this computer's clock"] is Outcome.WARN
    assert outcomes["signing key"] is Outcome.PASS
    real = REAL.model_copy(update={"unsigned": True})
    assert {c.name: c.outcome for c in judge(real, facts)}["signing key"] is Outcome.WARN


def test_a_real_computer_is_looked_at(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("gcs.host_checks._warm_up", lambda: 1.0)  # has its own tests, and takes seconds
    key = tmp_path / "key"
    absent = look(signed(key), tmp_path / "flights" / "new")
    assert "arvi keygen" in (absent.key_problem or "")
    assert absent.disk_free_bytes is not None
    assert not (tmp_path / "flights").exists(), "it only looks"
    write_new_key(key)
    assert look(signed(key), tmp_path).key_problem == ""
    key.chmod(0o644)
    assert "chmod 600" in (look(signed(key), tmp_path).key_problem or "")
    assert look(LAB, tmp_path).key_problem is None


def test_the_kernels_clock_is_read() -> None:
    clock = read_clock()
    if clock is not None:  # another system than Linux
        assert 0.0 <= clock.estimated_error_s <= 1e5
        assert clock.maximum_error_s > 0.0
