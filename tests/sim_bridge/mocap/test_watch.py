"""What is wrong with motion capture is said once when it begins and once when it ends."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sim_bridge.mocap.pose import MocapPose
from sim_bridge.mocap.watch import Trouble, Watch

NOON = 1_790_000_000.0
DT = 0.01


class Scene:
    """A watch on one vehicle that stands at 1 m north with 1 mm of noise, seen 100 times a second."""

    def __init__(self, *, noisy=True):
        self.watch = Watch(2, 100.0, 0.3, noisy=noisy)
        self.now_s = NOON
        self.rng = np.random.default_rng(1)
        self.noise_m = 0.001

    def run(self, seconds, every=1, north_m=1.0, age_s=0.01):
        for k in range(round(seconds / DT)):
            self.now_s += DT
            if every and k % every == 0:
                north_now_m = north_m(k) if callable(north_m) else north_m
                noise = self.noise_m * self.rng.standard_normal(3)
                position = (north_now_m + noise[0], 2.0 + noise[1], -1.0 + noise[2])
                self.watch.receive(
                    MocapPose(2, self.now_s - age_s, *position, (1.0, 0.0, 0.0, 0.0), 0.002, 0.01), self.now_s
                )
            self.watch.step(self.now_s)
        return [notice.text for notice in self.watch.notices()]


@pytest.fixture
def scene():
    scene = Scene()
    assert scene.run(5.0) == []
    return scene


def test_a_body_that_was_never_seen_is_not_missed():
    assert Scene().run(5.0, every=0) == []


def test_silence(scene):
    assert scene.run(3.0, every=0) == ["motion capture of vehicle 2 is silent"]
    assert scene.watch.troubles == {Trouble.SILENT}
    (text,) = scene.run(5.0)
    assert text == "motion capture of vehicle 2 is no longer silent, after 3.0 s"
    assert scene.watch.troubles == frozenset()


def test_slowness(scene):
    assert scene.run(6.0, every=3) == ["motion capture of vehicle 2 is slow (70 of 100 Hz)"]
    (text,) = scene.run(6.0)
    assert "no longer slow" in text
    assert scene.run(6.0, every=2)[0].startswith("motion capture of vehicle 2 is slow")


def test_frozen_numbers(scene):
    scene.noise_m = 0.0
    assert scene.run(4.0) == ["motion capture of vehicle 2 is frozen"]
    scene.noise_m = 0.001
    (text,) = scene.run(1.0)
    assert "no longer frozen" in text


def test_no_repetition_is_for_an_autopilot_and_every_measurement_is():
    watch = Watch(2, 100.0, 0.3, noisy=True)
    first = MocapPose(2, NOON, 1.0, 2.0, -1.0, (1.0, 0.0, 0.0, 0.0), 0.002, 0.01)
    again = replace(first, time_s=NOON + DT)
    moved = replace(again, time_s=NOON + 2 * DT, down_m=math.nextafter(-1.0, 0.0))
    turned = replace(moved, time_s=NOON + 3 * DT, attitude=(0.0, 0.0, 0.0, 1.0))
    assert [watch.receive(pose, pose.time_s) for pose in (first, again, moved, turned)] == [True, False, True, True]
    exact = Watch(2, 100.0, 0.3, noisy=False)
    assert [exact.receive(pose, pose.time_s) for pose in (first, again)] == [True, True]


def test_a_simulation_without_noise_does_not_look_frozen():
    still = Scene(noisy=False)
    still.noise_m = 0.0
    assert still.run(5.0) == []


def test_jumps_between_two_bodies(scene):
    (text,) = scene.run(1.0, north_m=lambda k: 1.0 + 0.8 * (k // 10 % 2))
    assert text == "motion capture of vehicle 2 is jumping (0.80 m from one pose to the next)"
    (text,) = scene.run(4.0)
    assert "no longer jumping" in text


def test_fast_flight_is_no_jump(scene):
    assert scene.run(2.0, north_m=lambda k: 1.0 + 5.0 * k * DT) == []


def test_old_poses(scene):
    assert scene.run(1.0, age_s=0.4) == ["motion capture of vehicle 2 is late (400 ms old)"]
    assert "no longer late" in scene.run(1.0)[0]
