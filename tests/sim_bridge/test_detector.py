"""The detector: eq. (13)-(15) with the noise law of the sensor model, at multiples of its period of UNIX time."""

import math

import numpy as np
import pytest
from scipy import stats

from onboard.config.simulation import DetectorConfig
from onboard.estimation.sensor import RangeBearingSensor
from onboard.geometry import wrap_angle
from sim_bridge.detector import MIN_HEIGHT_M, Detector
from sim_bridge.truth import TargetTruth, VehicleTruth

NOON = 1_790_000_000.0
DT = 0.005
SENSOR = RangeBearingSensor(range_std_m=0.3, bearing_std_rad=math.radians(5.0), max_range_m=1.0, fov_rad=math.tau)


def vehicle(vehicle_id=1, north_m=0.0, height_m=1.0, yaw_rad=0.4):
    return VehicleTruth(vehicle_id, north_m, 0.0, -height_m, 0.0, 0.0, 0.0, yaw_rad)


def target(target_id=1, north_m=0.3, east_m=0.4):
    return TargetTruth(target_id, north_m, east_m, 0.0, 0.0, 0.0)


def run(seconds, vehicles, targets, sensor=SENSOR, start_s=NOON, **config):
    """``[(arrival time, vehicle id, detection)]`` of a run in physics steps."""
    rngs = {v.vehicle_id: np.random.default_rng([2, v.vehicle_id]) for v in vehicles}
    detector = Detector(DetectorConfig(**config), sensor, rngs, start_s)
    arrived = []
    for k in range(1, round(seconds / DT) + 1):
        now = start_s + k * DT
        if detector.is_due(now):
            detector.look(now, DT, vehicles, targets)
        arrived += [(now, *delivery) for delivery in detector.deliveries(now)]
    assert detector.looks_missed == 0
    return arrived


@pytest.mark.parametrize("start_s", [NOON, NOON + 0.1234, NOON + 0.4999])
@pytest.mark.parametrize("period_s", [0.5, 0.25, 0.3])
def test_looks_are_at_multiples_of_the_period_and_arrive_after_the_delay(start_s, period_s):
    arrived = run(5.0, [vehicle()], [target()], start_s=start_s, period_s=period_s, delay_s=0.03)
    times = [detection.time_s for _, _, detection in arrived]
    assert len(times) == pytest.approx(5.0 / period_s, abs=1)
    assert np.diff(times) == pytest.approx(period_s, abs=1e-6)
    for now, _, detection in arrived:
        multiple = detection.time_s / period_s
        assert multiple == pytest.approx(round(multiple), abs=1e-5)
        assert 0.03 - 1e-5 <= now - detection.time_s <= 0.03 + DT + 1e-5


@pytest.mark.parametrize("distance_m", [0.5, 0.9])
def test_noise_has_the_variances_of_the_sensor(distance_m):
    bearing_rad = 2.5
    east, north = (distance_m * f(0.4 + bearing_rad) for f in (math.sin, math.cos))
    arrived = run(100.0, [vehicle()], [target(1, north, east)], period_s=0.05)
    range_variance, bearing_variance = SENSOR.variances(distance_m, bearing_rad)
    ranges = np.array([d.range_m for _, _, d in arrived])
    bearings = np.array([wrap_angle(d.bearing_rad - bearing_rad) for _, _, d in arrived])
    assert len(ranges) == pytest.approx(2000, abs=2)
    assert stats.kstest(bearings / math.sqrt(bearing_variance), "norm").pvalue > 1e-3
    # Below zero the range is cut off: compare the part that is not.
    z = (ranges - distance_m) / math.sqrt(range_variance)
    floor = -distance_m / math.sqrt(range_variance)
    assert stats.binomtest(int((ranges == 0.0).sum()), len(ranges), stats.norm.cdf(floor)).pvalue > 1e-3
    assert stats.kstest(z[ranges > 0.0], stats.truncnorm(floor, np.inf).cdf).pvalue > 1e-3


def test_a_range_is_never_negative_and_a_bearing_is_wrapped():
    arrived = run(50.0, [vehicle()], [target(1, 0.02, 0.0), target(2, -0.9, -0.001)], period_s=0.05)
    assert all(d.range_m >= 0.0 and -math.pi < d.bearing_rad <= math.pi for _, _, d in arrived)
    assert any(d.range_m == 0.0 for _, _, d in arrived)


def test_only_what_is_in_range_and_in_view_is_seen():
    narrow = RangeBearingSensor(range_std_m=0.1, bearing_std_rad=0.1, max_range_m=1.0, fov_rad=math.radians(90.0))
    ahead = [target(k, 0.9 * math.cos(a), 0.9 * math.sin(a)) for k, a in enumerate((0.0, 0.7, -0.7, 0.8, -0.8, 3.1))]
    far = target(10, 1.1, 0.0)
    arrived = run(1.0, [vehicle(yaw_rad=0.0)], [*ahead, far], sensor=narrow)
    assert {d.target_id for _, _, d in arrived} == {0, 1, 2}
    arrived = run(1.0, [vehicle(yaw_rad=0.0)], [*ahead, far])
    assert {d.target_id for _, _, d in arrived} == {0, 1, 2, 3, 4, 5}


def test_a_vehicle_on_the_ground_sees_nothing():
    vehicles = [vehicle(1, height_m=0.0), vehicle(2, height_m=MIN_HEIGHT_M), vehicle(3, height_m=MIN_HEIGHT_M + 0.01)]
    assert {i for _, i, _ in run(1.0, vehicles, [target()])} == {3}


def test_detections_are_as_frequent_as_configured():
    arrived = run(100.0, [vehicle()], [target()], period_s=0.05, detection_probability=0.7)
    assert stats.binomtest(len(arrived), 1999, 0.7).pvalue > 1e-3
    assert run(5.0, [vehicle()], [target()], detection_probability=0.0) == []


def test_looks_that_the_simulation_skipped_are_counted_and_not_made_up():
    detector = Detector(DetectorConfig(), SENSOR, {1: np.random.default_rng(1)}, NOON)
    detector.look(NOON + 0.5, DT, [vehicle()], [target()])
    assert len(detector.deliveries(NOON + 1.0)) == 1
    # Looks at 1.0, 1.5 and 2.0 fell into a stall that ended at 2.2; the next step reaches 2.205.
    assert detector.is_due(NOON + 2.205)
    detector.look(NOON + 2.205, DT, [vehicle()], [target()])
    assert detector.deliveries(NOON + 3.0) == []
    assert detector.looks_missed == 3
    detector.look(NOON + 2.5, DT, [vehicle()], [target()])
    assert len(detector.deliveries(NOON + 3.0)) == 1


def test_a_clock_that_is_set_back_is_followed():
    detector = Detector(DetectorConfig(delay_s=0.0), SENSOR, {1: np.random.default_rng(1)}, NOON)
    for now in (NOON - 100.0, NOON - 99.5):
        assert detector.is_due(now)
        detector.look(now, DT, [vehicle()], [target()])
    assert [d.detection.time_s for d in detector.deliveries(NOON)] == [NOON - 99.5]


def test_another_vehicle_changes_nobody_elses_noise():
    alone = [d for _, _, d in run(5.0, [vehicle(1)], [target()])]
    together = [d for _, i, d in run(5.0, [vehicle(2), vehicle(1)], [target()]) if i == 1]
    assert alone == together
    assert len(alone) == 9


def test_obstacles_hide_what_is_behind_them():
    pillar = ((0.1, -0.1), (0.2, -0.1), (0.2, 0.1), (0.1, 0.1))
    detector = Detector(DetectorConfig(delay_s=0.0), SENSOR, {1: np.random.default_rng(1)}, NOON, obstacles=(pillar,))
    targets = [target(1, 0.5, 0.0), target(2, 0.5, 0.6), target(3, -0.5, 0.0), target(4, 0.15, 0.0)]
    detector.look(NOON + 0.5, DT, [vehicle()], targets)
    assert [seen.detection.target_id for seen in detector.deliveries(NOON + 0.5)] == [2, 3]
