"""From standing to the layer: the launch, then the climb, and what keeps it from getting there."""

from __future__ import annotations

import math

from onboard.config.flight import FlightConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.failsafes import Condition
from onboard.flight.launch import Launch
from onboard.protocol.commands import CommandOutcome

__all__ = ["Ascent"]

STREAM_BEFORE_LAUNCH_S = 0.5
LAUNCH_PATIENCE_S = 20.0
AT_LAYER_M = 0.15
NEAR_LAYER_M = 0.6
NEAR_LAYER_PATIENCE_S = 2.0
"""Who takes off by its own idea of the height may stop a little off ours; the stream does the rest."""


class Ascent:
    """Brings one vehicle up.

    Args:
        config: Speed of the climb, patience.
        link: The autopilot.
        layer_m: Height at which it is to fly, m.
    """

    def __init__(self, config: FlightConfig, link: AutopilotLink, layer_m: float) -> None:
        self._link = link
        self._layer_m = layer_m
        self._climb_patience_s = config.takeoff_patience_s + 2.0 * layer_m / config.climb_m_s
        self._launch = Launch((), 0.0)
        self._refused = ""
        self._near_layer_s = math.inf

    def begin(self, down_m: float, time_s: float) -> None:
        """Launch, from a height (NED, m)."""
        behaviour = self._link.behaviour
        begin_s = time_s + (STREAM_BEFORE_LAUNCH_S if behaviour.streams_before_takeoff else 0.0)
        self._launch = Launch(behaviour.launch(self._layer_m + down_m), begin_s)
        self._refused = ""

    def launched(self, time_s: float) -> bool:
        """Ask for what comes next; whether it is on its way up."""
        return self._launch.advance(self._link, time_s)

    def climb(self) -> None:
        """The climb begins."""
        self._near_layer_s = math.inf

    def arrived(self, time_s: float) -> bool:
        """Whether it is at its layer, or has been near it for a while; called at every tick of the climb."""
        error = self.off_layer_m
        self._near_layer_s = min(self._near_layer_s, time_s) if error < NEAR_LAYER_M else math.inf
        return error < AT_LAYER_M or time_s - self._near_layer_s > NEAR_LAYER_PATIENCE_S

    def accepted(self, outcome: CommandOutcome, time_s: float) -> None:
        """The autopilot does what the launch asked for."""
        self._launch.accepted(outcome, time_s)
        self._refused = ""

    def refused(self, text: str) -> None:
        """The autopilot refused a command, with why in words."""
        self._refused = text

    @property
    def off_layer_m(self) -> float:
        """How far its measured height is from that of its layer, m."""
        return abs(self._link.down_m + self._layer_m)

    @property
    def near_layer(self) -> bool:
        """Whether it is about as high as its layer."""
        return self.off_layer_m < NEAR_LAYER_M

    def seen_launching(self, lasts_s: float) -> dict[Condition, str]:
        """What keeps it on the ground, after so many seconds, s."""
        seen = {}
        if self._refused:
            seen[Condition.ARMING_REFUSED] = self._refused
        if lasts_s > LAUNCH_PATIENCE_S:
            seen[Condition.NOT_LAUNCHED] = self._launch.waits_for(self._link)
        return seen

    def seen_climbing(self, lasts_s: float) -> dict[Condition, str]:
        """What keeps it from its layer, after so many seconds of climbing, s."""
        if lasts_s <= self._climb_patience_s:
            return {}
        return {Condition.LAYER_NOT_REACHED: f"{self.off_layer_m:.1f} m off"}
