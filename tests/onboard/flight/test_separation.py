"""The last resort: against brute force, and in closed loop with vehicles that want nothing but to collide."""

import itertools
import math
import random
from dataclasses import replace

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from onboard.config.guard import GuardConfig
from onboard.config.polygon import contains
from onboard.flight.separation import Bound, Guard, Obstruction, approach_speed_m_s, nearest_velocity
from onboard.flight.setpoints import Setpoint

CONFIG = GuardConfig()
FENCE = ((0.0, 0.0), (4.0, 0.0), (4.0, 8.0), (0.0, 8.0))
L_SHAPE = ((0.0, 0.0), (6.0, 0.0), (6.0, 3.0), (3.0, 3.0), (3.0, 6.0), (0.0, 6.0))


def setpoint(north: float, east: float) -> Setpoint:
    return Setpoint(north, east, 0.0, -1.0, 0.3, 0.1)


def velocity(of: Setpoint) -> tuple[float, float]:
    return of.velocity_north_m_s, of.velocity_east_m_s


def test_the_bound_is_the_speed_from_which_reaction_and_braking_need_the_gap() -> None:
    for gap in (0.01, 0.3, 2.0):
        speed = approach_speed_m_s(gap, CONFIG)
        assert speed * CONFIG.reaction_s + speed**2 / (2.0 * CONFIG.brake_m_s2) == pytest.approx(gap)
    assert approach_speed_m_s(0.0, CONFIG) == 0.0
    assert approach_speed_m_s(-0.1, CONFIG) == pytest.approx(-0.2)
    assert approach_speed_m_s(-9.0, CONFIG) == -CONFIG.retreat_m_s


@settings(max_examples=150, deadline=None)
@given(
    st.tuples(st.floats(-3, 3), st.floats(-3, 3)),
    st.lists(st.tuples(st.floats(-math.pi, math.pi), st.floats(0.0, 2.0)), max_size=6),
)
def test_no_sampled_velocity_that_keeps_the_bounds_is_nearer(
    wanted: tuple[float, float], directions: list[tuple[float, float]]
) -> None:
    bounds = [Bound(math.cos(angle), math.sin(angle), speed) for angle, speed in directions]
    best = nearest_velocity(wanted, bounds)
    assert all(bound.excess(best) <= 1e-6 for bound in bounds)
    source = random.Random(1)
    for _ in range(300):
        other = (source.uniform(-3.5, 3.5), source.uniform(-3.5, 3.5))
        if all(bound.excess(other) <= 0.0 for bound in bounds):
            assert math.dist(other, wanted) >= math.dist(best, wanted) - 1e-6


def test_contradicting_retreats_end_in_a_standstill() -> None:
    assert nearest_velocity((1.0, 0.0), [Bound(1.0, 0.0, -0.5), Bound(-1.0, 0.0, -0.5)]) == pytest.approx((0.0, 0.0))


def test_far_from_everything_the_setpoint_is_untouched() -> None:
    wanted = setpoint(1.0, 0.0)
    assert Guard(CONFIG, FENCE).filter(wanted, (2.0, 4.0), [Obstruction(2.0, 7.0, 0.6)]) is wanted


BLOCK = ((1.0, 3.0), (2.0, 3.0), (2.0, 5.0), (1.0, 5.0))


def test_an_obstacle_is_approached_as_slowly_as_the_fence_and_kept_off() -> None:
    guard = Guard(CONFIG, FENCE, [BLOCK], CONFIG.fence_margin_m + 0.1)
    for gap_m in (0.0, 0.2, 0.6):
        filtered = guard.filter(setpoint(2.0, 0.0), (0.9 - gap_m, 4.0), [])
        assert filtered.velocity_north_m_s == pytest.approx(approach_speed_m_s(gap_m, CONFIG))
    wanted = setpoint(0.0, 1.0)
    assert guard.filter(wanted, (0.5, 4.0), []) is wanted, "along it"
    assert guard.filter(setpoint(1.0, 0.0), (0.9, 4.0), [], obstacles=False).velocity_north_m_s == 1.0


def test_who_is_inside_an_obstacle_or_too_near_is_led_out() -> None:
    guard = Guard(CONFIG, FENCE, [BLOCK], CONFIG.fence_margin_m + 0.1)
    assert guard.filter(setpoint(0.0, 0.0), (1.2, 4.0), []).velocity_north_m_s < -0.1
    assert guard.filter(setpoint(0.0, 0.0), (0.95, 4.0), []).velocity_north_m_s < -0.05


def test_a_trajectory_that_is_not_flown_leads_no_acceleration() -> None:
    wanted = replace(setpoint(1.0, 0.5), acceleration_north_m_s2=3.0, acceleration_east_m_s2=-3.0)
    filtered = Guard(CONFIG, FENCE).filter(wanted, (3.95, 4.0), [])
    assert (filtered.acceleration_north_m_s2, filtered.acceleration_east_m_s2) == (0.0, 0.0)


def test_a_peer_is_given_the_time_that_its_word_takes() -> None:
    wanted = setpoint(0.0, 2.0)
    here, peer = (2.0, 4.0), Obstruction(2.0, 5.5, 0.6)
    prompt = Guard(CONFIG.model_copy(update={"peer_delay_s": 0.0}), FENCE).filter(wanted, here, [peer])
    late = Guard(CONFIG, FENCE).filter(wanted, here, [peer])
    assert 0.0 < late.velocity_east_m_s < prompt.velocity_east_m_s < 2.0


def test_only_the_velocity_is_changed() -> None:
    filtered = Guard(CONFIG, FENCE).filter(setpoint(1.0, 0.5), (3.95, 4.0), [])
    assert filtered.velocity_north_m_s < 1.0
    assert filtered.velocity_east_m_s == pytest.approx(0.5)
    assert (filtered.down_m, filtered.yaw_rad, filtered.yaw_rate_rad_s) == (-1.0, 0.3, 0.1)


@pytest.mark.parametrize("fence", [FENCE, L_SHAPE])
def test_outside_the_fence_it_calls_back_in(fence: tuple[tuple[float, float], ...]) -> None:
    place, guard = (-0.8, 1.0), Guard(CONFIG, fence)
    north, east = velocity(guard.filter(setpoint(-1.0, 0.4), place, []))
    assert north > 0.2
    assert east == pytest.approx(0.4)


class Particle:
    """A vehicle whose velocity follows the setpoint late and with bounded acceleration."""

    def __init__(self, place: tuple[float, float], speed: tuple[float, float] = (0.0, 0.0)) -> None:
        self.place, self.speed = place, speed
        self._late = [speed] * 5

    def step(self, wanted: tuple[float, float], dt_s: float = 0.02) -> None:
        self._late.append(wanted)
        told = self._late.pop(0)
        change = (told[0] - self.speed[0], told[1] - self.speed[1])
        size = math.hypot(*change)
        share = min(1.0, 4.0 * dt_s / size) if size > 0.0 else 0.0
        self.speed = (self.speed[0] + share * change[0], self.speed[1] + share * change[1])
        self.place = (self.place[0] + dt_s * self.speed[0], self.place[1] + dt_s * self.speed[1])


def distance_outside(fence: tuple[tuple[float, float], ...], place: tuple[float, float]) -> float:
    if contains(fence, place):
        return 0.0
    from onboard.config.polygon import nearest_on_segment

    return min(math.dist(place, nearest_on_segment(fence[i - 1], fence[i], place)) for i in range(len(fence)))


@pytest.mark.parametrize("fence", [FENCE, L_SHAPE])
@pytest.mark.parametrize("seed", range(4))
def test_vehicles_that_want_to_leave_and_to_collide_do_neither(
    fence: tuple[tuple[float, float], ...], seed: int
) -> None:
    source = random.Random(seed)
    guard, keep_m = Guard(CONFIG, fence), 0.6
    vehicles = [Particle((1.0, 1.0)), Particle((2.0, 2.2)), Particle((0.8, 3.6))]
    wanted = [(0.0, 0.0)] * 3
    for tick in range(1500):
        if tick % 40 == 0:
            wanted = [(source.uniform(-1.5, 1.5), source.uniform(-1.5, 1.5)) for _ in vehicles]
            target = source.randrange(3)  # everybody at one of them
            wanted = [
                (2.0 * (vehicles[target].place[0] - v.place[0]), 2.0 * (vehicles[target].place[1] - v.place[1]))
                if source.random() < 0.7
                else wanted[index]
                for index, v in enumerate(vehicles)
            ]
        told = []
        for index, vehicle in enumerate(vehicles):
            others = [Obstruction(*v.place, keep_m) for v in vehicles if v is not vehicle]
            speed = min(1.5, math.hypot(*wanted[index]))
            size = math.hypot(*wanted[index]) or 1.0
            want = setpoint(wanted[index][0] / size * speed, wanted[index][1] / size * speed)
            told.append(velocity(guard.filter(want, vehicle.place, others)))
        for vehicle, velocity_told in zip(vehicles, told, strict=True):
            vehicle.step(velocity_told)
            assert distance_outside(fence, vehicle.place) <= CONFIG.fence_margin_m + 0.02
        for i, a in enumerate(vehicles):
            for b in vehicles[:i]:
                assert math.dist(a.place, b.place) >= keep_m - 0.03


def test_it_hands_back_without_a_step() -> None:
    """Leaving danger, the told velocity comes back to the wanted one continuously."""
    guard, told = Guard(CONFIG, FENCE), []
    for tick in range(300):
        peer = Obstruction(2.0, 4.5 + 0.01 * tick, 0.6)
        told.append(velocity(guard.filter(setpoint(0.0, 1.0), (2.0, 3.9), [peer])))
    jumps = [math.dist(a, b) for a, b in itertools.pairwise(told)]
    assert told[0][1] < 0.3
    assert told[-1] == (0.0, 1.0)
    assert max(jumps) < 0.1
