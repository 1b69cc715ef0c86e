"""UDP links under asyncio: the only place of this package that owns sockets.

A link is named by a URL, as in the configuration:

- ``udpin:HOST:PORT`` listens, and sends to the address heard from last;
- ``udpout:HOST:PORT`` sends there and receives its answers;
- ``mcast:GROUP:PORT`` sends to a multicast group and receives what others send to it.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import socket
import struct
from collections.abc import Callable
from dataclasses import dataclass
from typing import cast

from onboard.errors import OnboardError

__all__ = ["Address", "Link", "LinkUrl", "TransportError", "open_link"]

Address = tuple[str, int]

_log = logging.getLogger(__name__)


class TransportError(OnboardError):
    """A link that cannot be opened; the text names its URL and the reason."""


@dataclass(frozen=True, slots=True)
class LinkUrl:
    """A link's URL in parts.

    Attributes:
        kind: ``udpin``, ``udpout`` or ``mcast``.
        host: Host name or address.
        port: UDP port.
    """

    kind: str
    host: str
    port: int

    @classmethod
    def parse(cls, url: str) -> LinkUrl:
        """The parts of a URL.

        Raises:
            TransportError: It is none of the three kinds.
        """
        kind, _, rest = url.partition(":")
        host, _, port = rest.rpartition(":")
        if kind not in ("udpin", "udpout", "mcast") or not host or not port.isdigit() or not 0 < int(port) < 65536:
            raise TransportError(f"{url!r} is no link; udpin:HOST:PORT, udpout:HOST:PORT or mcast:GROUP:PORT is")
        return cls(kind, host, int(port))

    def __str__(self) -> str:
        return f"{self.kind}:{self.host}:{self.port}"


class Link(asyncio.DatagramProtocol):
    """One open UDP link; made by :func:`open_link`.

    Attributes:
        bytes_sent: Payload handed to the socket, bytes.
        bytes_received: Payload received, bytes.
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
        self._receive = receive
        self._receive_from = receive_from
        self._transport: asyncio.DatagramTransport | None = None
        self._remote: Address | None = (url.host, url.port) if url.kind == "mcast" else None

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
        address = (str(addr[0]), int(addr[1]))
        if self.url.kind == "udpin":
            self._remote = address
        if self._receive is not None:
            self._receive(data)
        if self._receive_from is not None:
            self._receive_from(data, address)

    def error_received(self, exc: Exception) -> None:
        """Asyncio: the remote's port is closed (ICMP); normal while it has not started or after it died."""
        _log.debug("%s: %s", self.url, exc)


async def open_link(
    url: str,
    receive: Callable[[bytes], None] | None = None,
    *,
    receive_from: Callable[[bytes, Address], None] | None = None,
    local: Address | None = None,
) -> Link:
    """Open a link; its callbacks run in the event loop, one call for each datagram.

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
    link = Link(parts, receive, receive_from)
    try:
        if parts.kind == "udpin":
            await loop.create_datagram_endpoint(lambda: link, local_addr=(parts.host, parts.port))
        elif parts.kind == "udpout":
            await loop.create_datagram_endpoint(lambda: link, remote_addr=(parts.host, parts.port), local_addr=local)
        else:
            await loop.create_datagram_endpoint(lambda: link, sock=_multicast_socket(parts))
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
        sock.bind(("", url.port))
        membership = struct.pack("=4sl", socket.inet_aton(url.host), socket.INADDR_ANY)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_ADD_MEMBERSHIP, membership)
        sock.setsockopt(socket.IPPROTO_IP, socket.IP_MULTICAST_LOOP, 1)
        sock.setblocking(False)
    except OSError:
        sock.close()
        raise
    return sock
