import json
import socket
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import pytest
import yaml

from gcs import summary
from gcs.folder import describe_run
from gcs.mission import MissionDirector
from gcs.recording.display import RecordedDisplay
from gcs.recording.recorder import Recorder
from gcs.router import TEAM
from gcs.station import GroundStation
from gcs.team import Event, TeamState
from onboard.config import Scenario, load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.link_url import LinkUrl
from sim_bridge.virtual_team import VirtualTeam

LAB = Path(__file__).parents[2] / "configs" / "lab.yaml"


@pytest.fixture(scope="session")
def scenario() -> Scenario:
    """The lab: vehicles 1, 2, 3, five targets, τ = 0.5 s."""
    return load_scenario(LAB)


@pytest.fixture
def heard() -> Callable[[int, int, mavlink.MAVLink_message], mavlink.MAVLink_message]:
    """A message as it arrives from a system and component: packed, unpacked, with its header."""

    def through_the_wire(system: int, component: int, message: mavlink.MAVLink_message) -> mavlink.MAVLink_message:
        (received,) = Codec(255, 190).decode(Codec(system, component).encode(message))
        return received

    return through_the_wire


@pytest.fixture
def heartbeat() -> Callable[..., mavlink.MAVLink_message]:
    """HEARTBEAT of a PX4 autopilot."""

    def build(armed: bool = False, mode: int = 0x03040000) -> mavlink.MAVLink_message:
        base = mavlink.MAV_MODE_FLAG_SAFETY_ARMED if armed else 0
        return mavlink.MAVLink_heartbeat_message(2, mavlink.MAV_AUTOPILOT_PX4, base, mode, 4, 3)

    return build


@pytest.fixture
def status() -> Callable[..., mavlink.MAVLink_message]:
    """PLANNER_STATUS, with what a test does not care for filled in."""

    def build(time_s: float, **changes: object) -> mavlink.MAVLink_message:
        fields: dict[str, object] = {
            "mission_start_usec": 0,
            "north": 1.0,
            "east": 2.0,
            "down": 0.0,
            "yaw": 0.0,
            "tracking_error": float("nan"),
            "plan_age": float("nan"),
            "setpoint_gap_max": 0.0,
            "setpoints": 0,
            "plans": 0,
            "deadline_misses": 0,
            "peer_bytes_sent": 0,
            "peer_bytes_received": 0,
            "detections": 0,
            "rejected": 0,
            "neighbours": [0] * 32,
            "state": 1,
            "group_size": 1,
            "group_order": 0,
            "targets": 0,
            "landmarks": 0,
            "over_home": 1,
            "neighbour_loss": [255] * 32,
        }
        return mavlink.MAVLink_planner_status_message(round(time_s * 1e6), **(fields | changes))

    return build


@pytest.fixture
def own_ports(tmp_path: Path) -> Path:
    """Two of the lab's vehicles on UDP ports of their own: a test may run beside a real flight."""
    data = yaml.safe_load(LAB.read_text(encoding="utf-8"))
    base = _free_base()
    data["name"] = "own-ports"
    del data["vehicles"][2:]
    data["mission"]["takeoff_time_s"] = 1.0
    data["ground"] = {"url": f"udpin:127.0.0.1:{base}"}
    for i, vehicle in enumerate(data["vehicles"]):
        vehicle["links"] = {
            "autopilot": f"udpin:127.0.0.1:{base + 10 + i}",
            "peers": f"udpout:127.0.0.1:{base + 20 + i}",
            "sensor": f"udpin:127.0.0.1:{base + 30 + i}",
            "ground": f"udpout:127.0.0.1:{base}",
        }
    path = tmp_path / "own-ports.yaml"
    path.write_text(yaml.safe_dump(data), encoding="utf-8")
    return path


def _free_base() -> int:
    """A port that the system has just given us; those above it are as good as always free, too."""
    while True:
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sock:
            sock.bind(("127.0.0.1", 0))
            port = int(sock.getsockname()[1])
        if port < 60000:
            return port


@dataclass
class Flown:
    """A flight of the lab in virtual time, through the real ground station and recorder.

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

    def read(self) -> bool:
        return True

    def send(self, frame: bytes, address: object = None) -> None:
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


def fly_virtually(folder: Path, mission_s: float) -> Flown:
    scenario = load_scenario(LAB)
    team = VirtualTeam(scenario, seed=3, plan_nodes=80)
    director = MissionDirector(scenario.mission.step_s, scenario.mission.takeoff_time_s, mission_s)
    attachments = describe_run(folder, LAB, {"scenario": "lab", "seed": 3})
    recorder = Recorder(folder, scenario, attachments=attachments, queue_items=1_000_000)  # time flies here
    clock = lambda: team.time_s  # noqa: E731
    station = GroundStation(scenario, director=director, recorder=recorder, clock=clock, steady=clock)
    station.switchboard.attach(TEAM, FakeLink(team))
    team.on_ground_message = lambda heard: station.switchboard.receive(
        TEAM, bytes(heard.message.get_msgbuf()), ("virtual", 1), team.time_s
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
    return fly_virtually(tmp_path_factory.mktemp("flight"), 8.0)


@pytest.fixture(scope="session")
def flown_for_five_minutes(tmp_path_factory: pytest.TempPathFactory) -> Flown:
    return fly_virtually(tmp_path_factory.mktemp("five_minutes"), 300.0)
