"""Whether the UDP ports that a flight needs are free, before anything is started."""

from __future__ import annotations

import contextlib
import errno
import socket
from dataclasses import dataclass

from gcs.errors import GroundError
from onboard.config import Scenario
from onboard.protocol.transport import LinkUrl
from sim_bridge.errors import BridgeError
from sim_bridge.ports import find_ports

__all__ = ["NeededPort", "PortInUseError", "check_free", "needed_ports"]


_NAMED = 4


class PortInUseError(GroundError):
    """Ports that somebody else has; the text names them and whose they are."""


@dataclass(frozen=True, slots=True)
class NeededPort:
    """A UDP port that a part of the flight binds.

    Attributes:
        host: Address that it binds to.
        port: UDP port.
        owner: What for.
    """

    host: str
    port: int
    owner: str


def needed_ports(scenario: Scenario) -> list[NeededPort]:
    """Every port that ground station, onboard processes and bridge bind when a scenario is flown on one machine.

    Raises:
        GroundError: The bridge cannot reach a vehicle's links as they are configured.
    """
    ground = LinkUrl.parse(scenario.ground.url)
    needed = [NeededPort(ground.host, ground.port, "ground station")]
    for vehicle in scenario.vehicles:
        for name, url in (("autopilot", vehicle.autopilot_url), ("sensor", vehicle.sensor_url)):
            link = LinkUrl.parse(url)
            if link.kind == "udpin":
                needed.append(NeededPort(link.host, link.port, f"vehicle {vehicle.id}, {name} link"))
    try:
        bridge = find_ports(scenario)
    except BridgeError as error:
        raise GroundError(str(error)) from None
    for vehicle_id, ports in bridge.vehicles.items():
        owner = f"bridge, vehicle {vehicle_id}'s"
        if ports.autopilot is not None:
            needed.append(NeededPort(*ports.autopilot.onboard_local, f"{owner} autopilot"))
            needed.append(NeededPort(*ports.autopilot.gcs_local, f"{owner} ground link"))
        if ports.external is not None:
            link = LinkUrl.parse(ports.external)
            if link.kind == "udpin":
                needed.append(NeededPort(link.host, link.port, f"{owner} link to its external autopilot"))
        if ports.radio_local is not None:
            needed.append(NeededPort(*ports.radio_local, f"{owner} radio"))
    return needed


def check_free(needed: list[NeededPort]) -> None:
    """Make sure that all these ports can be bound.

    Raises:
        PortInUseError: Some cannot; the first of them are named.
    """
    problems = []
    with contextlib.ExitStack() as stack:
        for port in needed:
            sock = stack.enter_context(socket.socket(socket.AF_INET, socket.SOCK_DGRAM))
            try:
                sock.bind((port.host, port.port))
            except OSError as error:
                in_use = error.errno == errno.EADDRINUSE
                reason = "is in use" if in_use else f"cannot be had: {error.strerror or error}"
                problems.append(f"UDP port {port.port} ({port.owner}) {reason}")
    if problems:
        if len(problems) > _NAMED:
            problems[_NAMED:] = [f"and {len(problems) - _NAMED} more ports of this scenario"]
        hint = "Is a second copy running? Stop it, or give this scenario other ports (ground.url, vehicles[].links)."
        raise PortInUseError("\n".join([*problems, hint]))
