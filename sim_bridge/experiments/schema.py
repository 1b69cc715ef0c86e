"""What an experiment is: a setting, the arms that change it, trials, and the comparisons to be made."""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self, get_args

from pydantic import Field, model_validator

from onboard.config.base import Positive, Section
from onboard.config.flight import FlightConfig
from onboard.config.mission import MissionConfig
from onboard.config.models import EstimationConfig, ExplorationConfig, PlannerConfig, SensorConfig, TargetsConfig
from onboard.config.patterns import ScenarioName
from onboard.config.schema import Scenario
from onboard.config.simulation import SimulationConfig
from onboard.config.vehicle import VehicleConfig
from sim_bridge.lockstep.config import WorldConfig

__all__ = ["METRICS", "ArmConfig", "ComparisonConfig", "ExperimentFile", "Metric", "Setting", "TeamConfig"]

Metric = Literal[
    "entropy_nats",
    "known_by_robot",
    "rmse_per_target_m",
    "rmse_m",
    "tracked_by_robot",
    "known_by_team",
    "explored_share",
]
METRICS: tuple[Metric, ...] = get_args(Metric)

Label = Annotated[str, Field(min_length=1, max_length=60)]

_FIRST_UNUSED_PORT = 20_000
"""Nothing is opened in lock-step, but a scenario gives every link of every vehicle a port of its own."""


class TeamConfig(Section):
    """A team without names: robots 1 to n start in a square lattice in the middle of the area."""

    robots: Annotated[int, Field(ge=1, le=200)]
    spacing_m: Positive = 3.0
    layer_m: Positive = 2.0

    def vehicles(self, fence: tuple[tuple[float, float], ...]) -> tuple[VehicleConfig, ...]:
        """The robots, around the middle of a fence's bounding box."""
        middle = [0.5 * (min(axis) + max(axis)) for axis in zip(*fence, strict=True)]
        side = math.ceil(math.sqrt(self.robots))
        rows = math.ceil(self.robots / side)
        return tuple(
            VehicleConfig.model_validate(
                {
                    "id": index + 1,
                    "home": (
                        middle[0] + self.spacing_m * (index // side - 0.5 * (rows - 1)),
                        middle[1] + self.spacing_m * (index % side - 0.5 * (side - 1)),
                    ),
                    "layer_m": self.layer_m,
                    "links": {
                        name: f"udpin:127.0.0.1:{_FIRST_UNUSED_PORT + 4 * index + k}"
                        for k, name in enumerate(("autopilot", "peers", "sensor", "ground"))
                    },
                }
            )
            for index in range(self.robots)
        )


class Setting(Section):
    """Everything that a trial depends on, except its seed; the sections of a scenario and the lock-step world."""

    mission: MissionConfig
    primitives: tuple[tuple[float, float], ...] = Field(min_length=1, max_length=127)
    sensor: SensorConfig
    targets: TargetsConfig
    estimation: EstimationConfig = EstimationConfig()
    exploration: ExplorationConfig = ExplorationConfig()
    planner: PlannerConfig = PlannerConfig()
    flight: FlightConfig = FlightConfig()
    team: TeamConfig | None = Field(default=None, description="instead of vehicles")
    vehicles: tuple[VehicleConfig, ...] | None = None
    simulation: SimulationConfig | None = None
    harness: Literal["lockstep", "flight_stack", "processes"] = Field(
        default="lockstep",
        description="flight_stack: companions, MAVLink and simulated autopilots in virtual time; processes: the same "
        "in real time, as `arvi fly` starts them. Both take the number of targets and the budget from world, the rest "
        "from simulation",
    )
    world: WorldConfig

    @model_validator(mode="after")
    def _is_a_scenario(self) -> Self:
        if self.team is None and self.vehicles is None:
            raise ValueError("team: is missing (a number of robots), and no vehicles are given instead")
        if self.harness != "lockstep" and self.simulation is None:
            raise ValueError(f"harness: {self.harness} needs the section simulation")
        budget = self.world.budget
        if self.harness == "flight_stack" and (budget.nodes is None or self.planner.use != "arvi"):
            raise ValueError("harness: flight_stack runs in virtual time, with planner arvi and world.budget.nodes")
        if self.harness == "processes" and (
            (budget.nodes, budget.time_s, budget.clock) != (None, self.mission.planning_time_s, "wall")
        ):
            raise ValueError(
                "harness: processes plan as long as mission.planning_time_s says; world.budget has to say so, too: "
                f"{{time_s: {self.mission.planning_time_s:g}, clock: wall}}"
            )
        self.scenario("experiment")
        return self

    def scenario(self, name: str) -> Scenario:
        """The setting as a scenario of vehicles."""
        vehicles = self.team.vehicles(self.mission.fence) if self.team is not None else self.vehicles
        sections = ("mission", "primitives", "sensor", "targets", "estimation", "exploration", "planner", "flight")
        return Scenario.model_validate(
            {
                "name": name,
                "vehicles": vehicles,
                "simulation": self.simulation,
                **{section: getattr(self, section) for section in sections},
            }
        )

    def simulated_scenario(self, name: str) -> Scenario:
        """The setting as a scenario that can be flown in simulation, with the targets that ``world`` asks for."""
        scenario = self.scenario(name)
        if scenario.simulation is None:
            raise ValueError("there is no section simulation")
        robots = scenario.simulation.ground_robots.model_copy(update={"count": self.world.truth.count})
        simulation = scenario.simulation.model_copy(update={"ground_robots": robots})
        return scenario.model_copy(update={"simulation": simulation})


class ArmConfig(Section):
    """One variant of the setting."""

    label: Label
    trials: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="at most so many, whatever the command line says; null for the experiment's number"
    )
    value: float | None = Field(default=None, description="of the swept quantity, for an axis; null for a category")
    changes: dict[str, Any] = Field(default_factory=dict, description="key path in the setting: its value in this arm")


class ComparisonConfig(Section):
    """One claim: the metric's mean over a span of steps, in one arm less in another, trial by trial."""

    claim: Annotated[str, Field(min_length=1, max_length=300)]
    metric: Metric
    arm: Label
    against: Label
    from_step: Annotated[int, Field(ge=0)] = 0
    expect: Literal["less", "more", "either"] = "either"


class ExperimentFile(Section):
    """One file in ``configs/experiments/``."""

    name: ScenarioName
    question: Annotated[str, Field(min_length=1, max_length=1000)]
    scenario: str | None = Field(default=None, description="file whose sections the setting starts from")
    trials: Annotated[int, Field(ge=1, le=10_000)]
    steps: Annotated[int, Field(ge=1, le=100_000)]
    seed: Annotated[int, Field(ge=0)] = 1
    axis: str | None = Field(default=None, description="what value means, with its unit")
    setting: dict[str, Any]
    arms: tuple[ArmConfig, ...] = Field(min_length=1, max_length=100)
    comparisons: tuple[ComparisonConfig, ...] = ()

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        labels = [arm.label for arm in self.arms]
        for index, label in enumerate(labels):
            if label in labels[:index]:
                raise ValueError(f"arms[{index}].label: {label!r} is also another arm's")
        for index, comparison in enumerate(self.comparisons):
            for key in ("arm", "against"):
                if getattr(comparison, key) not in labels:
                    raise ValueError(
                        f"comparisons[{index}].{key}: no arm has this label; there are {', '.join(labels)}"
                    )
            if comparison.from_step >= self.steps:
                raise ValueError(f"comparisons[{index}].from_step: there are only {self.steps} steps")
        return self
