"""What radio, detector and motion capture deliver while something is wrong with them."""

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.config.simulation import RadioConfig
from onboard.messages import Detection
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.detector import VehicleDetection
from sim_bridge.faults import FaultSchedule
from sim_bridge.faults.detections import FaultyDetections
from sim_bridge.faults.poses import FaultyPoses
from sim_bridge.faults.radio import FaultyRadio
from sim_bridge.mocap import MocapPose
from sim_bridge.radio import Radio

PLACES = {i: (0.0, float(i), -1.0) for i in (1, 2, 3, 4)}
UNTIL_S = 100.0


def schedule(component, kind, vehicles=(), **parameters):
    config = FaultConfig(
        component=component,
        type=kind,
        vehicles=vehicles,
        since="boot",
        from_s=10.0,
        until_s=UNTIL_S,
        parameters=parameters,
    )
    return FaultSchedule([config], 0.0)


def radio(kind, vehicles=(), **parameters):
    medium = Radio(RadioConfig(delay_s=0.0), np.random.default_rng(1))
    return FaultyRadio(medium, schedule(Component.RADIO, kind, vehicles, **parameters), np.random.default_rng(2))


def heard(radio, sender, datagram, time_s, later_s=0.0):
    radio.broadcast(sender, datagram, time_s, PLACES)
    return [(d.sender, d.receiver, d.datagram) for d in radio.deliveries(time_s + later_s)]


def test_a_radio_that_is_off_neither_reaches_nor_hears_and_recovers():
    faulty = radio(FaultType.OFF, (2,))
    assert len(heard(faulty, 2, b"before", 9.0)) == 3
    assert heard(faulty, 2, b"x", 10.0) == []
    assert {receiver for _, receiver, _ in heard(faulty, 1, b"x", 11.0)} == {3, 4}
    assert (faulty.links[2, 1].delivered, faulty.links[2, 1].lost) == (1, 1)
    assert len(heard(faulty, 2, b"after", UNTIL_S)) == 3


def test_a_partition_cuts_between_its_sides_only():
    faulty = radio(FaultType.OFF, (1, 2), among_themselves=1.0)
    reached = {(s, r) for sender in PLACES for s, r, _ in heard(faulty, sender, b"x", 20.0)}
    assert reached == {(1, 2), (2, 1), (3, 4), (4, 3)}


def test_losses_follow_their_probability_and_their_seed():
    runs = []
    for _ in range(2):
        faulty = radio(FaultType.INTERMITTENT, loss=0.3)
        runs.append([len(heard(faulty, 1, b"x", 10.0 + 0.01 * k)) for k in range(1000)])
    assert runs[0] == runs[1]
    assert stats.binomtest(3000 - sum(runs[0]), 3000, 0.3).pvalue > 0.01


def test_delay_and_jitter_are_added_and_the_radio_says_when():
    faulty = radio(FaultType.DELAYED, delay_s=0.1, jitter_s=0.1)
    for k in range(80):
        faulty.broadcast(1, b"x", 10.0 + k, {1: PLACES[1], 2: PLACES[2]})
        assert faulty.deliveries(10.0 + k) == []
        due_s = faulty.next_due_s
        assert 0.1 <= due_s - 10.0 - k <= 0.2
        assert len(faulty.deliveries(due_s)) == 1


def test_wrong_doubles_and_reorders_but_loses_nothing():
    faulty = radio(FaultType.WRONG, duplicated=0.5, reordered=0.5, within_s=0.2)
    received = []
    for k in range(500):
        received += [int(d) for _, r, d in heard(faulty, 1, str(k).encode(), 10.0 + 0.01 * k) if r == 2]
    received += [int(d.datagram) for d in faulty.deliveries(90.0) if d.receiver == 2]
    assert set(received) == set(range(500))
    assert 650 < len(received) < 850
    assert received != sorted(received)


def test_a_stuck_link_repeats_and_a_slow_one_carries_its_rate():
    stuck = radio(FaultType.STUCK)
    assert [d for k in range(3) for _, r, d in heard(stuck, 1, str(k).encode(), 10.0 + k) if r == 2] == [b"0"] * 3
    slow = radio(FaultType.SLOW, bytes_per_s=1000.0)
    arrived = 0
    for k in range(1000):
        arrived += sum(len(d) for _, r, d in heard(slow, 1, bytes(40), 10.0 + 0.01 * k) if r == 2)
    assert arrived == pytest.approx(10_000, rel=0.01)


def test_damaged_frames_do_not_pass_the_codec():
    faulty = radio(FaultType.GARBAGE, probability=1.0)
    sender, receiver = Codec(1, 191), Codec(2, 191)
    frame = sender.encode(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3))
    for k in range(300):
        for _, r, damaged in heard(faulty, 1, frame, 10.0 + 0.01 * k):
            if r == 2 and damaged != frame:
                assert receiver.decode(damaged) == []
    assert receiver.rejected + receiver.unknown > 250


def detection(vehicle=1, target=1, time_s=10.0, range_m=0.7, bearing_rad=0.2):
    return VehicleDetection(vehicle, Detection(time_s, target, range_m, bearing_rad))


def through(kind, items, vehicles=(), **parameters):
    """What arrives of detections, each pushed at its own time."""
    stream = FaultyDetections(
        schedule(Component.DETECTOR, kind, vehicles, **parameters), np.random.default_rng(3), (1, 2, 3)
    )
    arrived = []
    for item in items:
        stream.push(item, item.detection.time_s)
        arrived += stream.pop_due(item.detection.time_s)
    return arrived


def test_detections_go_missing_are_false_or_old():
    looks = [detection(time_s=10.0 + k, range_m=0.1 * k) for k in range(8)]
    assert through(FaultType.OFF, looks) == []
    assert through(FaultType.OFF, looks, vehicles=(2,)) == looks
    biased = through(FaultType.WRONG, looks, range_m=0.5)
    assert [a.detection.range_m for a in biased] == pytest.approx([0.1 * k + 0.5 for k in range(8)])
    assert {a.detection.range_m for a in through(FaultType.WRONG, looks, range_m=-5.0)} == {0.0}
    frozen = through(FaultType.STUCK, looks)
    assert [a.detection for a in frozen] == [replace(looks[0].detection, time_s=10.0 + k) for k in range(8)]
    assert through(FaultType.SLOW, looks, looks=4.0) == [looks[0], looks[4]]
    assert through(FaultType.DELAYED, looks, delay_s=2.0) == looks[:6]


def test_ghosts_come_beside_true_detections_of_targets_that_there_are():
    looks = [detection(time_s=10.0 + 0.1 * k) for k in range(400)]
    arrived = through(FaultType.GARBAGE, looks, probability=0.5, range_m=1.0)
    ghosts = [a for a in arrived if a not in looks]
    assert [a for a in arrived if a in looks] == looks
    assert stats.binomtest(len(ghosts), 400, 0.5).pvalue > 0.01
    assert {ghost.detection.target_id for ghost in ghosts} == {1, 2, 3}
    assert all(0.0 <= g.detection.range_m <= 1.0 and abs(g.detection.bearing_rad) <= math.pi for g in ghosts)


def poses(kind, count=50, **parameters):
    """Positions north and times of what arrives of 50 Hz poses that move at 1 m/s from 10 s on."""
    stream = FaultyPoses(schedule(Component.MOCAP, kind, **parameters), np.random.default_rng(4))
    arrived = []
    for k in range(count):
        time_s = 10.0 + 0.02 * k
        stream.push(MocapPose(1, time_s, 0.02 * k, 1.0, -1.0, (1.0, 0.0, 0.0, 0.0), 0.003, 0.01), time_s)
        arrived += [(now.north_m, now.time_s) for now in stream.pop_due(time_s)]
    return arrived


def test_poses_are_missing_frozen_displaced_scattered_rare_or_late():
    assert poses(FaultType.OFF) == []
    assert poses(FaultType.STUCK) == [(0.0, 10.0 + 0.02 * k) for k in range(50)]
    assert poses(FaultType.WRONG, north_m=0.5)[10] == pytest.approx((0.7, 10.2))
    scattered = np.array([north - 0.02 * k for k, (north, _) in enumerate(poses(FaultType.GARBAGE, 400, std_m=0.5))])
    assert stats.kstest(scattered / 0.5, "norm").pvalue > 0.01
    assert len(poses(FaultType.SLOW, rate_hz=5.0)) == 5
    assert len(poses(FaultType.DELAYED, delay_s=0.5)) == 25
    assert 5 < len(poses(FaultType.INTERMITTENT, loss=0.7)) < 25
