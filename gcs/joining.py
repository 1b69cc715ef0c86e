"""A program beside a running ground station: it joins that one through its shared port, or listens itself."""

from __future__ import annotations

import os

from gcs.operator_desk import OperatorDesk
from gcs.station import GroundStation
from gcs.switchboard import JOINED_COMPONENTS
from onboard.config import Scenario
from onboard.protocol.transport import TransportError

__all__ = ["joined_station", "open_or_join"]


def joined_station(scenario: Scenario, desk: OperatorDesk | None = None) -> GroundStation:
    """A station that can join another one: its component id is most likely nobody else's."""
    component_id = JOINED_COMPONENTS[2 * (os.getpid() % (len(JOINED_COMPONENTS) // 2))]
    return GroundStation(scenario, desk=desk, component_id=component_id)


async def open_or_join(station: GroundStation, via: str | None, *, mavsdk: bool) -> str:
    """Listen on the ground port, or join the station that has it; in words where the team is heard.

    Args:
        station: Of :func:`joined_station`.
        via: Join here, ``udpout:HOST:PORT``, without trying to listen.
        mavsdk: Whether it commands autopilots.

    Raises:
        TransportError: Neither is possible.
    """
    ground = station.scenario.ground
    if via is None:
        try:
            await station.open(mavsdk=mavsdk)
        except TransportError:
            via = ground.share_url.replace("udpin:", "udpout:", 1)
        else:
            return f"listening on {ground.url}"
    await station.open(via, mavsdk=mavsdk)
    return f"joined the ground station at {via}"
