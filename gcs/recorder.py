"""Recording: one ``.tlog`` per link, as QGroundControl, MAVProxy and Mission Planner read them.

A record is the 8-byte big-endian UNIX time in µs and the raw frame
(https://ardupilot.org/dev/docs/code-overview-adding-a-new-mavlink-message.html, telemetry logs). The event loop only
appends to memory; a thread of its own writes, so that a slow disk delays nobody, and a full one ends the recording,
not the flight.
"""

from __future__ import annotations

import queue
import struct
import threading
from collections.abc import Callable
from pathlib import Path

__all__ = ["Recorder"]

_STAMP = struct.Struct(">Q")
_CHUNK_BYTES = 64 * 1024
_QUEUE_CHUNKS = 64


class Recorder:
    """Writes the frames of several links into one folder.

    Args:
        folder: An existing folder.
        queue_chunks: Buffers that may wait for the disk before frames are dropped.

    Attributes:
        folder: Where the files are.
        frames: Frames taken.
        dropped: Frames lost because the disk did not keep up or failed.
        failure: Why the recording ended early; None while all is well.
    """

    def __init__(self, folder: Path, *, queue_chunks: int = _QUEUE_CHUNKS) -> None:
        self.folder = folder
        self.frames = 0
        self.dropped = 0
        self.failure: str | None = None
        self._failure_told = False
        self._dropped_told = 0
        self._buffers: dict[str, bytearray] = {}
        self._counts: dict[str, int] = {}
        self._queue: queue.Queue[tuple[str, bytes] | None] = queue.Queue(queue_chunks)
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
        buffer += _STAMP.pack(time_usec)
        buffer += frame
        self.frames += 1
        self._counts[link] = self._counts.get(link, 0) + 1
        if len(buffer) >= _CHUNK_BYTES:
            self._hand_over(link)

    def take_warnings(self) -> list[str]:
        """What has gone wrong since the last call, for the operator."""
        warnings = []
        if self.failure is not None and not self._failure_told:
            self._failure_told = True
            warnings.append(f"recording has stopped: {self.failure}")
        if self.dropped > self._dropped_told and self.failure is None:
            self._dropped_told = self.dropped
            warnings.append(f"the disk does not keep up: {self.dropped} frames are not in the recording")
        return warnings

    def flush(self) -> None:
        """Hand what has been taken to the writing thread; call it about once a second."""
        for link in list(self._buffers):
            self._hand_over(link)

    def close(self, timeout_s: float = 5.0) -> None:
        """Write what is left and close the files; waits no longer than the timeout for the disk."""
        self.flush()
        try:
            self._queue.put(None, timeout=timeout_s)
        except queue.Full:
            self.failure = self.failure or "the disk does not keep up"
            return
        self._thread.join(timeout_s)

    def _hand_over(self, link: str) -> None:
        buffer, count = self._buffers[link], self._counts.pop(link, 0)
        if not buffer:
            return
        try:
            self._queue.put_nowait((link, bytes(buffer)))
        except queue.Full:
            self.dropped += count
        buffer.clear()

    def _write_all(self) -> None:
        files: dict[str, Callable[[bytes], object]] = {}
        closers: list[Callable[[], None]] = []
        while (item := self._queue.get()) is not None:
            link, data = item
            if self.failure is not None:
                continue
            try:
                if link not in files:
                    file = (self.folder / f"{link}.tlog").open("ab", buffering=0)
                    files[link] = file.write
                    closers.append(file.close)
                files[link](data)
            except OSError as error:
                self.failure = f"{self.folder / link}.tlog: {error.strerror or error}"
        for close in closers:
            close()
