"""The picture and the lines, as text of a given size."""

import io
from dataclasses import replace

import pytest
from rich.console import Console
from rich.live import Live

from gcs.arena_map import ArenaMap
from gcs.metrics import Estimate, MetricsFigures, TargetState
from gcs.session import WATCHING
from gcs.team import Event, TeamMonitor, TeamState
from gcs.terminal import LineDisplay, LiveDisplay, arena_of, open_display, progress_line, render_team
from onboard.messages import FlightState
from onboard.protocol import dialect as mavlink

T0 = 1.5e9


@pytest.fixture
def team(scenario, heard, heartbeat, status):
    """Three vehicles in flight; target 1 found, target 2 not."""
    monitor = TeamMonitor(scenario)
    for i, (north, east) in enumerate(((0.1, 0.1), (3.9, 7.9), (2.0, 4.0)), 1):
        monitor.receive(heard(i, 1, heartbeat(armed=True, mode=0x00060000)), T0)
        monitor.receive(heard(i, 191, mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), T0)
        for step in range(3):
            message = status(
                T0 + 0.5 * step,
                state=FlightState.TRACK,
                north=north,
                east=east,
                down=-1.0,
                setpoints=25 * step,
                plan_age=0.25,
                tracking_error=0.125,
                neighbours=[9 if i == 1 else 1, *[0] * 31],
                deadline_misses=i - 1,
            )
            monitor.receive(heard(i, 191, message), T0)
    state = monitor.state(T0 + 1.0)
    found = TargetState(1, T0, (1,), Estimate(1, T0, 1.0, 1.0, 0.1, -1.0), (1.0, 2.0))
    hidden = TargetState(2, None, (), None, (3.0, 6.0))
    figures = MetricsFigures(0.5, 1.5, 0.25, 1.25, 10)
    return TeamState(state.time_s, state.vehicles, (found, hidden), 5, figures, T0)


def lines_of(renderable, width=100, height=30):
    console = Console(width=width, height=height, file=io.StringIO())
    console.print(renderable)
    return console.file.getvalue().splitlines()


def picture(team, scenario, events=(), width=100, height=30):
    arena = arena_of(scenario, height, width)
    drawn = render_team(team, arena, list(events), "arvi · lab", "flying", 42.0, height, width)
    return lines_of(drawn, width, height)


@pytest.mark.parametrize(("width", "height"), [(60, 16), (80, 24), (100, 30), (140, 40)])
def test_the_picture_fits_the_terminal_and_nothing_is_cut(team, scenario, width, height):
    events = [Event(T0, 6, "vehicle 1", f"event {i}") for i in range(60)]
    lines = picture(team, scenario, events, width, height)
    assert len(lines) < height, "one line stays for the cursor"
    assert max(map(len, lines)) <= width
    assert "…" not in "\n".join(lines)
    assert any("event 59" in line for line in lines)
    assert not any("event 0 " in line for line in lines)
    rows = [line.split() for line in lines if line.lstrip().startswith(("1 ", "2 ", "3 "))]
    assert [row[:4] for row in rows] == [[str(i), "TRACK", "OFFBOARD", "yes"] for i in (1, 2, 3)]


def test_a_title_that_is_too_long_is_cut_and_nothing_else(team):
    late = replace(team, behind_s=12.3)
    lines = lines_of(render_team(late, None, [], "x" * 200, "flying", 42.0, 24, 80), 80)
    assert lines[0].endswith("x…  ground station is 12 s behind, what you see is old")


def test_text_of_a_vehicle_that_looks_like_markup_is_text(team, scenario):
    """It ended the flight's program: rich raises at a tag that closes nothing."""
    talker = replace(team.vehicles[0], status_text="[/red] :smile: [bold]")
    said = replace(team, vehicles=(talker, *team.vehicles[1:]))
    assert "[/red] :smile: [bold]" in "\n".join(picture(said, scenario, (), 160, 40))


def test_the_picture_says_what_the_operator_needs(team, scenario):
    text = "\n".join(picture(team, scenario))
    for part in ("arvi · lab", "flying", "42 s left", "1 of 5", "0.25 m", "1.25 nats", "Ctrl-C"):
        assert part in text
    row = next(line for line in picture(team, scenario) if line.lstrip().startswith("2 "))
    facts = ["2", "TRACK", "OFFBOARD", "yes", "–", "1.00", "–", "0.2", "–", "1", "50", "0.12", "1", "1.0/1.0"]
    assert row.split() == facts


def test_a_wide_terminal_has_the_rest_of_the_vehicle_table(team, scenario, heard):
    wide = render_team(team, ArenaMap(scenario, 48, 12), [], "arvi", WATCHING, None, 40, 160)
    text = "\n".join(lines_of(wide, 160))
    for part in ("ε, δ m, W", "nodes", "last text", "Ctrl-C ends"):
        assert part in text


def test_a_silent_onboard_process_is_seen(team, scenario):
    late = TeamState(T0 + 20, team.vehicles, team.targets, 5, team.figures, T0)
    aged = [
        type(vehicle)(
            **{name: getattr(vehicle, name) for name in vehicle.__dataclass_fields__} | {"onboard_age_s": 9.0}
        )
        for vehicle in late.vehicles
    ]
    text = "\n".join(picture(TeamState(T0, tuple(aged), (), 5, team.figures, T0), scenario))
    assert text.count("silent") == 3


def test_a_station_that_is_behind_says_so_in_both_kinds_of_output(team, scenario):
    late = replace(team, behind_s=12.3)
    text = "\n".join(lines_of(render_team(late, ArenaMap(scenario, 48, 12), [], "arvi", "flying", 42.0), 100))
    assert "ground station is 12 s behind" in text
    assert "GROUND STATION IS 12 S BEHIND" in progress_line(late, "flying", None)


def test_the_map_has_north_up_and_east_to_the_right(team, scenario):
    arena = ArenaMap(scenario, 48, 12)
    rows = arena.draw(team).plain.split("\n")
    assert (len(rows), {len(row) for row in rows}) == (12, {48})
    where = {character: (r, c) for r, row in enumerate(rows) for c, character in enumerate(row) if character != "·"}
    assert where["1"] == (11, 0), "south-west"
    assert where["2"] == (0, 47), "north-east"
    assert where["◆"] == (9, 6), "1 m north, 1 m east: thirds of a metre per line, sixths per column"
    row, column = where["◇"]
    assert (row, column) == (9, 12) or (row, column) == (3, 36)


def test_a_map_of_any_shape_stays_in_its_box(scenario):
    fence = ((-50.0, -10.0), (200.0, -10.0), (75.0, 40.0))
    mission = scenario.mission.model_copy(update={"fence": fence})
    arena = ArenaMap(scenario.model_copy(update={"mission": mission}), 48, 12)
    assert arena.rows <= 12
    assert arena.columns <= 48
    drawn = arena.draw(TeamState(T0, (), (), None, MetricsFigures(None, None, None, None, 0), None)).plain
    assert " " in drawn, "outside the fence is empty"
    assert "·" in drawn


def test_lines_progress_every_few_seconds_and_events_at_once(team):
    now = [0.0]
    console = Console(width=200, file=io.StringIO())
    display = LineDisplay(console, clock=lambda: now[0])
    for tenth in range(0, 121):
        now[0] = tenth / 10
        display.show(team, "flying", 42.0)
        if tenth == 20:
            display.event(Event(T0, 4, "vehicle 2", "a plan was late (1 so far)"))
    lines = console.file.getvalue().splitlines()
    assert len(lines) == 4
    assert "flying, 42 s left | targets 1/5 | RMSE 0.25 m | entropy 1.25 nats | 1: TRACK OFFBOARD 1.0 m" in lines[0]
    assert lines[1].endswith("vehicle 2: a plan was late (1 so far)")
    assert "2: TRACK OFFBOARD 1.0 m 1 late" in lines[0]


def test_markup_in_texts_from_outside_is_text(team):
    console = Console(width=200, file=io.StringIO())
    LineDisplay(console).event(Event(T0, 6, "vehicle 1", "[bold]no markup[/bold] [/]"))
    assert "[bold]no markup[/bold] [/]" in console.file.getvalue()


def test_live_redraws_twice_a_second_and_keeps_errors(team, scenario):
    now = [0.0]
    console = Console(width=100, height=30, file=io.StringIO(), force_terminal=True)
    with Live(console=console, auto_refresh=False) as live:
        display = LiveDisplay(live, scenario, "arvi · lab", clock=lambda: now[0])
        for tenth in range(21):
            now[0] = tenth / 10 + 1e-9
            display.show(team, "flying", 42.0)
        display.event(Event(T0, 3, "launcher", "vehicle 2's onboard process ended"))
    output = console.file.getvalue()
    assert 4 <= output.count("arvi · lab") <= 7
    assert "vehicle 2's onboard process ended" in output


def test_where_there_is_no_terminal_there_are_lines(scenario):
    plain = Console(file=io.StringIO())
    with open_display(plain, scenario, "arvi", headless=False) as display:
        assert isinstance(display, LineDisplay)
    terminal = Console(file=io.StringIO(), force_terminal=True)
    with open_display(terminal, scenario, "arvi", headless=True) as display:
        assert isinstance(display, LineDisplay)
    with open_display(terminal, scenario, "arvi", headless=False) as display:
        assert isinstance(display, LiveDisplay)
    dumb = Console(file=io.StringIO(), force_terminal=True, _environ={"TERM": "dumb"})
    with open_display(dumb, scenario, "arvi", headless=False) as display:
        assert isinstance(display, LineDisplay), "it can draw nothing over what it has drawn"
