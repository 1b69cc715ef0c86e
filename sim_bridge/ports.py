"""Which UDP ports the bridge uses for a scenario, found from the links that the team itself is configured with.

The numbering is PX4's simulator's: an autopilot's own port is 40 above the one that it sends to (14580 to 14540), and
the one of its ground link 4020 above the ground station's (18570 to 14550). So a scenario that moves its links moves
the bridge with them, and two simulations run side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

from onboard.config import Scenario, VehicleConfig
from onboard.protocol.transport import LinkUrl
from sim_bridge.errors import BridgeError

__all__ = ["AutopilotPorts", "BridgePorts", "VehiclePorts", "find_ports"]

AUTOPILOT_PORT_OFFSET = 40
GCS_PORT_OFFSET = 4020
MAX_PORT = 65535

Address = tuple[str, int]

_ANY_HOST = "0.0.0.0"
_LOOPBACK = "127.0.0.1"


@dataclass(frozen=True, slots=True)
class AutopilotPorts:
    """The bridge's ends of a simulated autopilot's links.

    Attributes:
        onboard: Where the onboard process hears its autopilot.
        onboard_local: Where the autopilot sends that from.
        gcs_local: Where the autopilot sends to the ground station from.
    """

    onboard: Address
    onboard_local: Address
    gcs_local: Address


@dataclass(frozen=True, slots=True)
class VehiclePorts:
    """The bridge's ends of one vehicle's links.

    Attributes:
        autopilot: Those of its simulated autopilot; None for an external vehicle.
        sensor: Where the onboard process hears its detector.
        radio_local: Where the radio hears the vehicle; None if its peers link does not go through the radio.
        external: URL of the bridge's own link to the autopilot of an external vehicle; None for a simulated one.
    """

    autopilot: AutopilotPorts | None
    sensor: Address
    radio_local: Address | None
    external: str | None = None


@dataclass(frozen=True, slots=True)
class BridgePorts:
    """All ports of the bridge.

    Attributes:
        ground: Where the ground station listens.
        vehicles: Each vehicle's, by system id.
    """

    ground: Address
    vehicles: dict[int, VehiclePorts]


def find_ports(scenario: Scenario) -> BridgePorts:
    """The ports of a scenario.

    Raises:
        BridgeError: A vehicle's autopilot or sensor link does not listen on UDP, so that a bridge could reach it, or
            its port is too high for the numbering.
    """
    ground = _reachable(LinkUrl.parse(scenario.ground.url))
    return BridgePorts(ground, {vehicle.id: _vehicle_ports(vehicle, ground) for vehicle in scenario.vehicles})


def _vehicle_ports(vehicle: VehicleConfig, ground: Address) -> VehiclePorts:
    peers = LinkUrl.parse(vehicle.peers_url)
    return VehiclePorts(
        autopilot=_autopilot_ports(vehicle, ground) if vehicle.external is None else None,
        sensor=_listener(vehicle, "sensor", vehicle.sensor_url),
        radio_local=(peers.host, peers.port) if peers.kind == "udpout" else None,
        external=None if vehicle.external is None else vehicle.external_url,
    )


def _autopilot_ports(vehicle: VehicleConfig, ground: Address) -> AutopilotPorts:
    onboard = _listener(vehicle, "autopilot", vehicle.autopilot_url)
    return AutopilotPorts(
        onboard=onboard,
        onboard_local=_sender_to(onboard, AUTOPILOT_PORT_OFFSET),
        gcs_local=_sender_to(ground, GCS_PORT_OFFSET + vehicle.id - 1),
    )


def _listener(vehicle: VehicleConfig, name: str, url: str) -> Address:
    parts = LinkUrl.parse(url)
    if parts.kind != "udpin":
        raise BridgeError(
            f"vehicle {vehicle.id}: links.{name} = {url}: the bridge sends to a link that listens, udpin:HOST:PORT"
        )
    return _reachable(parts)


def _sender_to(remote: Address, offset: int) -> Address:
    """The bridge's end of a link to a listener, by PX4's offset of the port."""
    host, port = remote
    if port + offset > MAX_PORT:
        raise BridgeError(
            f"udpin:{host}:{port}: the bridge's end of this link is {offset} ports higher and there is no UDP port "
            f"{port + offset}; choose a lower port"
        )
    return (_LOOPBACK if host in (_LOOPBACK, "localhost") else _ANY_HOST), port + offset


def _reachable(url: LinkUrl) -> Address:
    return (_LOOPBACK if url.host == _ANY_HOST else url.host, url.port)
