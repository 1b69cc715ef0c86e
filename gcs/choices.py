"""Choices of command line options; free of heavy imports, so that help comes at once."""

from __future__ import annotations

from enum import StrEnum

__all__ = ["AutopilotFamily", "AutopilotLink"]


class AutopilotFamily(StrEnum):
    """What ``--autopilot`` may be."""

    PX4 = "px4"
    ARDUPILOT = "ardupilot"


class AutopilotLink(StrEnum):
    """What ``--link`` may be."""

    ONBOARD = "onboard"
    GCS = "gcs"
