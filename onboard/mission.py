"""One mission of one vehicle: its time, Algorithm 3 step by step, its plans; what of it is told to whom."""

from __future__ import annotations

from onboard.agent import Agent
from onboard.clock import MissionClock
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.counts import Counts
from onboard.flight.machine import FlightMachine
from onboard.flight.pose_history import PoseHistory
from onboard.links import LinkName
from onboard.planning.plan import Plan
from onboard.planning_desk import PlanningDesk, PlanningJob
from onboard.protocol import dialect as mavlink
from onboard.protocol.team_messages import (
    encode_belief,
    encode_landmarks,
    encode_plan,
    encode_tile,
    primitives_checksum,
)

__all__ = ["EVERYBODY", "Mission", "Said"]

EVERYBODY = (LinkName.PEERS, LinkName.GROUND)
"""Who hears of a mission: teammates and the ground."""

LANDMARKS_EVERY = 2
"""Steps from one message about landmarks to the next; only the ground hears them."""

Said = tuple[mavlink.MAVLink_message, tuple[LinkName, ...]]
"""A message, and the links that it goes to."""


class Mission:
    """A mission from its start on; another start begins another one.

    Args:
        scenario: The team's configuration.
        vehicle: This robot.
        start_s: UNIX time of step 0, s.
        machine: Flies its plans.
        counts: What is counted.

    Attributes:
        clock: Mission time.
        agent: This robot's estimate, map and plan.
        desk: Its planning.
    """

    def __init__(
        self, scenario: Scenario, vehicle: VehicleConfig, start_s: float, machine: FlightMachine, counts: Counts
    ) -> None:
        self.clock = MissionClock(start_s, scenario.mission.step_s)
        self.agent = Agent(scenario, vehicle, self.clock)
        self.desk = PlanningDesk(scenario, self.clock, self.agent, machine, counts)
        self._measuring_delay_s = scenario.mission.measuring_delay_s
        self._checksum = primitives_checksum(scenario.primitive_set)
        self._last_step = -1

    def step(self, time_s: float, poses: PoseHistory | None) -> list[Said]:
        """One step of Algorithm 3 when it is due, a little after its time so that its detections have arrived.

        Args:
            time_s: UNIX time, s.
            poses: Where the robot was lately; None on the ground, where it sees nothing.

        Returns:
            What is to be told, and on which links.
        """
        step = self.clock.step_at(time_s - self._measuring_delay_s)
        if step <= self._last_step:
            return []
        self._last_step = step
        at_s = self.clock.time_of(step)
        output = self.agent.step(step, None if poses is None else poses.at(at_s), time_s)
        said: list[Said] = [(encode_belief(belief, self.clock), EVERYBODY) for belief in output.beliefs]
        said += [(encode_tile(tile), EVERYBODY) for tile in output.tiles]
        if step % LANDMARKS_EVERY == 0:
            said.append((encode_landmarks(at_s, self.agent.landmarks.values()), (LinkName.GROUND,)))
        return said

    def planned(self, job: PlanningJob, plan: Plan, time_s: float) -> Said | None:
        """Fly a plan that was made; what is to be told of it, None if it is not flown."""
        own = self.desk.planned(job, plan, time_s)
        return None if own is None else (encode_plan(own, self.clock, self._checksum), EVERYBODY)
