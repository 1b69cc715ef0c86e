"""``arvi fly``: starts bridge, onboard processes and ground station, and leaves nothing behind."""

from __future__ import annotations

import asyncio
import math
import resource
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs import summary
from gcs.errors import GroundError
from gcs.folder import run_folder
from gcs.mission import MissionDirector, Phase
from gcs.operator_desk import OperatorDesk
from gcs.ports import check_free, needed_ports
from gcs.preflight import check_signing, check_simulation
from gcs.process_faults import BRIDGE, Order, ProcessFaults
from gcs.recording.display import RecordedDisplay
from gcs.recording.recorder import DEFAULT_LIMIT_MB, Recorder, record_flight
from gcs.session import Display, StopRequests, run_session
from gcs.station import GroundStation
from gcs.supervisor import ChildExit, Supervisor, tail
from gcs.team import Event, TeamState
from gcs.vehicle_state import VehicleState
from onboard.config import Scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from sim_bridge.faults import TAKEN_OFF_M

__all__ = ["FlightOptions", "FlightResult", "Programs", "fly"]

_READY_PATIENCE_S = 60.0
_EXTERNAL_READY_PATIENCE_S = 150.0
"""Real autopilots take half a minute and more until their estimators have settled."""
_STOP_GRACE_S = 2.5
_WARM_UP_QUIET_S = 1.5


@dataclass(frozen=True, slots=True)
class Programs:
    """The programs of a flight, each with its arguments; tests put others in their place.

    Attributes:
        warm_up: Run once before the others.
        bridge: The simulation.
        onboard: The onboard process of a vehicle, given its system id.
    """

    warm_up: list[str]
    bridge: list[str]
    onboard: Callable[[int], list[str]]

    @classmethod
    def of(cls, config: Path, seed: int) -> Programs:
        """The real ones, run by this interpreter."""
        python, path = sys.executable, str(config)
        return cls(
            warm_up=[python, "-m", "onboard.warmup"],
            bridge=[python, "-m", "sim_bridge", path, "--seed", str(seed)],
            onboard=lambda vehicle_id: [python, "-m", "onboard", path, "--vehicle", str(vehicle_id)],
        )


@dataclass(frozen=True, slots=True)
class FlightOptions:
    """What a flight is asked to be.

    Attributes:
        config: The scenario's file.
        scenario: What it says.
        duration_s: From step 0 to landing, s.
        seed: Of the simulation.
        record: Folder for recordings; None records nothing.
        version: Of this program.
        record_limit_mb: The recording stops at about this size, MB.
    """

    config: Path
    scenario: Scenario
    duration_s: float
    seed: int
    record: Path | None
    version: str
    record_limit_mb: int = DEFAULT_LIMIT_MB


@dataclass(frozen=True, slots=True)
class FlightResult:
    """How a flight went.

    Attributes:
        summary: As :func:`gcs.summary.summarize` has it; None if the team was never launched.
        problems: What went wrong, one sentence each; empty after a good flight.
        folder: Where recording and logs are; None if nothing was kept.
    """

    summary: dict[str, Any] | None
    problems: tuple[str, ...]
    folder: Path | None


async def fly(
    options: FlightOptions, display: Display, programs: Programs | None = None, desk: OperatorDesk | None = None
) -> FlightResult:
    """Fly a simulated team.

    Args:
        options: What to fly.
        display: Where the operator looks.
        programs: What is started; the real ones unless given.
        desk: Where an operator's orders arrive.

    Raises:
        GroundError: Ports are in use, the recording's folder cannot be made, or the scenario cannot be simulated.
        SigningError: The team's key cannot be used.
        TransportError: The ground station's port is in use.
    """
    if options.scenario.simulation is None:
        raise GroundError(
            f"{options.config}: has no section simulation, so there is nothing to fly here; on hardware run "
            "`arvi onboard CONFIG --vehicle N` on each vehicle and `arvi gcs CONFIG --start` on the ground"
        )
    check_simulation(options.config, options.scenario, options.seed)
    check_signing(options.scenario)
    check_free(needed_ports(options.scenario))
    stop = StopRequests()
    with stop.listening(), run_folder(options.record, options.scenario.name) as folder:
        programs = programs or Programs.of(options.config, options.seed)
        flight = _Flight(options, programs, display, stop, folder.path, desk)
        problems: tuple[str, ...] = ("the flight was not finished",)
        try:
            result = await flight.run()
            problems = result.problems
        finally:
            folder.keep = options.record is not None or bool(problems)
        return FlightResult(result.summary, problems, folder.path if folder.keep else None)


class _Flight:
    """One flight from the first process to the last."""

    def __init__(
        self,
        options: FlightOptions,
        programs: Programs,
        display: Display,
        stop: StopRequests,
        folder: Path,
        desk: OperatorDesk | None,
    ) -> None:
        mission = options.scenario.mission
        self._options = options
        self._programs = programs
        self._display = display
        self._stop = stop
        self._folder = folder
        self._problems: list[str] = []
        self._bridge_ended = False
        self._incomplete = False
        self._director = MissionDirector(mission.step_s, mission.takeoff_time_s, options.duration_s)
        self._names = {f"vehicle{vehicle.id}": vehicle.id for vehicle in options.scenario.vehicles}
        self._recorder = self._begin_recording() if options.record is not None else None
        self._station = GroundStation(options.scenario, director=self._director, recorder=self._recorder, desk=desk)
        self._supervisor = Supervisor(folder, self._child_ended)
        self._launched_s = 0.0
        self._faults = ProcessFaults((), {}, 0.0)
        external = any(vehicle.external is not None for vehicle in options.scenario.vehicles)
        self._patience_s = _EXTERNAL_READY_PATIENCE_S if external else _READY_PATIENCE_S

    async def run(self) -> FlightResult:
        """Warm up, fly, stop everything, summarize."""
        if not await self._warm_up():
            return FlightResult(None, tuple(self._problems), self._folder)
        cpu, own_cpu, started = _cpu_s(), time.process_time(), time.monotonic()
        cpu_by_name: dict[str, float] = {}
        try:
            await self._station.open()
            await self._launch()
            async with self._injected_faults():
                reason = await run_session(self._station, self._display, self._stop, time.time, self._cannot_go_on)
            if reason is not None:
                self._problem(reason)
            cpu_by_name = {"ground": time.process_time() - own_cpu, **self._supervisor.cpu_times_s()}
        finally:
            await self._stop_all()
        elapsed_s = time.monotonic() - started
        self._find_faults()
        facts = summary.FlightFacts(
            scenario=self._options.scenario.name,
            version=self._options.version,
            seed=self._options.seed,
            mission_start_s=self._director.start_s,
            mission_end_s=self._director.landing_since_s,
            cpu_cores=(_cpu_s() - cpu) / elapsed_s,
            cpu_s=cpu_by_name,
            problems=tuple(self._problems),
        )
        result = summary.summarize(self._station.team, facts, time.time())
        if self._recorder is not None:
            self._keep(result)
        return FlightResult(result, tuple(self._problems), self._folder)

    def _begin_recording(self) -> Recorder | None:
        """None when nothing can be written: a full disk never keeps a team on the ground."""
        options = self._options
        try:
            recorder = record_flight(
                self._folder, options.config, options.scenario, self._about(), options.record_limit_mb
            )
        except GroundError as error:
            self._say(mavlink.MAV_SEVERITY_WARNING, f"the flight is not recorded: {error}")
            return None
        self._display = RecordedDisplay(self._display, recorder)
        self._say(mavlink.MAV_SEVERITY_INFO, f"recording to {self._folder}")
        return recorder

    async def _warm_up(self) -> bool:
        """Compile the kernels once, before several processes need them at a time; whether that went well."""
        await self._supervisor.start("warmup", self._programs.warm_up)
        began = time.monotonic()
        told = False
        while "warmup" in self._supervisor.running():
            if self._stop.count:
                await self._supervisor.stop(_STOP_GRACE_S)
                self._problem("stopped before the flight")
                return False
            if not told and time.monotonic() - began > _WARM_UP_QUIET_S:
                told = True
                self._say(mavlink.MAV_SEVERITY_INFO, "compiling planner kernels (first start only)…")
            await asyncio.sleep(0.05)
        returncode = await self._supervisor.wait("warmup")
        if returncode != 0:
            log = self._supervisor.log_folder / "warmup.log"
            self._problem(f"the planner's kernels cannot be compiled (exit code {returncode})", tail(log))
            return False
        return True

    async def _launch(self) -> None:
        self._launched_s = time.monotonic()
        for name in (BRIDGE, *self._names):
            await self._supervisor.start(name, self._program(name))

    @asynccontextmanager
    async def _injected_faults(self) -> AsyncIterator[None]:
        """Let the processes fail as the scenario says; afterwards all that live go on."""
        simulation = self._options.scenario.simulation
        script = simulation.script if simulation is not None else ()
        self._faults = ProcessFaults(script, self._names, time.time())
        injecting = asyncio.create_task(self._inject()) if self._faults.needed else None
        try:
            yield
        finally:
            if injecting is not None:
                injecting.cancel()
                await asyncio.gather(injecting, return_exceptions=True)
                for name in self._supervisor.running():
                    self._supervisor.send(name, signal.SIGCONT)

    async def _inject(self) -> None:
        faults = self._faults
        while True:
            now = time.time()
            if faults.schedule.takeoff_s is None and any(map(_is_up, self._station.team.state(now).vehicles)):
                faults.schedule.take_off(now)
            for change in faults.schedule.changes(now):
                self._say(mavlink.MAV_SEVERITY_NOTICE, change.text)
            for action in faults.due(now):
                if action.order is Order.START:
                    await self._supervisor.start(action.process, self._program(action.process))
                else:
                    self._supervisor.send(action.process, action.order.value)
            await asyncio.sleep(faults.wait_s(now))

    def _program(self, name: str) -> list[str]:
        return self._programs.bridge if name == BRIDGE else self._programs.onboard(self._names[name])

    async def _stop_all(self) -> None:
        try:
            if self._stop.count > 1:
                self._supervisor.kill()
            await self._supervisor.stop(_STOP_GRACE_S)
        finally:
            await self._station.close()
            if self._recorder is not None:
                self._recorder.close()
                for warning in self._recorder.take_warnings():
                    self._say(mavlink.MAV_SEVERITY_WARNING, warning)

    def _child_ended(self, child: ChildExit) -> None:
        """A child is gone: at once say which, why, and its last words."""
        if child.expected or child.name == "warmup":
            return
        vehicle_id = self._names.get(child.name)
        if vehicle_id is not None and self._faults.killed(child.name):
            self._station.team.onboard_ended(vehicle_id)
            return
        if vehicle_id is None:
            self._bridge_ended = True
            self._problem(f"the bridge ended: {child.reason}", child.last_lines)
        else:
            self._incomplete = True
            self._station.team.onboard_ended(vehicle_id)
            self._problem(f"vehicle {vehicle_id}'s onboard process ended: {child.reason}", child.last_lines)

    def _cannot_go_on(self, team: TeamState) -> str | None:
        if self._bridge_ended:
            return "nothing is left to fly without the bridge"
        if self._director.phase is not Phase.WAITING:
            return None
        if self._incomplete:
            return "the team is not complete, so nobody takes off"
        if self._stop.count:
            return "stopped before takeoff"
        if time.monotonic() - self._launched_s > self._patience_s:
            missing = [_unready(v) for v in team.vehicles if v.flight_state is not FlightState.STANDBY]
            return f"not ready within {self._patience_s:.0f} s: {'; '.join(missing)}"
        return None

    def _find_faults(self) -> None:
        """What the summary must not hide: who did not fly, who is not down."""
        if self._director.start_s is None:
            return
        for vehicle in self._station.team.state(time.time()).vehicles:
            if not vehicle.flew:
                self._problems.append(f"vehicle {vehicle.id} did not take off")
            elif not (vehicle.landed and vehicle.armed is False):
                self._problems.append(f"vehicle {vehicle.id} did not land and disarm")

    def _problem(self, text: str, last_lines: tuple[str, ...] = ()) -> None:
        self._problems.append(text)
        self._say(mavlink.MAV_SEVERITY_ERROR, text)
        for line in last_lines:
            self._say(mavlink.MAV_SEVERITY_ERROR, f"  | {line}")

    def _say(self, severity: int, text: str) -> None:
        self._display.event(Event(time.time(), severity, "launcher", text))

    def _keep(self, result: dict[str, Any]) -> None:
        """The summary beside the recording."""
        try:
            summary.write_json(result, self._folder / "summary.json")
        except GroundError as error:
            self._say(mavlink.MAV_SEVERITY_WARNING, str(error))

    def _about(self) -> dict[str, Any]:
        """What ``flight.json`` says of this flight."""
        options = self._options
        return {
            "scenario": options.scenario.name,
            "version": options.version,
            "seed": options.seed,
            "duration_s": options.duration_s if math.isfinite(options.duration_s) else None,
            "vehicles": list(self._names.values()),
        }


def _unready(vehicle: VehicleState) -> str:
    """A vehicle that keeps a team waiting, with why as far as anybody said."""
    if not vehicle.autopilot_alive:
        return f"vehicle {vehicle.id} (no autopilot is heard)"
    return f"vehicle {vehicle.id} ({vehicle.status_text})" if vehicle.status_text else f"vehicle {vehicle.id}"


def _is_up(vehicle: VehicleState) -> bool:
    """Whether it has left the ground, by the same measure as in the bridge: both run scripts of faults from then on."""
    return vehicle.height_m is not None and vehicle.height_m > TAKEN_OFF_M


def _cpu_s() -> float:
    """CPU seconds of this process and of all children that have ended."""
    usages = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(usage.ru_utime + usage.ru_stime for usage in usages)
