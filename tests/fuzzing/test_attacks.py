"""The attacks that fuzzing/ makes by the million, in small."""

import os

import pytest

from fuzzing.datagrams import UdpSocket, family, flood, sockets_of
from fuzzing.forgeries import Attack, forge
from fuzzing.messages import flood_link
from onboard.links import LinkName
from onboard.planning.warmup import warm_kernels
from onboard.protocol.transport import DatagramLink, open_link


def test_none_of_ten_thousand_hostile_packets_is_let_in_and_the_sender_is_heard_after_each() -> None:
    made = forge(10_000, seed=7)
    assert made.total() == 10_000
    assert made.keys() == set(Attack)


@pytest.mark.parametrize("link", LinkName)
def test_hostile_messages_into_a_link_change_nothing_that_they_must_not(link: LinkName) -> None:
    warm_kernels()
    assert flood_link(link, 1000, seed=7) >= 1


async def test_every_udp_socket_of_a_process_is_found_and_hit() -> None:
    received: list[bytes] = []
    listening = await open_link("udpin:127.0.0.1:24871", received.append)
    calling = await open_link("udpout:127.0.0.1:24871")
    assert isinstance(listening, DatagramLink)
    assert isinstance(calling, DatagramLink)
    pid = os.getpid()
    assert pid in family(os.getppid())
    ours = [UdpSocket(pid, 24871, False), UdpSocket(pid, calling.local_port, True)]
    assert set(ours) <= set(sockets_of([pid]))
    assert flood(ours, 10, 1e6, seed=1, goes_on=lambda: True) == 20
    listening.close()
    calling.close()
