"""Ports follow PX4's numbering and move with the links of the scenario."""

from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from sim_bridge.errors import BridgeError
from sim_bridge.ports import find_ports

LAB = load_scenario(Path(__file__).parents[2] / "configs" / "lab.yaml")


def scenario(links=None, ground=None):
    """The lab, with other links for vehicle 2."""
    data = LAB.model_dump()
    if links is not None:
        data["vehicles"][1]["links"] = links
    if ground is not None:
        data["ground"] = {"url": ground}
    return Scenario.model_validate(data)


def test_the_lab_has_px4s_ports():
    ports = find_ports(LAB)
    assert ports.ground == ("127.0.0.1", 14550)
    for n in (1, 2, 3):
        vehicle = ports.vehicles[n]
        assert vehicle.autopilot.onboard == ("127.0.0.1", 14540 + n - 1)
        assert vehicle.autopilot.onboard_local == ("127.0.0.1", 14580 + n - 1)
        assert vehicle.autopilot.gcs_local == ("127.0.0.1", 18570 + n - 1)
        assert vehicle.sensor == ("127.0.0.1", 14740 + n - 1)
        assert vehicle.radio_local == ("127.0.0.1", 14640 + n - 1)


def test_links_that_move_take_the_bridge_along():
    links = {
        "autopilot": "udpin:127.0.0.1:24540",
        "peers": "udpout:127.0.0.1:24640",
        "sensor": "udpin:127.0.0.1:24740",
    }
    ports = find_ports(scenario(links, "udpin:0.0.0.0:24550"))
    assert ports.ground == ("127.0.0.1", 24550)
    vehicle = ports.vehicles[2]
    assert vehicle.autopilot.onboard == ("127.0.0.1", 24540)
    assert vehicle.autopilot.onboard_local == ("127.0.0.1", 24580)
    assert vehicle.autopilot.gcs_local == ("127.0.0.1", 28571)
    assert vehicle.sensor == ("127.0.0.1", 24740)
    assert vehicle.radio_local == ("127.0.0.1", 24640)


def test_a_process_on_another_host_is_reached_from_any_interface():
    vehicle = find_ports(scenario({"autopilot": "udpin:10.0.0.7:14541"})).vehicles[2]
    assert vehicle.autopilot.onboard == ("10.0.0.7", 14541)
    assert vehicle.autopilot.onboard_local == ("0.0.0.0", 14581)


def test_peers_on_multicast_do_not_go_through_the_radio():
    assert find_ports(scenario({"peers": "mcast:239.255.0.1:14660"})).vehicles[2].radio_local is None


@pytest.mark.parametrize(
    ("links", "ground", "message"),
    [
        ({"autopilot": "udpout:127.0.0.1:14540"}, None, r"vehicle 2: links.autopilot = udpout:127.0.0.1:14540.*udpin"),
        ({"sensor": "mcast:239.0.0.1:14740"}, None, r"vehicle 2: links.sensor"),
        ({"autopilot": "udpin:127.0.0.1:65530"}, None, "no UDP port 65570"),
        (None, "udpin:127.0.0.1:62000", "no UDP port 66020"),
    ],
)
def test_links_that_a_bridge_cannot_serve_are_named(links, ground, message):
    with pytest.raises(BridgeError, match=message):
        find_ports(scenario(links, ground))
