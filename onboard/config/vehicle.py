"""One of ``vehicles``, and its links."""

from __future__ import annotations

import math
from typing import Annotated, Literal

from pydantic import Field

from onboard.config.base import Positive, Section
from onboard.config.external import External
from onboard.config.patterns import AutopilotUrl, LinkUrl
from onboard.geometry import Pose

__all__ = ["MAX_SYSTEM_ID", "LinksConfig", "VehicleConfig"]

MAX_SYSTEM_ID = 200
"""Vehicles number from 1 up; ground stations and the bridge from 255 down."""


class LinksConfig(Section):
    """The four links of one onboard process; what is left out follows PX4's ports for its system id."""

    autopilot: AutopilotUrl | None = None
    peers: LinkUrl | None = None
    sensor: LinkUrl | None = None
    ground: LinkUrl | None = None


class VehicleConfig(Section):
    """One vehicle of the team."""

    id: Annotated[int, Field(ge=1, le=MAX_SYSTEM_ID)]
    home: tuple[float, float] = Field(description="[north m, east m] of the launch pad in the mission frame")
    home_yaw_deg: float = 0.0
    layer_m: Positive = Field(description="height above the ground that it flies at")
    autopilot: Literal["px4", "ardupilot"] = Field(
        default="px4",
        description="whose behaviour is simulated; of a vehicle that is not simulated, what is expected on its link",
    )
    type: str = Field(default="default", description="one of vehicle_types")
    links: LinksConfig = LinksConfig()
    external: External = Field(
        default=None, description="true, or a section: the vehicle is not simulated; its autopilot runs elsewhere"
    )

    @property
    def home_pose(self) -> Pose:
        """The launch pad."""
        return Pose(self.home[0], self.home[1], math.radians(self.home_yaw_deg))

    @property
    def autopilot_url(self) -> str:
        """Where the autopilot is heard: UDP 14540 + id − 1 unless configured."""
        return self.links.autopilot or f"udpin:127.0.0.1:{14540 + self.id - 1}"

    @property
    def peers_url(self) -> str:
        """Where peers are reached: the simulated radio's port 14640 + id − 1 unless configured."""
        return self.links.peers or f"udpout:127.0.0.1:{14640 + self.id - 1}"

    @property
    def sensor_url(self) -> str:
        """Where detections arrive: UDP 14740 + id − 1 unless configured."""
        return self.links.sensor or f"udpin:127.0.0.1:{14740 + self.id - 1}"

    @property
    def ground_url(self) -> str:
        """Where the ground station is reached: UDP 14550 unless configured."""
        return self.links.ground or "udpout:127.0.0.1:14550"

    @property
    def team_links(self) -> dict[str, str]:
        """The URLs of all that may reach a real vehicle, by their keys."""
        urls = {
            "links.autopilot": self.autopilot_url,
            "links.peers": self.peers_url,
            "links.sensor": self.sensor_url,
            "links.ground": self.ground_url,
        }
        return urls if self.external is None else {**urls, "external.link": self.external_url}

    @property
    def external_url(self) -> str:
        """The bridge's own link to an external autopilot.

        Unless configured, PX4's simulator SIH is heard on UDP 19410 + id − 1, where it tells a display its true state,
        and ArduPilot on UDP 14840 + id − 1.
        """
        if self.external is not None and self.external.link is not None:
            return self.external.link
        port = 19410 if self.autopilot == "px4" else 14840
        return f"udpin:127.0.0.1:{port + self.id - 1}"
