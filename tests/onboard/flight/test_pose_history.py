"""The pose at the time of a look, between samples."""

import math

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


def test_the_clock_offset_is_the_smallest_delay() -> None:
    offset = ClockOffset(window_s=10.0)
    assert offset.unix(1000, 51.010) == pytest.approx(51.010)
    assert offset.unix(2000, 52.002) == pytest.approx(52.002)
    assert offset.unix(3000, 53.030) == pytest.approx(53.002), "a late message is stamped as if it had been on time"


def test_the_clock_offset_follows_a_reboot() -> None:
    offset = ClockOffset(window_s=10.0)
    offset.unix(1_000_000, 51.0)
    assert offset.unix(500, 62.0) == pytest.approx(62.0)
