"""Where signing lives on disk: the team's key, and the timestamps that a restart must not forget."""

from __future__ import annotations

import json
import os
import secrets
import stat
from pathlib import Path

from onboard.protocol.signing import TICKS_PER_S, Signing, SigningError, SigningKey, SigningPast

__all__ = ["SAVE_PERIOD_S", "SigningState", "read_key", "write_new_key"]

SAVE_PERIOD_S = 1.0
"""How often a process keeps its timestamps."""

_LEASE_TICKS = round(2.0 * SAVE_PERIOD_S * TICKS_PER_S)
"""Added to what was kept last: in between, frames were signed and verified that the file does not know."""


def write_new_key(path: Path) -> None:
    """Make a key of the system's randomness, readable by its owner alone (mode 0600); never replaces a file.

    Raises:
        SigningError: The file exists or cannot be written.
    """
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW, 0o600)
        with os.fdopen(descriptor, "w") as file:
            file.write(secrets.token_hex(32) + "\n")
    except FileExistsError:
        raise SigningError(f"{path} exists; a key is never replaced. Choose another name, or remove it first") from None
    except OSError as error:
        raise SigningError(f"{path}: {error.strerror}") from None


def read_key(path: Path) -> SigningKey:
    """The key in a file that ``arvi keygen`` wrote.

    Raises:
        SigningError: The file cannot be read, others may read it, or it holds no key; the text never shows it.
    """
    try:
        with path.open("rb") as file:
            mode = stat.S_IMODE(os.fstat(file.fileno()).st_mode)
            text = file.read(1024)
    except OSError as error:
        raise SigningError(
            f"signing key {path}: {error.strerror}. Make one with `arvi keygen {path}`, once for the team, and copy it "
            "to every vehicle and the ground station"
        ) from None
    if mode & 0o077:
        raise SigningError(f"signing key {path}: others can read it (mode {mode:04o}); chmod 600 {path}")
    try:
        return SigningKey(bytes.fromhex(text.decode("ascii").strip()))
    except (ValueError, SigningError):
        raise SigningError(f"signing key {path}: holds no key; 64 hexadecimal digits are one") from None


class SigningState:
    """The file in which one process keeps its timestamps, so that a restart accepts no replay and repeats none.

    Args:
        path: The file; it and its folder are made when first needed.
    """

    def __init__(self, path: Path) -> None:
        self.path = path

    def restore(self, key: SigningKey) -> Signing:
        """Signing as the file remembers it; anew where there is none.

        Raises:
            SigningError: The file is damaged; a guess would let replays in.
        """
        try:
            text = self.path.read_text()
        except FileNotFoundError:
            return Signing(key)
        except OSError as error:
            raise SigningError(f"signing timestamps {self.path}: {error.strerror}") from None
        try:
            kept = json.loads(text)
            streams = {
                (int(system), int(component), int(link)): int(timestamp) + _LEASE_TICKS
                for system, component, link, timestamp in kept["streams"]
            }
            return Signing(key, SigningPast(int(kept["sent"]) + _LEASE_TICKS, streams))
        except (ValueError, TypeError, KeyError):
            raise SigningError(
                f"signing timestamps {self.path}: damaged; remove it one minute after the last flight, when "
                "replays of that flight are too old to be taken"
            ) from None

    def save(self, past: SigningPast) -> None:
        """Keep the timestamps; the file is replaced as a whole.

        Raises:
            OSError: It cannot be written.
        """
        self.path.parent.mkdir(parents=True, exist_ok=True)
        streams = [[*stream, timestamp] for stream, timestamp in sorted(past.streams.items())]
        beside = self.path.with_suffix(".new")
        beside.write_text(json.dumps({"sent": past.sent, "streams": streams}))
        beside.replace(self.path)
