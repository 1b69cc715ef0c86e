"""What the script makes of the processes of a flight: signals at their times, and a real child killed and restarted."""

import asyncio
import json
import sys
from pathlib import Path

import pytest
import yaml

from gcs.launcher import FlightOptions, Programs, fly
from gcs.process_faults import BRIDGE, Action, Order, ProcessFaults
from onboard.config import load_scenario
from onboard.config.faults import Component, FaultConfig, FaultType

FAKES = Path(__file__).parent / "fakes"
VEHICLES = {"vehicle1": 1, "vehicle2": 2}


def fault(component, kind, vehicles=(), from_s=1.0, until_s=2.0, since="boot", **parameters):
    return FaultConfig(
        component=component,
        type=kind,
        vehicles=vehicles,
        since=since,
        from_s=from_s,
        until_s=until_s,
        parameters=parameters,
    )


def orders(faults, times):
    return [(time_s, action.process, action.order) for time_s in times for action in faults.due(time_s)]


def test_processes_are_killed_stopped_and_brought_back_at_their_times():
    script = [
        fault(Component.PROCESS, FaultType.OFF, (2,)),
        fault(Component.PROCESS, FaultType.STUCK, (1,), from_s=1.5),
        fault(Component.BRIDGE, FaultType.STUCK, since="takeoff", until_s=None),
        fault(Component.RADIO, FaultType.OFF),
    ]
    faults = ProcessFaults(script, VEHICLES, 100.0)
    assert faults.needed
    assert orders(faults, (100.0, 100.9, 101.0, 101.2, 101.5, 102.0, 110.0)) == [
        (101.0, "vehicle2", Order.KILL),
        (101.5, "vehicle1", Order.STOP),
        (102.0, "vehicle1", Order.CONTINUE),
        (102.0, "vehicle2", Order.START),
    ]
    faults.schedule.take_off(200.0)
    assert orders(faults, (200.9, 201.0, 999.0)) == [(201.0, BRIDGE, Order.STOP)]
    assert not ProcessFaults([fault(Component.RADIO, FaultType.OFF)], VEHICLES, 100.0).needed


def test_a_slow_process_runs_for_its_share_of_the_time():
    faults = ProcessFaults([fault(Component.PROCESS, FaultType.SLOW, (1,), share=0.3)], VEHICLES, 100.0)
    running, ran = True, 0
    for k in range(3000):
        for action in faults.due(100.0 + 1e-3 * k):
            assert action.process == "vehicle1"
            running = action.order is Order.CONTINUE
        ran += running and 1000 <= k < 2000
    assert running
    assert ran == pytest.approx(300, abs=15)


def test_who_is_dead_is_started_even_if_it_is_to_be_stopped_then():
    script = [
        fault(Component.PROCESS, FaultType.OFF, (1,)),
        fault(Component.PROCESS, FaultType.STUCK, (1,), from_s=1.5, until_s=3.0),
    ]
    faults = ProcessFaults(script, VEHICLES, 100.0)
    faults.due(101.0)
    assert faults.killed("vehicle1")
    assert faults.due(101.6) == []
    assert faults.due(102.0) == [Action("vehicle1", Order.START)]
    assert faults.due(102.1) == [Action("vehicle1", Order.STOP)]
    assert not faults.killed("vehicle1")


class Watching:
    def __init__(self):
        self.texts = []

    def show(self, team, phase, time_left_s):
        pass

    def event(self, event):
        self.texts.append(event.text)


async def test_a_flight_kills_and_restarts_a_process_as_scripted_and_ends_well(own_ports, tmp_path):
    data = yaml.safe_load(own_ports.read_text())
    data["simulation"]["faults"] = [
        {"component": "process", "type": "off", "vehicles": [2], "since": "boot", "from_s": 0.3, "until_s": 0.8}
    ]
    config = tmp_path / "faulty.yaml"
    config.write_text(json.dumps(data))
    started = []

    def onboard(vehicle):
        started.append(vehicle)
        return [sys.executable, str(FAKES / "fake_onboard.py"), str(config), str(vehicle)]

    programs = Programs(
        warm_up=[sys.executable, "-c", "pass"],
        bridge=[sys.executable, str(FAKES / "fake_bridge.py"), str(config)],
        onboard=onboard,
    )
    watching = Watching()
    options = FlightOptions(config, load_scenario(config), 0.5, 7, None, "1.2.3")
    result = await asyncio.wait_for(fly(options, watching, programs), 60.0)
    assert sorted(started) == [1, 2, 2]
    assert "fault begins: process off, vehicles 2, for 0.5 s" in watching.texts
    assert "fault ends: process off, vehicles 2" in watching.texts
    assert result.problems == ()
