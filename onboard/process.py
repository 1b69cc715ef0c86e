"""The onboard process: sockets, timers, the planner's thread and signals around a :class:`Companion`.

The event loop streams setpoints and handles links; it never waits for the planner, which runs in a thread of its own
with the GIL released, against a deadline.
"""

from __future__ import annotations

import asyncio
import logging
import os
import signal
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from functools import partial

from onboard.companion import Companion
from onboard.config.faults import Component, clock_offset_s
from onboard.config.schema import Scenario
from onboard.links import LinkName
from onboard.planning.plan import Budget, Plan
from onboard.planning.pluggable import PlannerSetup, load_planner
from onboard.planning.warmup import warm_kernels
from onboard.planning_desk import PlanningJob
from onboard.protocol import dialect as mavlink
from onboard.protocol.signing import Signing
from onboard.protocol.transport import Link, open_link
from onboard.realtime import make_this_thread_urgent
from onboard.service import NotifySocket, ServiceReport
from onboard.signing_keeper import SigningKeeper, keeping

__all__ = ["clock_of", "fly"]

LEAVE_PATIENCE_S = 3.0

_log = logging.getLogger("onboard")
_LEVELS = {
    mavlink.MAV_SEVERITY_WARNING: logging.WARNING,
    mavlink.MAV_SEVERITY_NOTICE: logging.INFO,
    mavlink.MAV_SEVERITY_INFO: logging.INFO,
    mavlink.MAV_SEVERITY_DEBUG: logging.DEBUG,
}


async def fly(scenario: Scenario, vehicle_id: int) -> None:
    """Fly one vehicle of a team until SIGINT or SIGTERM; in the air these land it first, a second one ends at once.

    Raises:
        KeyError: The scenario has no such vehicle.
        PlannerError: ``planner.use`` names no planner.
        SigningError: The team's key cannot be used.
        TransportError: A link cannot be opened.
    """
    vehicle = scenario.vehicle(vehicle_id)
    keeper = None if scenario.signing is None else SigningKeeper(scenario.signing, f"vehicle-{vehicle_id}")
    warm_kernels()
    process = _Process(scenario, vehicle_id, None if keeper is None else keeper.signing)
    try:
        await process.open(
            {
                LinkName.AUTOPILOT: vehicle.autopilot_url,
                LinkName.PEERS: vehicle.peers_url,
                LinkName.SENSOR: vehicle.sensor_url,
                LinkName.GROUND: vehicle.ground_url,
            }
        )
        if not make_this_thread_urgent():
            _log.info("no permission for real-time priority: on a busy machine setpoints may come late")
        _log.info("autopilot %s, ground %s", vehicle.autopilot_url, vehicle.ground_url)
        async with keeping(keeper):
            await process.run()
    finally:
        process.close()


def clock_of(scenario: Scenario, vehicle_id: int, unix_s: Callable[[], float] = time.time) -> Callable[[], float]:
    """What the onboard computer's clock shows, UNIX time, s: the true time but for what the simulation makes of it.

    Args:
        scenario: Its ``simulation.faults`` may set the clock wrong, counted from this call.
        vehicle_id: Whose computer.
        unix_s: The true time, s.
    """
    script = scenario.simulation.script if scenario.simulation is not None else ()
    faults = tuple(fault for fault in script if fault.component is Component.CLOCK and fault.concerns(vehicle_id))
    if not faults:
        return unix_s
    boot_s = unix_s()

    def clock() -> float:
        now_s = unix_s()
        return now_s + clock_offset_s(faults, vehicle_id, now_s - boot_s)

    return clock


class _Process:
    def __init__(self, scenario: Scenario, vehicle_id: int, signing: Signing | None = None) -> None:
        self._clock = clock_of(scenario, vehicle_id)
        self._companion = Companion(scenario, vehicle_id, self._clock(), signing)
        self._planner = load_planner(
            scenario.planner.use,
            PlannerSetup(scenario, vehicle_id, seed=vehicle_id, options=scenario.planner.options),
        )
        # One that searches without the interpreter lock must not lose its processor while it holds it.
        releases_lock = getattr(self._planner, "releases_interpreter_lock", False)
        self._thread = ThreadPoolExecutor(1, "planner", make_this_thread_urgent if releases_lock else None)
        self._period_s = 1.0 / scenario.flight.setpoint_rate_hz
        self._links: dict[LinkName, Link] = {}
        self._stops = 0
        self._systemd = NotifySocket.of(os.environ)
        self._report = ServiceReport(self._systemd.watchdog_s)
        self._planning = False

    async def open(self, urls: dict[LinkName, str]) -> None:
        for name, url in urls.items():
            self._links[name] = await open_link(url, partial(self._receive, name))

    def close(self) -> None:
        for link in self._links.values():
            link.close()
        self._systemd.close()
        self._thread.shutdown(wait=True, cancel_futures=True)

    async def run(self) -> None:
        """Tick at the setpoint rate until stopped; ticks that the host made impossible are skipped, not made up."""
        loop = asyncio.get_running_loop()
        for number in (signal.SIGINT, signal.SIGTERM):
            loop.add_signal_handler(number, self._stop)
        due = loop.time()
        leave_by = None
        while self._stops < 2:
            now = self._clock()
            if self._stops:
                leave_by = leave_by if leave_by is not None else now + LEAVE_PATIENCE_S
                if self._companion.leave(now) or now > leave_by:
                    break
            self._companion.tick(now)
            self._flush()
            self._plan()
            self._tell_systemd(now, loop.time())
            until_slot = self._companion.next_slot_s(now) - now
            if 0.0 < until_slot < self._period_s:
                loop.call_later(until_slot, self._plan)
            due = max(due + self._period_s, loop.time() - self._period_s)
            await asyncio.sleep(due - loop.time())

    def _tell_systemd(self, now_s: float, steady_s: float) -> None:
        """After a tick's frames are sent: so a loop that hangs is not called alive by anybody."""
        status = self._companion.status_line(now_s) if self._report.wants_status(steady_s) else None
        self._systemd.send(self._report.ticked(steady_s, status))

    def _stop(self) -> None:
        self._stops += 1
        self._systemd.send(["STOPPING=1"])

    def _receive(self, link: LinkName, datagram: bytes) -> None:
        self._companion.receive(link, datagram, self._clock())
        self._flush()

    def _flush(self) -> None:
        for link, frame in self._companion.outbox():
            self._links[link].send(frame)
        for event in self._companion.events():
            _log.log(_LEVELS.get(event.severity, logging.ERROR), "%s", event.text)

    def _plan(self) -> None:
        """Start the planner when its slot has begun."""
        if self._planning:
            return
        job = self._companion.planning_job(self._clock())
        if job is None:
            return
        self._planning = True
        deadline = time.perf_counter() + (job.slot.deadline_s - self._clock())
        loop = asyncio.get_running_loop()
        future = loop.run_in_executor(self._thread, self._planner.plan, job.problem, Budget(deadline_s=deadline))
        future.add_done_callback(partial(self._planned, job))

    def _planned(self, job: PlanningJob, future: asyncio.Future[Plan]) -> None:
        self._planning = False
        if future.cancelled():
            return
        error = future.exception()
        if error is None:
            self._companion.planned(job, future.result(), self._clock())
        else:
            _log.error("planner failed", exc_info=error)
            self._companion.planning_failed(job, str(error) or type(error).__name__)
        self._flush()
