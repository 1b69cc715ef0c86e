"""What a lock-step world is made of, beside the scenario: truth, motion, radio with its faults, planning budget."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, model_validator

from onboard.config.base import NonNegative, Positive, Probability, Section, SystemId
from onboard.planning.plan import Budget, SearchClock

__all__ = ["BudgetConfig", "NetworkConfig", "PartitionConfig", "TargetTruthConfig", "WorldConfig"]

Steps = Annotated[int, Field(ge=0, le=1000)]


class TargetTruthConfig(Section):
    """How the targets really move, which need not be what the filter assumes."""

    count: Annotated[int, Field(ge=0, le=1000)]
    motion: Literal["model", "ground_robots"] = Field(
        default="model",
        description="model: as the filter assumes, at rest at first, reflected at the walls; ground_robots: the lab's",
    )
    noise: NonNegative | None = Field(default=None, description="q of the truth; null takes targets.noise")


class PartitionConfig(Section):
    """A time in which the team is split: only robots of one group hear each other."""

    from_step: Annotated[int, Field(ge=0)]
    until_step: Annotated[int, Field(ge=1)] = Field(description="the first step after it")
    groups: tuple[tuple[SystemId, ...], ...] = Field(description="who is not listed hears nobody")

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if self.until_step <= self.from_step:
            raise ValueError(f"until_step: {self.until_step} is not after from_step = {self.from_step}")
        listed = [member for group in self.groups for member in group]
        if len(set(listed)) != len(listed):
            raise ValueError("groups: a robot is listed twice")
        return self


class NetworkConfig(Section):
    """The radio between robots: unit-disc range, and faults drawn for each message and receiver."""

    range_m: NonNegative | None = Field(default=None, description="null reaches everybody, 0 nobody")
    loss: Probability = 0.0
    delay_steps: Steps = Field(default=0, description="0: before the receiver's next step; a plan at once")
    jitter_steps: Steps = Field(default=0, description="up to so many steps more, each equally likely")
    duplication: Probability = Field(default=0.0, description="that a message arrives twice, each with its own delay")
    reordering: Probability = Field(default=0.0, description="that a message is overtaken by others of its step")
    partitions: tuple[PartitionConfig, ...] = Field(default=(), max_length=100)

    @property
    def is_faultless(self) -> bool:
        """Whether every message to somebody in range arrives once, in order and at once."""
        return not (self.loss or self.delay_steps or self.jitter_steps or self.duplication or self.reordering)


class BudgetConfig(Section):
    """What a group may spend on one epoch's plans, split evenly over its members; the first limit ends a search."""

    nodes: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="successors generated: the same input gives the same plan"
    )
    time_s: Positive | None = Field(default=None, description="T_ARVI on the clock: plans depend on the machine")
    clock: Literal["cpu", "wall"] = Field(
        default="cpu",
        description="cpu: the planner's processor time, which means the same on a busy machine; wall: elapsed time",
    )

    @model_validator(mode="after")
    def _something(self) -> Self:
        if self.nodes is None and self.time_s is None:
            raise ValueError("give nodes, time_s, or both")
        return self

    @property
    def search_clock(self) -> SearchClock:
        """The clock that planning is timed on."""
        return SearchClock.THREAD_CPU if self.clock == "cpu" else SearchClock.MONOTONIC

    def share(self, members: int) -> Budget:
        """What one of ``members`` robots may spend from now on."""
        return Budget(
            deadline_s=None if self.time_s is None else self.search_clock.now_s() + self.time_s / members,
            nodes=None if self.nodes is None else max(1, self.nodes // members),
            clock=self.search_clock,
        )


class WorldConfig(Section):
    """Everything around the agents."""

    truth: TargetTruthConfig
    motion: Literal["ideal", "second_order"] = Field(
        default="ideal", description="ideal: eq. (12); second_order: setpoints flown by the simulated vehicle"
    )
    radio: NetworkConfig = NetworkConfig()
    estimation: Literal["distributed", "centralised"] = Field(
        default="distributed",
        description="centralised: one filter gets every robot's looks at once, and all plan with it",
    )
    detection_probability: Probability = 1.0
    random_starts: bool = Field(
        default=False, description="true: robots start anywhere; false: at home, turned at random"
    )
    budget: BudgetConfig
