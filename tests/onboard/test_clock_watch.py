"""Clocks compared by TIMESYNC: what is told of a clock that is off, jumps or drifts, and what of a slow radio."""

import pytest

from onboard.clock_watch import ClockWatch
from onboard.flight.failsafes import Condition
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

BOOT = 1_800_000_000.0
TICK_S = 0.02


class Clocks:
    """Three vehicles that ask each other; each has a clock error and a way's delay."""

    def __init__(self) -> None:
        self.offset_s = {1: 0.0, 2: 0.0, 3: 0.0}
        self.delay_s = 0.0
        self.autopilot_delay_s = 0.0
        self.watches = {i: ClockWatch(i, BOOT) for i in self.offset_s}
        self.now_s = BOOT
        self._codecs = {i: Codec(i, 191) for i in self.offset_s}
        self._reader = Codec(99, 1)
        self._under_way: list[tuple[float, int, int, mavlink.MAVLink_message]] = []

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / TICK_S)):
            self.now_s += TICK_S
            due = [item for item in self._under_way if item[0] <= self.now_s]
            self._under_way = [item for item in self._under_way if item[0] > self.now_s]
            for _, sender, receiver, message in due:
                self._deliver(sender, receiver, message)
            for i, watch in self.watches.items():
                question = watch.request(2, self.now_s + self.offset_s[i])
                if question is not None:
                    self._send(i, 0, question, self.autopilot_delay_s)
                    for other in self.watches.keys() - {i}:
                        self._send(i, other, question, self.delay_s)

    def seen(self, vehicle: int) -> dict[Condition, str]:
        return self.watches[vehicle].seen(self.now_s + self.offset_s[vehicle])

    def _send(self, sender: int, receiver: int, message: mavlink.MAVLink_message, delay_s: float) -> None:
        (heard,) = self._reader.decode(self._codecs[max(sender, 1)].encode(message))
        self._under_way.append((self.now_s + delay_s, sender, receiver, heard))

    def _deliver(self, sender: int, receiver: int, message: mavlink.MAVLink_message) -> None:
        assert isinstance(message, mavlink.MAVLink_timesync_message)
        if receiver == 0:
            answer = mavlink.MAVLink_timesync_message(round((self.now_s - BOOT + 30.0) * 1e9), message.ts1)
            self._under_way.append((self.now_s + self.autopilot_delay_s, 0, sender, answer))
            return
        own_s = self.now_s + self.offset_s[receiver]
        if sender == 0:
            self.watches[receiver].receive_autopilot(message, own_s)
            return
        answered = self.watches[receiver].receive_peer(message, own_s)
        if answered is not None:
            for other in self.watches.keys() - {receiver}:
                self._send(receiver, other, answered, self.delay_s)


@pytest.mark.parametrize("delay_s", [0.0, 0.1, 0.8])
def test_a_slow_radio_and_fifteen_milliseconds_are_nothing(delay_s: float) -> None:
    clocks = Clocks()
    clocks.delay_s = delay_s
    clocks.offset_s[2] = 0.015
    clocks.run(8.0)
    assert all(clocks.seen(i) == {} for i in (1, 2, 3))


def test_a_clock_that_is_off_from_the_start_shows_with_the_peers_and_only_its_own_vehicle_holds() -> None:
    clocks = Clocks()
    clocks.offset_s[2] = 0.4
    clocks.run(3.0)
    assert set(clocks.seen(2)) == {Condition.CLOCKS_DIFFER, Condition.CLOCK_ASTRAY}
    assert clocks.seen(2)[Condition.CLOCK_ASTRAY] == "+400 ms"
    assert clocks.seen(1) == {Condition.CLOCKS_DIFFER: "vehicle 2's is +400 ms ahead"}
    assert clocks.watches[1].peer_lead_s(2) == pytest.approx(0.4, abs=0.02)
    assert clocks.watches[1].peer_lead_s(3) == 0.0


@pytest.mark.parametrize("jump_s", [0.3, -5.0])
def test_a_jump_shows_by_the_autopilot_within_a_second_and_is_over_when_the_clock_is_back(jump_s: float) -> None:
    clocks = Clocks()
    clocks.run(6.0)
    clocks.offset_s[2] = jump_s
    clocks.run(1.0)
    assert {Condition.CLOCK_JUMPED, Condition.CLOCK_ASTRAY} <= set(clocks.seen(2))
    clocks.run(3.0)
    assert Condition.CLOCK_JUMPED not in clocks.seen(1)
    clocks.offset_s[2] = 0.0
    clocks.run(2.5)
    assert Condition.CLOCK_ASTRAY not in clocks.seen(2)


def test_ten_milliseconds_a_second_show_within_eight_seconds() -> None:
    clocks = Clocks()
    clocks.run(3.0)
    for _ in range(400):
        clocks.offset_s[2] += 0.01 * TICK_S
        clocks.run(TICK_S)
    assert {Condition.CLOCK_JUMPED, Condition.CLOCKS_DIFFER} <= set(clocks.seen(2))


def test_a_link_to_the_autopilot_that_slows_down_is_no_jump_and_a_reboot_neither() -> None:
    clocks = Clocks()
    clocks.run(4.0)
    clocks.autopilot_delay_s = 0.3
    clocks.run(4.0)
    assert clocks.seen(1) == {}


def test_answers_to_nothing_that_was_asked_are_ignored() -> None:
    watch = ClockWatch(1, BOOT)
    stray = Codec(99, 1).decode(Codec(2, 191).encode(mavlink.MAVLink_timesync_message(1, round(BOOT * 1e9))))[0]
    assert isinstance(stray, mavlink.MAVLink_timesync_message)
    assert watch.receive_peer(stray, BOOT) is None
    watch.receive_autopilot(stray, BOOT)
    assert watch.seen(BOOT) == {}
