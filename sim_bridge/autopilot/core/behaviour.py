"""What a firmware has to offer, so that the same vehicle can run any."""

from __future__ import annotations

from enum import Enum, auto
from typing import Protocol

from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot.core.platform import Platform
from sim_bridge.autopilot.links import LinkName

__all__ = ["Behaviour", "Halt"]


class Halt(Enum):
    """Why a firmware no longer runs."""

    REBOOT = auto()
    """It was asked to boot again."""
    CRASH = auto()
    """It has crashed: nothing is sent any more."""


class Behaviour(Protocol):
    """One run of a firmware, from a boot to a halt.

    Attributes:
        platform: What it works on.
        halt: Why it no longer runs; None while it does.
        reboot_s: From a reboot command to the next boot, s.
    """

    platform: Platform
    halt: Halt | None
    reboot_s: float

    @property
    def mode(self) -> int:
        """The active flight mode: HEARTBEAT.custom_mode."""

    @property
    def armed(self) -> bool:
        """Whether the motors run."""

    @property
    def landed(self) -> bool:
        """What its land detector says."""

    @property
    def message_ids(self) -> frozenset[int]:
        """All messages that it can send on request."""

    def receive(self, message: mavlink.MAVLink_message, link: LinkName) -> None:
        """Take a message, at the time of the platform's clock."""

    def receive_mocap(self, message: mavlink.MAVLink_message) -> None:
        """Take a pose of motion capture, from a link of its own, at the time of the platform's clock."""

    def step(self, time_s: float, dt_s: float) -> None:
        """Advance the firmware and its vehicle by ``dt_s`` to ``time_s``."""

    def send_requested(self, link: LinkName, message_id: int) -> bool:
        """Queue one message of a kind; False if there is none now."""
