"""The page's texts: what is shown, that it is escaped, that silence is red, that outcomes of commands are told."""

import re

import pytest

from gcs.dashboard import panels
from gcs.dashboard.board import Moment
from gcs.dashboard.view import MapBounds
from gcs.operator_desk import Action, CommandRecord, Outcome, Way
from gcs.team import Event
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec

T0 = 1.5e9


def cells(html, vehicle):
    row = re.search(rf"<tr data-vehicle='{vehicle}'.*?</tr>", html).group()
    return [re.sub(r"<[^>]+>", "", cell) for cell in re.findall(r"<td.*?</td>", row)]


@pytest.fixture
def bounds(scenario):
    return MapBounds(scenario)


def test_a_vehicles_row(fake_team, bounds):
    html = panels.vehicle_table(fake_team.monitor.state(T0 + 0.2), bounds)
    assert cells(html, 2) == [
        *("2", "TRACK", "OFFBOARD", "armed", "–", "1.50", "1.00", "0.4", "0.10, 0.20, 64", "4 321", "0", "1 3"),
        *("–", "0.2 / 0.2", ""),
    ]
    assert "silent" not in html


@pytest.mark.parametrize(("age_s", "red"), [(3.9, False), (4.0, True)])
def test_a_heartbeat_of_four_seconds_is_red(fake_team, bounds, age_s, red):
    html = panels.vehicle_table(fake_team.monitor.state(T0 + age_s), bounds)
    assert html.count("class=silent") == (3 if red else 0)
    assert cells(html, 1)[1] == ("SILENT" if red else "TRACK")


def test_a_process_known_to_be_gone_is_red_at_once(fake_team, bounds):
    fake_team.monitor.onboard_ended(3)
    html = panels.vehicle_table(fake_team.monitor.state(T0 + 0.1), bounds)
    assert re.findall(r"<tr data-vehicle='(\d)' class=silent>", html) == ["3"]


def test_nothing_heard_is_dashes_not_zeros(scenario, make_team, bounds):
    row = cells(panels.vehicle_table(make_team(scenario).monitor.state(T0), bounds), 1)
    assert row[1:10] == ["not heard", *["–"] * 8]


def test_lost_doubled_and_late_frames_are_shown_as_such(fake_team, bounds, scenario):
    frame = bytearray(Codec(1, 191).encode(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)))
    for number in (1, 2, 2, 5, 4):  # 2 comes twice, 3 is lost, 4 is overtaken
        frame[4] = number
        fake_team.monitor.sequence(bytes(frame), (1, 191), T0)
    assert cells(panels.vehicle_table(fake_team.monitor.state(T0), bounds), 1)[12] == "20&nbsp;% ×1"
    late = mavlink.MAVLink_planner_status_message(
        round((T0 - 2.5) * 1e6), 0, *[0.0] * 7, *[0] * 7, [0] * 32, FlightState.TRACK, 1, 0, 0, 0, 0, [255] * 32
    )
    fake_team.say(1, 191, late, T0)
    assert "late&nbsp;2.5&nbsp;s" in cells(panels.vehicle_table(fake_team.monitor.state(T0), bounds), 1)[12]


def test_many_neighbours_are_counted(scenario, make_team, bounds):
    first = scenario.vehicles[0]
    many = tuple(first.model_copy(update={"id": i}) for i in range(1, 21))
    team = make_team(scenario.model_copy(update={"vehicles": many}))
    team.speak(T0)
    assert cells(panels.vehicle_table(team.monitor.state(T0), bounds), 20)[11] == "19 of them"


def test_what_a_vehicle_says_is_escaped(fake_team, bounds):
    text = mavlink.MAVLink_statustext_message(4, b"<script>alert(1)</script>'")
    fake_team.say(1, 1, text, T0)
    state = fake_team.monitor.state(T0)
    events = fake_team.monitor.take_events()
    for html in (panels.vehicle_table(state, bounds), panels.event_lines(events, [1, 2, 3])):
        assert "<script" not in html
        assert "&lt;script&gt;" in html


def test_an_absurd_place_is_said_in_the_table(fake_team, bounds):
    fake_team.places[2] = (1e9, 0.0)
    fake_team.speak(T0 + 1.0)
    assert cells(panels.vehicle_table(fake_team.monitor.state(T0 + 1.0), bounds), 2)[-1] == (
        "position 1e+09 m N, 0.0 m E is absurd"
    )


def test_the_headline_counts_and_warns(fake_team):
    state = fake_team.monitor.state(T0 + 5.0)
    text = re.sub(r"<[^>]+>", "", panels.headline(Moment(state, "flying", 12.4, ()), "ARVI"))
    assert "targets found 2 of 5" in text
    assert "left 12 s" in text
    assert "vehicles 1, 2, 3 silent" in text
    begun = panels.headline(None, "<b>", latest=Event(T0, 6, "launcher", "compiling <kernels>"))
    assert "starting" in begun
    assert "launcher: compiling &lt;kernels&gt;" in begun
    assert "ground station is 12 s behind: what you see is old" in panels.headline(
        Moment(state, "flying", None, ()), "ARVI", 12.3
    )


def record(outcome, result="", ended_s=None, vehicle=2):
    return CommandRecord(T0, ended_s, Action.PAUSE, vehicle, (Way.ONBOARD,), outcome, result, frozenset())


def test_of_many_vehicles_those_that_answered_the_same_share_a_line():
    records = [
        record(Outcome.TIMED_OUT if i == 7 else Outcome.ACKNOWLEDGED, "no answer" if i == 7 else "", T0 + 1.0, i)
        for i in range(1, 21)
    ]
    lines = re.findall(r"<p.*?</p>", panels.command_lines(records, []))
    assert len(lines) == 2
    assert "Pause vehicles 1, 2, 3, 4, 5, 6, 8, 9, 10, 11," in lines[0]
    assert "Pause vehicle 7 " in lines[1]
    assert "timed out" in lines[1]


@pytest.mark.parametrize(
    ("outcome", "result", "words"),
    [
        (Outcome.SENT, "", "sent, waiting…"),
        (Outcome.ACKNOWLEDGED, "accepted", "acknowledged"),
        (Outcome.REFUSED, "temporarily rejected", "refused: temporarily rejected"),
        (Outcome.TIMED_OUT, "no answer", "timed out: no answer"),
    ],
)
def test_every_outcome_is_told(outcome, result, words):
    html = panels.command_lines([record(outcome, result, T0 + 1.0)], [])
    assert "Pause vehicle 2" in html
    assert f"<b>{words}</b>" in html
