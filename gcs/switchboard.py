"""The ground station's sockets: the team's link, the local port that programs here share, and links to other stations.

Frames go through a :class:`~gcs.router.Router`; what is for the station itself is handed to it, too.
"""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable
from functools import partial
from typing import Protocol

from gcs.ground_socket import GroundSocket
from gcs.router import TEAM, Port, Router
from onboard.config.schema import GroundConfig
from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import SystemComponent, source_of, target_of
from onboard.protocol.codec import BROADCAST, is_sound, message_id, split_frames
from onboard.protocol.transport import Address, LinkUrl, TransportError

__all__ = ["JOINED_COMPONENTS", "SHARE", "Switchboard"]

SHARE = "share"
"""Name of the link of programs on this machine."""

_BUFFER_BYTES = 4 * 1024 * 1024
"""Twenty vehicles tell of fifty targets each within milliseconds: the beliefs of one step."""

_NEEDED_BY_MAVSDK = frozenset({mavlink.MAVLINK_MSG_ID_HEARTBEAT, mavlink.MAVLINK_MSG_ID_EXTENDED_SYS_STATE})
"""Of what vehicles broadcast; MAVSDK's actions need no more, and each frame costs both sides."""

JOINED_COMPONENTS = range(mavlink.MAV_COMP_ID_USER2, mavlink.MAV_COMP_ID_USER2 + 48)
"""Component ids of programs that join a station, two each: the program's and its MAVSDK's."""

Receiver = Callable[[bytes, SystemComponent, Port, float], None]
"""A frame, its sender, where it came from, and the UNIX time at which it arrived, s."""


class Socket(Protocol):
    """What a link is sent and read with: a :class:`~gcs.ground_socket.GroundSocket`."""

    @property
    def url(self) -> LinkUrl:
        """Of the link."""

    @property
    def local_port(self) -> int:
        """UDP port on this side."""

    def read(self) -> bool:
        """Read what waits; whether nothing is left."""

    def send(self, data: bytes, address: Address | None = None) -> None:
        """Send to an address, or to the one remote of an ``udpout`` link."""

    def close(self) -> None:
        """Close it."""


class Switchboard:
    """Opens the links of a ground station and passes frames on.

    Args:
        ground: URLs of the links.
        receive: Called with each frame that the router lets pass.
        missed: Told how many datagrams of the team's link found no room before one, and when that one arrived.
        frugal: A component that needs few of the broadcasts: MAVSDK.

    Attributes:
        rejected: Pieces of datagrams that are no frame, or one that cannot be read of somebody new.
        router: Who is where.
    """

    def __init__(
        self,
        ground: GroundConfig,
        receive: Receiver,
        missed: Callable[[int, float], None],
        frugal: SystemComponent,
    ) -> None:
        self.rejected = 0
        self.router = Router()
        self._ground = ground
        self._deliver = receive
        self._missed = missed
        self._frugal = frugal
        self._links: dict[str, Socket] = {}
        self._admits: Callable[[SystemComponent, Port], bool] = lambda _source, _port: True
        self._is_genuine: Callable[[bytes, SystemComponent, float], bool] = lambda _frame, _source, _arrived_s: True

    def admit(self, admits: Callable[[SystemComponent, Port], bool]) -> None:
        """Ask this about every component that is heard for the first time on the team's link, and where."""
        self._admits = admits

    def verify(self, is_genuine: Callable[[bytes, SystemComponent, float], bool]) -> None:
        """Ask this about every frame of the team's link and its arrival; what is not genuine goes nowhere."""
        self._is_genuine = is_genuine

    async def open(self, team_url: str | None = None) -> list[str]:
        """Open all links; what could not be had, but is no reason not to fly.

        Args:
            team_url: Instead of the configured one: a station's shared port, for a program that joins in.

        Raises:
            TransportError: The team's link cannot be opened.
        """
        problems = []
        self._links[TEAM] = await GroundSocket.open(
            team_url or self._ground.url,
            partial(self.receive, TEAM),
            missed=self._missed,
            buffer_bytes=_BUFFER_BYTES,
        )
        with contextlib.suppress(TransportError):
            # A program that has joined in is no place for others to do so, but MAVSDK needs one.
            await self._open_link(SHARE, self._ground.share_url if team_url is None else _free_url())
        if SHARE not in self._links:
            problems.append(f"{self._ground.share_url} is in use: `arvi monitor` and `arvi command` cannot join here")
            await self._open_link(SHARE, _free_url())
        for url in self._ground.forward:
            try:
                await self._open_link(url, url)
            except TransportError as error:
                problems.append(f"forwarding: {error}")
                continue
            parts = LinkUrl.parse(url)
            if parts.kind == "udpout":
                self.router.add_remote(Port(url, (socket.gethostbyname(parts.host), parts.port)))
        return problems

    @property
    def share_port(self) -> int:
        """UDP port of the shared link on this machine."""
        return self._links[SHARE].local_port

    def close(self) -> None:
        """Close all links."""
        for link in self._links.values():
            link.close()
        self._links.clear()

    def reach_out(self, frame: bytes) -> None:
        """Send to the team's link even if nobody was heard there yet, where the URL says whom to send to."""
        link = self._links.get(TEAM)
        if link is not None and link.url.kind == "udpout":
            link.send(frame)

    def tell_joined(self, frame: bytes) -> None:
        """Send to the programs of ours that have joined: they hear the team through us, and so that we live."""
        for port in self.router.ports_on(SHARE, JOINED_COMPONENTS):
            self._transmit(frame, port)

    def send(self, frame: bytes, component: SystemComponent) -> bool:
        """Send to a component of the team at the address that it was heard from; False if it never was."""
        port = self.router.team_port(component)
        if port is None:
            return False
        self._transmit(frame, port)
        return True

    def heard(self) -> set[SystemComponent]:
        """The team's components that have been heard."""
        return set(self.router.team_components())

    def attach(self, name: str, link: Socket) -> None:
        """Use a link that is open already."""
        self._links[name] = link

    def read(self) -> bool:
        """Read what waits on all links, as far as one turn goes; whether nothing of the team's is left."""
        drained = {name: link.read() for name, link in list(self._links.items())}
        return drained.get(TEAM, True)

    def receive(self, link: str, datagram: bytes, address: Address, arrived_s: float) -> None:
        """Take one datagram of a link that came from an address and arrived at a UNIX time, s."""
        port = Port(link, address)
        for frame in split_frames(datagram):
            if frame is None:
                self.rejected += 1
                continue
            source = source_of(frame)
            known = self.router.is_at(source, port)
            if not known and not is_sound(frame):
                self.rejected += 1  # nobody's orders go where garbage came from
                continue
            if link == TEAM and not known and self.router.team_port(source) is None and not self._admits(source, port):
                continue
            if link == TEAM and not self._is_genuine(frame, source, arrived_s):
                continue
            if not self.router.receive(frame, port, arrived_s):
                continue
            if (known or self.router.is_at(source, port)) and (link != TEAM or self.router.has_guests):
                self._pass_on(frame, port)  # but not a copy
            self._deliver(frame, source, port, arrived_s)

    def _pass_on(self, frame: bytes, came_from: Port) -> None:
        spared: set[Port] = set()
        if came_from.link == TEAM and target_of(frame)[0] == BROADCAST and message_id(frame) not in _NEEDED_BY_MAVSDK:
            spared = self.router.guest_ports(self._frugal)
        for port in self.router.ways(frame, came_from):
            if port not in spared:
                self._transmit(frame, port)

    def _transmit(self, frame: bytes, port: Port) -> None:
        link = self._links.get(port.link)
        if link is None:
            return
        if link.url.kind == "udpout":
            link.send(frame)
        else:
            link.send(frame, port.address)

    async def _open_link(self, name: str, url: str) -> None:
        self._links[name] = await GroundSocket.open(url, partial(self.receive, name))


def _free_url() -> str:
    """A loopback port that the system has just given us."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return f"udpin:127.0.0.1:{sock.getsockname()[1]}"
