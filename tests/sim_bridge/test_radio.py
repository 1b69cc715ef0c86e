"""The radio: unit-disc range, losses, delays; frames stay as they are."""

import math

import numpy as np
import pytest
from scipy import stats

from onboard.config.simulation import RadioConfig
from sim_bridge.radio import Radio

LINE = {1: (0.0, 0.0, -1.0), 2: (2.0, 0.0, -1.0), 3: (5.0, 0.0, -1.0)}


def make(**config):
    return Radio(RadioConfig(**config), np.random.default_rng(5))


def test_a_broadcast_reaches_those_within_range_and_never_its_sender():
    radio = make(range_m=3.0)
    radio.broadcast(2, b"\xfd\x00 anything \xff", 10.0, LINE)
    assert radio.deliveries(10.001) == []
    heard = radio.deliveries(10.002)
    assert {(d.sender, d.receiver, d.datagram) for d in heard} == {
        (2, 1, b"\xfd\x00 anything \xff"),
        (2, 3, b"\xfd\x00 anything \xff"),
    }
    radio.broadcast(1, b"x", 11.0, LINE)
    assert [d.receiver for d in radio.deliveries(12.0)] == [2]
    assert radio.links[1, 3].out_of_range == 1
    assert (radio.links[1, 2].delivered, radio.links[1, 2].delivered_bytes) == (1, 1)
    assert (1, 1) not in radio.links


def test_range_is_measured_in_three_dimensions():
    radio = make(range_m=3.0)
    radio.broadcast(1, b"x", 0.0, {1: (0.0, 0.0, 0.0), 2: (2.9, 0.0, -1.0), 3: (2.9, 0.0, -0.5)})
    assert [d.receiver for d in radio.deliveries(1.0)] == [3]


def test_no_range_reaches_everybody():
    radio = make(range_m=None)
    radio.broadcast(1, b"x", 0.0, {1: (0.0, 0.0, 0.0), 2: (1e6, 0.0, 0.0)})
    assert len(radio.deliveries(1.0)) == 1


def test_losses_are_independent_and_as_frequent_as_configured():
    radio = make(loss=0.3)
    for k in range(2000):
        radio.broadcast(2, b"x", float(k), LINE)
    both = radio.links[2, 1], radio.links[2, 3]
    for link in both:
        assert link.delivered + link.lost == 2000
        assert stats.binomtest(link.lost, 2000, 0.3).pvalue > 1e-3
    heard = {receiver: [0] * 2000 for receiver in (1, 3)}
    radio = make(loss=0.3)
    for k in range(2000):
        radio.broadcast(2, k.to_bytes(2, "big"), 0.0, LINE)
    for delivery in radio.deliveries(1.0):
        heard[delivery.receiver][int.from_bytes(delivery.datagram, "big")] = 1
    assert abs(np.corrcoef(heard[1], heard[3])[0, 1]) < 4.0 / math.sqrt(2000)


def test_loss_of_one_loses_everything():
    radio = make(loss=1.0)
    radio.broadcast(1, b"x", 0.0, LINE)
    assert radio.deliveries(1.0) == []
    assert radio.next_due_s is None


def test_jitter_is_uniform_above_the_delay():
    radio = make(delay_s=0.010, jitter_s=0.020)
    for _ in range(1000):
        radio.broadcast(1, b"x", 0.0, {1: (0.0, 0.0, 0.0), 2: (1.0, 0.0, 0.0)})
    arrivals = []
    while radio.next_due_s is not None:
        now = radio.next_due_s
        arrivals += [now] * len(radio.deliveries(now))
    assert len(arrivals) == 1000
    assert stats.kstest(arrivals, stats.uniform(0.010, 0.020).cdf).pvalue > 1e-3


def test_a_seed_repeats_the_losses():
    def run():
        radio = make(loss=0.5, jitter_s=0.1)
        for k in range(50):
            radio.broadcast(2, bytes([k]), 0.0, LINE)
        return radio.deliveries(1.0)

    assert run() == run()


@pytest.mark.parametrize("sender", [1, 2, 3])
def test_counters_account_for_every_broadcast(sender):
    radio = make(range_m=4.0, loss=0.5)
    for k in range(100):
        radio.broadcast(sender, b"abc", float(k), LINE)
    for receiver in {1, 2, 3} - {sender}:
        link = radio.links[sender, receiver]
        assert link.delivered + link.lost + link.out_of_range == 100
        assert link.delivered_bytes == 3 * link.delivered
