"""The pose at the time of a look, between samples."""

import math
import random

import pytest

from onboard.flight.pose_history import ClockOffset, PoseHistory


def history() -> PoseHistory:
    poses = PoseHistory()
    for i in range(10):
        poses.add_position(100.0 + 0.1 * i, 1.0 * i, -2.0 * i)
        poses.add_yaw(100.0 + 0.1 * i, math.remainder(3.0 + 0.1 * i, math.tau))
    return poses


def test_between_samples_it_interpolates() -> None:
    pose = history().at(100.25)
    assert pose is not None
    assert (pose.north_m, pose.east_m) == pytest.approx((2.5, -5.0))
    assert math.remainder(pose.yaw_rad - 3.25, math.tau) == pytest.approx(0.0), "across ±π, too"


def test_beyond_the_samples_it_holds_the_nearest_for_a_moment_only() -> None:
    pose = history().at(101.0)
    assert pose is not None
    assert pose.north_m == pytest.approx(9.0)
    assert history().at(101.5) is None
    assert history().at(99.0) is None


def test_without_yaw_or_position_there_is_no_pose() -> None:
    poses = PoseHistory()
    assert poses.at(100.0) is None
    poses.add_position(100.0, 0.0, 0.0)
    assert poses.at(100.0) is None


def test_a_clock_that_jumps_back_starts_the_history_anew() -> None:
    poses = history()
    poses.add_position(50.0, 7.0, 7.0)
    poses.add_yaw(50.0, 0.0)
    pose = poses.at(50.0)
    assert pose is not None
    assert pose.north_m == 7.0


@pytest.mark.parametrize("drift", [0.0, 0.007, -0.0001])
def test_stamps_are_those_of_the_quickest_messages_also_of_a_clock_that_runs_slow(drift: float) -> None:
    """100 messages a second, one in ten at once and the others up to 30 ms late; once none for a second."""
    rng, offset = random.Random(1), ClockOffset()
    worst_s = 0.0
    for i in range(6000):
        sent_s = 50.0 + 0.01 * i + (1.0 if i > 3000 else 0.0)
        delay_s = 0.0 if rng.random() < 0.1 else 0.03 * rng.random()
        stamp_s = offset.unix(round(1e3 * (1.0 - drift) * (sent_s - 40.0)), sent_s + delay_s)
        if i > 200:
            worst_s = max(worst_s, abs(stamp_s - sent_s))
    assert worst_s < 0.021, "a second of silence may bring an error of 2 %"


def test_the_clock_offset_follows_a_reboot() -> None:
    offset = ClockOffset(window_s=10.0)
    offset.unix(1_000_000, 51.0)
    assert offset.unix(500, 62.0) == pytest.approx(62.0)
