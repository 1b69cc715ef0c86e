"""The last resort of one vehicle: knows where teammates are now, keeps off them and obstacles, and inside the fence."""

from __future__ import annotations

import math

from onboard.config.flight import FlightConfig
from onboard.config.polygon import Point
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import BEHAVIOURS
from onboard.flight.failsafes import Condition
from onboard.flight.separation import Guard, Obstruction
from onboard.flight.setpoints import Setpoint
from onboard.flight.trajectory import PlanTrajectory, Reference
from onboard.flight.ways import Ways
from onboard.geometry import Pose
from onboard.hearing import Hearing
from onboard.messages import FlightState, LostTeammate, PeerStatus
from onboard.strays import Place, Stray, Strays

__all__ = ["LastResort"]

EXPLAINED_M = 0.5
"""A peer that is no farther from its plan than this is taken to move along it."""
PLANS_KEPT = 3
NEAR_M = 1.5
"""Gap to a teammate below which positions must be fresh: at 2 m/s it lasts less than a second."""
NOTICE_M_S = 0.2
"""A change of the velocity that the operator is told of."""

_ON_THE_GROUND = (FlightState.WAIT, FlightState.STANDBY, FlightState.ARM, FlightState.LANDED)


class LastResort:
    """Filters setpoints by what peers said of themselves, extrapolated to now.

    Args:
        scenario: Separations, layers, speeds, fence, obstacles.
        vehicle: This robot.
        hearing: What was heard of the others.

    Attributes:
        near: Whether a teammate was so near, when a setpoint was filtered last, that it should hear more often where
            this robot is while that is in the air.
        strays: Teammates that nobody flies, or that land.
        dangers: What the setpoint was bent for last, with details in words (none).
    """

    def __init__(self, scenario: Scenario, vehicle: VehicleConfig, hearing: Hearing) -> None:
        config = scenario.flight.guard
        self._enabled = config.enabled
        mission = scenario.mission
        self._guard = Guard(config, mission.fence, mission.obstacles, mission.obstacle_clearance_m)
        self._ways = Ways(mission)
        self._keep_m = config.separation_share * scenario.mission.separation_m
        self._layers_m = scenario.mission.layer_separation_m
        self._silence_s = config.silence_s
        self._drift_m = config.drift_m
        self._speed_m_s = max(primitive.speed_m_s for primitive in scenario.primitive_set)
        self.near = False
        self.strays: list[Stray] = []
        self._hearing = hearing
        self._strays = Strays(scenario, hearing)
        self._homes = {mate.id: mate.home for mate in scenario.vehicles}
        self._leads_s = {mate.id: _lead_s(mate, scenario.flight) for mate in scenario.vehicles}
        self._return_m_s = scenario.flight.return_speed_m_s
        self._plans: dict[int, list[PlanTrajectory]] = {}
        self.dangers: dict[Condition, str] = {}

    def receive_plan(self, sender: int, trajectory: PlanTrajectory) -> None:
        """What a peer flies from the start of this trajectory on."""
        plans = self._plans.setdefault(sender, [])
        plans[:] = [*(plan for plan in plans if plan.start_s < trajectory.start_s), trajectory][-PLANS_KEPT:]

    def receive_lost(self, lost: LostTeammate, time_s: float) -> None:
        """What a peer says, at a UNIX time, of a teammate that fell silent."""
        self._strays.receive(lost, time_s)

    def lost(self, time_s: float) -> list[LostTeammate]:
        """What to tell others of teammates that fell silent, at a UNIX time."""
        return self._strays.told(time_s)

    def filter(self, setpoint: Setpoint, time_s: float, place: Pose | None, down_m: float) -> Setpoint:
        """The setpoint with a velocity that keeps off.

        Args:
            setpoint: What is wanted.
            time_s: UNIX time, s.
            place: Where this robot is; without that nothing is changed.
            down_m: Its height, NED, m: who is well above or below is out of the way.
        """
        if not self._enabled or place is None:
            self.rest()
            return setpoint
        here = (place.north_m, place.east_m)
        obstructions = self.obstructions(time_s, here, down_m)
        self.near = any(
            math.dist(here, (other.north_m, other.east_m)) - other.distance_m < NEAR_M for other in obstructions
        )
        filtered = self._guard.filter(setpoint, here, obstructions)
        self.dangers = self._dangers(setpoint, filtered, here)
        return filtered

    def rest(self) -> None:
        """No setpoint is bent now."""
        self.dangers = {}

    def obstructions(self, time_s: float, here: Point, down_m: float) -> list[Obstruction]:
        """Whom to keep off at a UNIX time, and by how much: strays in all layers, others in this one."""
        if self._keep_m <= 0.0:
            return []
        self.strays = self._strays.find(time_s, here, down_m, self._place_at)
        found = []
        for stray in self.strays:
            if not stray.sinks or stray.down_m - down_m < self._layers_m:
                north_m, east_m = stray.nearest(here)
                found.append(Obstruction(north_m, east_m, self._keep_m + stray.unsure_m, keeps_off=False))
        kept_off = {stray.peer for stray in self.strays}
        for status in self._hearing.statuses:
            age_s = max(time_s - status.time_s, 0.0)
            below_or_above = abs(status.position[2] - down_m) >= self._layers_m
            away = status.state in _ON_THE_GROUND or age_s > self._silence_s or below_or_above
            if away or status.sender in kept_off:
                continue
            north_m, east_m, unsure_m = self._place_of(status, age_s, time_s)
            found.append(Obstruction(north_m, east_m, self._keep_m + unsure_m))
        return found

    @property
    def lying(self) -> list[Stray]:
        """Strays, and teammates that fell silent, however long ago: they may lie there."""
        return [*self.strays, *(lost for lost in self._strays.lost if lost not in self.strays)]

    def may_descend(self, place: Point) -> bool:
        """Whether no stray may come down there."""
        return all(
            stray.sinks or math.dist(stray.nearest(place), place) >= self._keep_m + stray.unsure_m
            for stray in self.strays
        )

    def _place_at(self, status: PeerStatus, time_s: float) -> Place:
        """Where a peer was and how it moved at a UNIX time: along its plan if it was on it, else as it last did.

        Along its plan up to where its last setpoint began to be flown: setpoints are sent ahead by what the autopilot
        takes to follow them.
        """
        north, east, unsure_m = self._place_of(status, max(time_s - status.time_s, 0.0), time_s)
        now, lead_s = self._reference(status.sender, time_s), self._leads_s.get(status.sender, 0.0)
        last = self._reference(status.sender, time_s + lead_s)
        if now is not None and last is not None and unsure_m == 0.0 and status.state is FlightState.TRACK:
            north += last.pose.north_m - now.pose.north_m
            east += last.pose.east_m - now.pose.east_m
            return Place((north, east), (last.velocity_north_m_s, last.velocity_east_m_s))
        velocity = self._homewards(status) if status.state is FlightState.RETURN else status.velocity
        elapsed_s = max(time_s - status.time_s, 0.0)
        return Place((north + elapsed_s * velocity[0], east + elapsed_s * velocity[1]), velocity)

    def _homewards(self, status: PeerStatus) -> Point:
        """How a peer on its way home moves, soon if not yet."""
        home = self._homes.get(status.sender)
        if status.over_home or home is None:
            return status.velocity
        place = status.position[:2]
        corner = (self._ways.between(place, home) or [place, home])[1]
        north_m, east_m = corner[0] - place[0], corner[1] - place[1]
        away_m = math.hypot(north_m, east_m)
        speed_m_s = max(math.hypot(*status.velocity), self._return_m_s)
        return (speed_m_s * north_m / away_m, speed_m_s * east_m / away_m) if away_m > 0.0 else status.velocity

    def _place_of(self, status: PeerStatus, age_s: float, time_s: float) -> tuple[float, float, float]:
        """North, east and how far off at most that may be, m."""
        north, east = status.position[:2]
        then, now = self._reference(status.sender, status.time_s), self._reference(status.sender, time_s)
        if status.state is FlightState.TRACK and then is not None and now is not None:
            off = math.hypot(then.pose.north_m - north, then.pose.east_m - east)
            if off <= EXPLAINED_M:
                moved_north, moved_east = now.pose.north_m - then.pose.north_m, now.pose.east_m - then.pose.east_m
                return north + moved_north, east + moved_east, 0.0
        speed_m_s = 0.0 if status.state is FlightState.HOLD else self._speed_m_s
        return north, east, min(speed_m_s * age_s, self._drift_m)

    def _reference(self, peer: int, time_s: float) -> Reference | None:
        for plan in reversed(self._plans.get(peer, ())):
            if plan.start_s <= time_s:
                return plan.reference(time_s)
        return None

    def _dangers(self, wanted: Setpoint, filtered: Setpoint, here: Point) -> dict[Condition, str]:
        """Whether it was the fence, an obstacle or a teammate, or several of them."""
        if _change_m_s(wanted, filtered) <= NOTICE_M_S:
            return {}
        fenced, walled = self._guard.filter(wanted, here, (), obstacles=False), self._guard.filter(wanted, here, ())
        found = {}
        if _change_m_s(wanted, fenced) > NOTICE_M_S:
            found[Condition.FENCE_NEAR] = ""
        if _change_m_s(fenced, walled) > NOTICE_M_S:
            found[Condition.OBSTACLE_NEAR] = ""
        if not found or _change_m_s(walled, filtered) > NOTICE_M_S:
            found[Condition.TEAMMATE_NEAR] = ""
        return found


def _change_m_s(one: Setpoint, other: Setpoint) -> float:
    return math.hypot(
        one.velocity_north_m_s - other.velocity_north_m_s, one.velocity_east_m_s - other.velocity_east_m_s
    )


def _lead_s(vehicle: VehicleConfig, flight: FlightConfig) -> float:
    """How far ahead of its flight a vehicle's setpoints are."""
    response = BEHAVIOURS[vehicle.autopilot].response.configured(flight)
    return response.velocity_delay_s + response.velocity_lag_s
