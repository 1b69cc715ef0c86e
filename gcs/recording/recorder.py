"""The recording of one flight: one ``.tlog`` per link, and one MCAP file with what the ground knew.

The event loop only appends to memory; a thread of its own packs and writes, so that a slow disk delays nobody, and a
full one ends the recording, not the flight.
"""

from __future__ import annotations

import math
import queue
import threading
from dataclasses import dataclass
from io import FileIO
from pathlib import Path
from typing import Any

from gcs.commands import AUTOPILOT, ONBOARD
from gcs.folder import describe_run
from gcs.recording.mcap_log import McapLog
from gcs.recording.tlog import stamped
from gcs.team import Event, TeamState
from onboard.config import Scenario
from onboard.protocol.addressing import SystemComponent

__all__ = ["DEFAULT_LIMIT_MB", "MCAP_NAME", "OTHERS", "Recorder", "link_names", "record_flight"]

DEFAULT_LIMIT_MB = 2000
MCAP_NAME = "flight.mcap"
OTHERS = "others"
"""Name of what comes from, or goes to, nobody of the team."""

_CHUNK_BYTES = 64 * 1024
_QUEUE_ITEMS = 256
_MOMENT_PERIOD_S = 0.2
_FLUSHES_PER_CHUNK = 5
"""An MCAP chunk's index, 1.5 kB and more, stays in memory until the file is closed: one a second is 5 MB an hour."""


@dataclass(frozen=True, slots=True)
class _Frames:
    """Records of one link, ready to be written."""

    link: str
    count: int
    data: bytes


@dataclass(frozen=True, slots=True)
class _Moment:
    """The team as an operator sees it."""

    team: TeamState
    phase: str
    time_left_s: float | None


class _Flush:
    """Everything so far belongs on the disk."""


class Recorder:
    """Writes one flight into one folder.

    Args:
        folder: An existing folder.
        scenario: What is flown; without it only ``.tlog`` files are written.
        attachments: Texts that go into the MCAP file, too, by their file names.
        limit_bytes: The recording stops at about this size.
        queue_items: Pieces that may wait for the disk before they are dropped.

    Attributes:
        folder: Where the files are.
        frames: Frames taken.
        dropped: Frames, moments and events lost because the disk did not keep up or failed.
        failure: Why the recording ended early; None while all is well.
    """

    def __init__(
        self,
        folder: Path,
        scenario: Scenario | None = None,
        *,
        attachments: dict[str, str] | None = None,
        limit_bytes: int = DEFAULT_LIMIT_MB * 1_000_000,
        queue_items: int = _QUEUE_ITEMS,
    ) -> None:
        self.folder = folder
        self.frames = 0
        self.dropped = 0
        self.failure: str | None = None
        self._failure_told = False
        self._dropped_told = 0
        self._buffers: dict[str, bytearray] = {}
        self._counts: dict[str, int] = {}
        self._next_moment_s = -math.inf
        self._phase: str | None = None
        self._closed = False
        self._queue: queue.Queue[_Frames | _Moment | Event | _Flush | None] = queue.Queue(queue_items)
        self._files = _Files(folder, scenario, attachments or {}, limit_bytes)
        self._thread = threading.Thread(target=self._write_all, name="recorder", daemon=True)
        self._thread.start()

    def write(self, link: str, time_usec: int, frame: bytes) -> None:
        """Take one frame of a link, received or sent at a UNIX time."""
        if self.failure is not None:
            self.dropped += 1
            return
        buffer = self._buffers.get(link)
        if buffer is None:
            buffer = self._buffers[link] = bytearray()
        buffer += stamped(time_usec, frame)
        self.frames += 1
        self._counts[link] = self._counts.get(link, 0) + 1
        if len(buffer) >= _CHUNK_BYTES:
            self._hand_over(link)

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Take the team as it is now: five times a second, and whenever its phase changes."""
        if team.time_s >= self._next_moment_s or phase != self._phase:
            self._next_moment_s = team.time_s + _MOMENT_PERIOD_S - 0.02
            self._phase = phase
            self._put(_Moment(team, phase, time_left_s))

    def event(self, event: Event) -> None:
        """Take something that happened."""
        self._put(event)

    def take_warnings(self) -> list[str]:
        """What has gone wrong since the last call, for the operator."""
        warnings = []
        if self.failure is not None and not self._failure_told:
            self._failure_told = True
            warnings.append(f"recording has stopped, the flight goes on: {self.failure}")
        if self.dropped > self._dropped_told and self.failure is None:
            self._dropped_told = self.dropped
            warnings.append(f"the disk does not keep up: {self.dropped} frames or moments are not in the recording")
        return warnings

    def flush(self) -> None:
        """Hand what has been taken to the writing thread; call it about once a second."""
        for link in list(self._buffers):
            self._hand_over(link)
        self._put(_Flush())

    def close(self, timeout_s: float = 5.0) -> None:
        """Write what is left and close the files; waits no longer than the timeout for the disk."""
        if self._closed:
            return
        self.flush()
        self._closed = True
        try:
            self._queue.put(None, timeout=timeout_s)
        except queue.Full:
            self.failure = self.failure or "the disk does not keep up"
            return
        self._thread.join(timeout_s)

    def _hand_over(self, link: str) -> None:
        buffer, count = self._buffers[link], self._counts.pop(link, 0)
        if buffer:
            self._put(_Frames(link, count, bytes(buffer)))
            buffer.clear()

    def _put(self, item: _Frames | _Moment | Event | _Flush) -> None:
        lost = item.count if isinstance(item, _Frames) else int(not isinstance(item, _Flush))
        if self.failure is not None or self._closed:
            self.dropped += lost
            return
        try:
            self._queue.put_nowait(item)
        except queue.Full:
            self.dropped += lost

    def _write_all(self) -> None:
        while (item := self._queue.get()) is not None:
            if self.failure is None:
                self.failure = self._files.take(item)
        self._files.close()


def link_names(scenario: Scenario) -> dict[SystemComponent, str]:
    """The team's links, by whose they are: each has a ``.tlog`` file of that name."""
    names = {}
    for vehicle in scenario.vehicles:
        names[vehicle.id, AUTOPILOT] = f"vehicle{vehicle.id}_autopilot"
        names[vehicle.id, ONBOARD] = f"vehicle{vehicle.id}_onboard"
    if scenario.simulation is not None:
        names[scenario.simulation.system_id, AUTOPILOT] = "bridge"
    return names


def record_flight(folder: Path, config: Path, scenario: Scenario, about: dict[str, Any], limit_mb: int) -> Recorder:
    """Begin the recording of a flight: what is flown with what, then all that is heard and shown.

    Args:
        folder: An existing folder.
        config: The scenario's file.
        scenario: What it says.
        about: The rest that one needs to fly it again.
        limit_mb: The recording stops at about this size, MB.

    Raises:
        GroundError: The folder cannot be written.
    """
    attachments = describe_run(folder, config, about)
    return Recorder(folder, scenario, attachments=attachments, limit_bytes=limit_mb * 1_000_000)


class _Files:
    """The files of a recording, in the writing thread alone."""

    def __init__(self, folder: Path, scenario: Scenario | None, attachments: dict[str, str], limit_bytes: int) -> None:
        self._folder = folder
        self._scenario = scenario
        self._attachments = attachments
        self._limit_bytes = limit_bytes
        self._tlogs: dict[str, FileIO] = {}
        self._mcap: McapLog | None = None
        self._written = 0
        self._flushes = 0
        self._broken = False

    def take(self, item: _Frames | _Moment | Event | _Flush) -> str | None:
        """Write one piece; the reason why this and all that follows cannot be written, or None."""
        path = self._folder / (f"{item.link}.tlog" if isinstance(item, _Frames) else MCAP_NAME)
        try:
            if isinstance(item, _Frames):
                self._append(item.link, path, item.data)
            elif self._scenario is not None:
                self._log(self._scenario, path, item)
        except (OSError, ValueError) as error:
            self._broken = True
            words = error.strerror if isinstance(error, OSError) else None
            return f"{path}: {words or error}"
        size = self._written + (self._mcap.size if self._mcap is not None else 0)
        if size >= self._limit_bytes:
            return f"it has reached its limit of {self._limit_bytes / 1e6:.4g} MB (--record-limit)"
        return None

    def close(self) -> None:
        """Close all files; the MCAP file gets its index unless writing has failed before."""
        try:
            if self._mcap is not None:
                self._mcap.close(complete=not self._broken)
        except OSError:
            self._broken = True  # it is read without its index, as after a crash
        for file in self._tlogs.values():
            file.close()

    def _append(self, link: str, path: Path, data: bytes) -> None:
        if link not in self._tlogs:
            self._tlogs[link] = path.open("ab", buffering=0)
        file, rest = self._tlogs[link], memoryview(data)
        while rest:  # a disk that is nearly full takes a part
            count = file.write(rest)
            self._written += count
            rest = rest[count:]

    def _log(self, scenario: Scenario, path: Path, item: _Moment | Event | _Flush) -> None:
        if self._mcap is None:
            self._mcap = McapLog(path, scenario, self._attachments)
        match item:
            case _Moment():
                self._mcap.moment(item.team, item.phase, item.time_left_s)
            case Event():
                self._mcap.event(item)
            case _Flush():
                self._flushes += 1
                if self._flushes % _FLUSHES_PER_CHUNK == 0:
                    self._mcap.flush()
