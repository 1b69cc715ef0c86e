"""A trial flown by the whole flight stack in virtual time: what it costs, compared with lock-step.

The onboard companions, MAVLink on every link, simulated autopilots with their motion capture, detector and radio: see
``sim_bridge/virtual_team.py``. The team takes off first; step 0 is the mission's.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Mapping

from onboard.config.schema import Scenario
from onboard.estimation.track import Track
from onboard.links import COMPONENT
from onboard.messages import FlightState, PeerPlan
from onboard.protocol.start_order import encode_start
from sim_bridge.errors import BridgeError
from sim_bridge.experiments.records import PeakMemory, StepColumns, TrialResult, TrialTask
from sim_bridge.lockstep.figures_of_merit import figures_of_merit
from sim_bridge.virtual_team import VirtualTeam

__all__ = ["run_flight_trial"]

_STANDBY_LIMIT_S = 60.0
_SETTLE_S = 0.1
"""After a step's measuring delay, for its update to have been made."""


def run_flight_trial(task: TrialTask, on_step: Callable[[int], None] = lambda _: None) -> TrialResult:
    """Fly a trial.

    Args:
        task: Which; its setting has a simulation.
        on_step: Called after each step with how many are done.

    Raises:
        BridgeError: The team did not get ready, or into the air in time.
    """
    memory = PeakMemory()
    begun_s, begun_cpu_s = time.perf_counter(), time.thread_time()
    scenario = task.setting.simulated_scenario("experiment")
    nodes = task.setting.world.budget.nodes or 1
    team = VirtualTeam(scenario, seed=task.seed, plan_nodes=max(1, nodes // len(scenario.vehicles)))
    start_s = _take_off(team, scenario)
    step_s, settle_s = scenario.mission.step_s, scenario.mission.measuring_delay_s + _SETTLE_S
    columns = StepColumns()
    plans: dict[int, PeerPlan | None] = dict.fromkeys(team.companions)
    delivered = lost = 0
    for step in range(task.steps):
        team.run(start_s + step * step_s - team.time_s)
        truth = team.bridge.world.target_truth()
        team.run(settle_s)
        merit = figures_of_merit(list(_tracks(team).values()), truth, scenario.sensor.max_range_m)
        made = _new_plans(team, plans)
        links = team.bridge.radio.links.values()
        now_delivered, now_lost = sum(link.delivered for link in links), sum(link.lost for link in links)
        columns.append(
            step=step,
            time_s=step * step_s,
            merit=merit,
            explored_share=_explored_share(team),
            plans=len(made),
            infeasible_plans=sum(not plan.feasible for plan in made),
            nodes=sum(plan.nodes for plan in made),
            messages_delivered=now_delivered - delivered,
            messages_lost=now_lost - lost,
        )
        delivered, lost = now_delivered, now_lost
        on_step(step + 1)
    return TrialResult(
        task.key,
        columns.values,
        [],
        wall_s=time.perf_counter() - begun_s,
        cpu_s=time.thread_time() - begun_cpu_s,
        peak_memory_bytes=memory.bytes_now(),
    )


def _take_off(team: VirtualTeam, scenario: Scenario) -> float:
    """Start the mission; UNIX time of step 0."""
    try:
        team.until(lambda: _all(team, FlightState.STANDBY), _STANDBY_LIMIT_S)
    except TimeoutError:
        raise BridgeError(f"the team is not ready after {_STANDBY_LIMIT_S:g} s of virtual time") from None
    start_s = math.ceil(team.time_s + scenario.mission.takeoff_time_s)
    for vehicle_id in team.companions:
        team.command(encode_start(vehicle_id, COMPONENT, start_s))
    team.run(start_s - 1.0 - team.time_s)
    if not _all(team, FlightState.HOLD):
        raise BridgeError("mission.takeoff_time_s is too short: not everybody hovers a second before step 0")
    return float(start_s)


def _all(team: VirtualTeam, state: FlightState) -> bool:
    return all(companion.machine.state is state for companion in team.companions.values())


def _tracks(team: VirtualTeam) -> dict[int, Mapping[int, Track]]:
    return {
        vehicle_id: companion.agent.tracks if companion.agent is not None else {}
        for vehicle_id, companion in team.companions.items()
    }


def _explored_share(team: VirtualTeam) -> float:
    agents = [companion.agent for companion in team.companions.values()]
    return sum(agent.grid.explored_share for agent in agents if agent is not None) / len(agents)


def _new_plans(team: VirtualTeam, known: dict[int, PeerPlan | None]) -> list[PeerPlan]:
    """Plans that were made since the last call; ``known`` is brought up to date."""
    made = []
    for vehicle_id, companion in team.companions.items():
        plan = companion.agent.own_plan if companion.agent is not None else None
        if plan is not None and plan is not known[vehicle_id]:
            made.append(plan)
        known[vehicle_id] = plan
    return made
