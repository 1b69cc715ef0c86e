"""The two MAVLink links of a PX4 vehicle."""

from __future__ import annotations

from typing import Literal

__all__ = ["GCS", "LINKS", "ONBOARD", "LinkName"]

LinkName = Literal["onboard", "gcs"]

ONBOARD: LinkName = "onboard"
"""Companion computer: PX4's UDP port 14540 and up."""

GCS: LinkName = "gcs"
"""Ground station: PX4's UDP port 14550."""

LINKS: tuple[LinkName, ...] = (ONBOARD, GCS)
