"""Keys and timestamps on disk."""

from pathlib import Path

import pytest

from onboard.protocol import dialect as mavlink
from onboard.protocol.codec import Codec
from onboard.protocol.signing import EPOCH_UNIX_S, SignedLink, Signing, SigningError, SigningKey
from onboard.protocol.signing_files import SAVE_PERIOD_S, SigningState, read_key, write_new_key

NOW_S = EPOCH_UNIX_S + 3.0e8
HEARTBEAT = mavlink.MAVLink_heartbeat_message(18, 8, 0, 0, 3, 3)


def signing(key: SigningKey) -> Signing:
    made = Signing(key)
    made.advance(NOW_S)
    return made


def test_a_new_key_is_its_owners_alone_and_differs_from_every_other(tmp_path: Path) -> None:
    for name in ("a", "b"):
        write_new_key(tmp_path / name)
        assert (tmp_path / name).stat().st_mode & 0o777 == 0o600
    assert read_key(tmp_path / "a") != read_key(tmp_path / "b")


def test_a_key_is_never_replaced(tmp_path: Path) -> None:
    write_new_key(tmp_path / "key")
    before = read_key(tmp_path / "key")
    with pytest.raises(SigningError, match="exists"):
        write_new_key(tmp_path / "key")
    assert read_key(tmp_path / "key") == before


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
def test_a_key_that_others_can_read_is_refused(tmp_path: Path, mode: int) -> None:
    write_new_key(tmp_path / "key")
    (tmp_path / "key").chmod(mode)
    with pytest.raises(SigningError, match="chmod 600"):
        read_key(tmp_path / "key")


@pytest.mark.parametrize("content", [b"", b"secret-that-is-no-key", b"ab" * 31, b"\xff" * 32])
def test_what_holds_no_key_is_refused_and_not_shown(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "key"
    path.touch(0o600)
    path.write_bytes(content)
    with pytest.raises(SigningError, match="64 hexadecimal digits") as error:
        read_key(path)
    assert "secret" not in str(error.value)


def test_a_missing_key_says_how_to_make_one(tmp_path: Path) -> None:
    with pytest.raises(SigningError, match="arvi keygen"):
        read_key(tmp_path / "none")


def test_timestamps_survive_a_restart_in_both_directions(tmp_path: Path) -> None:
    """Also those of the moments between the last save and the crash."""
    key = SigningKey(bytes(range(32)))
    sender, receiver = signing(key), signing(key)
    state = SigningState(tmp_path / "state" / "timestamps.json")
    sends, hears = Codec(7, 191, sender.link(SignedLink.PEERS)), Codec(1, 191, receiver.link(SignedLink.PEERS))
    assert hears.decode(sends.encode(HEARTBEAT))
    answers = hears.encode(HEARTBEAT)
    state.save(receiver.past)
    sender.advance(NOW_S + 0.9 * SAVE_PERIOD_S)
    receiver.advance(NOW_S + 0.9 * SAVE_PERIOD_S)
    unsaved = sends.encode(HEARTBEAT)
    assert hears.decode(unsaved)
    assert sends.decode(answers)
    assert sends.decode(hears.encode(HEARTBEAT))

    restarted = state.restore(key)
    restarted.advance(NOW_S + SAVE_PERIOD_S)
    again = Codec(1, 191, restarted.link(SignedLink.PEERS))
    assert not again.decode(unsaved), "a replay of what was heard between the last save and the crash"
    assert sends.decode(again.encode(HEARTBEAT)), "its new frames are newer than all that it sent before"
    sender.advance(NOW_S + 3.0 * SAVE_PERIOD_S)
    restarted.advance(NOW_S + 3.0 * SAVE_PERIOD_S)
    assert again.decode(sends.encode(HEARTBEAT)), "the genuine sender is heard again soon"


@pytest.mark.parametrize("text", ["", "{}", '{"sent": 1, "streams": [[1, 2]]}', '{"sent": "x", "streams": []}'])
def test_damaged_timestamps_are_said_and_not_guessed(tmp_path: Path, text: str) -> None:
    path = tmp_path / "timestamps.json"
    path.write_text(text)
    with pytest.raises(SigningError, match="damaged"):
        SigningState(path).restore(SigningKey(bytes(range(32))))
