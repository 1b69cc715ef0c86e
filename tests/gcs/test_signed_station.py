"""A station with a team's key: nobody else speaks for an onboard process, and what it sends is signed."""

from pathlib import Path

import pytest

from gcs.recording.recorder import record_flight
from gcs.router import TEAM
from gcs.station import GroundStation
from onboard.config import load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import SignedLink, Signing, SigningError
from onboard.protocol.signing_files import read_key, write_new_key

NOW = 1.8e9
ADDRESS, THIEF = ("127.0.0.1", 40001), ("127.0.0.1", 6666)
HEARTBEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3)


@pytest.fixture
def config(tmp_path: Path) -> Path:
    write_new_key(tmp_path / "team.key")
    path = tmp_path / "signed.yaml"
    path.write_text(Path("configs/lab.yaml").read_text() + "\nsigning: {key_file: team.key, state_folder: state}\n")
    return path


@pytest.fixture
def station(config: Path) -> GroundStation:
    station = GroundStation(load_scenario(config), clock=lambda: NOW)
    station.tick()
    return station


def signed(config: Path, system: int = 1) -> Codec:
    signing = Signing(read_key(config.parent / "team.key"))
    signing.advance(NOW)
    return Codec(system, 191, signing.link(SignedLink.GROUND))


def test_only_the_teams_key_opens_the_way_to_an_onboard_process(station: GroundStation, config: Path) -> None:
    board, receive = station.switchboard, station.switchboard.receive
    receive(TEAM, Codec(1, 191).encode(HEARTBEAT), THIEF, NOW)
    assert board.heard() == set()
    genuine = signed(config).encode(HEARTBEAT)
    receive(TEAM, genuine, ADDRESS, NOW)
    assert board.router.team_port((1, 191)).address == ADDRESS
    receive(TEAM, genuine, THIEF, NOW)
    assert board.router.team_port((1, 191)).address == ADDRESS, "a replay does not redirect the commands"


def test_an_autopilot_needs_no_key(station: GroundStation) -> None:
    station.switchboard.receive(TEAM, Codec(1, 1).encode(HEARTBEAT), ADDRESS, NOW)
    assert station.switchboard.heard() == {(1, 1)}


def test_the_operator_is_told_who_knocked(station: GroundStation, config: Path) -> None:
    station.switchboard.receive(TEAM, Codec(1, 191).encode(HEARTBEAT), THIEF, NOW)
    station._next_heartbeat_s = 0.0
    station.tick()
    events = station.team.take_events()
    assert any("1 frames refused on the ground link; so far 1 unsigned" in event.text for event in events)


def test_without_its_key_a_station_does_not_start(config: Path) -> None:
    (config.parent / "team.key").chmod(0o644)
    with pytest.raises(SigningError, match="chmod 600"):
        GroundStation(load_scenario(config))


def test_without_a_signature_only_the_short_list_is_heard(station: GroundStation) -> None:
    """The team's vehicles but for their onboard processes, and the bridge; a stranger's heartbeat is not even told."""
    board = station.switchboard
    for system, component in ((1, 1), (2, 154), (250, 1), (254, 190), (77, 1)):
        board.receive(TEAM, Codec(system, component).encode(HEARTBEAT), (ADDRESS[0], 40000 + system), NOW)
    assert board.heard() == {(1, 1), (2, 154), (250, 1)}
    station._next_heartbeat_s = 0.0
    station.tick()
    assert not any("refused" in event.text for event in station.team.take_events())
    board.receive(TEAM, Codec(77, 1).encode(mavlink.MAVLink_statustext_message(4, b"text", 0, 0)), THIEF, NOW)
    station._next_heartbeat_s = 0.0
    station.tick()
    assert any("1 frames refused" in event.text for event in station.team.take_events())


def test_the_key_is_in_no_recording_and_no_log(config: Path, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Not even when somebody sends it around, as SETUP_SIGNING does."""
    scenario, folder = load_scenario(config), tmp_path / "flight"
    folder.mkdir()
    secret = read_key(config.parent / "team.key").secret
    recorder = record_flight(folder, config, scenario, {}, 100)
    station = GroundStation(scenario, recorder=recorder, clock=lambda: NOW)
    station.tick()
    offer = mavlink.MAVLink_setup_signing_message(1, 191, list(secret), 0)
    for codec in (Codec(1, 1), signed(config)):
        for message in (HEARTBEAT, offer):
            station.switchboard.receive(TEAM, codec.encode(message), ADDRESS, NOW)
    recorder.close()
    written = [path for path in folder.rglob("*") if path.is_file()]
    assert any(path.suffix == ".tlog" and path.stat().st_size > 0 for path in written)
    assert not any(path.name == "team.key" for path in written)
    everything = b"".join(path.read_bytes() for path in written) + caplog.text.encode()
    assert secret not in everything
    assert secret.hex().encode() not in everything


def test_a_station_that_stood_still_takes_nobody_for_a_message_from_the_future(
    station: GroundStation, config: Path
) -> None:
    """What has come in a pause longer than the clocks' tolerance is judged by when it came."""
    signing = Signing(read_key(config.parent / "team.key"))
    codec = Codec(1, 191, signing.link(SignedLink.GROUND))
    for arrived_s in (NOW + 30.0, NOW + 150.0, NOW + 300.0):
        signing.advance(arrived_s)
        station.switchboard.receive(TEAM, codec.encode(HEARTBEAT), ADDRESS, arrived_s)
    station._next_heartbeat_s = 0.0
    station.tick()
    assert station.team.state(NOW + 300.0).vehicle(1).onboard_alive
    assert not [event.text for event in station.team.take_events() if "refused" in event.text]
