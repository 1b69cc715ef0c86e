"""Who may speak for an onboard process: with a team's key, only who signs with it. Autopilots' telemetry stays open."""

from __future__ import annotations

from collections import Counter

from gcs.commands import ONBOARD
from onboard.protocol.addressing import SystemComponent
from onboard.protocol.codec import RefusalNotice
from onboard.protocol.signing import SignedLink, Signing, Verdict

__all__ = ["OnboardGate"]


class OnboardGate:
    """Judges the frames of the team's link before anything is learned from them.

    Args:
        signing: The station's; None lets everything in.

    Attributes:
        signing: For what the station sends; None leaves it unsigned.
    """

    def __init__(self, signing: Signing | None) -> None:
        self.signing = None if signing is None else signing.link(SignedLink.GROUND)
        self._process = signing
        self._refused: Counter[Verdict] = Counter()
        self._notice = RefusalNotice()

    def advance(self, unix_s: float) -> None:
        """Tell the time."""
        if self._process is not None:
            self._process.advance(unix_s)

    def lets_in(self, frame: bytes, source: SystemComponent) -> bool:
        """Whether a frame is believed; a vehicle's onboard process signs every one."""
        if self.signing is None or source[1] != ONBOARD:
            return True
        verdict = self.signing.verify(frame)
        if verdict is not Verdict.GENUINE:
            self._refused[verdict] += 1
        return verdict is Verdict.GENUINE

    def notice(self, time_s: float) -> str | None:
        """One line for the operator if frames were refused that were not told of."""
        return self._notice.update("ground", self._refused, time_s)
