"""The way home, and when the vehicle has come to rest above it so that it may land."""

from __future__ import annotations

import math

from onboard.config.flight import FlightConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.trajectory import Route
from onboard.flight.ways import Ways
from onboard.geometry import Pose

__all__ = ["AT_HOME_M", "OVER_HOME_M", "SLOW_M_S", "Homing"]

OVER_HOME_M = 0.3
AT_HOME_M = 0.08
SLOW_M_S = 0.15
PASSING_M_S = 0.5
SETTLING_S = 2.0
"""Landing begins at home and slow: an autopilot's landing mode keeps the velocity that it takes over for a while.

Who is kept off a little (by wind) for longer lands over home when it is slow. Who passes at more than ``PASSING_M_S``
is not over home yet.
"""


class Homing:
    """Leads one vehicle home.

    Args:
        config: Speed, patience.
        link: Tells where the vehicle is.
        home: Where it lands, mission frame.
        ways: Around what is in the way; straight home without.

    Attributes:
        home: Where it lands, mission frame; it may change on the way.
        since_s: UNIX time at which it set out.
        straight_through: Whether it goes straight because no way leads around what stands between.
        by_s: UNIX time until which it waits for a good moment to land.
    """

    def __init__(self, config: FlightConfig, link: AutopilotLink, home: Pose, ways: Ways | None = None) -> None:
        self.home = home
        self.since_s = -math.inf
        self.straight_through = False
        self.by_s = math.inf
        self._config = config
        self._link = link
        self._ways = ways
        self._arrived_s = math.inf

    def set_out(self, time_s: float, start: Pose) -> Route:
        """The way home from a place, to be flown from a UNIX time on."""
        home = (self.home.north_m, self.home.east_m)
        place = (start.north_m, start.east_m)
        found = [place, home] if self._ways is None else self._ways.between(place, home)
        self.straight_through = found is None
        way = Route(time_s, start, [home] if found is None else found[1:], self._config.return_speed_m_s)
        self.since_s, self.by_s = time_s, way.end_s + self._config.return_patience_s
        self._arrived_s = math.inf
        return way

    @property
    def is_over(self) -> bool:
        """Whether the vehicle is above home, and not in passing."""
        return self._distance_m < OVER_HOME_M and self._speed_m_s < PASSING_M_S

    def lands(self, time_s: float, *, at_layer: bool, may_descend: bool) -> bool:
        """Whether the vehicle may land now.

        Args:
            time_s: UNIX time, s; called at every tick on the way home.
            at_layer: Whether its height is that of its layer.
            may_descend: Whether no teammate is in the way.
        """
        arrived = self._distance_m < OVER_HOME_M and at_layer
        self._arrived_s = min(self._arrived_s, time_s) if arrived else math.inf
        settled = self._distance_m < AT_HOME_M or time_s - self._arrived_s > SETTLING_S
        return arrived and may_descend and settled and self._speed_m_s < SLOW_M_S

    def hindrance(self, *, may_descend: bool) -> str:
        """Why it does not land yet, in words."""
        waits = math.isfinite(self._arrived_s) and not may_descend
        return "teammates may fly below" if waits else f"{self._distance_m:.1f} m from home"

    @property
    def _distance_m(self) -> float:
        measured = self._link.pose()
        return math.inf if measured is None else measured.distance_m(self.home)

    @property
    def _speed_m_s(self) -> float:
        return math.hypot(*self._link.velocity)
