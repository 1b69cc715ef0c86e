"""A short flight of the lab in virtual time, through the real ground station, recorded."""

import json
from dataclasses import dataclass
from pathlib import Path

import pytest

from gcs import summary
from gcs.mission import MissionDirector
from gcs.recording.display import RecordedDisplay
from gcs.recording.recorder import Recorder, record_flight
from gcs.router import TEAM
from gcs.station import GroundStation
from gcs.team import Event, TeamState
from onboard.config import Scenario, load_scenario
from onboard.protocol.codec import Codec
from onboard.protocol.transport import LinkUrl
from sim_bridge.virtual_team import VirtualTeam

LAB = Path(__file__).parents[3] / "configs" / "lab.yaml"
MISSION_S = 8.0


@dataclass
class Flown:
    """A recorded flight, and what was known of it while it happened.

    Attributes:
        folder: The recording.
        scenario: What was flown.
        summary: The live summary.
        states: What the display was shown, ten times a second.
        events: What the display was told.
        frames: How many frames the recorder took.
    """

    folder: Path
    scenario: Scenario
    summary: dict
    states: list[TeamState]
    events: list[Event]
    frames: int


class FakeLink:
    """The ground station's socket: what it sends reaches the virtual team at once."""

    url = LinkUrl("udpin", "127.0.0.1", 14550)

    def __init__(self, team: VirtualTeam) -> None:
        self._team = team
        self._codec = Codec(1, 1)

    def send_to(self, frame: bytes, address: object) -> None:
        for message in self._codec.decode(frame):
            if hasattr(message, "target_system"):
                self._team.command(message)

    def close(self) -> None:
        pass


class Watching:
    def __init__(self) -> None:
        self.states: list[TeamState] = []
        self.events: list[Event] = []

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        self.states.append(team)

    def event(self, event: Event) -> None:
        self.events.append(event)


def fly_virtually(folder: Path) -> Flown:
    scenario = load_scenario(LAB)
    team = VirtualTeam(scenario, seed=3, plan_nodes=80)
    director = MissionDirector(scenario.mission.step_s, scenario.mission.takeoff_time_s, MISSION_S)
    recorder: Recorder = record_flight(folder, LAB, scenario, {"scenario": "lab", "seed": 3}, 100)
    station = GroundStation(scenario, director=director, recorder=recorder, clock=lambda: team.time_s)

    station.switchboard.attach(TEAM, FakeLink(team))
    team.on_ground_message = lambda heard: station.switchboard.receive(
        TEAM, bytes(heard.message.get_msgbuf()), ("virtual", 1)
    )
    watching = Watching()
    display = RecordedDisplay(watching, recorder)
    while not director.over:
        team.run(0.1)
        station.tick()
        for event in station.team.take_events():
            display.event(event)
        display.show(station.team.state(team.time_s), director.phase.value, director.time_left_s(team.time_s))
        if director.landing_since_s is not None:
            station.team.metrics.end_s = director.landing_since_s
    facts = summary.FlightFacts(
        scenario="lab", version="test", seed=3, mission_start_s=director.start_s,
        mission_end_s=director.landing_since_s, cpu_cores=None, cpu_s={}, problems=(),
    )  # fmt: skip
    live = summary.summarize(station.team, facts, team.time_s)
    recorder.close()
    assert recorder.take_warnings() == []
    assert recorder.dropped == 0
    (folder / "summary.json").write_text(json.dumps(live))
    return Flown(folder, scenario, live, watching.states, watching.events, recorder.frames)


@pytest.fixture(scope="session")
def flown(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly_virtually(tmp_path_factory.mktemp("flight"))
