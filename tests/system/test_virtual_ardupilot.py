"""The lab with ArduPilot instead of PX4, in virtual time: the same companions, which find out what they fly."""

import math
from pathlib import Path

import pytest

from onboard.config import Scenario, load_scenario
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.ardupilot_modes import CopterMode
from sim_bridge.virtual_team import VirtualTeam


@pytest.fixture(scope="module")
def lab() -> Scenario:
    data = load_scenario(Path("configs/lab.yaml")).model_dump()
    for vehicle in data["vehicles"]:
        vehicle["autopilot"] = "ardupilot"
    return Scenario.model_validate(data)


def test_the_lab_flies_on_ardupilot(lab: Scenario) -> None:
    """Armed and airborne without a human, the plans tracked, all targets found, landed."""
    team = VirtualTeam(lab, seed=1, plan_nodes=400)
    errors_m: list[float] = []
    modes: set[int] = set()

    def hear(heard) -> None:
        match heard.message:
            case mavlink.MAVLink_planner_status_message() if not math.isnan(heard.message.tracking_error):
                errors_m.append(heard.message.tracking_error)
            case mavlink.MAVLink_heartbeat_message() if heard.message.get_srcComponent() == 1:
                assert heard.message.autopilot == mavlink.MAV_AUTOPILOT_ARDUPILOTMEGA
                modes.add(heard.message.custom_mode)

    def all_in(state: FlightState) -> bool:
        return all(companion.machine.state is state for companion in team.companions.values())

    team.on_ground_message = hear
    team.until(lambda: all_in(FlightState.STANDBY), 30.0)
    seconds = math.ceil(team.time_s + lab.mission.takeoff_time_s)
    for vehicle_id in team.companions:
        team.command(
            mavlink.MAVLink_command_int_message(
                vehicle_id, 191, 0, mavlink.MAV_CMD_ARVI_START, 0, 0, 0, 0, 0, 0, seconds, 0, 0
            )
        )
    team.until(lambda: team.time_s > seconds, 30.0)
    team.run(30.0)
    assert all_in(FlightState.TRACK)
    assert math.sqrt(sum(error * error for error in errors_m) / len(errors_m)) < 0.25
    for companion in team.companions.values():
        assert companion.agent is not None
        assert set(companion.agent.tracks) == {1, 2, 3, 4, 5}
    for vehicle_id in team.companions:
        team.command(mavlink.MAVLink_command_long_message(vehicle_id, 191, mavlink.MAV_CMD_NAV_LAND, 0, *[0.0] * 7))
    team.until(lambda: all_in(FlightState.LANDED), 30.0)
    assert modes == {CopterMode.STABILIZE, CopterMode.GUIDED, CopterMode.LAND}
