"""Algorithm 3 for one robot, without I/O: poses, looks and peers' messages in; a plan and messages out.

The way from a detection to a plan is :meth:`Agent.look` → :meth:`Agent.step` (distributed filter, map) →
:meth:`Agent.problem` → planner → :meth:`Agent.adopt`. The same object runs in its own process over MAVLink and in a
lock-step world in virtual time.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from onboard.clock import MissionClock
from onboard.config.schema import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.measurement import Look
from onboard.estimation.target_models import TargetModel, TargetMotion
from onboard.estimation.track import Track
from onboard.flight.trajectory import HOVER, PlanTrajectory
from onboard.geometry import Pose
from onboard.mapping.landmarks import Landmarks
from onboard.mapping.visibility_grid import VisibilityGrid
from onboard.messages import Belief, ExploredTile, PeerPlan, PeerStatus
from onboard.planning.plan import Plan
from onboard.planning.primitives import Primitive, advance
from onboard.planning.problem import Block, Problem, Teammate
from onboard.team import Group, TeamTable

__all__ = ["Agent", "StepOutput"]

_LANDMARK = TargetMotion(TargetModel.STATIC, 0.0)


@dataclass(frozen=True, slots=True)
class StepOutput:
    """What a robot tells its neighbours after a step.

    Attributes:
        beliefs: Its posterior of each target.
        tiles: What it explored since it last said so.
    """

    beliefs: list[Belief]
    tiles: list[ExploredTile]


class Agent:
    """One robot's estimate, map and plan.

    Args:
        scenario: Models, primitives, team.
        vehicle: This robot.
        clock: Mission time.
        estimator: Another filter than one of its own, such as one that all robots share.

    Attributes:
        team: Who is in range.
        grid: What has been explored.
        own_plan: The last plan; None before the first.
    """

    def __init__(
        self,
        scenario: Scenario,
        vehicle: VehicleConfig,
        clock: MissionClock,
        estimator: DistributedFilter | None = None,
    ) -> None:
        below = [mate.id for mate in scenario.vehicles if mate.layer_m < vehicle.layer_m]
        self.team = TeamTable(
            vehicle.id, scenario.estimation.neighbour_timeout_s, below, epoch_s=scenario.mission.epoch_s
        )
        self.grid = VisibilityGrid(
            scenario.mission.fence,
            scenario.exploration.cell_m,
            obstacles=scenario.obstacle_grid(),
            reachable_from=[teammate.home for teammate in scenario.vehicles],
            forget_after_s=scenario.exploration.forget_after_s,
        )
        self.own_plan: PeerPlan | None = None
        self._scenario = scenario
        self._vehicle = vehicle
        self._clock = clock
        self._sensor = scenario.sensor.build()
        self._primitives = scenario.primitive_set
        self._fence = np.array(scenario.mission.fence, dtype=np.float64)
        self._obstacles = scenario.obstacle_grid(scenario.mission.obstacle_clearance_m)
        self._filter = estimator or DistributedFilter(
            scenario.targets.build(),
            self._sensor,
            scenario.mission.step_s,
            initial_speed_std_m_s=scenario.targets.initial_speed_std_m_s,
            max_message_age_steps=scenario.estimation.max_message_age_steps,
            fence=scenario.mission.fence,
        )
        self._landmarks = Landmarks(
            scenario.exploration.max_landmarks,
            patience=max(1, round(scenario.exploration.landmark_patience_s / scenario.mission.step_s)),
        )
        self._looks: list[tuple[float, Look]] = []
        self._neighbours: frozenset[int] = frozenset()
        self._peer_plans: dict[int, PeerPlan] = {}
        self._step = -1

    @property
    def tracks(self) -> dict[int, Track]:
        """What this robot believes of each target it knows, at its last step."""
        return dict(self._filter.tracks)

    @property
    def landmarks(self) -> dict[int, tuple[float, float]]:
        """North m, east m of the exploration landmarks at the last step, by id."""
        return dict(self._landmarks.places)

    @property
    def landmark_count(self) -> int:
        """Exploration landmarks at the last step."""
        return len(self._landmarks.places)

    # What comes in.

    def look(self, time_s: float, look: Look) -> None:
        """A look of this robot's own sensor, at its UNIX time; used by the step nearest to it."""
        self._looks.append((time_s, look))

    def receive_belief(self, belief: Belief) -> None:
        """A neighbour's posterior.

        Raises:
            EstimationError: It is no Gaussian of this team's target model.
        """
        self._filter.receive(belief)

    def receive_plan(self, plan: PeerPlan) -> None:
        """A teammate's plan; the newest of each teammate is kept."""
        known = self._peer_plans.get(plan.sender)
        if known is None or plan.step >= known.step:
            self._peer_plans[plan.sender] = plan

    def receive_tile(self, tile: ExploredTile, time_s: float) -> None:
        """What a neighbour has explored.

        Raises:
            MappingError: Its cells have another size, or it lies outside the mission area.
        """
        self.grid.merge(tile, time_s)

    def receive_status(self, status: PeerStatus, time_s: float) -> None:
        """What a peer says of itself."""
        self.team.receive(status, time_s)

    # One step of Algorithm 3: lines 3 to 5.

    def step(self, step: int, pose: Pose | None, time_s: float) -> StepOutput:
        """Fuse, predict and measure up to a step; mark what is seen from ``pose``; say what neighbours should know.

        Args:
            step: Mission step; steps that were missed are made up for by prediction.
            pose: Where the robot is; None when unknown or on the ground: then it sees nothing.
            time_s: UNIX time, s.
        """
        neighbours = self.team.neighbours(time_s)
        if not self._neighbours.issuperset(neighbours):
            self.grid.tell_all()
        self._neighbours = frozenset(neighbours)
        self._filter.advance(step, neighbours, self._looks_for(step))
        self._step = step
        self.grid.expire(time_s)
        if pose is not None:
            self.grid.observe(pose, self._sensor, time_s)
            self._landmarks.update(self.grid, pose)
        return StepOutput(
            beliefs=self._filter.beliefs(self._vehicle.id, degree=len(neighbours)),
            tiles=self.grid.tiles(changed_since_last=True),
        )

    # Line 6: planning.

    def group(self, time_s: float) -> Group:
        """Who this robot plans with, and its place in the order."""
        return self.team.group(time_s, self._clock.start_s)

    def problem(self, step: int, start: Pose, group: Group) -> Problem:
        """What to plan for an epoch.

        Args:
            step: Mission step at which the epoch starts.
            start: Predicted pose at that step.
            group: Those before this robot in the order give their plans, as far as they arrived.
        """
        blocks = [
            Block(target_id, self._filter.motion, mean, covariance)
            for target_id, (mean, covariance) in self._filter.predicted(step).items()
        ]
        sigma = self._scenario.exploration.landmark_sigma_m
        blocks += [
            Block(landmark_id, _LANDMARK, np.array(place, dtype=np.float64), sigma**2 * np.eye(2))
            for landmark_id, place in self._landmarks.places.items()
        ]
        return Problem(
            pose=start,
            step_s=self._scenario.mission.step_s,
            horizon=self._scenario.mission.horizon,
            primitives=self._primitives,
            sensor=self._sensor,
            blocks=tuple(blocks),
            teammates=self._teammates(step, group),
            fence=self._fence,
            obstacles=self._obstacles,
        )

    def adopt(self, step: int, start: Pose, plan: Plan, budget_s: float) -> PeerPlan:
        """Take a plan as one's own; what peers are told of it."""
        self.own_plan = PeerPlan(
            sender=self._vehicle.id,
            step=step,
            start=start,
            controls=tuple(int(control) for control in plan.controls),
            cost=plan.cost,
            lower_bound=plan.lower_bound,
            epsilon=plan.epsilon,
            delta=plan.delta,
            width=plan.width,
            planning_time_s=plan.elapsed_s,
            budget_s=budget_s,
            nodes=plan.nodes_generated,
            feasible=plan.feasible,
            complete=plan.complete,
        )
        return self.own_plan

    def controls(self, plan: PeerPlan) -> list[Primitive]:
        """A plan's primitives."""
        return [self._primitives[index] if index >= 0 else HOVER for index in plan.controls]

    def trajectory(self, plan: PeerPlan) -> PlanTrajectory:
        """A plan as it is flown, from the UNIX time of its step on."""
        return PlanTrajectory(self._clock.time_of(plan.step), plan.start, self.controls(plan), self._clock.step_s)

    def _teammates(self, step: int, group: Group) -> tuple[Teammate, ...]:
        """Plans for the same epoch of those who planned before; one that did not arrive counts as absent."""
        teammates = []
        for peer in group.members[: group.order]:
            plan = self._peer_plans.get(peer)
            if plan is not None and plan.step == step:
                teammates.append(Teammate(self._rollout(plan), self._separation_m(peer)))
        return tuple(teammates)

    def _rollout(self, plan: PeerPlan) -> NDArray[np.float64]:
        """(T, 3) poses of a plan over this robot's horizon; a shorter plan stops at its end."""
        horizon = self._scenario.mission.horizon
        primitives = self.controls(plan)[:horizon]
        pose, poses = plan.start, []
        for primitive in primitives + [HOVER] * (horizon - len(primitives)):
            pose = advance(pose, primitive, self._scenario.mission.step_s)
            poses.append(pose.as_tuple())
        return np.array(poses)

    def _separation_m(self, peer: int) -> float:
        """Horizontal distance to keep from a peer: none when it flies on another layer."""
        try:
            apart = abs(self._scenario.vehicle(peer).layer_m - self._vehicle.layer_m)
        except KeyError:
            apart = 0.0
        mission = self._scenario.mission
        return 0.0 if apart >= mission.layer_separation_m else mission.separation_m

    def _looks_for(self, step: int) -> list[Look]:
        """The look nearest to a step for each target; older ones are dropped, newer ones kept."""
        at = self._clock.time_of(step)
        best: dict[int, tuple[float, Look]] = {}
        later = []
        for time_s, look in self._looks:
            nearest = self._clock.nearest_step(time_s)
            if nearest > step:
                later.append((time_s, look))
            elif nearest == step:
                off = abs(time_s - at)
                if look.target_id not in best or off < best[look.target_id][0]:
                    best[look.target_id] = (off, look)
        self._looks = later
        return [look for _, look in best.values()]
