"""The documentation of faults is what the code has, and its examples run."""

import re
from pathlib import Path

import yaml

from onboard.config.faults import FaultConfig
from sim_bridge.faults.vocabulary import table

DOCUMENT = (Path(__file__).parents[3] / "docs" / "faults.md").read_text(encoding="utf-8")


def test_the_documented_table_is_generated() -> None:
    assert table() in DOCUMENT, "write it anew: python -m sim_bridge.faults.vocabulary"


def test_the_documented_script_is_valid() -> None:
    (example,) = re.findall(r"```yaml\n(.*?)```", DOCUMENT, re.DOTALL)
    faults = [
        FaultConfig.model_validate(entry, strict=False) for entry in yaml.safe_load(example)["simulation"]["faults"]
    ]
    assert len(faults) == 4


def test_the_documented_code_runs(monkeypatch) -> None:
    monkeypatch.chdir(Path(__file__).parents[3])
    (example,) = re.findall(r"```python\n(.*?)```", DOCUMENT, re.DOTALL)
    scope: dict[str, object] = {}
    exec(example, scope)
    team = scope["team"]
    assert not team.companions[2].autopilot.alive(team.time_s)  # type: ignore[attr-defined]
    assert team.companions[1].autopilot.alive(team.time_s)  # type: ignore[attr-defined]
