"""Reads a motion capture system with the library motioncapture, in a process of its own.

The library blocks without a time limit while it connects and while it waits for a frame, and holds Python's interpreter
lock while it connects: beside an event loop, even in a thread, it would stop everything. So it runs alone, writes one
line of JSON for each frame to its standard output, and is ended from outside
(https://github.com/IMRCLab/libmotioncapture).

    python -m sim_bridge.mocap.reader PROVIDER KEY=VALUE …
"""

from __future__ import annotations

import json
import os
import sys
import time
from collections.abc import Mapping
from typing import NoReturn, Protocol, TextIO

__all__ = ["main", "read_frames"]

NOT_INSTALLED = 3
"""Exit code: the library is missing."""
REFUSED = 4
"""Exit code: the library does not know the provider, or could not connect."""


class _Vector(Protocol):
    def tolist(self) -> list[float]: ...


class _Quaternion(Protocol):
    w: float
    x: float
    y: float
    z: float


class _Body(Protocol):
    position: _Vector
    rotation: _Quaternion


class System(Protocol):
    """What the library gives: a connection to a motion capture system."""

    rigidBodies: Mapping[str, _Body]  # noqa: N815 the library's name

    def waitForNextFrame(self) -> None:  # noqa: N802 the library's name
        """Return when the next frame is here, or some time later."""


def read_frames(system: System, out: TextIO) -> NoReturn:
    """Write frames until nobody reads them: ``{"t": UNIX s, "b": {name: [x, y, z, w, x, y, z]}}``."""
    while True:
        system.waitForNextFrame()
        received_s = time.time()
        bodies = {}
        for name, body in system.rigidBodies.items():
            rotation = body.rotation
            bodies[name] = [*body.position.tolist(), rotation.w, rotation.x, rotation.y, rotation.z]
        if bodies:
            out.write(json.dumps({"t": received_s, "b": bodies}) + "\n")
            out.flush()


def main(arguments: list[str]) -> int:
    """Connect and read until ended; the exit code."""
    provider, settings = arguments[0], dict(argument.split("=", 1) for argument in arguments[1:])
    # What the library prints goes to the log: standard output is ours alone.
    out = os.fdopen(os.dup(sys.stdout.fileno()), "w", encoding="utf-8")
    os.dup2(sys.stderr.fileno(), sys.stdout.fileno())
    try:
        import motioncapture  # noqa: PLC0415 an optional extra
    except ImportError:
        sys.stderr.write("the library motioncapture is not installed: pip install 'arvi-flight-stack[mocap]'\n")
        return NOT_INSTALLED
    try:
        system = motioncapture.connect(provider, settings)
    except RuntimeError as error:
        sys.stderr.write(f"{provider} at {settings.get('hostname', '?')}: {error}\n")
        return REFUSED
    try:
        read_frames(system, out)
    except (BrokenPipeError, KeyboardInterrupt):
        return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
