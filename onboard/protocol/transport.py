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
from onboard.protocol.link_url import LinkUrl, TransportError

__all__ = ["Address", "DatagramLink", "Link", "LinkUrl", "TransportError", "open_datagram_link", "open_link"]

Address = tuple[str, int]

MAX_DATAGRAM_BYTES = 4096
"""More than any part of a team or an autopilot puts into one; what is larger is dropped unread."""

REMOTE_SILENT_S = 1.0
"""Silence of a remote after which an ``udpin`` link sends to somebody else, s."""

_SO_RCVBUFFORCE = getattr(socket, "SO_RCVBUFFORCE", 33)
"""Linux; elsewhere setting it fails."""

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
        receive_from: Callable[[bytes, Address], None] | None,
    ) -> None:
        self.url = url
        self.bytes_sent = 0
        self.bytes_received = 0
        self.oversize = 0
        self._receive = receive
        self._receive_from = receive_from
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

    def send_to(self, data: bytes, address: Address) -> None:
        """Send to one of several remotes of an ``udpin`` link."""
        if self._transport is not None:
            self.bytes_sent += len(data)
            self._transport.sendto(data, address)

    def widen(self, size_bytes: int) -> None:
        """Let the system keep so much until it is read, as far as it allows: a team speaks at the same moments."""
        if self._transport is None:
            return
        sock = self._transport.get_extra_info("socket")
        try:
            sock.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, size_bytes)
        except OSError:  # only the privileged may exceed net.core.rmem_max
            sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size_bytes)

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
        if self._receive_from is not None:
            self._receive_from(data, address)

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
    receive_from: Callable[[bytes, Address], None] | None = None,
    local: Address | None = None,
) -> DatagramLink:
    """Open a UDP link; its callbacks run in the event loop, one call for each datagram.

    Args:
        url: ``udpin:HOST:PORT``, ``udpout:HOST:PORT`` or ``mcast:GROUP:PORT``.
        receive: Called with each datagram.
        receive_from: Called with each datagram and the address that it came from.
        local: Address to send from, for ``udpout`` only; any free port of the host by default.

    Raises:
        TransportError: The URL is malformed, the address in use or not to be had; the text says which.
    """
    parts = LinkUrl.parse(url)
    loop = asyncio.get_running_loop()
    link = DatagramLink(parts, receive, receive_from)
    try:
        if parts.kind == "udpin":
            await loop.create_datagram_endpoint(lambda: link, local_addr=(parts.host, parts.port))
        elif parts.kind == "udpout":
            await loop.create_datagram_endpoint(lambda: link, remote_addr=(parts.host, parts.port), local_addr=local)
        elif parts.kind == "mcast":
            await loop.create_datagram_endpoint(lambda: link, sock=_multicast_socket(parts))
        else:
            raise TransportError(f"{url}: a UDP link is needed here")
    except OSError as error:
        if error.errno == errno.EADDRINUSE:
            port = local[1] if local is not None else parts.port
            reason = f"UDP port {port} is in use by another program; is a second copy running?"
        else:
            reason = error.strerror or str(error)
        raise TransportError(f"{url}: {reason}") from None
    return link


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
