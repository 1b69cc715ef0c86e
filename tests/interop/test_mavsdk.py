"""MAVSDK, a client that nobody here wrote, flies the simulated autopilots over UDP."""

import asyncio
import contextlib
import math

import pytest

from onboard.protocol.ardupilot_modes import CopterMode
from onboard.protocol.px4_modes import Px4Mode
from sim_bridge.autopilot.px4.parameters import INDOOR_PARAMETERS

pytest.importorskip("mavsdk")
from mavsdk.asyncio import ComponentType, Configuration, Mavsdk
from mavsdk.asyncio.plugins.action import ActionAsync, ActionError, ActionResult
from mavsdk.asyncio.plugins.mocap import AngleBody, Covariance, MocapAsync, PositionBody, VisionPositionEstimate
from mavsdk.asyncio.plugins.offboard import OffboardAsync, VelocityNedYaw
from mavsdk.asyncio.plugins.param import ParamAsync, ParamError
from mavsdk.asyncio.plugins.telemetry import FlightMode, LandedState, TelemetryAsync

pytestmark = pytest.mark.interop

PATIENCE_S = 20.0


@contextlib.asynccontextmanager
async def connected(simulation):
    """The simulation running, and MAVSDK connected to it as a companion computer."""
    mavsdk = Mavsdk(Configuration.create_with_component_type(ComponentType.COMPANION_COMPUTER))
    await mavsdk.add_any_connection(f"udpin://127.0.0.1:{simulation.port}")
    async with simulation.running():
        try:
            system = await mavsdk.first_autopilot(PATIENCE_S)
            assert system is not None, "MAVSDK has not recognised the autopilot"
            yield mavsdk, system
        finally:
            mavsdk.destroy()


async def until(subscription, wanted):
    """The first update that is as wanted."""
    async with asyncio.timeout(PATIENCE_S), contextlib.aclosing(subscription) as updates:
        async for update in updates:
            if wanted(update):
                return update
    raise AssertionError("the subscription ended")


async def fly_east(simulation, autopilot, offboard, telemetry):
    """Four seconds at 1 m/s east, climbing a little, nose east; what MAVSDK saw is what happened."""
    vehicle = autopilot.vehicle
    await offboard.set_velocity_ned(VelocityNedYaw(0.0, 0.0, 0.0, 0.0))
    await offboard.start()
    await until(telemetry.subscribe_flight_mode(), lambda mode: mode is FlightMode.OFFBOARD)
    start = vehicle.north_m, vehicle.east_m, simulation.time_s
    await offboard.set_velocity_ned(VelocityNedYaw(0.0, 1.0, -0.3, 90.0))
    report = await until(telemetry.subscribe_position_velocity_ned(), lambda _: simulation.time_s > start[2] + 4.0)
    flown_s = simulation.time_s - start[2]
    assert report.velocity.east_m_s == pytest.approx(1.0, abs=0.2)
    assert report.velocity.north_m_s == pytest.approx(0.0, abs=0.2)
    assert vehicle.velocity_east_m_s == pytest.approx(1.0, abs=0.2)
    assert vehicle.velocity_down_m_s == pytest.approx(-0.3, abs=0.2)
    assert vehicle.east_m - start[1] == pytest.approx(flown_s, abs=1.2)
    assert vehicle.north_m - start[0] == pytest.approx(0.0, abs=0.5)
    attitude = await until(telemetry.subscribe_attitude_euler(), lambda _: True)
    assert attitude.yaw_deg == pytest.approx(90.0, abs=5.0)
    assert math.degrees(vehicle.yaw_rad) == pytest.approx(90.0, abs=5.0)
    return report


async def land(autopilot, action, telemetry):
    await action.land()
    await until(telemetry.subscribe_landed_state(), lambda state: state is LandedState.LANDING)
    await until(telemetry.subscribe_armed(), lambda armed: not armed)
    assert autopilot.vehicle.on_ground
    assert not autopilot.armed


async def test_px4_takes_off_flies_offboard_and_lands(simulation):
    fleet = simulation()
    autopilot = fleet.add()
    async with connected(fleet) as (_, system):
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
        report = await fly_east(fleet, autopilot, offboard, telemetry)
        assert report.position.east_m == pytest.approx(vehicle.east_m, abs=1.0)
        assert autopilot.statistics.setpoint_gap_max_s < 0.5
        await offboard.stop()
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode is FlightMode.HOLD)
        await land(autopilot, action, telemetry)
        assert autopilot.mode is Px4Mode.LOITER


async def test_px4_refusals_reach_the_client(simulation):
    """Arming before the attitude is aligned, and OFFBOARD's parameters, as MAVSDK reports them."""
    fleet = simulation()
    autopilot = fleet.add(alignment_s=math.inf)
    async with connected(fleet) as (_, system):
        action, params = ActionAsync(system), ParamAsync(system)
        with pytest.raises(ActionError) as refused:
            await action.arm()
        assert ActionResult.COMMAND_DENIED.name in str(refused.value)
        assert not autopilot.armed
        assert await params.get_param_float("MPC_XY_VEL_MAX") == 12.0
        await params.set_param_int("COM_OBL_RC_ACT", 5)
        assert autopilot.parameters["COM_OBL_RC_ACT"] == 5


async def test_px4_flies_on_the_clients_motion_capture(simulation):
    """Without GPS: MAVSDK's mocap plugin is the only source of position."""
    fleet = simulation()
    autopilot = fleet.add(parameters=INDOOR_PARAMETERS)
    vehicle = autopilot.vehicle
    async with connected(fleet) as (_, system):
        action, mocap, telemetry = ActionAsync(system), MocapAsync(system), TelemetryAsync(system)
        with pytest.raises(ActionError):
            await action.arm()

        async def capture():
            while True:
                await mocap.set_vision_position_estimate(
                    VisionPositionEstimate(
                        0,
                        PositionBody(vehicle.north_m, vehicle.east_m, vehicle.down_m),
                        AngleBody(0.0, 0.0, vehicle.yaw_rad),
                        Covariance([math.nan]),
                        0,
                    )
                )
                await asyncio.sleep(0.02)

        capturing = asyncio.create_task(capture())
        try:
            await until(telemetry.subscribe_health(), lambda health: health.is_local_position_ok and health.is_armable)
            report = await until(telemetry.subscribe_position_velocity_ned(), lambda _: True)
            assert report.position.east_m == pytest.approx(vehicle.east_m, abs=0.05)
            await action.arm()
            await action.takeoff()
            await until(telemetry.subscribe_landed_state(), lambda state: state is LandedState.IN_AIR)
            assert vehicle.height_m == pytest.approx(2.5, abs=1.0)
            assert vehicle.east_m == pytest.approx(2.0, abs=0.3)
            await land(autopilot, action, telemetry)
        finally:
            capturing.cancel()
            with contextlib.suppress(asyncio.CancelledError):
                await capturing


async def test_several_vehicles_share_one_port(simulation):
    """Three on MAVSDK's one UDP port: commands and telemetry do not mix."""
    fleet = simulation(speed_up=1.5)
    autopilots = {number: fleet.add(number) for number in (1, 2, 3)}
    async with connected(fleet) as (mavsdk, _):
        async with asyncio.timeout(PATIENCE_S):
            while await mavsdk.system_count() < 3:
                await asyncio.sleep(0.1)
        systems = {await system.get_system_id(): system for system in await mavsdk.get_systems()}
        assert sorted(systems) == [1, 2, 3]
        for number, system in systems.items():
            place = await until(
                TelemetryAsync(system).subscribe_position_velocity_ned(), lambda report: report.position.east_m != 0.0
            )
            assert place.position.east_m == pytest.approx(autopilots[number].vehicle.east_m, abs=1.0)
        params = ParamAsync(systems[2])
        await params.set_param_float("MPC_XY_VEL_MAX", 3.0)
        assert [autopilots[number].parameters["MPC_XY_VEL_MAX"] for number in (1, 2, 3)] == [12.0, 3.0, 12.0]
        await until(TelemetryAsync(systems[3]).subscribe_health(), lambda health: health.is_armable)
        await ActionAsync(systems[3]).arm()
        assert [autopilots[number].armed for number in (1, 2, 3)] == [False, False, True]


async def test_ardupilot_takes_off_flies_guided_and_lands(simulation):
    fleet = simulation()
    autopilot = fleet.add(firmware="ardupilot")
    async with connected(fleet) as (_, system):
        vehicle = autopilot.vehicle
        action, offboard, telemetry = ActionAsync(system), OffboardAsync(system), TelemetryAsync(system)
        for ask in (
            telemetry.set_rate_position_velocity_ned(20.0),  # of itself ArduPilot sends hardly anything
            telemetry.set_rate_attitude_euler(20.0),
            telemetry.set_rate_landed_state(5.0),
        ):
            await ask
        # It exists only once there is an estimate; before, it would arm in STABILIZE and then refuse GUIDED.
        await until(telemetry.subscribe_position_velocity_ned(), lambda report: report.position.east_m != 0.0)
        await action.set_takeoff_altitude(3.0)
        await armed_when_ready(action)
        await until(telemetry.subscribe_armed(), bool)
        await action.takeoff()
        await until(telemetry.subscribe_landed_state(), lambda state: state is LandedState.IN_AIR)
        assert autopilot.mode == CopterMode.GUIDED
        assert vehicle.height_m == pytest.approx(3.0, abs=0.5)
        await fly_east(fleet, autopilot, offboard, telemetry)
        await offboard.stop()  # which is BRAKE there
        await until(telemetry.subscribe_flight_mode(), lambda mode: mode is not FlightMode.OFFBOARD)
        assert autopilot.mode == CopterMode.BRAKE
        await land(autopilot, action, telemetry)


async def armed_when_ready(action):
    """Arm, trying again as long as it is refused: MAVSDK's health never says that an ArduPilot may be armed."""
    async with asyncio.timeout(PATIENCE_S):
        while True:
            try:
                await action.arm()
            except ActionError:
                await asyncio.sleep(0.3)
            else:
                return


async def test_ardupilot_parameters_by_value(simulation):
    fleet = simulation()
    autopilot = fleet.add(firmware="ardupilot")
    async with connected(fleet) as (_, system):
        params = ParamAsync(system)
        assert await params.get_param_float("GUID_TIMEOUT") == 3.0
        await params.set_param_float("GUID_TIMEOUT", 1.5)
        assert autopilot.parameters["GUID_TIMEOUT"] == 1.5
        with pytest.raises(ParamError):
            await params.get_param_float("NO_SUCH")
