"""When a datagram arrived and how many did not, by a real socket that is read late."""

import asyncio
import socket
import sys
import time

import pytest

from gcs.ground_socket import GroundSocket
from onboard.protocol.transport import MAX_DATAGRAM_BYTES, TransportError

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells when a datagram arrived")


class Heard:
    def __init__(self) -> None:
        self.data: list[tuple[bytes, float]] = []
        self.missed = 0

    def take(self, data: bytes, address: tuple[str, int], arrived_s: float) -> None:
        self.data.append((data, arrived_s))

    def miss(self, count: int, arrived_s: float) -> None:
        self.missed += count


def sender(to: GroundSocket) -> socket.socket:
    sock = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    sock.connect(("127.0.0.1", to.local_port))
    return sock


def free_url() -> str:
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
        sock.bind(("127.0.0.1", 0))
        return f"udpin:127.0.0.1:{sock.getsockname()[1]}"


def wait_for_stamps(link: GroundSocket, remote: socket.socket, heard: Heard) -> None:
    """The kernel begins to stamp a little after the first socket has asked for it; till then, what is read is new."""
    for _ in range(500):
        remote.send(b"probe")
        time.sleep(0.01)
        read_s = time.time()
        assert link.read()
        if heard.data.pop()[1] < read_s - 0.005:
            return
    pytest.fail("this kernel does not stamp datagrams")


async def test_what_is_read_late_has_the_time_at_which_it_arrived() -> None:
    heard = Heard()
    link = await GroundSocket.open(free_url(), heard.take)
    with sender(link) as remote:
        wait_for_stamps(link, remote, heard)
        sent_s = time.time()
        remote.send(b"first")
        time.sleep(0.3)  # the event loop gets no time: that is the point
        remote.send(b"second")
        remote.send(bytes(MAX_DATAGRAM_BYTES + 1))
    assert link.read()
    link.close()
    assert [data for data, _ in heard.data] == [b"first", b"second"]
    assert heard.data[0][1] - sent_s < 0.2
    assert 0.2 < heard.data[1][1] - heard.data[0][1] < 5.0
    assert (heard.missed, link.oversize) == (0, 1)


async def test_what_found_no_room_is_counted() -> None:
    heard = Heard()
    link = await GroundSocket.open(free_url(), heard.take, missed=heard.miss, buffer_bytes=8192)
    with sender(link) as remote:
        for number in range(200):
            remote.send(bytes([number]) * 100)
        link.read()
        remote.send(b"tells what was lost before it")
        link.read()
    link.close()
    assert 0 < len(heard.data) < 201
    assert heard.missed == 201 - len(heard.data)


async def test_a_flood_does_not_take_all_the_time() -> None:
    heard = Heard()

    def slowly(data: bytes, address: tuple[str, int], arrived_s: float) -> None:
        time.sleep(0.03)
        heard.take(data, address, arrived_s)

    link = await GroundSocket.open(free_url(), slowly)
    with sender(link) as remote:
        for _ in range(4):
            remote.send(b"one of many")
        assert not link.read()
        assert 0 < len(heard.data) < 4
        while len(heard.data) < 4:
            await asyncio.sleep(0.0)  # the event loop goes on with the rest
        assert link.read()
    link.close()


async def test_a_closed_port_at_the_other_end_and_a_closed_link_are_survived() -> None:
    link = await GroundSocket.open(free_url().replace("udpin", "udpout"), Heard().take)
    for _ in range(3):
        link.send(b"nobody is there")
        assert link.read()
    link.close()
    link.close()
    link.send(b"too late")
    assert link.read()
    with pytest.raises(TransportError, match="closed"):
        _ = link.local_port
