"""The operator's view as part of the recording."""

from __future__ import annotations

from gcs.recording.recorder import Recorder
from gcs.session import Display
from gcs.team import Event, TeamState

__all__ = ["RecordedDisplay"]


class RecordedDisplay:
    """A display whose operator's view is recorded."""

    def __init__(self, display: Display, recorder: Recorder) -> None:
        self._display = display
        self._recorder = recorder

    def show(self, team: TeamState, phase: str, time_left_s: float | None) -> None:
        """Display: show it and keep it."""
        self._recorder.show(team, phase, time_left_s)
        self._display.show(team, phase, time_left_s)

    def event(self, event: Event) -> None:
        """Display: show it and keep it."""
        self._recorder.event(event)
        self._display.event(event)
