"""When which tile is broadcast again, for robots that missed it: in turns, or all at once when one comes back."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

__all__ = ["ROUND", "ResendTurns"]

Mask = NDArray[np.bool_]

ROUND = 16
"""Turns of a round: in so many broadcasts every tile has its turn once."""

AT_ONCE = 16
"""Tiles that are broadcast together when all are wanted; for the radio's sake a larger map takes several broadcasts."""


class ResendTurns:
    """One turn a broadcast; a whole round at once when somebody came, which then rests until its time is over.

    Hence there are never more turns than broadcasts, however often somebody comes and goes.
    """

    def __init__(self) -> None:
        self._turn = 0
        self._ahead = 0
        self._hurried = 0
        self._wanted = False

    def want_all(self) -> None:
        """The next round shall be brought forward."""
        self._wanted = True

    def take(self, known: Mask) -> Mask:
        """Whose turn it is at a broadcast.

        Args:
            known: (tile rows, tile columns) tiles of which there is anything to tell.

        Returns:
            The same shape: tiles to broadcast again.
        """
        chosen = np.zeros_like(known)
        if self._wanted and self._ahead == 0:
            self._hurried = ROUND if known.any() else 0
            self._wanted = False
        if self._hurried:
            while self._hurried and not self._is_full(chosen, known):
                self._take_turn(chosen, known)
                self._hurried -= 1
                self._ahead += 1
        elif self._ahead == 0:
            self._take_turn(chosen, known)
            return chosen
        self._ahead -= 1
        return chosen

    def _take_turn(self, chosen: Mask, known: Mask) -> None:
        chosen.flat[self._turn :: ROUND] |= known.flat[self._turn :: ROUND]
        self._turn = (self._turn + 1) % ROUND

    def _is_full(self, chosen: Mask, known: Mask) -> bool:
        """Whether the next turn would make too many tiles at once; never for the first."""
        count = int(chosen.sum())
        return count > 0 and count + int(known.flat[self._turn :: ROUND].sum()) > AT_ONCE
