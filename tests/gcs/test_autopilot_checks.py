"""What an autopilot shows before a flight, against simulated autopilots in virtual time."""

from pathlib import Path

import pytest

from gcs.autopilot_checks import AutopilotWatch
from gcs.checks import Check, Outcome, is_go
from onboard.config import Scenario, load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from sim_bridge.autopilot import ONBOARD
from sim_bridge.bridge import Port, build_bridge


def alone(config: str) -> Scenario:
    """The first vehicle of a scenario, simulated, with nothing to look for."""
    whole = load_scenario(Path(f"configs/{config}.yaml"))
    assert whole.simulation is not None
    vehicle = whole.vehicles[0].model_copy(update={"external": None})
    robots = whole.simulation.ground_robots.model_copy(update={"count": 0})
    simulation = whole.simulation.model_copy(update={"ground_robots": robots, "physics_rate_hz": 100.0})
    return whole.model_copy(update={"vehicles": (vehicle,), "simulation": simulation})


LAB = alone("lab")
START_S = 1_800_000_000.0
TICK_S = 0.02


def look(
    fault: FaultConfig | None = None, *, scenario: Scenario = LAB, watched: Scenario | None = None
) -> dict[str, Check]:
    """The checks of vehicle 1 when it has been watched for a while, the last five seconds with a fault."""
    vehicle_id = 1
    watched = watched or scenario
    bridge = build_bridge(scenario, 1, START_S)
    watch = AutopilotWatch(watched, watched.vehicle(vehicle_id))
    autopilot, companion = Codec(vehicle_id, 1), Codec(vehicle_id, 191)
    enough_s = None
    for tick in range(1, 700):
        time_s = START_S + tick * TICK_S
        if tick == 400 and fault is not None:
            bridge.faults.inject(fault, time_s)
        bridge.advance(time_s)
        for port, sender, message in bridge.outbox():
            if port is Port.ONBOARD and sender == vehicle_id:
                for heard in autopilot.decode(autopilot.encode(message)):
                    watch.receive(heard, time_s)
        for message in watch.poll(time_s):
            for heard in companion.decode(companion.encode(message)):
                bridge.receive(vehicle_id, ONBOARD, heard, time_s)
        if enough_s is None and watch.seen_enough(time_s) and watch.link.preflight.done:
            enough_s = time_s
    assert enough_s is not None
    assert enough_s - START_S < 8.0, "an operator waits for this"
    checks = watch.checks(time_s)
    assert len({check.name for check in checks}) == len(checks)
    assert all(check.found and bool(check.wanted) == (check.outcome is not Outcome.PASS) for check in checks)
    return {check.name: check for check in checks}


def fault(component: Component, kind: FaultType, **parameters: float) -> FaultConfig:
    return FaultConfig(component=component, type=kind, from_s=0.0, parameters=parameters)


@pytest.mark.parametrize("config", ["lab", "lab_ardupilot"])
def test_a_vehicle_that_stands_ready_passes_everything(config: str) -> None:
    checks = look(scenario=alone(config))
    assert [str(check) for check in checks.values() if check.outcome is not Outcome.PASS] == []
    assert set(checks) >= {"link", "rate of ATTITUDE", "TIMESYNC", "position", "place", "battery", "ready"}
    assert "round trip" in checks["TIMESYNC"].found


@pytest.mark.parametrize(
    ("what", "name", "outcome", "told"),
    [
        (fault(Component.AUTOPILOT_LINK, FaultType.OFF), "link", Outcome.FAIL, "no heartbeat"),
        (fault(Component.AUTOPILOT_LINK, FaultType.INTERMITTENT, loss=0.35), "rate of ATTITUDE", Outcome.WARN, "Hz"),
        (fault(Component.AUTOPILOT_LINK, FaultType.INTERMITTENT, loss=0.9), "rate of ATTITUDE", Outcome.FAIL, "Hz"),
        (fault(Component.AUTOPILOT_LINK, FaultType.DELAYED, delay_s=0.1), "TIMESYNC", Outcome.WARN, "round trip 2"),
        (fault(Component.AUTOPILOT_LINK, FaultType.DELAYED, jitter_s=0.08), "TIMESYNC", Outcome.WARN, "steady"),
        (fault(Component.MOCAP, FaultType.OFF), "position", Outcome.FAIL, "wandered"),
        (fault(Component.BATTERY, FaultType.WRONG, remaining=0.5), "battery", Outcome.WARN, "50 %"),
        (fault(Component.BATTERY, FaultType.WRONG, remaining=0.2), "battery", Outcome.FAIL, "20 %"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_found_and_told(what: FaultConfig, name: str, outcome: Outcome, told: str) -> None:
    checks = look(what)
    assert checks[name].outcome is outcome
    assert told in checks[name].found
    assert is_go(checks.values()) == (outcome is not Outcome.FAIL)


def test_swapped_vehicles_and_another_autopilot_forbid_to_fly() -> None:
    own, second = load_scenario(Path("configs/lab.yaml")).vehicles[:2]
    swapped = tuple(a.model_copy(update={"home": b.home}) for a, b in ((own, second), (second, own)))
    place = look(watched=LAB.model_copy(update={"vehicles": swapped}))["place"]
    assert place.outcome is Outcome.FAIL
    assert "stands at vehicle 2's home" in place.found

    other = tuple(vehicle.model_copy(update={"autopilot": "ardupilot"}) for vehicle in LAB.vehicles)
    checks = look(watched=LAB.model_copy(update={"vehicles": other}))
    assert list(checks) == ["link"]
    assert checks["link"].wanted == "the scenario says ardupilot"


def test_an_estimate_that_never_changes_is_frozen() -> None:
    watch = AutopilotWatch(LAB, LAB.vehicles[0])
    codec = Codec(1, 1)
    for tick in range(100):
        time_s = START_S + 0.02 * tick
        for message in (
            mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, 81, 0, 3, 3),
            mavlink.MAVLink_attitude_message(20 * tick, 0.0, 0.0, 0.1, 0.0, 0.0, 0.0),
            mavlink.MAVLink_local_position_ned_message(20 * tick, 1.0, 2.8, 0.0, 0.0, 0.0, 0.0),
        ):
            for heard in codec.decode(codec.encode(message)):
                watch.receive(heard, time_s)
    position = next(check for check in watch.checks(time_s) if check.name == "position")
    assert position.outcome is Outcome.FAIL
    assert "frozen" in position.found
