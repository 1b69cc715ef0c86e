"""UDP links on the loopback interface."""

import asyncio
import socket

import pytest

from onboard.protocol.transport import Link, LinkUrl, TransportError, open_link


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


async def test_udpin_answers_the_last_address_that_it_heard() -> None:
    listening, at_in, calling, at_out = await pair(free_port())
    listening.send(b"nobody has called yet")
    assert listening.bytes_sent == 0
    calling.send(b"ping")
    assert await asyncio.wait_for(at_in.get(), 5) == b"ping"
    listening.send(b"pong")
    assert await asyncio.wait_for(at_out.get(), 5) == b"pong"
    assert (calling.bytes_sent, calling.bytes_received) == (4, 4)
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
    "url", ["", "udpin", "udpin:127.0.0.1", "tcp:127.0.0.1:1", "udpin:127.0.0.1:99999", "udpin::5"]
)
def test_a_malformed_url_is_named(url: str) -> None:
    with pytest.raises(TransportError, match="is no link"):
        LinkUrl.parse(url)


def test_a_url_reads_back_as_it_was_written() -> None:
    assert str(LinkUrl.parse("mcast:239.255.145.50:14640")) == "mcast:239.255.145.50:14640"
