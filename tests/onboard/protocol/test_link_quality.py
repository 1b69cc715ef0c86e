"""Losses, duplicates and late frames from sequence numbers, in virtual time."""

import numpy as np
import pytest

from onboard.protocol.link_quality import SequenceMonitor


def watch(numbers, period_s=0.02):
    monitor = SequenceMonitor()
    for i, number in enumerate(numbers):
        monitor.receive(number % 256, i * period_s)
    return monitor, len(numbers) * period_s


def counts(monitor, now_s):
    quality = monitor.quality(now_s)
    return quality.received, quality.lost, quality.duplicated


@pytest.mark.parametrize(
    ("numbers", "expected"),
    [
        (range(300), (300, 0, 0)),
        ([254, 255, 0, 1], (4, 0, 0)),
        ([1, 2, 5], (3, 2, 0)),
        ([1, 3, 2, 4], (4, 0, 0)),
        ([1, 2, 2, 3, 1], (3, 0, 2)),
        ([250, 3], (2, 8, 0)),
    ],
)
def test_frames_are_counted(numbers, expected):
    assert counts(*watch(list(numbers))) == expected


def test_a_lossy_links_rate_is_found():
    rng = np.random.default_rng(3)
    monitor, now_s = watch([i for i in range(480) if rng.random() > 0.15])
    assert monitor.quality(now_s).loss == pytest.approx(0.15, abs=0.03)


def test_a_restart_after_silence_is_no_loss():
    monitor, now_s = watch(range(100, 150))
    monitor.receive(0, now_s + 5.0)
    assert counts(monitor, now_s + 5.0) == (51, 0, 0)


def test_only_the_last_ten_seconds_count_and_nothing_heard_is_no_rate():
    monitor, now_s = watch([0, 9])
    assert monitor.quality(now_s).loss == pytest.approx(0.8)
    assert monitor.quality(now_s + 12.0).loss is None
    assert SequenceMonitor().quality(0.0).loss is None
