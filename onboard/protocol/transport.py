"""Links under asyncio: with :mod:`onboard.protocol.byte_links` the only place of this package that owns sockets.

A link is named by a URL, as in the configuration; two slashes after the first colon change nothing:

- ``udpin:HOST:PORT`` listens, and sends to the address that it has heard a message from, until that one is silent;
- ``udpout:HOST:PORT`` sends there and receives its answers;
- ``mcast:GROUP:PORT`` sends to a multicast group and receives what others send to it;
- ``tcp:HOST:PORT`` connects to a server, again and again when the connection is lost;
- ``serial:DEVICE:BAUD`` is a serial port, opened again when the device comes back.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import struct
from collections.abc import Callable
from typing import Protocol, cast

from onboard.protocol.byte_links import SerialLink, TcpLink
from onboard.protocol.framing import holds_message
from onboard.protocol.link_url import DATAGRAM_KINDS, LinkUrl, TransportError

__all__ = [
    "MAX_DATAGRAM_BYTES",
    "Address",
    "DatagramLink",
    "Link",
    "LinkUrl",
    "TransportError",
    "open_datagram_link",
    "open_link",
    "open_socket",
]

Address = tuple[str, int]

MAX_DATAGRAM_BYTES = 4096
"""More than any part of a team or an autopilot puts into one; what is larger is dropped unread."""

REMOTE_SILENT_S = 1.0
"""Silence of a remote after which an ``udpin`` link sends to somebody else, s."""

_log = logging.getLogger(__name__)


class Link(Protocol):
    """One open link; made by :func:`open_link`.

    Attributes:
        bytes_sent: Payload handed to the system, bytes.
        bytes_received: Payload received, bytes.
    """

    bytes_sent: int
    bytes_received: int

    def send(self, data: bytes) -> None:
        """Send to the link's remote; dropped while there is none, or after closing."""

    def close(self) -> None:
        """Close the link; sending afterwards does nothing."""


class DatagramLink(asyncio.DatagramProtocol):
    """One open UDP link.

    Attributes:
        bytes_sent: Payload handed to the socket, bytes.
        bytes_received: Payload received, bytes.
        oversize: Datagrams that were too large to be read.
    """

    def __init__(
        self,
        url: LinkUrl,
        receive: Callable[[bytes], None] | None,
    ) -> None:
        self.url = url
        self.bytes_sent = 0
        self.bytes_received = 0
        self.oversize = 0
        self._receive = receive
        self._transport: asyncio.DatagramTransport | None = None
        self._remote: Address | None = (url.host, url.port) if url.kind == "mcast" else None
        self._remote_heard_s = 0.0
        self._clock = asyncio.get_running_loop().time

    def send(self, data: bytes) -> None:
        """Send to the link's remote; dropped while an ``udpin`` link has heard nobody yet, or after closing."""
        if self._transport is None or (self._remote is None and self.url.kind != "udpout"):
            return
        self.bytes_sent += len(data)
        self._transport.sendto(data, self._remote)

    @property
    def local_port(self) -> int:
        """UDP port on this side, once the link is open.

        Raises:
            TransportError: It is not.
        """
        if self._transport is None:
            raise TransportError(f"{self.url} is closed")
        return int(self._transport.get_extra_info("sockname")[1])

    def close(self) -> None:
        """Close the socket; sending afterwards does nothing."""
        if self._transport is not None:
            self._transport.close()
            self._transport = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: the socket is open."""
        self._transport = cast(asyncio.DatagramTransport, transport)

    def datagram_received(self, data: bytes, addr: tuple[str | int, ...]) -> None:
        """Asyncio: a datagram arrived."""
        self.bytes_received += len(data)
        if len(data) > MAX_DATAGRAM_BYTES:
            self.oversize += 1
            return
        address = (str(addr[0]), int(addr[1]))
        if self.url.kind == "udpin":
            self._hear_from(address, data)
        if self._receive is not None:
            self._receive(data)

    def _hear_from(self, address: Address, data: bytes) -> None:
        """Whom to answer: who speaks MAVLink here, and nobody who comes in between, or vehicles could be stolen."""
        now_s = self._clock()
        if address == self._remote:
            self._remote_heard_s = now_s
        elif (self._remote is None or now_s - self._remote_heard_s > REMOTE_SILENT_S) and holds_message(data):
            self._remote, self._remote_heard_s = address, now_s

    def error_received(self, exc: Exception) -> None:
        """Asyncio: the remote's port is closed (ICMP); normal while it has not started or after it died."""
        _log.debug("%s: %s", self.url, exc)


async def open_link(url: str, receive: Callable[[bytes], None] | None = None) -> Link:
    """Open a link; its callback runs in the event loop, one call for each datagram, or each frame of a byte stream.

    Args:
        url: One of the kinds above.
        receive: Called with what arrives.

    Raises:
        TransportError: The URL is malformed, the address in use or not to be had; the text says which.
    """
    parts = LinkUrl.parse(url)
    if parts.kind == "tcp":
        return await TcpLink.open(parts, receive)
    if parts.kind == "serial":
        return SerialLink.open(parts, receive)
    return await open_datagram_link(url, receive)


async def open_datagram_link(
    url: str,
    receive: Callable[[bytes], None] | None = None,
    *,
    local: Address | None = None,
) -> DatagramLink:
    """Open a UDP link; its callback runs in the event loop, one call for each datagram.

    Args:
        url: ``udpin:HOST:PORT``, ``udpout:HOST:PORT`` or ``mcast:GROUP:PORT``.
        receive: Called with each datagram.
        local: Address to send from, for ``udpout`` only; any free port of the host by default.

    Raises:
        TransportError: The URL is malformed, the address in use or not to be had; the text says which.
    """
    parts = LinkUrl.parse(url)
    link = DatagramLink(parts, receive)
    sock = await open_socket(parts, local)
    await asyncio.get_running_loop().create_datagram_endpoint(lambda: link, sock=sock)
    return link


async def open_socket(url: LinkUrl, local: Address | None = None) -> socket.socket:
    """The UDP socket of a link: bound or connected, and non-blocking.

    Args:
        url: Of the kinds ``udpin``, ``udpout`` and ``mcast``.
        local: Address to send from, for ``udpout`` only; any free port of the host by default.

    Raises:
        TransportError: It is of another kind, the address in use or not to be had; the text says which.
    """
    if url.kind not in DATAGRAM_KINDS:
        raise TransportError(f"{url}: a UDP link is needed here")
    loop = asyncio.get_running_loop()
    try:
        if url.kind == "mcast":
            return _multicast_socket(url)
        family, _, _, _, address = (await loop.getaddrinfo(url.host, url.port, type=socket.SOCK_DGRAM))[0]
        sock = socket.socket(family, socket.SOCK_DGRAM)
        try:
            sock.setblocking(False)
            if url.kind == "udpin":
                sock.bind(address)
            else:
                if local is not None:
                    sock.bind(local)
                sock.connect(address)  # at once, for UDP: it only sets the address
        except OSError:
            sock.close()
            raise
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            port = local[1] if local is not None else url.port
            reason = f"UDP port {port} is in use by another program; is a second copy running?"
        else:
            reason = error.strerror or str(error)
        raise TransportError(f"{url}: {reason}") from None
    return sock


def _multicast_socket(url: LinkUrl) -> socket.socket:
    """A socket that has joined the group and hears other processes of this host, too."""
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    try:
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        # To the group and not to every address: what is sent to this machine itself does not come in here.
        sock.bind((url.host, url.port))
        membership = struct.pack("=4sl", socket.inet_aton(url.host), socket.INADDR_ANY)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        sock.setblocking(False)
    except OSError:
        sock.close()
        raise
    return sock
