"""The map's columns against a team whose messages are known; absurd telemetry breaks nothing."""

import math

import pytest

from gcs.dashboard.palette import ALARM, ESTIMATE, TWO_WAY
from gcs.dashboard.view import BEST, FUSED, MapBounds, MapView, estimate_columns
from onboard.protocol import dialect as mavlink

T0 = 1.5e9


@pytest.fixture
def view(scenario):
    return MapView(scenario)


def test_vehicles_are_where_they_say_north_up_east_right(fake_team, view):
    vehicles = view.layers(fake_team.monitor.state(T0)).vehicles
    assert vehicles["label"] == ["1", "2", "3"]
    assert (vehicles["x"], vehicles["y"]) == ([2.0, 3.0, 4.0], [1.0, 2.0, 3.0])
    assert vehicles["heading"][0] == pytest.approx(math.pi / 2 - 0.5, abs=1e-3)
    assert vehicles["place"][0] == "1.00 m N, 2.00 m E, 1.50 m high"
    assert vehicles["motion"][0] == "1.00 m/s, heading 29°"
    assert {len(values) for values in vehicles.values()} == {3}


def test_the_field_of_view_is_symmetric_about_the_heading(fake_team, scenario):
    sensor = scenario.sensor.model_copy(update={"fov_deg": 90.0})
    view = MapView(scenario.model_copy(update={"sensor": sensor}))
    vehicles = view.layers(fake_team.monitor.state(T0)).vehicles
    assert vehicles["fov_to"][0] - vehicles["fov_from"][0] == pytest.approx(math.pi / 2, abs=2e-3)
    assert vehicles["fov_to"][0] + vehicles["fov_from"][0] == pytest.approx(2 * vehicles["heading"][0], abs=2e-3)


def test_plans_begin_where_they_start_and_say_what_they_cost(fake_team, view):
    plans = view.layers(fake_team.monitor.state(T0)).plans
    assert (plans["xs"][1][0], plans["ys"][1][0]) == (3.0, 2.0)
    assert plans["quality"][0] == "cost −12.5, lower bound −14.0"
    assert plans["search"][0] == "4321 nodes in 120 of 150 ms"


def test_estimates_best_and_by_robot(fake_team, view):
    team = fake_team.monitor.state(T0 + 0.5)
    best = estimate_columns(team, view.bounds, BEST)
    assert (best["x"], best["y"], best["label"]) == ([1.0, 2.0], [1.0, 2.0], ["1", "2"])
    scale = 2 * math.sqrt(-2 * math.log(0.05))
    assert best["width"][0] == pytest.approx(0.2 * scale, abs=1e-3)
    assert best["height"][0] == pytest.approx(0.1 * scale, abs=1e-3)
    assert abs(best["angle"][0]) == pytest.approx(math.pi / 2, abs=1e-3), "the north-south variance is the larger"
    assert best["error"] == ["0.50 m", "0.50 m"]
    assert estimate_columns(team, view.bounds, 1)["label"] == ["1", "2"]
    assert estimate_columns(team, view.bounds, 2)["label"] == []


def test_fused_estimates_name_their_robots(fake_team, view):
    usec = round(T0 * 1e6)
    fake_team.say(
        2,
        191,
        mavlink.MAVLink_target_belief_message(usec, [100.0, 25.0, 0, 0], [100.0, 0, 25.0, *[0] * 7], 1, 1, 0),
        T0,
    )
    fused = estimate_columns(fake_team.monitor.state(T0), view.bounds, FUSED)
    # Mean information diag(62.5, 62.5), at the mean of two estimates of (1, 1).
    assert (fused["x"][0], fused["y"][0]) == (1.0, 1.0)
    assert fused["width"][0] == fused["height"][0] == pytest.approx(2 * math.sqrt(5.991 / 62.5), abs=1e-3)
    assert [source.split(",")[0] for source in fused["source"]] == ["vehicles 1", "vehicle 1 fused"]
    assert "vehicles 1, 2 fused" in fused["source"][0]


def test_links_are_coloured_by_the_worse_loss_and_dashed_one_way(fake_team, view):
    fake_team.losses = {(1, 2): 1, (2, 1): 6, (1, 3): 30}
    for second in range(1, 6):
        if second > 1:
            fake_team.dead.add(3)
        fake_team.speak(T0 + second)
    links = view.layers(fake_team.monitor.state(T0 + 5.0)).links
    assert list(zip(links["label"], links["colour"], links["dash"], strict=True)) == [
        ("1 hears 2, 1 % lost; 2 hears 1, 6 % lost", ESTIMATE, "solid"),
        ("one way: 1 hears 3, 30 % lost", ALARM, "dashed"),
        ("one way: 2 hears 3, loss unknown", TWO_WAY, "dashed"),
    ]
    assert links["width"] == [2.5, 3.5, 1.5], "who cannot tell the colours has the width"


def test_landmarks_are_their_robots_and_go_when_it_is_silent(fake_team, view):
    marks = view.layers(fake_team.monitor.state(T0)).landmarks
    assert (marks["x"], marks["y"], marks["label"]) == ([7.0], [3.0], ["1"])
    assert view.layers(fake_team.monitor.state(T0 + 9.0)).landmarks["x"] == []


@pytest.mark.parametrize("place", [(math.nan, 1.0), (1e9, 1.0), (1.0, -math.inf), (3e38, 3e38)])
def test_absurd_places_are_said_and_not_drawn(fake_team, view, place):
    fake_team.places[2] = place
    fake_team.speak(T0 + 1.0)
    layers = view.layers(fake_team.monitor.state(T0 + 1.0))
    assert layers.vehicles["label"] == ["1", "3"]
    assert bool(layers.notices) == (math.isfinite(place[0]) and math.isfinite(place[1]))
    assert all("vehicle 2" in notice for notice in layers.notices)


def test_an_absurd_belief_is_said_and_not_drawn(fake_team, view):
    far = mavlink.MAVLink_target_belief_message(round(T0 * 1e6), [1e9, 0, 0, 0], [1.0, 0, 1.0, *[0.0] * 7], 2, 1, 0)
    fake_team.say(1, 191, far, T0)
    team = fake_team.monitor.state(T0)
    assert estimate_columns(team, view.bounds, BEST)["label"] == ["1"]
    assert view.layers(team).notices == ("estimates of targets 2 are far outside the area: not drawn",)


def test_a_team_that_nobody_has_heard_is_an_empty_map(scenario, make_team, view):
    layers = view.layers(make_team(scenario).monitor.state(T0))
    assert layers.vehicles["x"] == layers.plans["xs"] == layers.truth["x"] == layers.links["x0"] == []


def test_bounds_are_the_fences(scenario):
    bounds = MapBounds(scenario)
    assert (bounds.south_m, bounds.north_m, bounds.west_m, bounds.east_m) == (0.0, 4.0, 0.0, 8.0)
    assert bounds.plausible(50.0, -50.0)
    assert not bounds.plausible(None, 1.0)
