"""The stream of setpoints into OFFBOARD: whether it is alive, and what it says."""

from __future__ import annotations

import math

from sim_bridge.autopilot.core.setpoint import Setpoint, SetpointStatistics
from sim_bridge.autopilot.px4.setpoints import is_complete

__all__ = ["OffboardInput"]

_ZERO = (0.0, 0.0, 0.0)


class OffboardInput:
    """What was last received, and when.

    Args:
        statistics: Where setpoints are counted that arrive while the vehicle is armed and in OFFBOARD.

    Attributes:
        setpoint: What to fly; None until one arrives in OFFBOARD itself. Earlier ones only show that the stream lives.
            One that leaves an axis free has become zero velocity.
    """

    def __init__(self, statistics: SetpointStatistics) -> None:
        self.setpoint: Setpoint | None = None
        self._statistics = statistics
        self._received_s = -math.inf

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
            self.setpoint = setpoint if is_complete(setpoint) else Setpoint(velocity=_ZERO)
        if flying_offboard:
            self._statistics.count(time_s)
        else:
            self._statistics.pause()

    def leave(self) -> None:
        """Forget what to fly: OFFBOARD was entered or left on command, or the vehicle was disarmed."""
        self.setpoint = None
        self._statistics.pause()
