"""Who has fallen silent and is worth telling of: peers within reach, all of them, the ground station."""

from __future__ import annotations

from onboard.flight.failsafes import Condition
from onboard.flight.states import AIRBORNE
from onboard.hearing import Hearing

__all__ = ["GROUND_SILENCE_S", "PEER_SILENCE_S", "WELL_WITHIN", "silences"]

PEER_SILENCE_S = 3.0
"""The operator is told of what lasts; ``strays.SILENT_S``, after which a peer is kept off, is much shorter."""
GROUND_SILENCE_S = 5.0
"""Of its heartbeat, which comes once a second."""
WELL_WITHIN = 0.5
"""Who was last heard from no farther than this share of the longest distance ever heard over has not flown off.

In 3 s a peer may fly far, so this is stricter than ``strays.py``, which foresees where it may have gone.
"""


def silences(hearing: Hearing, time_s: float, *, flown: bool) -> dict[Condition, str]:
    """What gives reason to worry at a UNIX time, with details in words.

    Args:
        hearing: Who was heard.
        time_s: UNIX time, s.
        flown: Whether this vehicle flies: nobody who lands, or stands on the ground, misses anybody.
    """
    found: dict[Condition, str] = {}
    if hearing.ground_s is not None and time_s - hearing.ground_s > GROUND_SILENCE_S:
        found[Condition.GROUND_LOST] = ""
    flying = {status.sender: hearing.peers[status.sender] for status in hearing.statuses if status.state in AIRBORNE}
    silent = {peer: heard for peer, heard in flying.items() if time_s - heard.heard_s > PEER_SILENCE_S}
    lost = sorted(peer for peer, heard in silent.items() if heard.apart_m < WELL_WITHIN * hearing.reach_m)
    if flown and lost:
        found[Condition.PEER_LOST] = ", ".join(f"vehicle {peer}" for peer in lost)
        if len(silent) == len(flying) > 1:
            found[Condition.PARTITION] = ""
    return found
