"""The MCAP file of a flight (https://mcap.dev/spec): JSON messages with Foxglove's schemas.

Each second ends a chunk, so that a process that is killed leaves a file without index whose chunks can be read.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcap.exceptions import McapError
from mcap.records import Channel, Message
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from zstandard import ZstdError

from gcs.recording.scene import Scene, channels, event_message
from gcs.recording.scene_parts import nanoseconds
from gcs.team import Event, TeamState
from onboard.config import Scenario

__all__ = ["LoggedMessage", "McapLog", "read_mcap"]

_MEDIA_TYPES = {".yaml": "application/yaml", ".json": "application/json"}


@dataclass(frozen=True, slots=True)
class LoggedMessage:
    """A message of an MCAP file.

    Attributes:
        topic: Its channel's topic.
        time_s: When it was logged, UNIX time, s.
        content: What it says.
    """

    topic: str
    time_s: float
    content: dict[str, Any]


class McapLog:
    """Writes the MCAP file.

    Args:
        path: A new file.
        scenario: Whose team it is.
        attachments: Texts by file names.

    Raises:
        OSError: It cannot be written; so do all methods.
    """

    def __init__(self, path: Path, scenario: Scenario, attachments: dict[str, str]) -> None:
        self._file = _WholeWrites(path)
        self._writer = Writer(self._file)  # type: ignore[arg-type]  # write, tell and flush are all that it uses
        self._scene = Scene(scenario)
        self._sequence: dict[int, int] = {}
        self._channels: dict[str, int] = {}
        try:
            self._begin(scenario, attachments)
        except OSError:
            self._file.close()
            raise

    @property
    def size(self) -> int:
        """Bytes written so far."""
        return self._file.tell()

    def moment(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Log the team at one moment."""
        for topic, content in self._scene.messages(team, phase, time_left_s):
            self._add(topic, team.time_s, content)

    def event(self, event: Event) -> None:
        """Log something that happened."""
        topic, content = event_message(event)
        self._add(topic, event.time_s, content)

    def flush(self) -> None:
        """Write all that has been logged as a chunk."""
        self._writer.flush()

    def close(self, *, complete: bool) -> None:
        """Close the file, complete with its index unless an earlier write has failed."""
        try:
            if complete:
                self._writer.finish()
        finally:
            self._file.close()

    def _begin(self, scenario: Scenario, attachments: dict[str, str]) -> None:
        self._writer.start(profile="", library="arvi-flight-stack")
        for name, text in attachments.items():
            media_type = _MEDIA_TYPES.get(Path(name).suffix, "text/plain")
            self._writer.add_attachment(0, 0, name, media_type, text.encode())
        schemas: dict[str, int] = {}
        for topic, schema in channels(scenario).items():
            name = schema["title"]
            if name not in schemas:
                schemas[name] = self._writer.register_schema(name, "jsonschema", json.dumps(schema).encode())
            self._channels[topic] = self._writer.register_channel(topic, "json", schemas[name])

    def _add(self, topic: str, time_s: float, content: dict[str, Any]) -> None:
        channel = self._channels[topic]
        sequence = self._sequence[channel] = self._sequence.get(channel, -1) + 1
        time_ns = nanoseconds(time_s)
        data = json.dumps(content, separators=(",", ":"), allow_nan=False).encode()
        self._writer.add_message(channel, time_ns, data, time_ns, sequence)


def read_mcap(
    path: Path, topics: frozenset[str] | None = None, *, cut_off: Callable[[], None] = lambda: None
) -> Iterator[LoggedMessage]:
    """The messages of a file in their order, as far as it goes; a file without index, or cut off, is no error.

    Args:
        path: The file.
        topics: Those that are wanted; None wants all.
        cut_off: Called at the end if the file ends early or is damaged there.

    Raises:
        OSError: It cannot be read.
    """
    names: dict[int, str] = {}
    with path.open("rb") as file:
        try:
            for record in StreamReader(file, validate_crcs=True).records:
                if isinstance(record, Channel):
                    names[record.id] = record.topic
                elif isinstance(record, Message):
                    topic = names.get(record.channel_id, "")
                    if topics is None or topic in topics:
                        yield LoggedMessage(topic, record.log_time / 1e9, dict(json.loads(record.data)))
        except (McapError, ZstdError, struct.error, ValueError, TypeError, LookupError):
            cut_off()  # whoever wrote it was stopped


class _WholeWrites:
    """A file that is written without a buffer of its own, and never half."""

    def __init__(self, path: Path) -> None:
        self._file = path.open("wb", buffering=0)
        self._position = 0

    def write(self, data: bytes) -> int:
        rest = memoryview(data)
        while rest:  # a disk that is nearly full takes a part
            count = self._file.write(rest)
            self._position += count
            rest = rest[count:]
        return len(data)

    def tell(self) -> int:
        return self._position

    def flush(self) -> None:
        """Nothing is held back."""

    def close(self) -> None:
        self._file.close()
