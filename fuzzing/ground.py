"""A ground station with its terminal, which hears a team in its mission, and into whose links a fuzzer writes.

The team's genuine frames keep a picture going; the hostile ones have valid checksums, as in :mod:`fuzzing.flight`.
"""

from __future__ import annotations

import io
import json
from collections import deque

from rich.console import Console

from fuzzing.flight import BrokenPromiseError
from fuzzing.genuine import BEGUN_S, HEALTHY, LAB, OFFBOARD, START_S, belief, plan, status, tile
from fuzzing.hostile import hostile_frame
from fuzzing.source import ByteSource
from gcs import summary
from gcs.arena_map import ArenaMap
from gcs.mission import MissionDirector
from gcs.operator_desk import Action, Order
from gcs.router import TEAM
from gcs.station import GroundStation
from gcs.switchboard import SHARE
from gcs.team import Event
from gcs.terminal import progress_line, render_team
from onboard.links import COMPONENT
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.link_url import LinkUrl
from onboard.protocol.transport import Address

__all__ = ["FuzzedStation"]

TICK_S = 0.1
MAX_HOSTILE = 6
MAX_INPUTS = 300
_WIDTH, _HEIGHT = 160, 40
_EVENTS = 40
_MOST_REMEMBERED = 5000
"""Things that a station may keep in one place: a flight of this length needs far fewer."""

_SENDERS = ((1, 1), (2, COMPONENT), (3, COMPONENT), (1, COMPONENT), (250, 1), (255, 190), (77, 77), (9, 1))


class _Nowhere:
    """A link that sends to nobody."""

    url = LinkUrl("udpin", "127.0.0.1", 14550)
    local_port = 14550

    def read(self) -> bool:
        """Nothing waits."""
        return True

    def send(self, data: bytes, address: Address | None = None) -> None:
        """Drop it."""

    def close(self) -> None:
        """Nothing is open."""


class FuzzedStation:
    """A station that flies the lab, as it listens, draws, commands and sums up."""

    def __init__(self) -> None:
        self._inputs = 0
        self._time_s = BEGUN_S
        director = MissionDirector(LAB.mission.step_s, LAB.mission.takeoff_time_s, 60.0)
        self.station = GroundStation(LAB, director=director, clock=lambda: self._time_s, steady=lambda: self._time_s)
        for link in (TEAM, SHARE):
            self.station.switchboard.attach(link, _Nowhere())
        self._codecs = {(i, c): Codec(i, c) for i in (1, 2, 3) for c in (1, COMPONENT)}
        self._arena = ArenaMap(LAB, 48, 12)
        self._events: list[Event] = []
        for _ in range(20):
            self._tick()

    @property
    def is_over(self) -> bool:
        """Whether a new station would be more interesting."""
        return self._inputs >= MAX_INPUTS

    def feed(self, data: bytes) -> None:
        """Write an input's frames into the links, let time pass, give an order, draw, and look at what is promised.

        Raises:
            BrokenPromiseError: The summary is none, or something grows without bound.
        """
        self._inputs += 1
        source = ByteSource(data)
        for _ in range(MAX_HOSTILE):
            if not source.left:
                break
            frame = hostile_frame(source, self._genuine(), _SENDERS)
            address = ("127.0.0.1", 40000 + source.below(16))
            self.station.switchboard.receive(source.pick((TEAM, TEAM, TEAM, SHARE)), frame, address, self._time_s)
        if source.below(8) == 0:
            self.station.desk.submit(Order(source.pick(list(Action)), (1, 2, 3)))
        for _ in range(1 + source.below(5)):
            self._tick()
        self._look()

    def _tick(self) -> None:
        self._time_s += TICK_S
        for (system, component), codec in self._codecs.items():
            for message in self._autopilot() if component == 1 else self._onboard():
                address = ("127.0.0.1", 20000 + 1000 * component + system)
                self.station.switchboard.receive(TEAM, codec.encode(message), address, self._time_s)
        self.station.tick()
        self._events = (self._events + self.station.team.take_events())[-_EVENTS:]

    def _genuine(self) -> tuple[mavlink.MAVLink_message, ...]:
        return (*self._onboard(), *self._autopilot(), *_SAID_NOW_AND_THEN, plan(self._time_s), belief(self._time_s))

    def _onboard(self) -> tuple[mavlink.MAVLink_message, ...]:
        return mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3), status(self._time_s), belief(self._time_s)

    def _autopilot(self) -> tuple[mavlink.MAVLink_message, ...]:
        boot_ms = round(1e3 * (self._time_s - BEGUN_S))
        return (
            mavlink.MAVLink_heartbeat_message(2, 12, 145, OFFBOARD, 4, 3),
            HEALTHY,
            mavlink.MAVLink_local_position_ned_message(boot_ms, 1.0, 2.8, -1.0, 0.0, 0.0, 0.0),
        )

    def _look(self) -> None:
        team = self.station.team.state(self._time_s)
        drawn = io.StringIO()
        console = Console(file=drawn, width=_WIDTH, height=_HEIGHT)
        console.print(render_team(team, self._arena, self._events, "fuzzed", "flying", 1.0, _HEIGHT, _WIDTH))
        for character in drawn.getvalue() + progress_line(team, "flying", 1.0):
            if not (character.isprintable() or character == "\n"):
                raise BrokenPromiseError(f"{character!r} reaches the terminal")
        facts = summary.FlightFacts("lab", "0", 1, START_S, START_S + 1.0, None, {}, ())
        json.dumps(summary.summarize(self.station.team, facts, self._time_s), allow_nan=False)
        size = _most_remembered(self.station, set())
        if size > _MOST_REMEMBERED:
            raise BrokenPromiseError(f"{size} things are remembered in one place")


def _most_remembered(thing: object, seen: set[int]) -> int:
    """The size of the largest collection that can be reached from an object of ours."""
    if id(thing) in seen:
        return 0
    seen.add(id(thing))
    if isinstance(thing, (dict, list, tuple, set, frozenset, deque)):
        parts = [*thing.keys(), *thing.values()] if isinstance(thing, dict) else list(thing)
        return max([len(thing), *(_most_remembered(part, seen) for part in parts)])
    if type(thing).__module__.startswith(("gcs.", "onboard.")) and hasattr(thing, "__dict__"):
        return max((_most_remembered(part, seen) for part in vars(thing).values()), default=0)
    return 0


_SAID_NOW_AND_THEN: tuple[mavlink.MAVLink_message, ...] = (
    mavlink.MAVLink_attitude_message(1000, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0),
    mavlink.MAVLink_extended_sys_state_message(0, 2),
    mavlink.MAVLink_command_ack_message(mavlink.MAV_CMD_NAV_LAND, 0, 0, 0, 255, 190),
    mavlink.MAVLink_statustext_message(4, b"[/bold] :smile: \x1b[2J \xff\xfe", 0, 0),
    mavlink.MAVLink_statustext_message(4, "\u202e\u200b\u00e1 [red]".encode(), 0, 0),
    mavlink.MAVLink_target_truth_message(round(1e6 * START_S), 1.0, 2.0, 0.0, 0.0, 1),
    mavlink.MAVLink_vehicle_truth_message(
        round(1e6 * START_S), 1.0, 2.0, -1.0, 0.0, 0.0, 0.0, 0.0, 0.8, 0.04, 10.0, 501, 1
    ),
    mavlink.MAVLink_arvi_landmarks_message(round(1e6 * START_S), [1.0] * 24, [2.0] * 24, 3),
    tile(),
)
