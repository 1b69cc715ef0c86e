"""What an onboard process says of itself once a step: PLANNER_STATUS."""

from __future__ import annotations

import math
from collections.abc import Mapping

from onboard.agent import Agent
from onboard.clock import usec
from onboard.counts import Counts
from onboard.flight.autopilot import AutopilotLink
from onboard.flight.machine import FlightMachine
from onboard.messages import FlightState
from onboard.mission import Mission
from onboard.protocol import dialect as mavlink
from onboard.whereabouts import Known

__all__ = ["planner_status", "status_line"]

_MAX_NEIGHBOURS = 32
_UNKNOWN = 255
_UINT8, _UINT32 = 0xFF, 0xFFFFFFFF


_UNKNOWN_PLACE = Known((math.nan, math.nan, math.nan), math.nan, (math.nan, math.nan))


def planner_status(
    time_s: float,
    mission: Mission | None,
    machine: FlightMachine,
    place: Known | None,
    counts: Counts,
    rejected: int,
    peer_loss: Mapping[int, float | None],
) -> mavlink.MAVLink_planner_status_message:
    """The status at a UNIX time; what is unknown is NaN.

    Args:
        time_s: UNIX time, s.
        mission: What is flown; None before the first start.
        machine: Flight states.
        place: Where the vehicle is, or was when that was last known.
        counts: What was done.
        rejected: Pieces of datagrams on all links that were no valid frame.
        peer_loss: Frames lost over frames sent, 0 to 1, by the peer that sent them.
    """
    agent = None if mission is None else mission.agent
    neighbours = agent.team.neighbours(time_s)[:_MAX_NEIGHBOURS] if agent is not None else ()
    group = agent.group(time_s) if agent is not None else None
    place = place or _UNKNOWN_PLACE
    error = machine.tracking_error_m(time_s)
    plan_age_s = machine.plan_age_s(time_s)
    return mavlink.MAVLink_planner_status_message(
        time_usec=usec(time_s),
        mission_start_usec=usec(mission.clock.start_s) if mission is not None else 0,
        north=place.position[0],
        east=place.position[1],
        down=place.position[2],
        yaw=place.yaw_rad,
        tracking_error=error if error is not None else math.nan,
        plan_age=plan_age_s if plan_age_s is not None else math.nan,
        setpoint_gap_max=counts.setpoint_gap_max_s,
        setpoints=counts.setpoints & _UINT32,
        plans=counts.plans & _UINT32,
        deadline_misses=counts.deadline_misses & _UINT32,
        peer_bytes_sent=counts.peer_bytes_sent & _UINT32,
        peer_bytes_received=counts.peer_bytes_received & _UINT32,
        detections=counts.detections & _UINT32,
        rejected=(counts.refused + rejected) & _UINT32,
        neighbours=[*neighbours, *[0] * (_MAX_NEIGHBOURS - len(neighbours))],
        state=int(machine.state),
        group_size=min(len(group.members), _UINT8) if group is not None else 1,
        group_order=min(group.order, _UINT8) if group is not None else 0,
        targets=min(len(agent.tracks), _UINT8) if agent is not None else 0,
        landmarks=min(agent.landmark_count, _UINT8) if agent is not None else 0,
        over_home=int(machine.over_home),
        neighbour_loss=_percent([peer_loss.get(neighbour) for neighbour in neighbours]),
        velocity_north=place.velocity[0],
        velocity_east=place.velocity[1],
        adrift=int(machine.adrift(time_s)),
    )


def status_line(time_s: float, machine: FlightMachine, autopilot: AutopilotLink, agent: Agent | None) -> str:
    """What it is doing at a UNIX time (s), in one line for whoever looks at the computer."""
    if machine.state in (FlightState.WAIT, FlightState.STANDBY):
        return f"{machine.state.name}: {autopilot.lacks(time_s) or 'ready to start'}"
    targets = f", {len(agent.tracks)} targets" if agent is not None else ""
    return f"{machine.state.name}, autopilot in {autopilot.mode_name}{targets}"


def _percent(shares: list[float | None]) -> list[int]:
    """Of each neighbour, %; what is unknown, and places without a neighbour, say so."""
    known = [_UNKNOWN if share is None else round(100.0 * share) for share in shares]
    return [*known, *[_UNKNOWN] * (_MAX_NEIGHBOURS - len(known))]
