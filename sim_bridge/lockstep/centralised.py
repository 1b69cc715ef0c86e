"""The bound that distributed estimation is compared with: one filter that gets every robot's looks at once."""

from __future__ import annotations

from collections.abc import Collection, Sequence

from onboard.estimation.distributed_filter import DistributedFilter
from onboard.estimation.measurement import Look
from onboard.messages import Belief

__all__ = ["CentralFilter"]


class CentralFilter(DistributedFilter):
    """One filter that all agents share.

    Before a step's first agent, :meth:`collect` takes the looks of the whole team. The first agent's
    :meth:`advance` then advances with all of them, and for the others there is nothing left to do. Nothing is
    broadcast: everybody knows it all already.
    """

    _collected: tuple[Look, ...] = ()

    def collect(self, looks: Sequence[Look]) -> None:
        """The looks of all robots at the next step."""
        self._collected = tuple(looks)

    def advance(self, step: int, neighbours: Collection[int], looks: Sequence[Look]) -> None:
        """To ``step`` with all that was collected; a second call for one step changes nothing."""
        if self.step != step:
            super().advance(step, (), self._collected)

    def beliefs(self, sender: int, degree: int) -> list[Belief]:
        """None."""
        return []
