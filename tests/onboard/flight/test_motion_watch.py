"""A position that freezes or jumps is noticed, in time; one that a vehicle in wind really has is not doubted."""

import math

import numpy as np
import pytest

from onboard.flight.failsafes import RULES, Condition
from onboard.flight.motion_watch import FROZEN_M, JUMP_M, MAX_BRAKE_M_S, SETTLING_S, MotionWatch
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot import ONBOARD
from tests.sim_bridge.autopilot.conftest import Bench

TICK_MS = 20
TICK_S = 1e-3 * TICK_MS
GRAVITY_M_S2 = 9.81
DRAG_PER_S = 0.2
NAN = math.nan


class Vehicle:
    """Flies as its acceleration says, and tells it as an autopilot does; what it tells may be otherwise."""

    def __init__(self) -> None:
        self.watch = MotionWatch()
        self.boot_ms = 60_000
        self.position, self.velocity = [1.0, 2.0], [0.0, 0.0]
        self.frozen_at: list[float] | None = None
        self.off_m = 0.0
        self.drift_m_s = 0.0

    def fly(self, duration_s: float, north_m_s2: float = 0.0, east_m_s2: float = 0.0) -> None:
        """Tilt for an acceleration on top of the drag."""
        for _ in range(round(duration_s / TICK_S)):
            self.boot_ms += TICK_MS
            thrust = [north_m_s2 + DRAG_PER_S * self.velocity[0], east_m_s2 + DRAG_PER_S * self.velocity[1]]
            for axis, acceleration in enumerate((north_m_s2, east_m_s2)):
                self.velocity[axis] += TICK_S * acceleration
                self.position[axis] += TICK_S * (self.velocity[axis] + self.drift_m_s)
            self.tell_attitude(*thrust)
            self.tell_position()

    def fly_until_noticed(self, limit_s: float, **acceleration: float) -> float:
        """How long it takes until the position is doubted."""
        begin_ms = self.boot_ms
        while not (self.watch.frozen or self.watch.jumped_m):
            assert self.boot_ms - begin_ms < 1e3 * limit_s, "not noticed in time"
            self.fly(TICK_S, **acceleration)
        return 1e-3 * (self.boot_ms - begin_ms)

    def tell_attitude(self, north_m_s2: float, east_m_s2: float, yaw_rad: float = 0.0) -> None:
        pitch, roll = -math.atan(north_m_s2 / GRAVITY_M_S2), math.atan(east_m_s2 / GRAVITY_M_S2)
        self.watch.receive(mavlink.MAVLink_attitude_message(self.boot_ms, roll, pitch, yaw_rad, 0.0, 0.0, 0.0))

    def tell_position(self, *, north_m: float | None = None) -> None:
        place, velocity = list(self.position), [value + self.drift_m_s for value in self.velocity]
        if self.frozen_at is not None:
            place, velocity = self.frozen_at, [0.0, 0.0]
        north = place[0] + self.off_m if north_m is None else north_m
        self.watch.receive(
            mavlink.MAVLink_local_position_ned_message(self.boot_ms, north, place[1], -1.7, *velocity, 0.0)
        )


@pytest.fixture
def flying() -> Vehicle:
    """At 1 m/s northward, for long enough to be known."""
    vehicle = Vehicle()
    vehicle.fly(1.0, 1.0)
    vehicle.fly(SETTLING_S + 1.0)
    assert vehicle.watch.velocity_m_s == pytest.approx((1.0, 0.0), abs=0.05)
    return vehicle


def test_a_position_that_freezes_in_flight_is_noticed_in_time_and_braked_against_until_it_moves(
    flying: Vehicle,
) -> None:
    flying.frozen_at = list(flying.position)
    noticed_s = flying.fly_until_noticed(1.0)
    assert FROZEN_M < noticed_s <= 0.6, "of an estimate that follows at once"
    velocity, brake = flying.watch.velocity_m_s, flying.watch.brake_m_s
    assert velocity == pytest.approx((1.0, 0.0), abs=0.2), "what the lies have drawn it to is taken back"
    assert brake is not None
    assert -MAX_BRAKE_M_S <= brake[0] < -0.8
    flying.fly(1.0, -1.0)
    assert flying.watch.velocity_m_s == pytest.approx((0.0, 0.0), abs=0.25), "the tilt says how it brakes"
    assert flying.watch.frozen, "for as long as the position stands"
    flying.frozen_at = None
    flying.position[0] += 0.2
    flying.fly(0.3, 1.0)
    assert not flying.watch.frozen
    assert flying.watch.brake_m_s is None


def test_a_jump_is_measured_while_it_is_new_and_a_small_step_is_none(flying: Vehicle) -> None:
    flying.off_m = 0.9 * JUMP_M
    flying.fly(1.0)
    assert flying.watch.jumped_m == 0.0
    flying.off_m += 1.0
    assert flying.fly_until_noticed(0.5) <= RULES[Condition.POSITION_JUMPS].noticed_s
    assert flying.watch.jumped_m == pytest.approx(1.0, abs=0.1)
    assert not flying.watch.frozen
    flying.fly(0.5)
    assert flying.watch.jumped_m == 0.0


@pytest.mark.parametrize("passed_ms", [500, -50_000], ids=["a gap in the messages", "the autopilot boots anew"])
def test_what_messages_far_apart_tell_is_not_compared(flying: Vehicle, passed_ms: int) -> None:
    flying.boot_ms += passed_ms
    flying.position[0] += 5.0
    for _ in range(round(SETTLING_S / TICK_S) - 1):
        flying.fly(TICK_S)
        assert flying.watch.velocity_m_s is None, "it has to find velocity and wind anew"
        assert flying.watch.jumped_m == 0.0
    flying.fly(0.5)
    assert flying.watch.velocity_m_s == pytest.approx((1.0, 0.0), abs=0.05)
    flying.frozen_at = list(flying.position)
    flying.fly_until_noticed(0.6)


def test_what_is_no_number_is_as_if_it_had_not_come(flying: Vehicle) -> None:
    for _ in range(5):
        flying.tell_attitude(NAN, 0.0)
        flying.tell_attitude(0.0, 0.0, yaw_rad=math.inf)
        flying.tell_position(north_m=NAN)
        flying.fly(TICK_S)
    assert flying.watch.velocity_m_s == pytest.approx((1.0, 0.0), abs=0.05)
    flying.frozen_at = list(flying.position)
    flying.fly_until_noticed(0.6)


@pytest.mark.parametrize("drift_m_s", [0.0, 0.1, 0.5], ids=["hovers", "drifts slowly", "is drawn along level"])
def test_who_hovers_or_drifts_is_not_called_frozen(drift_m_s: float) -> None:
    vehicle = Vehicle()
    vehicle.drift_m_s = drift_m_s
    for second in range(20):
        for north_m_s2 in (0.4, -0.4, -0.4, 0.4):  # as it corrects its place
            vehicle.fly(0.25, north_m_s2)
            assert not vehicle.watch.frozen, second
            assert vehicle.watch.jumped_m == 0.0


def test_a_vehicle_that_reverses_rests_for_a_moment_and_is_not_called_frozen(flying: Vehicle) -> None:
    for north_m_s2 in (-4.0, 4.0) * 10:
        flying.fly(0.5, north_m_s2)
        assert not flying.watch.frozen


def test_in_a_minute_of_simulated_flight_in_gusts_no_position_is_doubted() -> None:
    """A PX4 that is sent another way every half second; gusts are six times those of the simulated lab."""
    bench, rng = Bench(wind_acceleration_std_m_s2=0.3), np.random.default_rng(4)
    bench.take_off(1.7)
    bench.run(0.1, bench.setpoint())
    assert bench.command(mavlink.MAV_CMD_DO_SET_MODE, 1, 6) == mavlink.MAV_RESULT_ACCEPTED
    watch, off_m_s = MotionWatch(), []
    for _ in range(120):
        heading, speed = rng.uniform(-math.pi, math.pi), rng.choice((0.0, 1.2, 1.2))
        bench.sent.clear()
        bench.run(0.5, bench.setpoint((speed * math.cos(heading), speed * math.sin(heading), 0.0), yaw=heading))
        for _, link, message in bench.sent:
            if link == ONBOARD and message.get_type() in ("ATTITUDE", "LOCAL_POSITION_NED"):
                watch.receive(message)
                assert not watch.frozen
                assert watch.jumped_m == 0.0
        if watch.velocity_m_s is not None:
            true = (bench.vehicle.velocity_north_m_s, bench.vehicle.velocity_east_m_s)
            off_m_s.append(math.dist(watch.velocity_m_s, true))
    assert len(off_m_s) > 100
    assert np.mean(off_m_s) < 0.35, "gusts are what it cannot feel"
