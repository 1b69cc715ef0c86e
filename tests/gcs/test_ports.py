"""Ports are checked before anything starts, and those in use are named."""

import socket

import pytest

from gcs.errors import GroundError
from gcs.ports import PortInUseError, check_free, needed_ports
from onboard.config import load_scenario


def test_the_lab_needs_px4s_ports(scenario):
    ports = {port.port: port.owner for port in needed_ports(scenario)}
    assert ports[14550] == "ground station"
    for i, vehicle in enumerate((1, 2, 3)):
        for base, owner in (
            (14540, f"vehicle {vehicle}, autopilot link"),
            (14740, f"vehicle {vehicle}, sensor link"),
            (14580, f"bridge, vehicle {vehicle}'s autopilot"),
            (18570, f"bridge, vehicle {vehicle}'s ground link"),
            (14640, f"bridge, vehicle {vehicle}'s radio"),
        ):
            assert ports[base + i] == owner
    assert len(ports) == 16


def test_all_ports_in_use_are_named_and_free_ones_are_left_free(own_ports):
    needed = needed_ports(load_scenario(own_ports))
    check_free(needed)
    check_free(needed)
    taken = [needed[0], needed[3]]
    socks = [socket.socket(socket.AF_INET, socket.SOCK_DGRAM) for _ in taken]
    try:
        for sock, port in zip(socks, taken, strict=True):
            sock.bind((port.host, port.port))
        with pytest.raises(PortInUseError) as caught:
            check_free(needed)
    finally:
        for sock in socks:
            sock.close()
    lines = str(caught.value).splitlines()
    assert lines[:-1] == [f"UDP port {port.port} ({port.owner}) is in use" for port in taken]
    assert "second copy" in lines[-1]


def test_links_that_a_bridge_cannot_reach_are_refused(scenario):
    first, *others = scenario.vehicles
    links = first.links.model_copy(update={"autopilot": "udpout:127.0.0.1:14540"})
    odd = scenario.model_copy(update={"vehicles": (first.model_copy(update={"links": links}), *others)})
    with pytest.raises(GroundError, match=r"vehicle 1: links\.autopilot"):
        needed_ports(odd)
