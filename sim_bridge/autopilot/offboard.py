"""The stream of setpoints: whether it is alive, what it says, and how well it was kept up."""

from __future__ import annotations

import math
from dataclasses import dataclass

from sim_bridge.autopilot.setpoints import Setpoint

__all__ = ["OffboardInput", "SetpointStatistics"]


@dataclass(slots=True)
class SetpointStatistics:
    """Setpoints received while armed and in OFFBOARD; time outside of it counts as no pause.

    Attributes:
        setpoints: How many.
        setpoint_gap_max_s: Longest pause between two, s.
        setpoint_time_s: Sum of the pauses, which is the time from the first to the last, s.
    """

    setpoints: int = 0
    setpoint_gap_max_s: float = 0.0
    setpoint_time_s: float = 0.0


class OffboardInput:
    """What was last received, and when.

    Attributes:
        setpoint: What to fly; None until one arrives in OFFBOARD itself. Earlier ones only show that the stream lives.
        statistics: How well the stream was kept up.
    """

    def __init__(self) -> None:
        self.setpoint: Setpoint | None = None
        self.statistics = SetpointStatistics()
        self._received_s = -math.inf
        self._counted_s: float | None = None

    @property
    def seen(self) -> bool:
        """Whether any setpoint was ever accepted."""
        return self._received_s > -math.inf

    def alive(self, time_s: float, timeout_s: float) -> bool:
        """Whether the last accepted setpoint is younger than COM_OF_LOSS_T."""
        return time_s - self._received_s <= timeout_s

    def receive(self, setpoint: Setpoint, time_s: float, *, flying_offboard: bool, in_offboard: bool) -> None:
        """Take an accepted setpoint.

        Args:
            setpoint: What it says.
            time_s: Now, s.
            flying_offboard: Whether the vehicle is armed and in OFFBOARD.
            in_offboard: Whether it is in OFFBOARD.
        """
        self._received_s = time_s
        if in_offboard:
            self.setpoint = setpoint
        if not flying_offboard:
            self._counted_s = None
            return
        statistics = self.statistics
        statistics.setpoints += 1
        if self._counted_s is not None:
            gap_s = time_s - self._counted_s
            statistics.setpoint_time_s += gap_s
            statistics.setpoint_gap_max_s = max(statistics.setpoint_gap_max_s, gap_s)
        self._counted_s = time_s

    def leave(self) -> None:
        """Forget what to fly: OFFBOARD was entered or left on command, or the vehicle was disarmed."""
        self.setpoint = None
        self._counted_s = None
