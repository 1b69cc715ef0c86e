"""The heading that is commanded."""

import math

import pytest

from onboard.flight.yaw import YawShaper
from onboard.geometry import wrap_angle

TICK_S = 0.02


def test_without_a_bound_it_is_the_plans() -> None:
    shaper = YawShaper(3.5, math.inf)
    assert shaper.follow(1.0, 3.0, TICK_S) == (1.0, 3.0)
    assert shaper.follow(-2.0, -3.0, TICK_S) == (-2.0, -3.0)
    assert shaper.follow(-2.0, -9.0, TICK_S) == (-2.0, -3.5), "but for the rate"


@pytest.mark.parametrize("acceleration", [2.0, 5.0])
def test_a_plan_that_reverses_is_followed_within_rate_and_acceleration(acceleration: float) -> None:
    shaper = YawShaper(3.2, acceleration)
    yaw, rate = shaper.follow(0.0, 0.0, TICK_S)
    wanted = 0.0
    for tick in range(1000):
        turn = 3.0 if tick // 25 % 2 else -3.0
        wanted = wrap_angle(wanted + turn * TICK_S)
        before_yaw, before_rate = yaw, rate
        yaw, rate = shaper.follow(wanted, turn, TICK_S)
        assert abs(rate) <= 3.2
        assert abs(rate - before_rate) <= acceleration * TICK_S + 1e-9
        assert wrap_angle(yaw - before_yaw) == pytest.approx(rate * TICK_S)


def test_a_step_is_reached_the_short_way_round_with_little_overshoot() -> None:
    shaper = YawShaper(3.5, 3.0)
    shaper.follow(3.0, 0.0, TICK_S)
    track = [shaper.follow(-3.0, 0.0, TICK_S)[0] for _ in range(200)]
    errors = [wrap_angle(yaw + 3.0) for yaw in track]
    assert abs(errors[-1]) < 1e-3
    assert max(abs(error) for error in errors) <= 2.0 * math.pi - 6.0 + 1e-9, "over the south, 0.28 rad"
    assert max(errors) < 0.03


def test_a_steady_turn_is_followed_without_lag() -> None:
    shaper = YawShaper(3.5, 3.0)
    for tick in range(400):
        yaw, rate = shaper.follow(wrap_angle(2.0 * tick * TICK_S), 2.0 if tick else 0.0, TICK_S)
    assert wrap_angle(yaw - 2.0 * 399 * TICK_S) == pytest.approx(0.0, abs=1e-3)
    assert rate == pytest.approx(2.0, abs=1e-3)
