# ruff: noqa: E501 (the table of mistakes has one line for each)
"""A scenario file: what is right loads, what is wrong gets file, line, key path, value and what is allowed."""

import cmath
import math
import re
from pathlib import Path

import pytest

from onboard.config import ConfigError, Scenario, load_scenario
from onboard.config.polygon import contains, is_simple
from onboard.errors import OnboardError

SCENARIO = """\
name: small
mission:
  step_s: 0.5
  horizon: 12
  replan_steps: 2
  planning_time_s: 0.5
  fence: [[0.0, 0.0], [4.0, 0.0], [4.0, 8.0], [0.0, 8.0]]
  separation_m: 0.8
primitives: [[1.0, 0.0], [1.0, 1.0], [1.0, -1.0]]
sensor:
  range_std_m: 0.3
  bearing_std_deg: 5.0
  max_range_m: 1.0
targets:
  model: random_walk
  noise: 0.1
exploration:
  cell_m: 0.25
vehicles:
  - {id: 1, home: [1.0, 2.8], layer_m: 1.0}
  - {id: 2, home: [1.0, 4.0], layer_m: 1.7}
simulation:
  seed: 1
  ground_robots:
    count: 5
  radio: {range_m: 3.0, loss: 0.0}
"""


@pytest.fixture
def scenario_file(tmp_path):
    def write(content):
        path = tmp_path / "scenario.yaml"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def mistakes(path):
    """The error's lines without the file's name, which each must carry."""
    with pytest.raises(ConfigError) as caught:
        load_scenario(path)
    assert isinstance(caught.value, OnboardError)
    lines = str(caught.value).splitlines()
    assert all(line.startswith(str(path)) for line in lines)
    return [line.removeprefix(str(path)) for line in lines]


def test_the_small_scenario_is_right(scenario_file):
    scenario = load_scenario(scenario_file(SCENARIO))
    assert isinstance(scenario, Scenario)
    assert scenario.mission.epoch_s == 1.0
    assert [vehicle.id for vehicle in scenario.vehicles] == [1, 2]
    assert scenario.exploration.forget_after_s is None
    assert scenario.vehicle(2).autopilot_url == "udpin:127.0.0.1:14541"
    with pytest.raises(KeyError, match="no vehicle 7 in scenario small; it has 1, 2"):
        scenario.vehicle(7)


@pytest.mark.parametrize(
    "path", sorted((Path(__file__).parents[3] / "configs").glob("*.yaml")), ids=lambda path: path.name
)
def test_the_shipped_scenarios_load(path):
    load_scenario(path)


# (what is replaced, by what, what is said: line, key path, value, what is allowed)
BROKEN = {
    "negative": ("step_s: 0.5", "step_s: -0.5", ":3: mission.step_s: -0.5 should be greater than 0"),
    "text for number": ("horizon: 12", "horizon: twelve", ':4: mission.horizon: "twelve" should be a valid integer'),
    "fraction for integer": ("horizon: 12", "horizon: 12.5", ":4: mission.horizon: 12.5 should be a valid integer"),
    "boolean for number": ("horizon: 12", "horizon: true", ":4: mission.horizon: true should be a valid integer"),
    "null for number": ("horizon: 12", "horizon:", ":4: mission.horizon: null should be a valid integer"),
    "too many steps": ("horizon: 12", "horizon: 65", ":4: mission.horizon: 65 should be less than or equal to 64"),
    "not a number": ("step_s: 0.5", "step_s: .nan", ":3: mission.step_s: .nan is not a finite number"),
    "infinite": ("loss: 0.0", "loss: -.inf", ":26: simulation.radio.loss: -.inf is not a finite number"),
    "exponent": (
        "step_s: 0.5",
        "step_s: 5e-1",
        ':3: mission.step_s: "5e-1" should be a valid number; YAML takes an exponent only after a decimal point and '
        "with a sign, as in 1.0e-3",
    ),
    "misspelt key": (
        "  cell_m: 0.25",
        "  cel_m: 0.25",
        ":18: exploration.cel_m: unknown key; known here are "
        "cell_m, forget_after_s, max_landmarks, landmark_sigma_m, landmark_patience_s",
    ),
    "missing key": ("  max_range_m: 1.0\n", "", ":10: sensor.max_range_m: is missing"),
    "obstacle that crosses itself": (
        "  separation_m: 0.8",
        "  obstacles:\n    - [[1, 1], [2, 2], [2, 1], [1, 2]]",
        ":9: mission.obstacles[0]: an obstacle has at least three different corners and does not cross itself",
    ),
    "obstacle of two corners": ("  separation_m: 0.8", "  obstacles: [[[1, 1], [2, 2]]]", ":8: mission.obstacles[0]: an obstacle has at least three different corners and does not cross itself"),
    "obstacle outside": ("  separation_m: 0.8", "  obstacles: [[[5, 1], [6, 1], [6, 2]]]", ":8: mission.obstacles[0]: lies outside the fence; corners are [north m, east m]"),
    "obstacle over a home": ("  separation_m: 0.8", "  obstacles: [[[0.5, 3], [0.8, 3], [0.8, 5]]]", ":20: vehicles[0].home: [1.0, 2.8] is in an obstacle or nearer to it than mission.obstacle_clearance_m = 0.3, in cells of exploration.cell_m = 0.25"),
    "negative clearance": ("  separation_m: 0.8", "  obstacle_clearance_m: -1", ":8: mission.obstacle_clearance_m: -1 should be greater than or equal to 0"),
    "key twice": ("  horizon: 12", "  horizon: 12\n  horizon: 12", ":5: mission.horizon: this key stands twice in one mapping"),
    "key that is no name": ("  seed: 1", "  1: seed", ":23: simulation: 1 is not a name; keys are text"),
    "merge key": ("  seed: 1", "  <<: {seed: 2}", ":23: simulation: << is not a name; keys are text"),
    "number for section": ("targets:\n  model: random_walk\n  noise: 0.1", "targets: 3", ":14: targets: 3 should be a mapping of keys"),
    "list for section": ("targets:\n  model: random_walk\n  noise: 0.1", "targets: [3]", ":14: targets: should be a mapping of keys"),
    "mapping for list": ("  horizon: 12", "  horizon: {a: 1}", ":4: mission.horizon: should be a valid integer"),
    "choice": ("random_walk", "randomwalk", ":15: targets.model: \"randomwalk\" should be 'double_integrator', 'random_walk' or 'static'"),
    "crossing fence": ("[4.0, 8.0], [0.0, 8.0]]", "[0.0, 8.0], [4.0, 8.0]]", ":7: mission.fence: a fence has at least three different corners and does not cross itself"),
    "three numbers for a corner": ("[0.0, 8.0]]", "[0.0, 8.0, 1.0]]", ":7: mission.fence[3]: should have at most 2 entries, not 3"),
    "text in a corner": ("[0.0, 8.0]]", "[0.0, x]]", ':7: mission.fence[3][1]: "x" should be a valid number'),
    "replan beyond horizon": ("replan_steps: 2", "replan_steps: 13", ":5: mission.replan_steps: 13 is beyond the horizon of 12 steps"),
    "planning longer than an epoch": ("planning_time_s: 0.5", "planning_time_s: 3.0", ":6: mission.planning_time_s: 3 and planning_lead_s = 0.03 do not fit between epochs, replan_steps x step_s = 1 s"),
    "id twice": ("id: 2", "id: 1", ":21: vehicles[1].id: 1 is also vehicles[0]'s; every vehicle has its own"),
    "id of a ground station": ("id: 2", "id: 255", ":21: vehicles[1].id: 255 should be less than or equal to 200"),
    "bridge with a vehicle's id": ("  seed: 1", "  seed: 1\n  system_id: 2", ":24: simulation.system_id: 2 is also a vehicle's id"),
    "home outside": ("[1.0, 2.8]", "[9.0, 2.8]", ":20: vehicles[0].home: [9.0, 2.8] is outside the fence"),
    "homes too close": ("[1.0, 2.8]", "[1.0, 3.9]", ":21: vehicles[1].home: [1.0, 4.0] is 0.10 m from vehicle 1's home; separation_m asks for 0.8"),
    "no vehicle": (SCENARIO[SCENARIO.index("vehicles:") : SCENARIO.index("simulation:")], "vehicles: []\n", ":19: vehicles: should have at least 1 entries, not 0"),
    "backward primitive": ("[[1.0, 0.0], ", "[[-1.0, 0.0], ", ":9: primitives: [-1.0, 0.0]: speeds, the first number of [m/s, rad/s], are not negative"),
    "primitive twice": ("[1.0, 1.0]", "[1.0, 0.0]", ":9: primitives: [1.0, 0.0] is listed twice"),
    "link": ("layer_m: 1.7", "layer_m: 1.7, links: {peers: 'tcp:host:1'}", ':21: vehicles[1].links.peers: "tcp:host:1" should be udpin:HOST:PORT, udpout:HOST:PORT or mcast:GROUP:PORT'),
    "autopilot": ("layer_m: 1.7", "layer_m: 1.7, autopilot: copter", ':21: vehicles[1].autopilot: "copter" should be \'px4\' or \'ardupilot\''),
    "port": ("layer_m: 1.7", "layer_m: 1.7, links: {peers: 'udpin:host:99999'}", ':21: vehicles[1].links.peers: "udpin:host:99999" has the port 99999; ports are 1 to 65535'),
    "two listeners on one port": ("layer_m: 1.7", "layer_m: 1.7, links: {sensor: 'udpin:127.0.0.1:14740'}", ":21: vehicles[1].links.sensor: udpin:127.0.0.1:14740 is also vehicles[0].links.sensor; every link has its own"),
    "listener on the ground's port": ("layer_m: 1.7", "layer_m: 1.7, links: {sensor: 'udpin:127.0.0.1:14550'}", ":21: vehicles[1].links.sensor: udpin:127.0.0.1:14550 is also ground.url; every link has its own"),
    "primitive too fast": ("[[1.0, 0.0], ", "[[9.0, 0.0], ", ":9: primitives[0]: 9.0 m/s is beyond simulation.vehicles.max_speed_m_s = 3.0"),
    "primitive turns too fast": ("[1.0, -1.0]", "[1.0, -9.0]", ":9: primitives[2]: -9.0 rad/s is beyond simulation.vehicles.max_yaw_rate_rad_s = 3.5"),
    "unknown type": ("layer_m: 1.7", "layer_m: 1.7, type: big", ":21: vehicles[1].type: big is not in vehicle_types; known are default"),
    "type too slow": ("vehicles:", "vehicle_types: {default: {max_speed_m_s: 0.5}}\nvehicles:", ":9: primitives[0]: 1.0 m/s is beyond max_speed_m_s = 0.5 of vehicle type default"),
    "probability": ("loss: 0.0", "loss: 1.5", ":26: simulation.radio.loss: 1.5 should be less than or equal to 1"),
    "name": ("name: small", "name: my lab", ':1: name: "my lab" should have letters, digits, dots, dashes and underscores only'),
    "date": ("name: small", "name: 2020-01-01", ":1: name: 2020-01-01 is neither a number, text, true, false nor null; quote text"),
    "parameter": ("  seed: 1", "  seed: 1\n  parameters: {A: x}", ':24: simulation.parameters.A: "x" should be a valid integer, or "x" should be a valid number'),
    "parameter name": ("  seed: 1", "  seed: 1\n  parameters: {A_NAME_OF_17_CHARS: 1}", ":24: simulation.parameters.A_NAME_OF_17_CHARS: as a name it should have at most 16 characters"),
    "starts": ("count: 5", "count: 5\n    starts: [[1.0, 1.0]]", ":26: simulation.ground_robots.starts: lists 1 places for count = 5 robots"),
    "speeds": ("count: 5", "count: 5\n    cruise_speed_m_s: [0.9, 0.2]", ":26: simulation.ground_robots.cruise_speed_m_s: [0.9, 0.2] should be [lowest, highest], lowest <= highest <= max_speed_m_s = 1.4"),
    "cells that fill the memory": ("[4.0, 0.0], [4.0, 8.0]", "[4000.0, 0.0], [4000.0, 4000.0]", ":18: exploration.cell_m: 0.25 divides the fence into 251001 tiles of 32 x 32 cells; at most 3000 fit"),
    "python object": ("name: small", "name: !!python/object/apply:os.getcwd []", ":1: name: the tag tag:yaml.org,2002:python/object/apply:os.getcwd has no meaning here"),
    "unknown tag": ("name: small", "name: !color red", ":1: name: red cannot be read"),
    "undefined alias": ("name: small", "name: *other", ":1: not valid YAML: found undefined alias 'other'"),
    "bracket": ("horizon: 12", "horizon: [12", ":5: not valid YAML: expected ',' or ']', but got ':'"),
    "tabulator": ("  horizon", "\thorizon", ":4: not valid YAML: found character '\\t' that cannot start any token"),
    "control character": ("name: small", "name: \x01", ": not valid YAML: special characters are not allowed"),
}  # fmt: skip


@pytest.mark.parametrize("case", BROKEN)
def test_each_mistake_has_its_clear_error(case, scenario_file):
    old, new, said = BROKEN[case]
    assert SCENARIO.count(old) >= 1
    assert mistakes(scenario_file(SCENARIO.replace(old, new, 1))) == [said]


def test_all_independent_mistakes_are_listed_in_the_order_of_the_file(scenario_file):
    broken = SCENARIO.replace("step_s: 0.5", "step_s: 0").replace("id: 2", "id: x").replace("loss: 0.0", "los: 0.0")
    said = mistakes(scenario_file(broken))
    assert [re.match(r":(\d+): ([^:]+):", line).groups() for line in said] == [
        ("3", "mission.step_s"),
        ("21", "vehicles[1].id"),
        ("26", "simulation.radio.los"),
    ]


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ("", ": a scenario is a mapping of keys (name, mission, vehicles, …)"),
        ("- 1\n- 2\n", ": a scenario is a mapping of keys (name, mission, vehicles, …)"),
        ("just text", ": a scenario is a mapping of keys (name, mission, vehicles, …)"),
        ("a: 1\n---\nb: 2\n", ":2: not valid YAML: but found another document"),
        (b"name: \xff\xfe", ": not UTF-8 text at byte 6"),
        ("#" * 300_000, ": larger than 250000 bytes; a scenario has a few hundred lines"),
    ],
)
def test_files_that_are_no_scenario(content, said, scenario_file):
    assert mistakes(scenario_file(content)) == [said]


def test_files_that_cannot_be_read(tmp_path):
    assert mistakes(tmp_path / "none.yaml") == [": no such file"]
    assert mistakes(tmp_path) == [": cannot be read: Is a directory"]


# Hostile files


def test_aliases_may_be_used(scenario_file):
    text = SCENARIO.replace("step_s: 0.5", "step_s: &half 0.5").replace(
        "planning_time_s: 0.5", "planning_time_s: *half"
    )
    assert load_scenario(scenario_file(text)).mission.planning_time_s == 0.5


def test_a_bomb_of_nested_aliases_is_defused(scenario_file):
    """Nine levels of nine aliases each stand for 387 million values."""
    levels = "".join(f"b{k}: &b{k} [{', '.join([f'*b{k - 1}'] * 9)}]\n" for k in range(1, 10))
    (said,) = mistakes(scenario_file(f"b0: &b0 x\n{levels}"))
    assert "too much data up to here; are aliases (*name) nested in each other?" in said


def test_a_bomb_of_one_long_text_is_defused(scenario_file):
    """A few thousand aliases of one text of 100 kB would be hundreds of megabytes."""
    text = f"a: &a {'x' * 100_000}\nb: [{', '.join(['*a'] * 5000)}]\n"
    (said,) = mistakes(scenario_file(text))
    assert said.startswith(":1: b[")
    assert "too much data" in said


def test_an_alias_of_itself_ends(scenario_file):
    (said,) = mistakes(scenario_file("name: &a [*a]\n"))
    assert said.endswith("nested more than 20 levels deep, or an alias of itself")


@pytest.mark.parametrize("depth", [30, 50_000])
def test_deep_nesting_ends(depth, scenario_file):
    (said,) = mistakes(scenario_file(f"name: {'[' * depth}{']' * depth}\n"))
    assert "nested more than 20 levels deep" in said


def test_long_values_are_cut(scenario_file):
    (said,) = mistakes(scenario_file(SCENARIO.replace("name: small", "name: " + "1" * 5000)))
    assert said == f":1: name: {'1' * 60}… (5000 characters) cannot be read"
    (said,) = mistakes(scenario_file(SCENARIO.replace("name: small", "name: " + "n" * 5000)))
    assert len(said) < 200
    assert said.endswith("should have at most 64 characters")


# Polygons


def test_contains_is_the_winding_of_the_boundary():
    """Oracle: a point is inside when the corners' directions wind around it once."""
    corners = [(-3.0, -5.0), (6.0, -5.0), (6.0, 1.0), (2.0, 1.0), (2.0, 7.0), (-3.0, 7.0)]
    found = set()
    for i in range(-40, 70, 3):
        for j in range(-60, 80, 3):
            point = (i / 10 + 0.013, j / 10 + 0.017)
            at = [complex(north - point[0], east - point[1]) for north, east in corners]
            turn = sum(cmath.phase(b / a) for a, b in zip(at, [*at[1:], at[0]], strict=True))
            inside = abs(turn) > math.pi
            assert contains(corners, point) == inside
            found.add(inside)
    assert found == {True, False}


@pytest.mark.parametrize(
    ("corners", "simple"),
    [
        ([(0, 0), (1, 0), (1, 1), (0, 1)], True),
        ([(0, 0), (2, 0), (1, 1)], True),
        ([(0, 0), (1, 0)], False),
        ([(0, 0), (1, 1), (2, 2)], False),
        ([(0, 0), (1, 1), (1, 0), (0, 1)], False),
        ([(0, 0), (4, 0), (4, 4), (2, 0), (0, 4)], False),  # a corner on another edge
        ([(0, 0), (1, 0), (1, 1), (0, 0), (0, 1)], False),
    ],
)
def test_simple_polygons(corners, simple):
    assert is_simple(corners) == simple
