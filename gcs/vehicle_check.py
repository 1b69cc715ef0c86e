"""Looks at vehicles' autopilots before a flight; reads, and on request sets, the parameters that plans depend on."""

from __future__ import annotations

import asyncio
import time
from dataclasses import dataclass

from gcs.autopilot_checks import AutopilotWatch
from gcs.checks import Check, is_go
from onboard.config import Scenario
from onboard.config.vehicle import VehicleConfig
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.preflight import Finding, Verdict
from onboard.links import COMPONENT
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.transport import Link, TransportError, open_link

__all__ = ["VehicleReport", "check_vehicle"]

HEARTBEAT_PATIENCE_S = 10.0
READ_PATIENCE_S = 30.0
TICK_S = 0.02


@dataclass(frozen=True)
class VehicleReport:
    """What was found on one vehicle.

    Attributes:
        vehicle_id: System id.
        url: Link of its autopilot.
        autopilot: Name of its family; empty if none was heard.
        problem: Why its parameters could not be checked; empty if they could.
        findings: Every requirement, as it holds now.
        changed: Parameters that were set: name → value that holds now.
        reboot: Whether one of these takes effect after a reboot only.
        checks: What else was looked at.
    """

    vehicle_id: int
    url: str
    autopilot: str
    problem: str
    findings: tuple[Finding, ...] = ()
    changed: tuple[tuple[str, float], ...] = ()
    reboot: bool = False
    checks: tuple[Check, ...] = ()

    @property
    def go(self) -> bool:
        """Whether the plan may be flown."""
        violated = any(finding.verdict is Verdict.WRONG for finding in self.findings)
        return not self.problem and not violated and is_go(self.checks)


class _Session:
    """An autopilot link with a socket, as the onboard process has one."""

    def __init__(self, scenario: Scenario, vehicle: VehicleConfig) -> None:
        self._watch = AutopilotWatch(scenario, vehicle)
        self.link = self._watch.link
        self._codec = Codec(vehicle.id, COMPONENT)
        self._socket: Link | None = None
        self._heartbeat_s = 0.0

    async def open(self, url: str) -> None:
        self._socket = await open_link(url, self._receive)

    def close(self) -> None:
        if self._socket is not None:
            self._socket.close()

    def checks(self) -> tuple[Check, ...]:
        """What is seen now, parameters apart."""
        return tuple(self._watch.checks(time.time()))

    def _receive(self, datagram: bytes) -> None:
        for message in self._codec.decode(datagram):
            self._watch.receive(message, time.time())

    async def until_settled(self) -> str:
        """Run the link until its check is done; what went wrong, if anything."""
        begin_s = time.time()
        while time.time() - begin_s < READ_PATIENCE_S:
            now_s = time.time()
            heard = self.link.alive(now_s)
            if not heard and now_s - begin_s > HEARTBEAT_PATIENCE_S:
                return f"no heartbeat within {HEARTBEAT_PATIENCE_S:.0f} s"
            self._send(now_s)
            if heard and self.link.preflight.done and not self.link.parameters.busy:
                if not self.link.preflight.answered:
                    return "the autopilot does not answer for its parameters"
                if self._watch.seen_enough(now_s):
                    return ""
            await asyncio.sleep(TICK_S)
        return f"its parameters were not read within {READ_PATIENCE_S:.0f} s"

    def _send(self, now_s: float) -> None:
        assert self._socket is not None
        out = self._watch.poll(now_s)
        if now_s - self._heartbeat_s >= 1.0:
            self._heartbeat_s = now_s
            out.append(
                mavlink.MAVLink_heartbeat_message(
                    mavlink.MAV_TYPE_ONBOARD_CONTROLLER,
                    mavlink.MAV_AUTOPILOT_INVALID,
                    0,
                    0,
                    mavlink.MAV_STATE_STANDBY,
                    3,
                )
            )
        for message in out:
            self._socket.send(self._codec.encode(message))


async def check_vehicle(scenario: Scenario, vehicle_id: int, *, mend: bool) -> VehicleReport:
    """Connect to a vehicle's autopilot as its onboard process would, and look at it.

    Args:
        scenario: What is to be flown.
        vehicle_id: Which of its vehicles.
        mend: Set what is not as it should be, and read it back; never on an armed vehicle.

    Raises:
        KeyError: The scenario has no such vehicle.
    """
    vehicle = scenario.vehicle(vehicle_id)
    url = vehicle.autopilot_url
    session = _Session(scenario, vehicle)
    try:
        await session.open(url)
    except TransportError as error:
        return VehicleReport(vehicle_id, url, "", str(error))
    try:
        problem = await session.until_settled()
        changed: tuple[Finding, ...] = ()
        if mend and not problem:
            if session.link.heard.armed:
                problem = "it is armed: nothing was set"
            else:
                changed = _mend(session.link)
                problem = await session.until_settled()
        return _report(session, vehicle, problem, changed)
    finally:
        session.close()


def _mend(link: AutopilotLink) -> tuple[Finding, ...]:
    """Ask for every value that is not as it should be; what was asked for."""
    wrong = tuple(
        finding for finding in link.preflight.findings() if finding.verdict in (Verdict.WRONG, Verdict.ADVICE)
    )
    for finding in wrong:
        if finding.parameter is not None:
            link.parameters.set(finding.parameter.name, finding.requirement.wanted.nearest(finding.parameter.value))
    return wrong


def _report(session: _Session, vehicle: VehicleConfig, problem: str, asked: tuple[Finding, ...]) -> VehicleReport:
    link = session.link
    heard = link.heard.autopilot is not None
    changed = []
    for finding in asked:
        now = link.parameters.values.get(finding.parameter.name) if finding.parameter is not None else None
        if now is not None and now != finding.parameter:
            changed.append((now.name, now.value))
    names = {name for name, _ in changed}
    reboot = any(finding.requirement.reboot and names & set(finding.requirement.names) for finding in asked)
    return VehicleReport(
        vehicle.id,
        vehicle.autopilot_url,
        link.behaviour.name if heard else "",
        problem,
        tuple(link.preflight.findings()) if heard and not problem else (),
        tuple(changed),
        reboot,
        session.checks(),
    )
