"""Between the team's link and other ground stations: which frame goes where. A core without I/O.

The rules are MAVLink's (https://mavlink.io/en/guide/routing.html): broadcasts go everywhere, what is addressed goes
only where its addressee was heard, what is unknown is passed on, and no frame is ever changed or sent back to where it
came from. Three rules of our own: vehicles are not connected with each other (they have their radio, with its range);
what claims to come from a vehicle is believed on the team's link only, so a circle of forwarding stations ends here;
and onboard processes, which hear their own ground station alone, are spared the broadcasts of others.
"""

from __future__ import annotations

import math
from collections.abc import Container, Iterator
from dataclasses import dataclass

from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import SystemComponent, source_of, target_of
from onboard.protocol.codec import BROADCAST
from onboard.protocol.transport import Address

__all__ = ["TEAM", "Port", "Router"]

TEAM = "team"
"""Name of the link that the vehicles are on."""

_ROUTE_TIMEOUT_S = 1.5
"""Silence after which a component is reached where else it is heard, s: a process that began anew has another port."""

_DOUBLED_S = 5.0
"""A component that is heard at two places for so long is two, s."""

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_ONBOARD = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
_SILENT_AFTER_S = 10.0
_MAX_PORTS_PER_LINK = 16
_MAX_COMPONENTS_PER_PORT = 64


@dataclass(frozen=True, slots=True)
class Port:
    """One end that frames come from and go to.

    Attributes:
        link: Name of the link: :data:`TEAM`, or one on which other ground stations are.
        address: Of the remote.
    """

    link: str
    address: Address


@dataclass(slots=True)
class _Heard:
    """Where a component of the team is, and since when somebody speaks in its name elsewhere."""

    port: Port
    heard_s: float
    rival: Port | None = None
    rival_since_s: float = math.inf
    rival_heard_s: float = -math.inf
    told: bool = False


class Router:
    """Learns who is where from what arrives.

    A component of the team is at one place. Other ground stations may have one id at several, as QGroundControl has
    everywhere: what is addressed to it goes to all of them.

    Attributes:
        refused: Frames that were not passed on: a vehicle's from elsewhere than the team's link, or too many remotes.
    """

    def __init__(self) -> None:
        self.refused = 0
        self._team: dict[SystemComponent, _Heard] = {}
        self._guests: dict[Port, dict[SystemComponent, float]] = {}
        self._always: dict[Port, None] = {}

    def add_remote(self, port: Port) -> None:
        """A remote that gets broadcasts even before it has said anything, as ``udpout`` links have."""
        self._always[port] = None

    @property
    def has_guests(self) -> bool:
        """Whether anybody but the team is connected."""
        return bool(self._guests or self._always)

    def team_port(self, component: SystemComponent) -> Port | None:
        """Where a component of the team was heard last; None if never."""
        heard = self._team.get(component)
        return heard.port if heard is not None else None

    def team_components(self) -> Iterator[SystemComponent]:
        """Who was heard on the team's link."""
        return iter(self._team)

    def is_at(self, component: SystemComponent, port: Port) -> bool:
        """Whether a component is known to be at a place."""
        if port.link != TEAM:
            return component in self._guests.get(port, ())
        heard = self._team.get(component)
        return heard is not None and heard.port == port

    def guest_ports(self, component: SystemComponent) -> set[Port]:
        """Where a component was heard that is not of the team."""
        return {port for port, components in self._guests.items() if component in components}

    def ports_on(self, link: str, components: Container[int]) -> set[Port]:
        """Where components with one of these ids were heard on a link of other ground stations."""
        return {
            port
            for port, heard in self._guests.items()
            if port.link == link and any(component in components for _, component in heard)
        }

    def receive(self, frame: bytes, port: Port, now_s: float) -> bool:
        """Learn from a frame; whether it may be used.

        A component of the team is where it was heard first until it is silent there: some autopilots forward what their
        companions send, and such a copy does not replace the direct way. The direct way always replaces the one through
        the autopilot, which may have been the first to be read after this program stood still.
        """
        source = source_of(frame)
        if port.link == TEAM:
            self._receive_from_team(source, port, now_s)
            return True
        heard = self._guests.get(port)
        if source in self._team or (heard is None and not self._has_room(port)):
            self.refused += 1
            return False
        if heard is None:
            heard = self._guests[port] = {}
        if source in heard or len(heard) < _MAX_COMPONENTS_PER_PORT:
            heard[source] = now_s
        return True

    def take_doubled(self) -> list[tuple[SystemComponent, Port, Port]]:
        """The team's components that are heard at two places, with both, each once; the first is believed."""
        doubled = []
        for source, heard in self._team.items():
            if heard.rival is not None and not heard.told and heard.rival_heard_s - heard.rival_since_s >= _DOUBLED_S:
                heard.told = True
                doubled.append((source, heard.port, heard.rival))
        return doubled

    def ways(self, frame: bytes, came_from: Port) -> list[Port]:
        """Where to pass a frame on, that has been received."""
        system, component = target_of(frame)
        from_team = came_from.link == TEAM
        if system == BROADCAST:
            ports = [*self._guests, *self._always]
            if not from_team:
                ports += [heard.port for known, heard in self._team.items() if known[1] != _ONBOARD]
        else:

            def meant(known: SystemComponent) -> bool:
                return known[0] == system and component in (BROADCAST, known[1])

            ports = [port for port, components in self._guests.items() if any(map(meant, components))]
            if not from_team:
                ports += [heard.port for known, heard in self._team.items() if meant(known)]
        return [port for port in dict.fromkeys(ports) if port != came_from]

    def forget_silent(self, now_s: float) -> None:
        """Drop other ground stations that have gone."""
        for port, heard in list(self._guests.items()):
            for component, heard_s in list(heard.items()):
                if now_s - heard_s > _SILENT_AFTER_S:
                    del heard[component]
            if not heard:
                del self._guests[port]

    def _receive_from_team(self, source: SystemComponent, port: Port, now_s: float) -> None:
        heard = self._team.get(source)
        if heard is None:
            self._team[source] = _Heard(port, now_s)
            for components in self._guests.values():
                components.pop(source, None)
            return
        if port == heard.port:
            heard.heard_s = now_s
            return
        autopilot = self.team_port((source[0], _AUTOPILOT)) if source[1] != _AUTOPILOT else None
        if heard.port == autopilot or now_s - heard.heard_s > _ROUTE_TIMEOUT_S:
            self._team[source] = _Heard(port, now_s)
        elif port != autopilot:
            if heard.rival != port or now_s - heard.rival_heard_s > _ROUTE_TIMEOUT_S:
                heard.rival, heard.rival_since_s = port, now_s
            heard.rival_heard_s = now_s

    def _has_room(self, port: Port) -> bool:
        return sum(other.link == port.link for other in self._guests) < _MAX_PORTS_PER_LINK
