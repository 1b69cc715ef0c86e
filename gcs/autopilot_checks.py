"""What a vehicle's autopilot shows on its link before a flight: rates, delay, position, battery. No I/O.

It speaks as the onboard process does (:class:`onboard.flight.autopilot.AutopilotLink`), and asks for TIMESYNC besides
(https://mavlink.io/en/services/timesync.html): an answer tells the round trip and the difference of the clocks.
"""

from __future__ import annotations

import math
import statistics
from collections import deque

from gcs.checks import Check, Outcome
from onboard.config import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.requirements import Needs
from onboard.flight.streams import MIN_SHARE
from onboard.protocol import dialect as mavlink

__all__ = ["AutopilotWatch"]

WINDOW_S = 3.0
"""Over which rates, delays and positions are judged."""
ASK_PERIOD_S = 0.1
MIN_POSE_RATE_HZ = 10.0
"""Position and attitude that come less often fly no plan."""
GOOD_ROUND_TRIP_S = 0.05
GOOD_JITTER_S = 0.02
FROZEN_S = 1.0
"""An estimate that is the same to the last bit for so long is none: filters of real sensors never rest."""
STEADY_M = {"mocap": 0.1, "gps": 1.0}
"""How far an estimate may wander within a window while the vehicle stands, by the source of positions."""
LOW_BATTERY_PERCENT = 30
GOOD_BATTERY_PERCENT = 70
FAR_FROM_HOME_M = {"mocap": 0.5, "gps": 5.0}
"""By the source of positions: GPS wanders by metres."""
GOOD_CLOCK_S = 1.0

_VITAL = frozenset({mavlink.MAVLINK_MSG_ID_LOCAL_POSITION_NED, mavlink.MAVLINK_MSG_ID_ATTITUDE})


class AutopilotWatch:
    """Listens to one autopilot.

    Args:
        scenario: What is to be flown.
        vehicle: By which of its vehicles.

    Attributes:
        link: The companion's side of its link.
    """

    def __init__(self, scenario: Scenario, vehicle: VehicleConfig) -> None:
        self.link = AutopilotLink(
            vehicle.id,
            scenario.flight.autopilot_timeout_s,
            expected=vehicle.autopilot,
            origin=scenario.mission.origin,
            related_by_gps=scenario.mission.position_source == "gps",
            needs=Needs.of(scenario, vehicle),
        )
        self._scenario = scenario
        self._vehicle = vehicle
        self._arrivals: dict[int, deque[float]] = {}
        self._round_trips: deque[tuple[float, float, float]] = deque()
        self._clock_error_s: float | None = None
        self._moved_s = -math.inf
        self._places: deque[tuple[float, tuple[float, float, float]]] = deque()
        self._next_ask_s = -math.inf
        self._begin_s: float | None = None

    def receive(self, message: mavlink.MAVLink_message, time_s: float) -> None:
        """Take a message that arrived at a UNIX time."""
        before = self.link.heard.local_position
        self.link.receive(message, time_s)
        if message.get_srcSystem() != self._vehicle.id or message.get_srcComponent() != mavlink.MAV_COMP_ID_AUTOPILOT1:
            return
        self._arrivals.setdefault(message.get_msgId(), deque()).append(time_s)
        if self.link.heard.local_position not in (None, before):
            self._moved_s = time_s
            self._places.append((time_s, self.link.heard.local_position))
        if isinstance(message, mavlink.MAVLink_timesync_message) and message.tc1 != 0:
            round_trip_s = time_s - message.ts1 * 1e-9
            if 0.0 <= round_trip_s < WINDOW_S:
                offset_s = message.tc1 * 1e-9 - time_s + round_trip_s / 2.0
                self._round_trips.append((time_s, round_trip_s, offset_s))
        elif isinstance(message, mavlink.MAVLink_system_time_message) and message.time_unix_usec:
            self._clock_error_s = message.time_unix_usec * 1e-6 - time_s

    def poll(self, time_s: float) -> list[mavlink.MAVLink_message]:
        """What to send at a UNIX time, s."""
        out = self.link.poll(time_s)
        if self._begin_s is None and self.link.alive(time_s):
            self._begin_s = time_s
        if self.link.alive(time_s) and time_s >= self._next_ask_s:
            self._next_ask_s = time_s + ASK_PERIOD_S
            out.append(mavlink.MAVLink_timesync_message(0, round(time_s * 1e9)))
        return out

    def seen_enough(self, time_s: float) -> bool:
        """Whether the rates have been there for a whole window, after the time that asking for them takes."""
        return self._begin_s is not None and time_s - self._begin_s >= 2.0 * WINDOW_S

    def checks(self, time_s: float) -> list[Check]:
        """What is seen at a UNIX time, s; only the link itself where nothing is heard."""
        for arrivals in self._arrivals.values():
            while arrivals and time_s - arrivals[0] > WINDOW_S:
                arrivals.popleft()
        while self._places and time_s - self._places[0][0] > WINDOW_S:
            self._places.popleft()
        while self._round_trips and time_s - self._round_trips[0][0] > WINDOW_S:
            self._round_trips.popleft()
        link = self._link(time_s)
        if link.outcome is Outcome.FAIL:
            return [link]
        return [link, *self._rates(), *self._clocks(), *self._position(time_s), self._battery(), self._ready(time_s)]

    def _link(self, time_s: float) -> Check:
        url, expected = self._vehicle.autopilot_url, self._vehicle.autopilot
        wanted = f"HEARTBEAT of system {self._vehicle.id}, component 1, once a second on {url}"
        if not self.link.alive(time_s):
            return Check("link", Outcome.FAIL, "no heartbeat", wanted)
        name = self.link.behaviour.name
        if self.link.behaviour.autopilot != self.link.heard.autopilot:
            found = f"autopilot {self.link.heard.autopilot} is neither PX4 nor ArduPilot"
            return Check("link", Outcome.FAIL, found, f"vehicles[].autopilot: {expected}")
        right = name.lower() == expected
        return Check.of("link", Outcome.PASS if right else Outcome.FAIL, name, f"the scenario says {expected}")

    def _rates(self) -> list[Check]:
        checks = []
        for message_id, wanted_hz in self.link.behaviour.rates_hz.items():
            hz = len(self._arrivals.get(message_id, ())) / WINDOW_S
            if hz >= MIN_SHARE * wanted_hz - 1.0 / WINDOW_S:
                outcome = Outcome.PASS
            elif hz == 0.0 or (message_id in _VITAL and hz < MIN_POSE_RATE_HZ):
                outcome = Outcome.FAIL
            else:
                outcome = Outcome.WARN
            name = f"rate of {mavlink.mavlink_map[message_id].msgname}"
            wanted = f"{wanted_hz:g} Hz; is the link fast enough, does another stream crowd it out?"
            checks.append(Check.of(name, outcome, f"{hz:.1f} Hz", wanted))
        return checks

    def _clocks(self) -> list[Check]:
        checks = []
        wanted = f"round trip within {1e3 * GOOD_ROUND_TRIP_S:.0f} ms, steady within {1e3 * GOOD_JITTER_S:.0f} ms"
        if not self._round_trips:
            checks.append(Check("TIMESYNC", Outcome.WARN, "no answer", wanted))
        else:
            trip_s = statistics.median(trip for _, trip, _ in self._round_trips)
            offsets = sorted(offset for _, _, offset in self._round_trips)
            boot_s = -statistics.median(offsets)
            # Half a round trip that is late on one way only shifts the offset by as much.
            jitter_s = offsets[(9 * len(offsets)) // 10] - offsets[len(offsets) // 10]
            good = trip_s <= GOOD_ROUND_TRIP_S and jitter_s <= GOOD_JITTER_S
            found = f"round trip {1e3 * trip_s:.1f} ms, offset {boot_s:.3f} s, steady within {1e3 * jitter_s:.1f} ms"
            checks.append(Check.of("TIMESYNC", Outcome.PASS if good else Outcome.WARN, found, wanted))
        if self._clock_error_s is not None:
            good = abs(self._clock_error_s) <= GOOD_CLOCK_S
            found = f"{self._clock_error_s:+.3f} s from this computer's"
            wanted = f"within {GOOD_CLOCK_S:g} s, or its logs do not match ours; GPS or a companion sets it"
            checks.append(Check.of("autopilot's clock", Outcome.PASS if good else Outcome.WARN, found, wanted))
        return checks

    def _position(self, time_s: float) -> list[Check]:
        source = self._scenario.mission.position_source
        wanted = f"an estimate from {source} that follows every move"
        position = self.link.position
        if not self.link.heard.has_position(time_s) or position is None:
            lacks = self.link.lacks(time_s)
            return [Check("position", Outcome.FAIL, lacks if "origin" in lacks else "no position estimate", wanted)]
        still_s = time_s - self._moved_s
        north_m, east_m, down_m = position
        found = f"north {north_m:.2f} m, east {east_m:.2f} m, up {-down_m:.2f} m"
        if still_s > FROZEN_S:
            return [Check("position", Outcome.FAIL, f"{found}, the same for {still_s:.1f} s: frozen", wanted)]
        axes = list(zip(*(place for _, place in self._places), strict=True))
        wandered_m = math.hypot(*(max(axis) - min(axis) for axis in axes))
        if wandered_m > STEADY_M[source]:
            text = f"{found}, wandered {wandered_m:.2f} m in {WINDOW_S:.0f} s"
            return [Check("position", Outcome.FAIL, text, f"steady within {STEADY_M[source]:g} m while it stands")]
        return [Check("position", Outcome.PASS, found), self._home(north_m, east_m, source)]

    def _home(self, north_m: float, east_m: float, source: str) -> Check:
        """Bodies that are swapped in the motion capture system make vehicles fly into each other."""

        def away_m(vehicle: VehicleConfig) -> float:
            return math.dist((north_m, east_m), vehicle.home)

        own = self._vehicle
        wanted = f"within {FAR_FROM_HOME_M[source]:g} m of home, north {own.home[0]:g} m, east {own.home[1]:g} m"
        found = f"{away_m(own):.2f} m from home"
        nearest = min(self._scenario.vehicles, key=away_m)
        if away_m(own) <= FAR_FROM_HOME_M[source]:
            return Check("place", Outcome.PASS, found)
        if nearest is not own and away_m(nearest) <= FAR_FROM_HOME_M[source]:
            text = f"stands at vehicle {nearest.id}'s home: are they, or their rigid bodies, swapped?"
            return Check("place", Outcome.FAIL, text, wanted)
        return Check("place", Outcome.WARN, found, wanted)

    def _battery(self) -> Check:
        percent = self.link.heard.battery_percent
        wanted = f"{GOOD_BATTERY_PERCENT} % or more for a flight; no start below {LOW_BATTERY_PERCENT} %"
        if percent is None:
            return Check("battery", Outcome.WARN, "unknown", wanted)
        low = Outcome.FAIL if percent < LOW_BATTERY_PERCENT else Outcome.WARN
        return Check.of("battery", Outcome.PASS if percent >= GOOD_BATTERY_PERCENT else low, f"{percent} %", wanted)

    def _ready(self, time_s: float) -> Check:
        """What would keep the onboard process from starting; parameters and position have their own checks."""
        heard = self.link.heard
        if heard.armed:
            return Check("ready", Outcome.FAIL, "it is armed", "on the ground and disarmed")
        lacks = self.link.behaviour.lacks(heard)
        if not lacks:
            return Check("ready", Outcome.PASS, "standing by" + (f", {self.link.mode_name}" if heard.mode else ""))
        unhealthy = f" ({', '.join(heard.unhealthy)} unhealthy)" if heard.unhealthy else ""
        said = self.link.explanation(time_s)
        return Check(
            "ready", Outcome.FAIL, f"{lacks}{unhealthy}" + (f": {said}" if said else ""), "pre-arm checks pass"
        )
