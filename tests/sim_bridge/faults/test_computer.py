"""An onboard computer in virtual time: processes that die, stop, crawl and come back; clocks, planners, ground link."""

from dataclasses import dataclass, field

import numpy as np
import pytest

from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.links import LinkName
from sim_bridge.faults import FaultSchedule
from sim_bridge.faults.computer import SOCKET_BUFFER_BYTES, OnboardComputer

BOOT_S, TICK_S = 1000.0, 0.02


@dataclass
class Process:
    """Notes when it ticks and what it hears, and says its name on the ground link at each tick."""

    boot_s: float
    ticks: list = field(default_factory=list)
    received: list = field(default_factory=list)

    def receive(self, link, datagram, time_s):
        self.received.append((link, datagram, time_s))

    def tick(self, time_s):
        self.ticks.append(time_s)

    def planning_job(self, time_s):
        return None

    def outbox(self):
        return [(LinkName.GROUND, b"status"), (LinkName.PEERS, b"belief")]


def make(component, kind, from_s=1.0, until_s=2.0, **parameters):
    config = FaultConfig(
        component=component, type=kind, since="boot", from_s=from_s, until_s=until_s, parameters=parameters
    )
    started = []

    def start(time_s):
        started.append(Process(time_s))
        return started[-1]

    schedule = FaultSchedule([config], BOOT_S)
    computer = OnboardComputer(2, start, lambda job: None, schedule, np.random.default_rng(1), BOOT_S)
    return computer, started


def run(computer, seconds, from_s=0.0):
    """Frames by the time since boot at which they leave; a datagram arrives 10 ms before each tick."""
    sent = []
    for k in range(round(from_s / TICK_S) + 1, round((from_s + seconds) / TICK_S) + 1):
        now_s = BOOT_S + k * TICK_S
        computer.receive(LinkName.AUTOPILOT, str(k).encode(), now_s - 0.01)
        sent += [(now_s - BOOT_S, *frame) for frame in computer.step(now_s, TICK_S)]
    return sent


def test_a_killed_process_is_silent_and_started_anew_when_the_fault_ends():
    computer, started = make(Component.PROCESS, FaultType.OFF)
    sent = run(computer, 3.0)
    assert len(started) == 2
    assert started[1].boot_s == pytest.approx(BOOT_S + 2.0)
    assert started[1].received[0][2] == pytest.approx(BOOT_S + 2.01), "what came while it was dead is lost"
    assert not [t for t, *_ in sent if 0.99 < t < 1.99]
    computer.kill()
    assert run(computer, 1.0, 3.0) == []
    assert computer.companion is None


def test_a_stopped_process_finds_what_came_in_its_sockets():
    computer, (process,) = make(Component.PROCESS, FaultType.STUCK)
    run(computer, 3.0)
    assert not [t for t in process.ticks if 0.999 < t - BOOT_S < 1.999]
    assert [int(datagram) for _, datagram, _ in process.received] == list(range(1, 151)), "all, in order"
    late = [time_s for _, datagram, time_s in process.received if 51 < int(datagram) < 99]
    assert late == pytest.approx([BOOT_S + 2.0] * len(late))


def test_socket_buffers_end():
    computer, (process,) = make(Component.PROCESS, FaultType.STUCK, from_s=0.0)
    for _ in range(400):
        computer.receive(LinkName.PEERS, bytes(1000), BOOT_S + 1.0)
    computer.step(BOOT_S + 2.0, TICK_S)
    assert sum(len(datagram) for _, datagram, _ in process.received) <= SOCKET_BUFFER_BYTES


def test_a_slow_process_gets_its_share_of_the_ticks():
    computer, (process,) = make(Component.PROCESS, FaultType.SLOW, share=0.2)
    run(computer, 3.0)
    ticks = np.array(process.ticks) - BOOT_S
    assert np.sum((ticks > 0.999) & (ticks < 1.999)) == 10
    assert np.sum(ticks > 2.001) == 50


def test_a_wrong_clock_is_what_the_process_goes_by():
    computer, (process,) = make(Component.CLOCK, FaultType.WRONG, offset_s=-5.0, drift_ppm=1000.0)
    run(computer, 3.0)
    assert process.ticks[48] == pytest.approx(BOOT_S + 0.98)
    assert process.ticks[74] == pytest.approx(BOOT_S + 1.5 - 5.0 + 0.5e-3)
    assert process.ticks[-1] == pytest.approx(BOOT_S + 3.0)


@pytest.mark.parametrize(("kind", "share"), [(FaultType.OFF, 0.0), (FaultType.INTERMITTENT, 0.7)])
def test_the_ground_link_fails_both_ways_and_no_other_link_does(kind, share):
    computer, (process,) = make(Component.GROUND_LINK, kind, until_s=21.0)
    for k in range(1, 1001):
        now_s = BOOT_S + 1.0 + k * TICK_S
        computer.receive(LinkName.GROUND, b"command", now_s)
        sent = computer.step(now_s, TICK_S)
        process.received += [(link, frame, now_s) for link, frame in sent]
    for link, frame in ((LinkName.GROUND, b"command"), (LinkName.GROUND, b"status"), (LinkName.PEERS, b"belief")):
        count = sum(1 for found, data, _ in process.received if (found, data) == (link, frame))
        expected = 1000 * (1.0 if link is LinkName.PEERS else share)
        assert count == pytest.approx(expected, abs=0.05 * 1000 * (0.0 < share < 1.0) * (link is LinkName.GROUND) + 2)
