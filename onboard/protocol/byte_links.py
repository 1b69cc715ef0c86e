"""Links that carry a stream of bytes: TCP connections and serial ports.

What arrives is cut into frames, what is sent is never queued beyond :data:`MAX_QUEUED_BYTES`: like UDP, a link that
cannot keep up drops. A link that is lost is opened again, every :data:`RETRY_S`, until it is closed.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import os
import termios
from collections.abc import Callable

from onboard.protocol.framing import FrameBuffer
from onboard.protocol.link_url import LinkUrl, TransportError

__all__ = ["MAX_QUEUED_BYTES", "RETRY_S", "SerialLink", "TcpLink"]

MAX_QUEUED_BYTES = 16384
"""What waits to be sent at most; half a second of a busy link. More is dropped, frame by frame."""

RETRY_S = 1.0
"""Between attempts to open a lost link again, s."""

CONNECT_S = 5.0
"""How long a server may take to accept a connection, s."""

_CHUNK_BYTES = 4096

_log = logging.getLogger(__name__)

Receive = Callable[[bytes], None]


class _ByteLink:
    """What both kinds have in common.

    Attributes:
        url: Its name.
        bytes_sent: Handed to the system, bytes.
        bytes_received: Received, bytes.
        bytes_dropped: Not sent because too much was waiting, bytes.
    """

    def __init__(self, url: LinkUrl, receive: Receive | None) -> None:
        self.url = url
        self.bytes_sent = 0
        self.bytes_received = 0
        self.bytes_dropped = 0
        self._receive = receive
        self._frames = FrameBuffer()

    def _take(self, data: bytes) -> None:
        self.bytes_received += len(data)
        for piece in self._frames.feed(data):
            if self._receive is not None:
                self._receive(piece)


class TcpLink(_ByteLink, asyncio.Protocol):
    """A connection to a TCP server, e.g. ArduPilot's or a serial server's."""

    def __init__(self, url: LinkUrl, receive: Receive | None) -> None:
        super().__init__(url, receive)
        self._transport: asyncio.Transport | None = None
        self._retry: asyncio.Task[None] | None = None
        self._closed = False

    @classmethod
    async def open(cls, url: LinkUrl, receive: Receive | None) -> TcpLink:
        """Connect.

        Raises:
            TransportError: There is no such server, or it does not accept in time.
        """
        link = cls(url, receive)
        try:
            await link._connect()
        except TimeoutError:
            raise TransportError(f"{url}: no connection within {CONNECT_S:g} s") from None
        except OSError as error:
            refused = error.errno == errno.ECONNREFUSED
            reason = f"nobody listens on TCP port {url.port}" if refused else error.strerror or str(error)
            raise TransportError(f"{url}: {reason}") from None
        return link

    def send(self, data: bytes) -> None:
        """Send; dropped while there is no connection, or too much waits already."""
        if self._transport is None:
            return
        if self._transport.get_write_buffer_size() + len(data) > MAX_QUEUED_BYTES:
            self.bytes_dropped += len(data)
            return
        self.bytes_sent += len(data)
        self._transport.write(data)

    def close(self) -> None:
        """Close the connection."""
        self._closed = True
        if self._retry is not None:
            self._retry.cancel()
        if self._transport is not None:
            self._transport.abort()
            self._transport = None

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        """Asyncio: connected."""
        assert isinstance(transport, asyncio.Transport)
        self._transport = transport
        self._frames = FrameBuffer()

    def data_received(self, data: bytes) -> None:
        """Asyncio: bytes arrived."""
        self._take(data)

    def connection_lost(self, exc: Exception | None) -> None:
        """Asyncio: the connection is gone."""
        self._transport = None
        if not self._closed:
            _log.warning("%s: connection lost%s; trying again", self.url, f" ({exc})" if exc is not None else "")
            self._retry = asyncio.get_running_loop().create_task(self._reconnect())

    async def _connect(self) -> None:
        loop = asyncio.get_running_loop()
        async with asyncio.timeout(CONNECT_S):
            await loop.create_connection(lambda: self, self.url.host, self.url.port)

    async def _reconnect(self) -> None:
        while not self._closed:
            await asyncio.sleep(RETRY_S)
            try:
                await self._connect()
            except OSError as error:  # TimeoutError is one
                _log.debug("%s: %s", self.url, error)
            else:
                _log.warning("%s: connected again", self.url)
                return


class SerialLink(_ByteLink):
    """A serial port: raw, 8 bits, no parity, one stop bit, no flow control."""

    def __init__(self, url: LinkUrl, receive: Receive | None) -> None:
        super().__init__(url, receive)
        self._descriptor: int | None = None
        self._queue = bytearray()
        self._retry: asyncio.TimerHandle | None = None

    @classmethod
    def open(cls, url: LinkUrl, receive: Receive | None) -> SerialLink:
        """Open the port.

        Raises:
            TransportError: There is no such device, it is not ours to open, or does not know the rate.
        """
        link = cls(url, receive)
        try:
            link._attach()
        except OSError as error:
            raise TransportError(f"{url}: {error.strerror or error}") from None
        return link

    def send(self, data: bytes) -> None:
        """Send; dropped while the device is gone, or too much waits already."""
        if self._descriptor is None:
            return
        if len(self._queue) + len(data) > MAX_QUEUED_BYTES:
            self.bytes_dropped += len(data)
            return
        self.bytes_sent += len(data)
        self._queue += data
        self._write()

    def close(self) -> None:
        """Close the port."""
        if self._retry is not None:
            self._retry.cancel()
        self._detach()

    def _attach(self) -> None:
        rate = getattr(termios, f"B{self.url.port}", None)
        if rate is None:
            raise TransportError(f"{self.url}: {self.url.port} is no rate of a serial port; 57600, 115200, 921600 are")
        descriptor = os.open(self.url.host, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            _make_raw(descriptor, rate)
        except termios.error as error:
            os.close(descriptor)
            raise TransportError(f"{self.url}: is no serial port ({error.args[-1]})") from None
        self._descriptor = descriptor
        self._queue.clear()
        self._frames = FrameBuffer()
        asyncio.get_running_loop().add_reader(descriptor, self._read)

    def _detach(self) -> None:
        if self._descriptor is not None:
            loop = asyncio.get_running_loop()
            loop.remove_reader(self._descriptor)
            loop.remove_writer(self._descriptor)
            os.close(self._descriptor)
            self._descriptor = None

    def _read(self) -> None:
        if self._descriptor is None:
            return
        try:
            data = os.read(self._descriptor, _CHUNK_BYTES)
        except BlockingIOError:
            return
        except OSError as error:
            self._lost(error)
            return
        if data:
            self._take(data)
        else:
            self._lost(None)

    def _write(self) -> None:
        if self._descriptor is None:
            return
        loop = asyncio.get_running_loop()
        try:
            sent = os.write(self._descriptor, self._queue)
        except BlockingIOError:
            sent = 0
        except OSError as error:
            self._lost(error)
            return
        del self._queue[:sent]
        if self._queue:
            loop.add_writer(self._descriptor, self._write)
        else:
            loop.remove_writer(self._descriptor)

    def _lost(self, error: OSError | None) -> None:
        _log.warning("%s: device lost%s; trying again", self.url, f" ({error.strerror})" if error is not None else "")
        self._detach()
        self._retry_later()

    def _retry_later(self) -> None:
        self._retry = asyncio.get_running_loop().call_later(RETRY_S, self._reattach)

    def _reattach(self) -> None:
        try:
            self._attach()
        except (OSError, TransportError) as error:
            _log.debug("%s: %s", self.url, error)
            self._retry_later()
        else:
            _log.warning("%s: device is back", self.url)


def _make_raw(descriptor: int, rate: int) -> None:
    """Bytes as they are, at this rate."""
    attributes = termios.tcgetattr(descriptor)
    attributes[0] = 0
    attributes[1] = 0
    attributes[2] = termios.CS8 | termios.CREAD | termios.CLOCAL
    attributes[3] = 0
    attributes[4] = attributes[5] = rate
    attributes[6][termios.VMIN] = 1  # none: nothing to read; zero bytes then mean that the device is gone
    attributes[6][termios.VTIME] = 0
    termios.tcsetattr(descriptor, termios.TCSANOW, attributes)
