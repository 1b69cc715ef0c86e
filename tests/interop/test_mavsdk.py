"""MAVSDK, a client that nobody here wrote, flies the simulated autopilot over UDP."""

import asyncio
import contextlib
import math
import socket
import time

import numpy as np
import pytest

from onboard.config.simulation import OriginConfig, VehicleDynamicsConfig
from onboard.protocol.codec import Codec
from onboard.protocol.px4_modes import Px4Mode
from onboard.protocol.transport import open_link
from sim_bridge.autopilot import ONBOARD, SimulatedAutopilot
from sim_bridge.vehicle import Vehicle

pytest.importorskip("mavsdk")
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError, ActionResult
from mavsdk.asyncio.plugins.offboard import OffboardAsync, VelocityNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync

pytestmark = pytest.mark.interop

STEP_S = 0.005
SPEED_UP = 2.0
"""The vehicle lives so much faster than the client, to keep the test short; the client notices nothing."""

PATIENCE_S = 20.0


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


class Shell:
    """One autopilot on one UDP link: all that it takes to run the core."""

    def __init__(self, autopilot):
        self.autopilot = autopilot
        self.codec = Codec(autopilot.system_id, 1)
        self.started_s = time.monotonic()

    @property
    def now_s(self):
        return SPEED_UP * (time.monotonic() - self.started_s)

    def receive(self, datagram):
        for message in self.codec.decode(datagram):
            self.autopilot.receive(message, ONBOARD, self.autopilot.time_s)

    async def run(self, port):
        link = await open_link(f"udpout:127.0.0.1:{port}", self.receive)
        try:
            steps = 0
            while True:
                while steps * STEP_S < self.now_s:
                    steps += 1
                    self.autopilot.step(steps * STEP_S, STEP_S)
                    for name, message in self.autopilot.outbox():
                        if name == ONBOARD:
                            link.send(self.codec.encode(message))
                await asyncio.sleep(STEP_S / SPEED_UP)
        finally:
            link.close()


@contextlib.asynccontextmanager
async def flight(**options):
    """A simulated autopilot, and MAVSDK connected to it as a companion computer."""
    vehicle = Vehicle(VehicleDynamicsConfig(), (1.0, 2.0, 0.0), 0.5, rng=np.random.default_rng(1))
    autopilot = SimulatedAutopilot(
        1, vehicle, origin=OriginConfig(), parameters={}, rng=np.random.default_rng(2), boot_time_s=0.0, **options
    )
    port = free_port()
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    await mavsdk.add_any_connection(f"udpin://127.0.0.1:{port}")
    running = asyncio.create_task(Shell(autopilot).run(port))
    try:
        system = await mavsdk.first_autopilot(PATIENCE_S)
        assert system is not None, "MAVSDK has not recognised the autopilot"
        yield autopilot, system
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running
        mavsdk.destroy()


async def until(subscription, wanted):
    """The first update that is as wanted."""
    async with asyncio.timeout(PATIENCE_S), contextlib.aclosing(subscription) as updates:
        async for update in updates:
            if wanted(update):
                return update
    raise AssertionError("the subscription ended")


async def test_takes_off_flies_offboard_and_lands():
    async with flight() as (autopilot, system):
        vehicle = autopilot.vehicle
        action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
        await until(
            telemetry.subscribe_health(),
            lambda health: health.is_armable and health.is_local_position_ok and health.is_home_position_ok,
        )

        await action.set_takeoff_altitude(2.0)
        await action.arm()
        await until(telemetry.subscribe_armed(), bool)
        assert autopilot.armed
        await action.takeoff()
        await until(telemetry.subscribe_landed_state(), lambda state: state is LandedState.TAKING_OFF)
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode is FlightMode.HOLD)
        position = await until(telemetry.subscribe_position(), lambda _: True)
        assert position.relative_altitude_m == pytest.approx(2.0, abs=0.3)
        assert vehicle.height_m == pytest.approx(2.0, abs=0.5)

        await offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
        await offboard.start()
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode is FlightMode.OFFBOARD)
        start = vehicle.north_m, vehicle.east_m, autopilot.time_s
        await offboard.set_velocity_ned(VelocityNedYaw(0.0, 1.0, -0.3, 90.0))
        report = await until(
            telemetry.subscribe_position_velocity_ned(),
            lambda _: autopilot.time_s > start[2] + 4.0,
        )
        flown_s = autopilot.time_s - start[2]
        assert report.velocity.east_m_s == pytest.approx(1.0, abs=0.2)
        assert report.velocity.north_m_s == pytest.approx(0.0, abs=0.2)
        assert vehicle.velocity_east_m_s == pytest.approx(1.0, abs=0.2)
        assert vehicle.velocity_down_m_s == pytest.approx(-0.3, abs=0.2)
        assert vehicle.east_m - start[1] == pytest.approx(flown_s, abs=1.0)
        assert vehicle.north_m - start[0] == pytest.approx(0.0, abs=0.5)
        assert report.position.east_m == pytest.approx(vehicle.east_m, abs=1.0)
        attitude = await until(telemetry.subscribe_attitude_euler(), lambda _: True)
        assert attitude.yaw_deg == pytest.approx(90.0, abs=5.0)
        assert math.degrees(vehicle.yaw_rad) == pytest.approx(90.0, abs=5.0)
        assert autopilot.statistics.setpoint_gap_max_s < 0.5

        await offboard.stop()
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode is FlightMode.HOLD)
        await action.land()
        await until(telemetry.subscribe_landed_state(), lambda state: state is LandedState.LANDING)
        await until(telemetry.subscribe_armed(), lambda armed: not armed)
        assert vehicle.on_ground
        assert not autopilot.armed
        assert autopilot.mode is Px4Mode.LOITER


async def test_refusals_reach_the_client():
    """Arming before the attitude is aligned, and OFFBOARD's parameters, as MAVSDK reports them."""
    async with flight(alignment_s=math.inf) as (autopilot, system):
        action, params = ActionAsync(system), ParamAsync(system)
        with pytest.raises(ActionError) as refused:
            await action.arm()
        assert ActionResult.COMMAND_DENIED.name in str(refused.value)
        assert not autopilot.armed
        assert await params.get_param_float("MPC_XY_VEL_MAX") == 12.0
        await params.set_param_int("COM_OBL_RC_ACT", 5)
        assert autopilot.parameters["COM_OBL_RC_ACT"] == 5
