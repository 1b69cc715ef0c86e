"""A session against a simulated autopilot, in virtual time."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol import dialect as mavlink
from sim_bridge.autopilot import FIRMWARES, SimulatedAutopilot
from sim_bridge.autopilot.links import LinkName
from sim_bridge.conformance.catalogue import Catalogue, Family, Position
from sim_bridge.conformance.mocap_feed import Truth
from sim_bridge.conformance.session import Plan, Session
from sim_bridge.vehicle import Vehicle

__all__ = ["run_simulated"]

STEP_S = 0.005
ALIGNMENT_S = {Family.PX4: 33.0, Family.ARDUPILOT: 8.0}
"""From the boot until tilt and heading are known, s, so that the autopilot can be armed when the recorded one could."""
SYSTEM_ID = 1
_LIMIT_S = 3600.0


def run_simulated(
    catalogue: Catalogue, plan: Plan, *, seed: int = 1, watch: Callable[[Session], None] | None = None
) -> Session:
    """Perform a plan against a simulated autopilot of the catalogue's family, with GPS or without as the plan says.

    Args:
        catalogue: What is asked and expected.
        plan: Which entries.
        seed: Of the sensors' errors.
        watch: Called after each step of time.
    """
    session = Session(catalogue, plan)
    vehicle = Vehicle(VehicleDynamicsConfig(), (0.0, 0.0, 0.0), 0.0, rng=np.random.default_rng((seed, 1)))
    indoors = plan.position is Position.MOCAP
    autopilot = SimulatedAutopilot(
        SYSTEM_ID,
        vehicle,
        origin=None if indoors else OriginConfig(),
        parameters=FIRMWARES[catalogue.family.value].indoor_parameters if indoors else {},
        rng=np.random.default_rng((seed, 2)),
        boot_time_s=0.0,
        alignment_s=ALIGNMENT_S[catalogue.family],
        firmware=catalogue.family.value,
    )
    link: LinkName = "gcs" if plan.link == "gcs" else "onboard"
    steps = 0
    while not session.finished and steps * STEP_S < _LIMIT_S:
        steps += 1
        time_s = steps * STEP_S
        autopilot.step(time_s, STEP_S)
        if session.dialogue.feed is not None:
            session.dialogue.feed.see(_truth(vehicle), time_s)
        session.advance(time_s)
        _exchange(session, autopilot, link, time_s)
        if watch is not None:
            watch(session)
    return session


def _truth(vehicle: Vehicle) -> Truth:
    half_yaw = 0.5 * vehicle.yaw_rad
    return Truth(
        (vehicle.north_m, vehicle.east_m, vehicle.down_m),
        (vehicle.velocity_north_m_s, vehicle.velocity_east_m_s, vehicle.velocity_down_m_s),
        (math.cos(half_yaw), 0.0, 0.0, math.sin(half_yaw)),
    )


def _exchange(session: Session, autopilot: SimulatedAutopilot, link: LinkName, time_s: float) -> None:
    """Carry messages both ways until nobody has anything to say at this time."""
    quiet = False
    while not quiet:
        quiet = True
        for name, message in autopilot.outbox():
            if name == link:
                quiet = False
                _from(message, autopilot.system_id, mavlink.MAV_COMP_ID_AUTOPILOT1)
                session.receive(message, time_s)
        for outgoing in session.outbox():
            quiet = False
            _from(outgoing.message, *outgoing.source)
            autopilot.receive(outgoing.message, link, time_s)


def _from(message: mavlink.MAVLink_message, system: int, component: int) -> None:
    header = message.get_header()
    header.srcSystem, header.srcComponent = system, component
