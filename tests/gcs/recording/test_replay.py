"""Replay: the ground's state at any time is what it was in flight, whichever way one gets there."""

import os
import re
import shutil
from dataclasses import replace

import numpy as np
import pytest

from gcs import summary
from gcs.dashboard.board import DashboardFeed
from gcs.dashboard.replay_board import ReplayBoard
from gcs.errors import GroundError
from gcs.operator_desk import OperatorDesk
from gcs.recording.player import Player
from gcs.recording.reader import find_recording, open_recording
from gcs.recording.recorder import MCAP_NAME, record_flight
from gcs.recording.replay import TICK_S, Replay
from gcs.recording.tlog import read_tlog
from gcs.router import TEAM
from gcs.station import GroundStation
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec


@pytest.fixture(scope="module")
def recording(flown):
    return open_recording(flown.folder)


class Clock:
    def __init__(self, looking_takes_s=0.0):
        self.now_s = 1000.0
        self.looking_takes_s = looking_takes_s

    def __call__(self):
        self.now_s += self.looking_takes_s
        return self.now_s


def same(first, second):
    """Equal states; the explored area compares by its cells."""
    for one, other in ((first, second), (second, first)):
        assert (one.explored is None) == (other.explored is None)
    if first.explored is not None:
        assert np.array_equal(first.explored.cells, second.explored.cells)
        assert first.explored.share == second.explored.share
    assert replace(first, explored=None) == replace(second, explored=None)


def test_the_end_is_the_live_summary(recording, flown):
    replay = Replay(recording)
    replay.go(replay.ticks)
    live = flown.summary
    facts = summary.FlightFacts(
        scenario="lab", version="test", seed=3, mission_start_s=replay.state().mission_start_s,
        mission_end_s=recording.landing_since_s, cpu_cores=None, cpu_s={}, problems=(),
    )  # fmt: skip
    assert summary.summarize(replay.monitor, facts, replay.time_of(replay.ticks)) == live


def test_states_are_those_that_the_operator_saw(recording, flown):
    """At 0.1 s or less from a state that was shown: what comes once a step is the same, what moves is near."""
    replay = Replay(recording)
    for live in flown.states[60::40]:
        replay.go(replay.tick_at(live.time_s))
        state = replay.state()
        assert state.time_s == pytest.approx(live.time_s, abs=TICK_S)
        assert state.discovered == pytest.approx(live.discovered, abs=1)
        for vehicle, seen in zip(state.vehicles, live.vehicles, strict=True):
            assert vehicle.mode == seen.mode
            assert vehicle.north_m == pytest.approx(seen.north_m, abs=0.4)
            assert vehicle.height_m == pytest.approx(seen.height_m, abs=0.4)


def test_seeking_gives_the_state_that_playing_gives(recording):
    played, states = Replay(recording), {}
    wanted = (1, 7, 99, 100, 101, 155, 230, played.ticks)
    while played.tick < played.ticks:
        played.step()
        if played.tick in wanted:
            states[played.tick] = played.state()
    sought = Replay(recording)
    while sought.read < sought.ticks:
        sought.read_ahead()
    same(sought.state_ahead(), states[sought.ticks])
    for tick in (155, 7, played.ticks, 100, 101, 99, 230, 1, played.ticks, 155):
        sought.go(tick)
        assert sought.tick == tick
        same(sought.state(), states[tick])
    same(played.state(), states[played.ticks])


def play(player, clock, board, seconds):
    for _ in range(round(seconds / 0.1)):
        clock.now_s += 0.1
        board.refresh()


def make_board(recording, speed=1.0):
    clock = Clock()
    player = Player(recording, speed, clock)
    board = ReplayBoard(DashboardFeed(OperatorDesk()), player)
    board.refresh()
    player.playing = True
    return board, player, clock


def test_the_board_plays_pauses_seeks_and_is_the_same_either_way(recording, flown):
    board, player, clock = make_board(recording)
    play(player, clock, board, 10.0)
    assert player.position_s == pytest.approx(10.0, abs=0.11)
    player.toggle()
    play(player, clock, board, 5.0)
    assert player.position_s == pytest.approx(10.0, abs=0.11), "paused"
    player.toggle()
    player.speed = 4.0
    play(player, clock, board, 1.5)
    assert player.position_s == pytest.approx(16.0, abs=0.5)
    there = player.replay.tick
    moment, history, trails = board.moment, board.history.columns(board.history.serial - 40), board.history.trails()
    events = board.events.find(limit=1000)
    assert events
    assert all(event in flown.events for event in events)

    player.playing = False
    for position_s in (player.duration_s, 3.0, TICK_S * there):
        player.seek(position_s)
        while not player.arrived:
            board.refresh()
        board.refresh()
    same(board.moment.team, moment.team)
    assert board.moment.phase == moment.phase == "replay: flying"
    assert board.history.trails() == trails
    np.testing.assert_equal(board.history.columns(board.history.serial - 40), history)
    assert board.events.find(limit=1000) == events

    player.seek(player.duration_s)
    while not player.arrived:
        board.refresh()
    board.refresh()
    assert board.events.find(limit=1000)[::-1] == sorted(flown.events, key=lambda event: event.time_s)
    player.toggle()
    assert player.playing
    board.refresh()
    assert player.position_s == 0.0, "play at the end starts again"


def test_a_long_way_is_read_bit_by_bit_and_once(recording):
    clock = Clock(looking_takes_s=0.01)
    player = Player(recording, clock=clock)
    player.seek(player.duration_s)
    shares = []
    while not player.arrived:
        assert player.position_s == 0.0 or player.reading is None, "stays until it can be there soon"
        began_s = clock.now_s
        player.advance()
        assert clock.now_s - began_s <= 0.2
        shares.append(1.0 if player.reading is None else player.reading)
    assert shares == sorted(shares)
    assert len(shares) > 10
    assert 0.0 < shares[0] < 0.2
    player.seek(5.0)
    player.advance()
    player.seek(player.duration_s)
    calls = 0
    while not player.arrived:
        player.advance()
        calls += 1
    assert calls < 0.5 * len(shares)


def test_a_recording_that_was_cut_off_replays_as_far_as_it_goes(flown, tmp_path):
    for path in flown.folder.iterdir():
        content = path.read_bytes()
        (tmp_path / path.name).write_bytes(content[: len(content) // 2] if path.suffix != ".yaml" else content)
    recording = open_recording(tmp_path)
    assert (recording.summary, recording.about) == (None, {})
    whole, half = Replay(open_recording(flown.folder)), Replay(recording)
    assert 0.3 * whole.ticks < half.ticks < 0.8 * whole.ticks
    # The logs of the links end at different times: until the first of them does, all is as in the whole one.
    half.go(100)
    whole.go(100)
    same(half.state(), whole.state())
    half.go(half.ticks)
    assert half.state().vehicles


def test_telemetry_logs_alone_replay_with_the_events_that_messages_tell(flown, tmp_path):
    for path in flown.folder.iterdir():
        if path.name not in (MCAP_NAME, "flight.json", "summary.json"):
            shutil.copy(path, tmp_path)
    replay = Replay(open_recording(tmp_path))
    replay.go(replay.ticks)
    texts = {event.text for event in replay.events(-1, replay.ticks)}
    assert {event.text for event in flown.events if "found by vehicle" in event.text} <= texts
    count = len(replay.events(-1, replay.ticks))
    replay.go(10)
    replay.go(replay.ticks)
    assert len(replay.events(-1, replay.ticks)) == count, "said once, however often one passes"
    assert replay.phase().phase == "recorded"


def test_what_an_autopilot_passes_on_for_its_companion_is_in_its_own_log_and_no_loss_of_the_companions(
    flown, heartbeat, tmp_path
):
    """As PX4 and ArduPilot do; the companion counts its frames on each of its links."""
    now_s = 1.7e9
    clock = lambda: now_s  # noqa: E731
    recorder = record_flight(tmp_path, flown.folder / "scenario.yaml", flown.scenario, {}, 100)
    station = GroundStation(flown.scenario, recorder=recorder, clock=clock, steady=clock)
    autopilot, onboard, to_autopilot = Codec(1, 1), Codec(1, 191), Codec(1, 191)
    for i in range(100):
        now_s += 0.1
        for frame, port in (
            (autopilot.encode(heartbeat()), 1),
            (onboard.encode(mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 4, 3)), 2),
            *[(to_autopilot.encode(mavlink.MAVLink_timesync_message(0, i)), 1)] * (i % 3 == 0),
        ):
            station.switchboard.receive(TEAM, frame, ("vehicle", port), now_s)
    recorder.close()
    live = station.team.state(now_s).vehicle(1).link
    assert live.loss == 0.0
    assert live.received > 150
    replay = Replay(open_recording(tmp_path))
    replay.go(replay.ticks)
    assert replay.state().vehicle(1).link == live
    counts = {path.stem: len(list(read_tlog(path))) for path in tmp_path.glob("*.tlog")}
    assert counts == {"vehicle1_autopilot": 134, "vehicle1_onboard": 100}


def test_what_is_damaged_is_said_and_the_rest_is_used(flown, tmp_path):
    shutil.copytree(flown.folder, tmp_path, dirs_exist_ok=True)
    assert open_recording(tmp_path).problems == ()
    mcap = (flown.folder / MCAP_NAME).read_bytes()
    (tmp_path / MCAP_NAME).write_bytes(mcap[: len(mcap) // 2])
    (tmp_path / "summary.json").write_text('{"discovered": 5')
    (tmp_path / "flight.json").write_text('{"software": 3}')
    recording = open_recording(tmp_path)
    assert 0 < len(recording.phases) < len(open_recording(flown.folder).phases)
    first, second = recording.problems
    assert re.match(r"flight.mcap is cut off or damaged: events and phases are known until \d\d:\d\d:\d\d$", first)
    assert second == "summary.json is damaged"
    (tmp_path / MCAP_NAME).write_bytes(b"no mcap at all")
    recording = open_recording(tmp_path)
    assert (recording.events, recording.phases) == (None, ())
    assert recording.problems[0].startswith("flight.mcap cannot be read")


@pytest.mark.parametrize(
    ("present", "words"),
    [((), "is no recording"), (("scenario.yaml",), "holds no .tlog file"), (None, "no such folder")],
)
def test_what_is_no_recording_is_refused_with_a_reason(present, words, flown, tmp_path):
    folder = tmp_path / "there"
    if present is not None:
        folder.mkdir()
        for name in present:
            shutil.copy(flown.folder / name, folder)
    with pytest.raises(GroundError, match=words):
        open_recording(folder)


def test_a_folder_of_recordings_names_the_latest(flown, tmp_path):
    for age, name in enumerate(("new", "old")):
        (tmp_path / name).mkdir()
        shutil.copy(flown.folder / "scenario.yaml", tmp_path / name)
        os.utime(tmp_path / name / "scenario.yaml", (1e9 - age, 1e9 - age))
    with pytest.raises(GroundError, match=r"is no recording, but holds 2; the latest is .*/new$"):
        open_recording(tmp_path)
    assert find_recording(tmp_path) == tmp_path / "new"
    assert find_recording(tmp_path / "old") == tmp_path / "old"
    with pytest.raises(GroundError, match="is a file; name the folder"):
        open_recording(tmp_path / "old" / "scenario.yaml")
