"""Links on the loopback interface, and on a pseudo terminal."""

import asyncio
import os
import socket
import termios

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.byte_links import TcpLink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import (
    MAX_DATAGRAM_BYTES,
    DatagramLink,
    Link,
    LinkUrl,
    TransportError,
    open_link,
)


def free_port() -> int:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return int(sock.getsockname()[1])


async def pair(port: int) -> tuple[Link, "asyncio.Queue[bytes]", Link, "asyncio.Queue[bytes]"]:
    at_in: asyncio.Queue[bytes] = asyncio.Queue()
    at_out: asyncio.Queue[bytes] = asyncio.Queue()
    listening = await open_link(f"udpin:127.0.0.1:{port}", at_in.put_nowait)
    calling = await open_link(f"udpout:127.0.0.1:{port}", at_out.put_nowait)
    return listening, at_in, calling, at_out


HEARTBEAT = Codec(1, 1).encode(mavlink.MAVLink_heartbeat_message(2, 12, 0, 0, 3, 3))


async def test_udpin_answers_who_has_spoken_mavlink_to_it() -> None:
    listening, at_in, calling, at_out = await pair(free_port())
    for garbage in (b"nobody has called yet", HEARTBEAT[:-1] + b"?"):
        calling.send(garbage)
        assert await asyncio.wait_for(at_in.get(), 5) == garbage
        listening.send(b"pong")
        assert listening.bytes_sent == 0
    calling.send(HEARTBEAT)
    assert await asyncio.wait_for(at_in.get(), 5) == HEARTBEAT
    listening.send(b"pong")
    assert await asyncio.wait_for(at_out.get(), 5) == b"pong"
    assert calling.bytes_received == 4
    listening.close()
    calling.close()


async def test_udpin_is_not_taken_over_while_its_remote_speaks(monkeypatch: pytest.MonkeyPatch) -> None:
    """Else one datagram of a stranger would have the setpoints sent to him."""
    port = free_port()
    listening, at_in, calling, at_out = await pair(port)
    stranger = await open_link(f"udpout:127.0.0.1:{port}")
    for link in (calling, stranger):
        link.send(HEARTBEAT)
        await asyncio.wait_for(at_in.get(), 5)
    listening.send(b"setpoint")
    assert await asyncio.wait_for(at_out.get(), 5) == b"setpoint"
    assert stranger.bytes_received == 0
    monkeypatch.setattr("onboard.protocol.transport.REMOTE_SILENT_S", 0.0)
    stranger.send(HEARTBEAT)
    await asyncio.wait_for(at_in.get(), 5)
    listening.send(b"setpoint")
    await asyncio.sleep(0.05)
    assert stranger.bytes_received == 8
    for link in (listening, calling, stranger):
        link.close()


async def test_what_is_too_large_is_not_read() -> None:
    listening, at_in, calling, _ = await pair(free_port())
    calling.send(bytes(MAX_DATAGRAM_BYTES + 1))
    calling.send(bytes(MAX_DATAGRAM_BYTES))
    assert len(await asyncio.wait_for(at_in.get(), 5)) == MAX_DATAGRAM_BYTES
    assert isinstance(listening, DatagramLink)
    assert listening.oversize == 1
    listening.close()
    calling.close()


async def test_a_port_in_use_is_named() -> None:
    port = free_port()
    first = await open_link(f"udpin:127.0.0.1:{port}")
    with pytest.raises(TransportError, match=f"UDP port {port} is in use"):
        await open_link(f"udpin:127.0.0.1:{port}")
    first.close()


async def test_sending_on_a_closed_link_does_nothing() -> None:
    link = await open_link(f"udpout:127.0.0.1:{free_port()}")
    link.close()
    link.send(b"late")
    assert link.bytes_sent == 0


@pytest.mark.parametrize(
    "url",
    ["", "udpin", "udpin:127.0.0.1", "tls:127.0.0.1:1", "udpin:127.0.0.1:99999", "udpin::5", "serial:57600", "tcp:h:0"],
)
def test_a_malformed_url_is_named(url: str) -> None:
    with pytest.raises(TransportError, match="is no link"):
        LinkUrl.parse(url)


@pytest.mark.parametrize(
    "url", ["mcast:239.255.145.50:14640", "tcp:localhost:5760", "serial:/dev/serial/by-path/pci-0000:00:14.0:921600"]
)
def test_a_url_reads_back_as_it_was_written(url: str) -> None:
    assert str(LinkUrl.parse(url)) == url


def test_slashes_change_nothing() -> None:
    assert LinkUrl.parse("udpin://0.0.0.0:14540") == LinkUrl.parse("udpin:0.0.0.0:14540")
    assert LinkUrl.parse("serial:///dev/ttyACM0:57600") == LinkUrl("serial", "/dev/ttyACM0", 57600)


def frame(sequence: int = 0) -> bytes:
    codec = Codec(1, 1)
    for _ in range(sequence):
        codec.encode(PING)
    return codec.encode(PING)


PING = mavlink.MAVLink_ping_message(123456, 7, 0, 0)


class Server:
    """A TCP server that keeps what it hears and its connections."""

    def __init__(self) -> None:
        self.heard: asyncio.Queue[bytes] = asyncio.Queue()
        self.writers: list[asyncio.StreamWriter] = []

    async def start(self, port: int = 0) -> int:
        self.server = await asyncio.start_server(self._serve, "127.0.0.1", port)
        return int(self.server.sockets[0].getsockname()[1])

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self.writers.append(writer)
        while data := await reader.read(1000):
            self.heard.put_nowait(data)
        writer.close()

    async def stop(self) -> None:
        self.server.close()
        for writer in self.writers:
            writer.transport.abort()
        await self.server.wait_closed()


async def test_tcp_delivers_frames_however_they_are_cut_and_connects_again() -> None:
    server, heard = Server(), asyncio.Queue()
    port = await server.start()
    link = await open_link(f"tcp:127.0.0.1:{port}", heard.put_nowait)
    link.send(b"hello")
    assert await asyncio.wait_for(server.heard.get(), 5) == b"hello"
    first, second = frame(), frame(1)
    server.writers[0].write(b"boot text\n" + first + second[:9])
    assert await asyncio.wait_for(heard.get(), 5) == b"boot text\n"
    assert await asyncio.wait_for(heard.get(), 5) == first
    server.writers[0].write(second[9:])
    assert await asyncio.wait_for(heard.get(), 5) == second
    await server.stop()
    again = Server()
    await again.start(port)
    async with asyncio.timeout(10):
        while not again.writers:
            link.send(b"x")  # lost without harm while there is no connection
            await asyncio.sleep(0.05)
    again.writers[0].write(first)
    assert await asyncio.wait_for(heard.get(), 5) == first
    link.close()
    await again.stop()


async def test_tcp_without_a_server_says_so() -> None:
    with socket.socket() as sock:
        sock.bind(("127.0.0.1", 0))
        port = sock.getsockname()[1]
        with pytest.raises(TransportError, match=f"tcp:127.0.0.1:{port}: nobody listens on TCP port {port}"):
            await open_link(f"tcp:127.0.0.1:{port}")


async def test_a_tcp_peer_that_does_not_read_costs_bounded_memory() -> None:
    with socket.create_server(("127.0.0.1", 0)) as server:
        link = await open_link(f"tcp:127.0.0.1:{server.getsockname()[1]}")
        sent = 0
        for _ in range(20_000):
            link.send(bytes(1000))
            sent += 1000
        assert isinstance(link, TcpLink)
        assert link.bytes_dropped > 0
        assert link.bytes_sent + link.bytes_dropped == sent
        link.close()


async def test_serial_port_both_ways_and_lost() -> None:
    controller, device = os.openpty()
    heard: asyncio.Queue[bytes] = asyncio.Queue()
    link = await open_link(f"serial:{os.ttyname(device)}:57600", heard.put_nowait)
    attributes = termios.tcgetattr(device)
    assert attributes[4] == termios.B57600
    assert not attributes[3] & (termios.ECHO | termios.ICANON)
    os.write(controller, frame()[:4])
    await asyncio.sleep(0.05)
    os.write(controller, frame()[4:])
    assert await asyncio.wait_for(heard.get(), 5) == frame()
    link.send(frame(1))
    assert os.read(controller, 100) == frame(1)
    os.close(device)
    os.close(controller)  # unplugged
    await asyncio.sleep(0.1)
    before = link.bytes_sent
    link.send(frame())
    assert link.bytes_sent == before
    link.close()


@pytest.mark.parametrize(
    ("url", "reason"),
    [
        ("serial:/dev/no-such-port:57600", "No such file or directory"),
        ("serial:/dev/null:57600", "is no serial port"),
        ("serial:/dev/null:57601", "57601 is no rate of a serial port"),
    ],
)
async def test_a_serial_port_that_is_none_is_named(url: str, reason: str) -> None:
    with pytest.raises(TransportError, match=reason):
        await open_link(url)
