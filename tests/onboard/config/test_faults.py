# ruff: noqa: E501 (the table of mistakes has one line for each)
"""Faults in a scenario: what is in the vocabulary loads, what is not gets told what is."""

import json
from pathlib import Path

import pytest
from pydantic import ValidationError

from onboard.config import ConfigError, load_scenario
from onboard.config.faults import VOCABULARY, Component, FaultConfig, FaultType, clock_offset_s

LAB = "configs/lab.yaml"


def fault(**entry):
    return FaultConfig.model_validate_json(json.dumps({"from_s": 1.0} | entry))


@pytest.mark.parametrize(("component", "kind"), VOCABULARY)
def test_every_word_of_the_vocabulary_can_be_written_with_its_parameters(component, kind):
    since = "boot" if component is Component.CLOCK else "takeoff"
    effect = VOCABULARY[component, kind]
    plain = fault(component=component, type=kind, since=since)
    full = {name: parameter.default for name, parameter in effect.parameters.items()}
    assert {name: plain.value(name) for name in effect.parameters} == full
    assert fault(component=component, type=kind, since=since, parameters=full).effect is effect
    assert all(parameter.low <= parameter.default <= parameter.high for parameter in effect.parameters.values())


def test_every_component_fails_in_some_way():
    assert {component for component, _ in VOCABULARY} == set(Component)
    assert {kind for _, kind in VOCABULARY} == set(FaultType)


MISTAKES = {
    "another component's type": ("{component: battery, type: off, from_s: 1.0}", "type: a fault of battery is one of wrong, not off"),
    "no component": ("{component: radios, type: off, from_s: 1.0}", "component: \"radios\" should be 'radio', 'mocap'"),
    "no time": ("{component: radio, type: off}", "from_s: is missing"),
    "ends first": ("{component: radio, type: off, from_s: 2.0, until_s: 2.0}", "until_s: 2 is not after from_s = 2"),
    "no such parameter": ("{component: radio, type: off, from_s: 1.0, parameters: {loss: 0.3}}", "parameters: unknown loss; radio off has among_themselves"),
    "out of range": ("{component: radio, type: intermittent, from_s: 1.0, parameters: {loss: 30.0}}", "parameters.loss: 30 should be 0 to 1 (probability that one is lost)"),
    "comes again, but when": ("{component: radio, type: off, from_s: 1.0, until_s: 2.0, times: 3}", "every_s: goes together with times of more than one"),
    "comes again while there": ("{component: radio, type: off, from_s: 1.0, until_s: 9.0, times: 3, every_s: 5.0}", "until_s - from_s is at most every_s"),
    "no such vehicle": ("{component: radio, type: off, vehicles: [9], from_s: 1.0}", "simulation.faults[0].vehicles: there is no vehicle 9; the team is 1, 2, 3"),
    "clock since takeoff": ("{component: clock, type: wrong, from_s: 1.0}", "since: a clock's faults count from boot"),
    "the bridge is nobody's": ("{component: bridge, type: off, vehicles: [1], from_s: 1.0}", "vehicles: bridge is nobody's in particular"),
    "unknown key": ("{component: radio, type: off, from_s: 1.0, for_s: 2.0}", "for_s: unknown key; known here are component, type, vehicles"),
}  # fmt: skip


@pytest.mark.parametrize(("entry", "told"), MISTAKES.values(), ids=MISTAKES.keys())
def test_a_mistake_is_told_with_what_is_right(tmp_path, entry, told):
    with open(LAB, encoding="utf-8") as lab:  # noqa: PTH123
        text = lab.read()
    path = tmp_path / "scenario.yaml"
    path.write_text(text + f"  faults:\n    - {entry}\n", encoding="utf-8")
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert told in str(caught.value)
    assert "\n" not in str(caught.value)


def test_only_a_known_word_is_a_fault():
    with pytest.raises(ValidationError):
        fault(component="radio", type="broken")


def test_a_clock_is_off_while_its_fault_lasts_and_gains_on_the_way():
    clocks = (
        fault(component="clock", type="wrong", since="boot", vehicles=[2], until_s=11.0, parameters={"offset_s": 0.5, "drift_ppm": 100.0}),
        fault(component="radio", type="off"),
    )  # fmt: skip
    assert clock_offset_s(clocks, 2, 0.9) == 0.0
    assert clock_offset_s(clocks, 2, 1.0) == 0.5
    assert clock_offset_s(clocks, 2, 10.0) == pytest.approx(0.5 + 9.0 * 100e-6)
    assert clock_offset_s(clocks, 2, 11.0) == 0.0
    assert clock_offset_s(clocks, 1, 5.0) == 0.0


def test_a_fault_comes_again_as_faults_that_happen_once():
    again = fault(component="radio", type="off", from_s=20.0, until_s=50.0, times=3, every_s=300.0)
    assert [(one.from_s, one.until_s) for one in again.occurrences] == [(20.0, 50.0), (320.0, 350.0), (620.0, 650.0)]
    assert all(one.occurrences == (one,) for one in again.occurrences)
    soak = load_scenario(Path("configs/soak.yaml")).simulation
    assert len(soak.script) == 12 * len(soak.faults)
    assert max(one.until_s for one in soak.script) < 3600.0
