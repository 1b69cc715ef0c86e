"""A recorded flight as the records of an experiment's trial: what the messages say of each step."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from gcs.errors import GroundError
from gcs.recording.tlog import read_tlog
from gcs.target_truth import TargetTruths
from onboard.clock import MissionClock
from onboard.config import Scenario
from onboard.estimation.track import Track
from onboard.messages import PeerPlan
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id
from onboard.protocol.team_messages import primitives_checksum, read_belief, read_plan
from sim_bridge.experiments.records import StepColumns
from sim_bridge.lockstep.figures_of_merit import figures_of_merit
from sim_bridge.truth import TargetTruth

__all__ = ["FlightRecord", "read_recording"]

_WANTED = frozenset(
    {mavlink.MAVLINK_MSG_ID_TARGET_BELIEF, mavlink.MAVLINK_MSG_ID_TARGET_TRUTH, mavlink.MAVLINK_MSG_ID_ARVI_PLAN}
)
_BRIDGE_LOG = "bridge.tlog"


class FlightRecord:
    """Collects beliefs, plans and the truth of a flight, in any order.

    Args:
        scenario: What was flown.
        start_s: UNIX time of step 0.
        steps: How many steps count.
    """

    def __init__(self, scenario: Scenario, start_s: float, steps: int) -> None:
        self._scenario = scenario
        self._steps = steps
        self._clock = MissionClock(start_s, scenario.mission.step_s)
        self._motion = scenario.targets.build()
        self._checksum = primitives_checksum(scenario.primitive_set)
        self._truths = TargetTruths(memory_s=(steps + 2) * scenario.mission.step_s)
        self._tracks: list[dict[int, dict[int, Track]]] = [
            {vehicle.id: {} for vehicle in scenario.vehicles} for _ in range(steps)
        ]
        self._plans: dict[tuple[int, int], PeerPlan] = {}

    def receive(self, message: mavlink.MAVLink_message) -> None:
        """Take one message; of a step that does not count, or of another kind, it is ignored.

        Raises:
            MessageError: Its content cannot be used.
        """
        match message:
            case mavlink.MAVLink_target_truth_message():
                if message.time_usec * 1e-6 <= self._clock.time_of(self._steps):
                    self._truths.receive(message)
            case mavlink.MAVLink_target_belief_message():
                belief = read_belief(message, self._clock)
                if 0 <= belief.step < self._steps and belief.sender in self._tracks[belief.step]:
                    self._tracks[belief.step][belief.sender][belief.target_id] = Track(
                        belief.target_id,
                        self._motion,
                        belief.step,
                        belief.information_vector,
                        belief.information_matrix,
                    )
            case mavlink.MAVLink_arvi_plan_message():
                plan = read_plan(message, self._clock, self._checksum, len(self._scenario.primitives))
                if 0 <= plan.step < self._steps:
                    self._plans[plan.step, plan.sender] = plan

    @property
    def planning_s(self) -> list[float]:
        """Time that each plan took, s, by step and vehicle."""
        return [self._plans[key].planning_time_s for key in sorted(self._plans)]

    def columns(self) -> StepColumns:
        """The records of all steps; what flights do not count is null.

        Raises:
            GroundError: Of a step's target there is no truth.
        """
        columns = StepColumns()
        reach_m = self._scenario.sensor.max_range_m
        for step, robots in enumerate(self._tracks):
            made = [plan for (at, _), plan in self._plans.items() if at == step]
            columns.append(
                step=step,
                time_s=step * self._clock.step_s,
                merit=figures_of_merit(list(robots.values()), self._truth(step, robots), reach_m),
                plans=len(made),
                infeasible_plans=sum(not plan.feasible for plan in made),
                nodes=sum(plan.nodes for plan in made),
            )
        return columns

    def _truth(self, step: int, robots: Mapping[int, Mapping[int, Track]]) -> list[TargetTruth]:
        time_s, result = self._clock.time_of(step), []
        for target_id in sorted({target for tracks in robots.values() for target in tracks}):
            place = self._truths.at(target_id, time_s)
            if place is None:
                raise GroundError(f"nobody told where target {target_id} was at step {step}")
            result.append(TargetTruth(target_id, *place, 0.0, 0.0, 0.0))
        return result


def read_recording(folder: Path, scenario: Scenario, start_s: float, steps: int) -> FlightRecord:
    """The record of a flight from the folder of its recording.

    Raises:
        GroundError: The folder holds no recording of a simulated flight, or one that says too little.
        MessageError: A message's content cannot be used.
    """
    record, codec = FlightRecord(scenario, start_s, steps), Codec(scenario.ground.system_id, 0)
    logs = [folder / _BRIDGE_LOG, *(folder / f"vehicle{vehicle.id}_onboard.tlog" for vehicle in scenario.vehicles)]
    for log in logs:
        try:
            for _, frame in read_tlog(log):
                if message_id(frame) in _WANTED:
                    for message in codec.decode(frame):
                        record.receive(message)
        except OSError as error:
            raise GroundError(f"{log}: cannot be read: {error.strerror or error}") from None
    return record
