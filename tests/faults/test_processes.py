"""The worst faults in real processes: ``arvi fly`` with the fault on the scenario's script; ``make faults`` runs these.

Each flight takes about a minute, on PX4's default ports, so they are not in ``make test``.
"""

import json
import math
import random
import subprocess
import sys
from itertools import combinations
from pathlib import Path

import pytest
import yaml

from gcs.recording.tlog import read_tlog
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec, message_id
from sim_bridge.faults import TAKEN_OFF_M

pytestmark = pytest.mark.faults

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"
BEGIN_S = 14.0
"""Since takeoff: 9 s after step 0 at the latest."""


class Flown:
    """A flight's exit code, texts, summary and recording."""

    def __init__(self, folder, *faults):
        data = yaml.safe_load(LAB.read_text(encoding="utf-8"))
        data["simulation"]["faults"] = [{"from_s": BEGIN_S} | fault for fault in faults]
        config, summary = folder / "faulty.yaml", folder / "summary.json"
        config.write_text(json.dumps(data), encoding="utf-8")
        command = [sys.executable, "-m", "gcs", "fly", str(config), "--duration", "24", "--headless"]
        finished = subprocess.run(
            [*command, "--json", str(summary), "--record", str(folder / "flights")],
            capture_output=True,
            text=True,
            timeout=240,
            check=False,
            cwd=LAB.parents[1],
        )
        self.code, self.text = finished.returncode, finished.stdout + finished.stderr
        self.summary = json.loads(summary.read_text()) if summary.exists() else None
        self._recording = folder / "flights"
        print(self.text)

    def vehicle(self, number):
        return self.summary["vehicles"][number - 1]

    def at(self, text):
        """Where a text comes first in what was told; infinity if nowhere."""
        place = self.text.find(text)
        return place if place >= 0 else math.inf

    def failed_safe(self, number):
        """Where its autopilot began to land it without having been told to by anybody; infinity if nowhere."""
        lands = self.at(f"vehicle {number}: mode OFFBOARD → LAND")
        return lands if lands < self.at(f"vehicle {number}: landing ordered") else math.inf

    def check_apart_but_for_the_dead(self, killed_s):
        """Nobody comes near to anybody while either is flown by its process; killed when, s since takeoff."""
        (path,) = self._recording.glob("*/bridge.tlog")
        codec = Codec(99, 0)
        places: dict[int, tuple[float, float, float]] = {}
        took_off_s = math.inf
        for time_usec, frame in read_tlog(path):
            if message_id(frame) != mavlink.MAVLINK_MSG_ID_VEHICLE_TRUTH:
                continue
            for truth in codec.decode(frame):
                places[truth.vehicle] = (truth.north, truth.east, truth.down)
                if truth.down < -TAKEN_OFF_M:
                    took_off_s = min(took_off_s, time_usec * 1e-6)
            elapsed_s = time_usec * 1e-6 - took_off_s
            dead = {number for number, at_s in killed_s.items() if elapsed_s > at_s}
            for one, other in combinations(places, 2):
                assert {one, other} <= dead or math.dist(places[one], places[other]) >= 0.5, (one, other, elapsed_s)
        assert took_off_s < math.inf

    def check_all_down(self, *numbers):
        for number in numbers:
            assert self.vehicle(number)["landed"], number
            assert self.vehicle(number)["disarmed"], number

    def check_all_down_and_apart(self, *numbers):
        self.check_all_down(*numbers)
        for number in numbers:
            assert self.vehicle(number)["min_separation_m"] >= 0.5, number


@pytest.fixture
def fly(tmp_path):
    return lambda *faults: Flown(tmp_path, *faults)


def fault(component, kind, length_s, vehicles=(2,), **parameters):
    until = {} if length_s is None else {"until_s": BEGIN_S + length_s}
    return {"component": component, "type": kind, "vehicles": list(vehicles), "parameters": parameters} | until


HARMLESS = {
    "radio: 30 % lost, jitter 100 ms": (
        fault("radio", "intermittent", 10.0, (), loss=0.3),
        fault("radio", "delayed", 10.0, (), delay_s=0.0, jitter_s=0.1),
    ),
    "radio: partition": (fault("radio", "off", 10.0),),
    "radio: doubled, reordered, damaged": (fault("radio", "wrong", 8.0, ()), fault("radio", "garbage", 8.0, ())),
    "process: stopped for 0.5 s": (fault("process", "stuck", 0.5),),
    "bridge: stopped for 0.2 s": (fault("bridge", "stuck", 0.2, ()),),
    "mocap: off for 1.5 s": (fault("mocap", "off", 1.5),),
    "detector: ghosts": (fault("detector", "garbage", 8.0, ()),),
    "autopilot link: 30 % lost": (fault("autopilot_link", "intermittent", 8.0),),
}


@pytest.mark.parametrize("faults", HARMLESS.values(), ids=HARMLESS.keys())
def test_the_team_flies_on(fly, faults):
    flown = fly(*faults)
    assert flown.code == 0
    flown.check_all_down_and_apart(1, 2, 3)
    assert flown.summary["discovered"] >= 3
    assert "failsafe" not in flown.text.lower()
    for entry in faults:
        assert f"fault begins: {entry['component']} {entry['type']}" in flown.text


def test_a_killed_process_leaves_its_vehicle_in_its_autopilots_failsafe_and_the_others_flying(fly):
    flown = fly(fault("process", "off", None))
    assert flown.failed_safe(2) < math.inf
    assert "vehicle 2: Disarmed by landing" in flown.text
    assert flown.failed_safe(1) == flown.failed_safe(3) == math.inf
    flown.check_all_down_and_apart(1, 2, 3)


@pytest.mark.parametrize("seed", range(1, 18))
def test_any_process_may_be_killed_at_any_moment(fly, seed):
    """Each vehicle's once a flight, from its take-off to its landing: 51 moments in all.

    Two that nobody flies any more come down wherever they are; all others keep clear of them.
    """
    draw = random.Random(seed)
    moments = {number: draw.uniform(0.5, 38.0) for number in (1, 2, 3)}
    flown = fly(*(fault("process", "off", None, (number,)) | {"from_s": at_s} for number, at_s in moments.items()))
    for number in moments:
        killed = flown.at(f"fault begins: process off, vehicles {number}")
        assert flown.failed_safe(number) > killed, "whose process lives flies on"
        if killed < flown.at(f"vehicle {number}: landing ordered"):
            assert flown.failed_safe(number) < math.inf, "whose process is dead is landed by its autopilot"
    flown.check_all_down(1, 2, 3)
    flown.check_apart_but_for_the_dead(moments)


def test_a_process_that_starts_again_takes_its_vehicle_up_in_the_air(fly):
    flown = fly(fault("process", "off", 0.5, (3,)))
    rejoined = flown.at("vehicle 3: in the air in")
    assert flown.at("fault ends: process off, vehicles 3") < rejoined < math.inf
    assert "vehicle 3: HOLD -> TRACK" in flown.text[rejoined:]
    flown.check_all_down_and_apart(1, 2, 3)


def test_a_stopped_process_takes_its_vehicle_up_again(fly):
    flown = fly(fault("process", "stuck", 2.0))
    assert "vehicle 2: mode OFFBOARD → LAND" in flown.text
    assert "vehicle 2: mode LAND → OFFBOARD" in flown.text
    flown.check_all_down_and_apart(1, 2, 3)


def test_a_silent_autopilot_link_is_told(fly):
    flown = fly(fault("autopilot_link", "off", 6.0))
    assert "vehicle 2: autopilot link lost" in flown.text
    assert "vehicle 2: mode OFFBOARD → LAND" in flown.text
    flown.check_all_down_and_apart(1, 2, 3)


def test_without_the_bridge_the_flight_ends_and_leaves_nothing_behind(fly):
    flown = fly({"component": "bridge", "type": "off"})
    assert flown.code == 1
    assert "nothing is left to fly without the bridge" in flown.text
