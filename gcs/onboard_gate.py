"""What is believed on the team's link once the team has a key: what it signed, and the telemetry on a short list.

Without a signature only these are heard: the components of the team's own vehicles other than their onboard processes
(autopilots, cameras and gimbals do not have the key), and the bridge where there is one. Their word moves no onboard
process: it fills the display.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Collection

from gcs.commands import ONBOARD
from onboard.protocol.addressing import SystemComponent
from onboard.protocol.codec import BROADCAST_BY_ALL, RefusalNotice, message_id
from onboard.protocol.signing import SignedLink, Signing, Verdict

__all__ = ["OnboardGate"]


class OnboardGate:
    """Judges the frames of the team's link before anything is learned from them.

    Args:
        signing: The station's; None lets everything in.
        unsigned_systems: Systems whose components are heard without a signature, their onboard processes excepted.

    Attributes:
        signing: For what the station sends; None leaves it unsigned.
    """

    def __init__(self, signing: Signing | None, unsigned_systems: Collection[int] = ()) -> None:
        self.signing = None if signing is None else signing.link(SignedLink.GROUND)
        self._process = signing
        self._unsigned_systems = frozenset(unsigned_systems)
        self._refused: Counter[Verdict] = Counter()
        self._notice = RefusalNotice()

    def advance(self, unix_s: float) -> None:
        """Tell the time."""
        if self._process is not None:
            self._process.advance(unix_s)

    def lets_in(self, frame: bytes, source: SystemComponent, arrived_s: float) -> bool:
        """Whether a frame is believed; a vehicle's onboard process signs every one.

        Args:
            frame: A whole frame.
            source: Who sent it.
            arrived_s: UNIX time at which it arrived, s: a station that stood still does not take it for the future's.
        """
        if self.signing is None or (source[1] != ONBOARD and source[0] in self._unsigned_systems):
            return True
        self.advance(arrived_s)
        verdict = self.signing.verify(frame)
        stranger = verdict is Verdict.UNSIGNED and source[1] != ONBOARD and message_id(frame) in BROADCAST_BY_ALL
        if verdict is not Verdict.GENUINE and not stranger:
            self._refused[verdict] += 1
        return verdict is Verdict.GENUINE

    def notice(self, time_s: float) -> str | None:
        """One line for the operator if frames were refused that were not told of."""
        return self._notice.update("ground", self._refused, time_s)
