"""Are the clocks right? TIMESYNC (https://mavlink.io/en/services/timesync.html) with the autopilot and with peers.

Of an exchange that began at t₁ and ended at t₂ by the own clock, the other clock's answer T tells its lead over the own
one to within half the round trip, whatever the ways took:

    lead = T − (t₁ + t₂)/2 ± (t₂ − t₁)/2.

The autopilot's clock counts from its boot, so only changes of its lead mean something: the own clock has jumped, or
runs at another rate. Peers' clocks show UNIX time, so their leads should be nought.
"""

from __future__ import annotations

import statistics
from collections import deque
from dataclasses import dataclass

from onboard.flight.failsafes import Condition
from onboard.protocol import dialect as mavlink
from onboard.timer import Timer

__all__ = ["LARGE_S", "ClockWatch"]

NOTICE_S = 0.02
"""More than this, beyond what the round trip leaves open, is told."""
LARGE_S = 0.25
"""With so much no plan is flown at its time: half a step of the lab's."""
PERIOD_S = 0.5
PERIOD_PER_NEIGHBOUR_S = 0.1
WINDOW_S = 10.0
"""A change over this time is a jump; slower ones are crystals that differ."""
MAX_ROUND_TRIP_S = 2.0
KEPT = 3
"""Exchanges with a peer of which the quickest counts."""
PEER_FORGOTTEN_S = 5.0


@dataclass(frozen=True, slots=True)
class _Exchange:
    """How far another clock leads, s, give or take ``unsure_s``; ``told_s`` is the other clock's time, s."""

    told_s: float
    lead_s: float
    unsure_s: float


class ClockWatch:
    """Watches one onboard computer's clock and its peers'.

    Args:
        system_id: Whose.
        time_s: UNIX time by its clock, s.
    """

    def __init__(self, system_id: int, time_s: float) -> None:
        self._system_id = system_id
        self._timer = Timer(PERIOD_S, time_s)
        self._autopilot: deque[_Exchange] = deque()
        self._peers: dict[int, deque[_Exchange]] = {}
        self._answered_s: dict[int, float] = {}
        self._asked_ns = 0
        self._unanswered = False

    # What it asks and hears.

    def request(self, neighbours: int, time_s: float) -> mavlink.MAVLink_timesync_message | None:
        """A question for the autopilot and for whoever hears it, if it is time for one.

        Args:
            neighbours: How many will answer: the more, the more seldom, so that radio traffic grows linearly.
            time_s: UNIX time, s.
        """
        if not self._timer.due(time_s):
            return None
        self._timer.restart(time_s, max(PERIOD_S, neighbours * PERIOD_PER_NEIGHBOUR_S))
        # Stamps of several vehicles must differ: answers carry nothing else that says whose question it was.
        self._asked_ns = round(time_s * 1e6) * 1000 + self._system_id
        self._unanswered = True
        return mavlink.MAVLink_timesync_message(0, self._asked_ns)

    def receive_autopilot(self, message: mavlink.MAVLink_timesync_message, time_s: float) -> None:
        """An answer of the autopilot."""
        exchange = self._exchange(message, time_s) if self._unanswered else None
        if exchange is None:
            return
        self._unanswered = False
        if self._autopilot and exchange.told_s < self._autopilot[-1].told_s:
            self._autopilot.clear()  # it has booted
        self._autopilot.append(exchange)
        while exchange.told_s - self._autopilot[0].told_s > WINDOW_S:
            self._autopilot.popleft()

    def receive_peer(
        self, message: mavlink.MAVLink_timesync_message, time_s: float
    ) -> mavlink.MAVLink_timesync_message | None:
        """A question of a peer, which is answered, or an answer; those between others are not for us."""
        if message.tc1 == 0:
            return mavlink.MAVLink_timesync_message(round(time_s * 1e9), message.ts1)
        exchange, peer = self._exchange(message, time_s), message.get_srcSystem()
        if exchange is not None:
            self._peers.setdefault(peer, deque(maxlen=KEPT)).append(exchange)
            self._answered_s[peer] = time_s
        return None

    def _exchange(self, message: mavlink.MAVLink_timesync_message, time_s: float) -> _Exchange | None:
        """What an answer tells; None if it does not answer the last question."""
        asked_s, told_s = message.ts1 * 1e-9, message.tc1 * 1e-9
        round_trip_s = time_s - asked_s
        if message.ts1 != self._asked_ns or message.tc1 == 0 or not 0.0 <= round_trip_s <= MAX_ROUND_TRIP_S:
            return None
        return _Exchange(told_s, told_s - 0.5 * (asked_s + time_s), 0.5 * round_trip_s)

    # What it makes of it.

    def peer_lead_s(self, peer: int) -> float:
        """How far a peer's clock is ahead, s; 0 while nothing shows that it is off."""
        best = self._best(peer)
        return best.lead_s if best is not None and abs(best.lead_s) - best.unsure_s > NOTICE_S else 0.0

    def seen(self, time_s: float) -> dict[Condition, str]:
        """What gives reason to worry at a UNIX time, with details in words."""
        for peer in [peer for peer, heard_s in self._answered_s.items() if time_s - heard_s > PEER_FORGOTTEN_S]:
            del self._answered_s[peer], self._peers[peer]
        found: dict[Condition, str] = {}
        jump = self._jump()
        if abs(jump.lead_s) - jump.unsure_s > NOTICE_S:
            found[Condition.CLOCK_JUMPED] = _milliseconds(-jump.lead_s)
        leads = {peer: lead_s for peer in self._peers if (lead_s := self.peer_lead_s(peer)) != 0.0}
        if leads:
            found[Condition.CLOCKS_DIFFER] = ", ".join(
                f"vehicle {peer}'s is {_milliseconds(leads[peer])} ahead" for peer in sorted(leads)
            )
        most_s = statistics.median_low([leads.get(peer, 0.0) for peer in self._peers]) if len(self._peers) > 1 else 0.0
        for off_s, unsure_s in ((-jump.lead_s, jump.unsure_s), (-most_s, 0.0)):
            if abs(off_s) - unsure_s >= LARGE_S:
                found[Condition.CLOCK_ASTRAY] = _milliseconds(off_s)
        return found

    def _best(self, peer: int) -> _Exchange | None:
        return min(self._peers.get(peer, ()), key=lambda exchange: exchange.unsure_s, default=None)

    def _jump(self) -> _Exchange:
        """How the autopilot's lead has changed within the window."""
        if len(self._autopilot) < 2:
            return _Exchange(0.0, 0.0, 0.0)
        earlier = min(list(self._autopilot)[: max(1, len(self._autopilot) // 4)], key=lambda one: one.unsure_s)
        latest = self._autopilot[-1]
        return _Exchange(latest.told_s, latest.lead_s - earlier.lead_s, latest.unsure_s + earlier.unsure_s)


def _milliseconds(duration_s: float) -> str:
    return f"{1e3 * duration_s:+.0f} ms" if abs(duration_s) < 1.0 else f"{duration_s:+.1f} s"
