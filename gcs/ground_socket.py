"""A UDP socket of the ground station, which knows when each datagram arrived and how many it has missed.

A program that gets no processor time reads late: what it reads then looks new, unless the system says when it came.
Linux does (``SO_TIMESTAMPNS``, ``SO_RXQ_OVFL``: socket(7), and the kernel's Documentation/networking/timestamping.rst);
elsewhere a datagram counts as having arrived when it is read, and what was missed is not known.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import socket
import struct
import sys
import time
from collections.abc import Callable

from onboard.protocol.transport import MAX_DATAGRAM_BYTES, Address, LinkUrl, TransportError, open_socket

__all__ = ["GroundSocket"]

_TURN_S = 0.05
"""How long one turn may read before others get theirs, s."""

_LINUX = sys.platform == "linux"
_SO_RCVBUFFORCE, _SO_TIMESTAMPNS, _SO_RXQ_OVFL = 33, 35, 40
"""asm-generic/socket.h; of these, Python's ``socket`` names none in all the versions that we run on."""

_TIMESPEC = struct.Struct("@ll")
_COUNT = struct.Struct("@I")
_ANCILLARY_BYTES = socket.CMSG_SPACE(_TIMESPEC.size) + socket.CMSG_SPACE(_COUNT.size)

_log = logging.getLogger(__name__)


class GroundSocket:
    """Reads whatever waits, and sends to one remote or many; made by :meth:`open`.

    Attributes:
        url: Of the link.
        oversize: Datagrams that were too large to be read.
    """

    def __init__(
        self,
        url: LinkUrl,
        sock: socket.socket,
        receive: Callable[[bytes, Address, float], None],
        missed: Callable[[int, float], None],
    ) -> None:
        self.url = url
        self.oversize = 0
        self._socket: socket.socket | None = sock
        self._receive = receive
        self._missed = missed
        self._missed_before = 0
        for option in (_SO_TIMESTAMPNS, _SO_RXQ_OVFL) if _LINUX else ():
            with contextlib.suppress(OSError):  # not every kernel has both
                sock.setsockopt(socket.SOL_SOCKET, option, 1)
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(sock, self.read)

    @classmethod
    async def open(
        cls,
        url: str,
        receive: Callable[[bytes, Address, float], None],
        *,
        missed: Callable[[int, float], None] = lambda count, arrived_s: None,
        buffer_bytes: int | None = None,
    ) -> GroundSocket:
        """Open a socket that the event loop reads; the callbacks run there.

        Args:
            url: ``udpin:HOST:PORT``, ``udpout:HOST:PORT`` or ``mcast:GROUP:PORT``.
            receive: Called with each datagram, the address that it came from, and the UNIX time at which it arrived, s.
            missed: Called before it with how many datagrams were dropped for lack of room since the one before.
            buffer_bytes: Let the system keep so much until it is read, as far as it allows.

        Raises:
            TransportError: The URL is malformed, the address in use or not to be had; the text says which.
        """
        parts = LinkUrl.parse(url)
        sock = await open_socket(parts)
        if buffer_bytes is not None:
            _widen(sock, buffer_bytes)
        return cls(parts, sock, receive, missed)

    def read(self) -> bool:
        """Read what waits, but no longer than a turn; whether nothing is left."""
        end_s = time.monotonic() + _TURN_S
        while (sock := self._socket) is not None:
            if time.monotonic() > end_s:
                return False
            try:
                data, ancillary, flags, address = sock.recvmsg(MAX_DATAGRAM_BYTES, _ANCILLARY_BYTES)
            except (BlockingIOError, InterruptedError):
                return True
            except OSError as error:  # a remote's port is closed (ICMP); normal while it has not started
                _log.debug("%s: %s", self.url, error)
                continue
            arrived_s, missed = self._told(ancillary)
            if missed:
                self._missed(missed, arrived_s)
            if flags & socket.MSG_TRUNC:
                self.oversize += 1
            else:
                self._receive(data, (str(address[0]), int(address[1])), arrived_s)
        return True

    def send(self, data: bytes, address: Address | None = None) -> None:
        """Send to an address, or to the one remote of an ``udpout`` link; what cannot be sent now is lost."""
        if self._socket is None:
            return
        try:
            if address is None:
                self._socket.send(data)
            else:
                self._socket.sendto(data, address)
        except OSError as error:
            _log.debug("%s: %s", self.url, error)

    @property
    def local_port(self) -> int:
        """UDP port on this side.

        Raises:
            TransportError: It is closed.
        """
        if self._socket is None:
            raise TransportError(f"{self.url} is closed")
        return int(self._socket.getsockname()[1])

    def close(self) -> None:
        """Close the socket; sending afterwards does nothing."""
        if self._socket is not None:
            self._loop.remove_reader(self._socket)
            self._socket.close()
            self._socket = None

    def _told(self, ancillary: list[tuple[int, int, bytes]]) -> tuple[float, int]:
        """When a datagram arrived (UNIX time, s), and how many before it found no room."""
        now_s = time.time()
        arrived_s, missed = now_s, 0
        for level, kind, content in ancillary:
            if level != socket.SOL_SOCKET:
                continue
            if kind == _SO_TIMESTAMPNS:
                seconds, nanoseconds = _TIMESPEC.unpack(content)
                arrived_s = seconds + nanoseconds * 1e-9
            elif kind == _SO_RXQ_OVFL:
                (total,) = _COUNT.unpack(content)
                missed = (total - self._missed_before) % 2**32
                self._missed_before = total
        return min(arrived_s, now_s), missed  # the clock may have been set back since


def _widen(sock: socket.socket, size_bytes: int) -> None:
    try:
        sock.setsockopt(socket.SOL_SOCKET, _SO_RCVBUFFORCE, size_bytes)
    except OSError:  # only the privileged may exceed net.core.rmem_max
        sock.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, size_bytes)
