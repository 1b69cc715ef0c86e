"""What plans need of autopilots' parameters."""

import math
from dataclasses import replace
from pathlib import Path

import pytest

from onboard.config import load_scenario
from onboard.flight.autopilot import BEHAVIOURS
from onboard.flight.preflight import Preflight, Verdict
from onboard.flight.requirements import Bits, Needs, OneOf, Wanted, Within
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.parameters import ParameterClient

SCENARIO = load_scenario(Path("configs/lab.yaml"))
NEEDS = Needs.of(SCENARIO, SCENARIO.vehicles[0])


@pytest.mark.parametrize(
    ("wanted", "good", "bad", "mended"),
    [
        (Within(low=171.9), 171.9, 171.0, 172.0),
        (Within(low=17188.7, step=1000.0), 18000.0, 6000.0, 18000.0),
        (Within(low=0.25, step=0.1), 0.3, 0.2, 0.3),
        (Within(0.5, 5.0), 5.0, 9.0, 5.0),
        (Within(0.5, 0.8), 0.8, 0.1, 0.8),
        (Within(low=5.0, off=-1.0), -1.0, 0.0, 5.0),
        (OneOf((6.0, 0.0)), 0.0, 3.0, 6.0),
        (Bits(11), 15.0, 4.0, 15.0),
    ],
)
def test_a_condition_holds_or_not_and_knows_what_to_set(wanted: Wanted, good: float, bad: float, mended: float) -> None:
    assert wanted.holds(good)
    assert not wanted.holds(bad)
    assert wanted.nearest(bad) == pytest.approx(mended)
    assert wanted.holds(wanted.nearest(bad)), "what is set must hold"


@pytest.mark.parametrize("wanted", [Within(low=3.0), Within(high=3.0), Within(0.5, 5.0), OneOf((6.0,)), Bits(11)])
@pytest.mark.parametrize("value", [math.nan, math.inf, -math.inf])
def test_what_is_no_number_fulfils_nothing_and_can_be_mended(wanted: Wanted, value: float) -> None:
    assert not wanted.holds(value)
    assert wanted.holds(wanted.nearest(value))


def test_the_lab_needs_what_its_primitives_say() -> None:
    assert NEEDS.yaw_rate_rad_s == 3.0
    assert NEEDS.speed_m_s == 1.0
    assert NEEDS.acceleration_m_s2 == 3.0
    assert NEEDS.jerk_m_s3 == 9.0
    assert NEEDS.mocap


@pytest.mark.parametrize("family", list(BEHAVIOURS))
@pytest.mark.parametrize("mocap", [True, False])
def test_names_are_valid_and_every_violation_can_be_mended(family: str, mocap: bool) -> None:
    for requirement in BEHAVIOURS[family].requirements(replace(NEEDS, mocap=mocap)):
        assert all(0 < len(name) <= 16 for name in requirement.names)
        assert requirement.wanted.holds(requirement.wanted.nearest(-1e6))
        assert requirement.why
        assert f"{requirement.why}{requirement.unit}{requirement.wanted}".isascii(), "STATUSTEXT carries it"


def heard(family: str, values: dict[str, float], *, answers: bool = True) -> Preflight:
    """A check whose autopilot answered with these values, and was silent about others."""
    client = ParameterClient((1, 1), attempts=1)
    check = Preflight(client, BEHAVIOURS[family].requirements(NEEDS))
    for tick in range(20):
        check.poll(float(tick))
        for sent in client.poll(float(tick)):
            name = sent.param_id
            if answers and name in values:
                answer = mavlink.MAVLink_param_value_message(name.encode(), values[name], 9, 1, 0)
                (message,) = Codec(1, 191).decode(Codec(1, 1).encode(answer))
                assert isinstance(message, mavlink.MAVLink_param_value_message)
                client.receive(message)
    return check


COPTER = {
    "ATC_SLEW_YAW": 6000.0,
    "WPNAV_SPEED": 1000.0,
    "WPNAV_ACCEL": 250.0,
    "PSC_JERK_NE": 5.0,
    "WPNAV_SPEED_UP": 250.0,
    "WPNAV_SPEED_DN": 150.0,
    "GUID_TIMEOUT": 3.0,
    "DISARM_DELAY": 10.0,
    "FS_EKF_ACTION": 2.0,
    "VISO_TYPE": 1.0,
    "EK3_SRC1_POSXY": 6.0,
    "EK3_SRC1_POSZ": 6.0,
    "EK3_SRC1_YAW": 6.0,
    "EK3_SRC1_VELXY": 0.0,
    "EK3_SRC1_VELZ": 0.0,
}


def test_copters_defaults_do_not_turn_and_curve_as_the_lab_does() -> None:
    """A yaw rate is clamped to 1.05 rad/s by ATC_SLEW_YAW 6000, and 3 m/s² sideways are beyond WPNAV_ACCEL."""
    check = heard("ardupilot", COPTER)
    assert check.done
    names = [finding.parameter.name for finding in check.violations() if finding.parameter is not None]
    assert names == ["ATC_SLEW_YAW", "WPNAV_ACCEL", "PSC_JERK_NE"], "the last under its name in newer releases"
    verdicts = {finding.requirement.name: finding.verdict for finding in check.findings()}
    assert verdicts["FS_EKF_ACTION"] is Verdict.ADVICE
    assert verdicts["GPS1_TYPE"] is Verdict.UNKNOWN
    assert verdicts["GUID_TIMEOUT"] is Verdict.GOOD
    first = str(check.violations()[0])
    assert first == "ATC_SLEW_YAW is 6000 cdeg/s, should be at least 17188.7: primitives turn at 3 rad/s"


def test_an_autopilot_that_never_answers_is_not_taken_for_one_without_parameters() -> None:
    check = heard("px4", {}, answers=False)
    assert check.done
    assert not check.answered
    assert check.violations() == []


def test_what_is_wrong_is_read_again_and_what_is_unknown_is_not() -> None:
    client = ParameterClient((1, 1), attempts=1)
    check = Preflight(client, BEHAVIOURS["ardupilot"].requirements(NEEDS))
    asked: list[str] = []
    for tick in range(200):
        check.poll(0.1 * tick)
        for sent in client.poll(0.1 * tick):
            name = sent.param_id
            asked.append(name)
            if name in COPTER:
                answer = mavlink.MAVLink_param_value_message(name.encode(), COPTER[name], 9, 1, 0)
                (message,) = Codec(1, 191).decode(Codec(1, 1).encode(answer))
                assert isinstance(message, mavlink.MAVLink_param_value_message)
                client.receive(message)
    assert asked.count("ATC_SLEW_YAW") >= 3
    assert asked.count("COMPASS_ENABLE") == 1
    assert asked.count("GUID_TIMEOUT") == 1
