"""A recording's folder, read as far as it goes."""

from __future__ import annotations

import json
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from gcs.errors import GroundError
from gcs.output import printable
from gcs.recording.mcap_log import read_mcap
from gcs.recording.recorder import MCAP_NAME, OTHERS, link_names
from gcs.recording.tlog import read_tlog
from gcs.team import Event
from onboard.config import ConfigError, Scenario, load_scenario
from onboard.protocol import dialect as mavlink
from onboard.protocol.addressing import source_of

__all__ = ["HeardFrame", "PhaseMark", "Recording", "find_recording", "open_recording"]

_SEVERITIES = {entry.name: value for value, entry in mavlink.enums["MAV_SEVERITY"].items()}


@dataclass(frozen=True, slots=True)
class HeardFrame:
    """A frame of a log that came from the team.

    Attributes:
        time_s: UNIX time of its reception, s.
        frame: The raw frame.
        direct: Whether it came on its sender's own link; not, for what an autopilot passed on for its companion.
    """

    time_s: float
    frame: bytes
    direct: bool


@dataclass(frozen=True, slots=True)
class PhaseMark:
    """What the team was doing from a time on.

    Attributes:
        time_s: UNIX time, s.
        phase: In words.
        time_left_s: Until landing, s; None when there is no such time.
    """

    time_s: float
    phase: str
    time_left_s: float | None


@dataclass(frozen=True, slots=True)
class Recording:
    """What is left of a flight.

    Attributes:
        folder: Where it was read.
        scenario: What was flown.
        about: ``flight.json``: seed, versions; empty if it is missing.
        summary: ``summary.json``; None for a flight that did not come to its end.
        frames: What the team said, in the order of reception.
        events: What the operator was told; None if that was not kept, as in recordings without MCAP file.
        phases: By time; empty if that was not kept.
        problems: What is missing or damaged, one sentence each.
    """

    folder: Path
    scenario: Scenario
    about: dict[str, Any]
    summary: dict[str, Any] | None
    frames: tuple[HeardFrame, ...]
    events: tuple[Event, ...] | None
    phases: tuple[PhaseMark, ...]
    problems: tuple[str, ...]

    @property
    def start_s(self) -> float:
        """UNIX time of the first frame, s."""
        return self.frames[0].time_s

    @property
    def end_s(self) -> float:
        """UNIX time of the last frame, s."""
        return self.frames[-1].time_s

    @property
    def landing_since_s(self) -> float | None:
        """UNIX time at which landing began; None if it did not, or was not kept."""
        return next((mark.time_s for mark in self.phases if mark.phase == "landing"), None)


def find_recording(folder: Path) -> Path:
    """The folder itself, or the latest recording in it if it is none, as ``flights``."""
    inside = _recordings_in(folder)
    return inside[-1] if inside else folder


def open_recording(folder: Path) -> Recording:
    """Read the recording in a folder.

    Raises:
        GroundError: There is none, or nothing in it can be used.
    """
    if folder.is_file():
        raise GroundError(f"{folder}: is a file; name the folder that it is in")
    if not folder.is_dir():
        raise GroundError(f"{folder}: no such folder; `arvi fly` prints the folder that it records to")
    if inside := _recordings_in(folder):
        raise GroundError(f"{folder}: is no recording, but holds {len(inside)}; the latest is {inside[-1]}")
    try:
        scenario = load_scenario(folder / "scenario.yaml")
    except ConfigError as error:
        raise GroundError(f"{folder}: is no recording, or of another version: {error}") from None
    problems: list[str] = []
    try:
        frames = _read_links(folder, scenario)
        events, phases = _read_view(folder / MCAP_NAME, problems)
    except OSError as error:
        raise GroundError(f"{error.filename or folder}: cannot be read: {error.strerror or error}") from None
    if not frames:
        raise GroundError(f"{folder}: holds no .tlog file with anything that a team said")
    return Recording(
        folder=folder,
        scenario=scenario,
        about=_read_json(folder / "flight.json", problems) or {},
        summary=_read_json(folder / "summary.json", problems),
        frames=frames,
        events=events,
        phases=phases,
        problems=tuple(problems),
    )


def _recordings_in(folder: Path) -> list[Path]:
    """The recordings in a folder that is none itself; the latest comes last."""
    if (folder / "scenario.yaml").exists():
        return []
    found = sorted(folder.glob("*/scenario.yaml"), key=lambda path: path.stat().st_mtime)
    return [path.parent for path in found]


def _read_links(folder: Path, scenario: Scenario) -> tuple[HeardFrame, ...]:
    """What the team said on all links, in the order of time."""
    senders = {vehicle.id for vehicle in scenario.vehicles}
    if scenario.simulation is not None:
        senders.add(scenario.simulation.system_id)
    names = link_names(scenario)
    known = {*names.values(), OTHERS}
    heard = []
    for path in sorted(folder.glob("*.tlog")):
        for time_usec, frame in read_tlog(path):
            source = source_of(frame)
            if source[0] in senders:
                # A log of another program holds whole links, by whatever name.
                direct = path.stem not in known or names.get(source) == path.stem
                heard.append(HeardFrame(time_usec / 1e6, frame, direct))
    heard.sort(key=lambda item: item.time_s)
    return tuple(heard)


def _read_view(path: Path, problems: list[str]) -> tuple[tuple[Event, ...] | None, tuple[PhaseMark, ...]]:
    """What the operator was told, and the phases; nothing when the MCAP file is missing or empty."""
    lost = "what the operator was told is worked out from the messages, and when landing began is not known"
    if not path.exists():
        problems.append(f"{path.name} is missing: {lost}")
        return None, ()
    events: list[Event] = []
    phases: list[PhaseMark] = []
    cut_off: list[bool] = []
    for message in read_mcap(path, frozenset({"/events", "/team"}), cut_off=lambda: cut_off.append(True)):
        content = message.content
        if message.topic == "/events":
            severity = _SEVERITIES.get(str(content.get("file")), int(mavlink.MAV_SEVERITY_INFO))
            source, text = (printable(str(content.get(key, ""))) for key in ("name", "message"))
            events.append(Event(message.time_s, severity, source, text))
        elif content.get("phase"):
            left_s = content.get("time_left_s")
            known = left_s if isinstance(left_s, int | float) else None
            phases.append(PhaseMark(message.time_s, str(content["phase"]), known))
    if not events and not phases:
        problems.append(f"{path.name} cannot be read: {lost}")
        return None, ()
    if cut_off:
        last_s = max([event.time_s for event in events] + [mark.time_s for mark in phases])
        until = time.strftime("%H:%M:%S", time.localtime(last_s))
        problems.append(f"{path.name} is cut off or damaged: events and phases are known until {until}")
    return tuple(sorted(events, key=lambda event: event.time_s)), tuple(phases)


def _read_json(path: Path, problems: list[str]) -> dict[str, Any] | None:
    """What a JSON file says; None when it is missing or damaged."""
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        return None
    except (OSError, ValueError):
        content = None
    if not isinstance(content, dict):
        problems.append(f"{path.name} is damaged")
        return None
    return content
