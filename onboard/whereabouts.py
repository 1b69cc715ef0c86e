"""Where one vehicle is, as far as its onboard process knows: what it tells its teammates."""

from __future__ import annotations

from dataclasses import dataclass

from onboard.flight.autopilot import AutopilotLink
from onboard.flight.setpoints import Setpoint

__all__ = ["SETTLES_S", "Known", "Whereabouts"]

SETTLES_S = 0.4
"""In about this time a multirotor takes up the velocity that it is asked for."""


@dataclass(frozen=True, slots=True)
class Known:
    """Where the vehicle was when that was last known.

    Attributes:
        position: North m, east m, down m, mission frame.
        yaw_rad: Heading.
        velocity: North m/s, east m/s.
    """

    position: tuple[float, float, float]
    yaw_rad: float
    velocity: tuple[float, float]


class Whereabouts:
    """Follows what the autopilot says, and what it was asked for when it said that.

    A vehicle whose autopilot is unheard does as it was last asked to, since that hears no setpoints any more either:
    so teammates know where it flies on to. How it moved before carries it ``SETTLES_S`` farther.

    Args:
        autopilot: Of the vehicle.

    Attributes:
        known: The last that is known; None before anything is.
    """

    def __init__(self, autopilot: AutopilotLink) -> None:
        self.known: Known | None = None
        self._autopilot = autopilot
        self._position: tuple[float, float, float] | None = None
        self._heard_anew = False
        self._asked_m_s = (0.0, 0.0)

    def look(self, time_s: float) -> None:
        """Take what the autopilot has said by a UNIX time."""
        pose, position = self._autopilot.pose(), self._autopilot.position
        self._heard_anew, self._position = position != self._position, position
        if pose is None or position is None:
            return
        velocity = self._autopilot.velocity
        if not self._autopilot.has_position(time_s):
            north, east, down = position
            north += SETTLES_S * (velocity[0] - self._asked_m_s[0])
            east += SETTLES_S * (velocity[1] - self._asked_m_s[1])
            position, velocity = (north, east, down), self._asked_m_s
        self.known = Known(position, pose.yaw_rad, velocity)

    def ask(self, setpoint: Setpoint) -> None:
        """What is asked for right after a look; it arrives, as far as anybody can know, if the autopilot is heard."""
        if self._heard_anew:
            self._asked_m_s = (setpoint.velocity_north_m_s, setpoint.velocity_east_m_s)
