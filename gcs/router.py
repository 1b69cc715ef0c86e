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

_ROUTE_TIMEOUT_S = 3.0
"""Silence after which a component is reached where else it is heard, s."""

_AUTOPILOT = mavlink.MAV_COMP_ID_AUTOPILOT1
_ONBOARD = mavlink.MAV_COMP_ID_ONBOARD_COMPUTER
_SILENT_AFTER_S = 10.0
_MAX_PORTS_PER_LINK = 16


@dataclass(frozen=True, slots=True)
class Port:
    """One end that frames come from and go to.

    Attributes:
        link: Name of the link: :data:`TEAM`, or one on which other ground stations are.
        address: Of the remote.
    """

    link: str
    address: Address


class Router:
    """Learns who is where from what arrives.

    Attributes:
        refused: Frames that were not passed on: a vehicle's from elsewhere than the team's link, or too many remotes.
    """

    def __init__(self) -> None:
        self.refused = 0
        self._ports: dict[SystemComponent, Port] = {}
        self._heard_s: dict[SystemComponent, float] = {}
        self._others: dict[Port, float] = {}
        self._always: set[Port] = set()

    def add_remote(self, port: Port) -> None:
        """A remote that gets broadcasts even before it has said anything, as ``udpout`` links have."""
        self._always.add(port)

    @property
    def has_guests(self) -> bool:
        """Whether anybody but the team is connected."""
        return bool(self._others or self._always)

    def team_port(self, component: SystemComponent) -> Port | None:
        """Where a component of the team was heard last; None if never."""
        port = self._ports.get(component)
        return port if port is not None and port.link == TEAM else None

    def team_components(self) -> Iterator[SystemComponent]:
        """Who was heard on the team's link."""
        return (component for component, port in self._ports.items() if port.link == TEAM)

    def ports_on(self, link: str, components: Container[int]) -> set[Port]:
        """Where components with one of these ids were heard on a link."""
        return {port for source, port in self._ports.items() if port.link == link and source[1] in components}

    def port_of(self, component: SystemComponent) -> Port | None:
        """Where a component was heard last; None if never."""
        return self._ports.get(component)

    def receive(self, frame: bytes, port: Port, now_s: float) -> bool:
        """Learn from a frame; whether it may be used.

        A component is where it was heard first until it is silent there: some autopilots forward what their companions
        send, and such a copy does not replace the direct way. The direct way always replaces the one through the
        autopilot, which may have been the first to be read after this program stood still.
        """
        source = source_of(frame)
        if port.link != TEAM:
            known = self._ports.get(source)
            if known is not None and known.link == TEAM:
                self.refused += 1
                return False
            if port not in self._others and not self._has_room(port):
                self.refused += 1
                return False
            self._others[port] = now_s
        known = self._ports.get(source)
        through_autopilot = (
            source[1] != _AUTOPILOT and known is not None and known == self._ports.get((source[0], _AUTOPILOT))
        )
        silent = now_s - self._heard_s.get(source, -math.inf) > _ROUTE_TIMEOUT_S
        if known == port or silent or through_autopilot:
            self._ports[source] = port
            self._heard_s[source] = now_s
        return True

    def ways(self, frame: bytes, came_from: Port) -> list[Port]:
        """Where to pass a frame on, that has been received."""
        system, component = target_of(frame)
        from_team = came_from.link == TEAM
        if system == BROADCAST:
            ports = [*self._others, *(port for port in self._always if port not in self._others)]
            if not from_team:
                ports += dict.fromkeys(
                    port for known, port in self._ports.items() if port.link == TEAM and known[1] != _ONBOARD
                )
        else:
            ports = list(
                dict.fromkeys(
                    port
                    for known, port in self._ports.items()
                    if known[0] == system and component in (BROADCAST, known[1])
                )
            )
        return [port for port in ports if port != came_from and not (from_team and port.link == TEAM)]

    def forget_silent(self, now_s: float) -> None:
        """Drop other ground stations that have gone."""
        gone = {port for port, heard_s in self._others.items() if now_s - heard_s > _SILENT_AFTER_S}
        for port in gone:
            del self._others[port]
        self._ports = {component: port for component, port in self._ports.items() if port not in gone}

    def _has_room(self, port: Port) -> bool:
        return sum(other.link == port.link for other in self._others) < _MAX_PORTS_PER_LINK
