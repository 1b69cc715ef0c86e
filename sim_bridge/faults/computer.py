"""An onboard computer in virtual time: its process, planner, clock and ground link, with what goes wrong with them.

It stands between a companion and the rest of a virtual team and does what the operating system does for the real
process: it lets it run or not, keeps datagrams in socket buffers meanwhile, starts it anew, and tells it the time.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from onboard.companion import Companion
from onboard.config.faults import Component, FaultType
from onboard.links import LinkName
from onboard.planning.plan import Plan
from onboard.planning_desk import PlanningJob
from sim_bridge.faults.schedule import Fault, FaultSchedule
from sim_bridge.faults.stream import FaultyStream, Way

__all__ = ["OnboardComputer"]

SOCKET_BUFFER_BYTES = 212_992
"""Of one socket (Linux's net.core.rmem_default); what comes on top is lost."""

Frame = tuple[LinkName, bytes]


class OnboardComputer:
    """One vehicle's onboard computer.

    Args:
        vehicle_id: Whose.
        start: Starts the onboard process at a time of its clock, s.
        make_plan: Plans; called when a planning slot begins.
        faults: What is wrong when.
        rng: Decides what happens by chance.
        time_s: UNIX time at which it is switched on, s.

    Attributes:
        companion: The process; None while there is none.
    """

    def __init__(
        self,
        vehicle_id: int,
        start: Callable[[float], Companion],
        make_plan: Callable[[PlanningJob], Plan],
        faults: FaultSchedule,
        rng: np.random.Generator,
        time_s: float,
    ) -> None:
        self._vehicle_id = vehicle_id
        self._start = start
        self._make_plan = make_plan
        self._faults = faults
        self._dead = False
        self._run_credit = 1.0
        self._buffers: dict[LinkName, list[bytes]] = {link: [] for link in LinkName}
        self._plan: tuple[PlanningJob, Plan] | None = None
        self._from_ground = _GroundLink(vehicle_id, faults, rng)
        self._to_ground = _GroundLink(vehicle_id, faults, rng)
        self.companion: Companion | None = start(self.clock(time_s))

    def clock(self, time_s: float) -> float:
        """What its clock shows at a UNIX time, s."""
        faults = self._faults.active(Component.CLOCK, time_s, self._vehicle_id)
        return time_s + sum(fault.config.clock_offset_s(time_s - fault.begin_s) for fault in faults)

    def kill(self) -> None:
        """End the process for good."""
        self._dead = True
        self._end()

    def receive(self, link: LinkName, datagram: bytes, time_s: float) -> None:
        """Take a datagram that arrived; a process that does not run finds it in its socket later."""
        if link is LinkName.GROUND:
            self._from_ground.push((link, datagram), time_s)
        else:
            self._take(link, datagram, time_s)

    def step(self, time_s: float, tick_s: float) -> list[Frame]:
        """Let a tick of the setpoint rate pass; frames that the process sent.

        Args:
            time_s: UNIX time, s.
            tick_s: Length of the tick, s.
        """
        self._live_or_die(time_s)
        for link, datagram in self._from_ground.pop_due(time_s):
            self._take(link, datagram, time_s)
        if self.companion is not None and self._gets_to_run(time_s):
            now_s = self.clock(time_s)
            for link, datagrams in self._buffers.items():
                for datagram in datagrams:
                    self.companion.receive(link, datagram, now_s)
                datagrams.clear()
            self._think(self.companion, now_s, time_s, tick_s)
            self.companion.tick(now_s)
        return self.outbox(time_s)

    def outbox(self, time_s: float) -> list[Frame]:
        """Frames that the process has sent since the last call."""
        sent = self.companion.outbox() if self.companion is not None else []
        for frame in sent:
            if frame[0] is LinkName.GROUND:
                self._to_ground.push(frame, time_s)
        return [frame for frame in sent if frame[0] is not LinkName.GROUND] + self._to_ground.pop_due(time_s)

    def _take(self, link: LinkName, datagram: bytes, time_s: float) -> None:
        if self.companion is None:
            return
        buffer = self._buffers[link]
        if not buffer and not self._is_held_up(time_s):
            self.companion.receive(link, datagram, self.clock(time_s))
        elif sum(map(len, buffer)) + len(datagram) <= SOCKET_BUFFER_BYTES:
            buffer.append(datagram)

    # The process.

    def _process_faults(self, kind: FaultType, time_s: float) -> list[Fault]:
        active = self._faults.active(Component.PROCESS, time_s, self._vehicle_id)
        return [fault for fault in active if fault.config.type is kind]

    def _is_held_up(self, time_s: float) -> bool:
        return bool(self._process_faults(FaultType.STUCK, time_s) or self._process_faults(FaultType.SLOW, time_s))

    def _live_or_die(self, time_s: float) -> None:
        if self._process_faults(FaultType.OFF, time_s):
            self._end()
        elif self.companion is None and not self._dead:
            self.companion = self._start(self.clock(time_s))

    def _end(self) -> None:
        self.companion = None
        self._plan = None
        for datagrams in self._buffers.values():
            datagrams.clear()

    def _gets_to_run(self, time_s: float) -> bool:
        """Whether this tick is one of those that the process gets."""
        if self._process_faults(FaultType.STUCK, time_s):
            return False
        shares = [fault.value("share") for fault in self._process_faults(FaultType.SLOW, time_s)]
        self._run_credit = min(self._run_credit + min(shares, default=1.0), 1.0)
        if self._run_credit < 1.0 - 1e-9:
            return False
        self._run_credit = 0.0 if shares else 1.0
        return True

    # The planner, which runs beside the process's event loop.

    def _think(self, companion: Companion, now_s: float, time_s: float, tick_s: float) -> None:
        """Start the plan that is due, and hand over the one whose slot ends."""
        faults = self._faults.active(Component.PLANNER, time_s, self._vehicle_id)
        kinds = {fault.config.type for fault in faults}
        if self._plan is None:
            job = companion.planning_job(now_s)
            if job is not None and FaultType.OFF in kinds:
                companion.planning_failed(job, "injected fault")
            elif job is not None:
                self._plan = (job, self._make_plan(job))
        if self._plan is None or FaultType.STUCK in kinds:
            return
        job, plan = self._plan
        late_s = sum(fault.value("delay_s") for fault in faults if fault.config.type is FaultType.DELAYED)
        # Its slot ends before the next tick: a plan that arrived then would be late.
        if now_s + tick_s > job.slot.end_s + late_s:
            self._plan = None
            companion.planned(job, _stop(job, plan) if FaultType.WRONG in kinds else plan, now_s)


class _GroundLink(FaultyStream[Frame]):
    def __init__(self, vehicle_id: int, faults: FaultSchedule, rng: np.random.Generator) -> None:
        super().__init__(Component.GROUND_LINK, faults, rng)
        self._vehicle_id = vehicle_id

    def _concerns(self, fault: Fault, item: Frame) -> bool:
        return fault.concerns(self._vehicle_id)

    def _alter(self, fault: Fault, item: Frame, due_s: float) -> Way[Frame]:
        raise AssertionError(fault.config.type)


def _stop(job: PlanningJob, plan: Plan) -> Plan:
    """What a planner gives that finds nothing feasible at the first step."""
    controls = np.full_like(plan.controls, -1)
    poses = np.tile(np.array(job.start.as_tuple()), (len(controls), 1))
    return replace(
        plan, controls=controls, poses=poses, epsilon=math.inf, delta=math.inf, complete=False, feasible=False
    )
