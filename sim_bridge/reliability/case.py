"""A row of the fault suite: a fault, and what is expected of a flight in which it happens."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

from onboard.config.faults import FaultConfig
from sim_bridge.autopilot.firmwares import Firmware
from sim_bridge.reliability.phases import Phase
from sim_bridge.reliability.reactions import CARRIES_ON, Reaction

__all__ = ["FENCE_M", "SEPARATION_M", "Case", "Expected", "Gap"]

FENCE_M = 0.3
"""How far outside the fence a vehicle may be: plans keep inside, tracking errors do not."""

SEPARATION_M = 0.5
"""The smallest distance in three dimensions: layers are 0.7 m apart in the lab, and vehicles bob."""


@dataclass(frozen=True, slots=True)
class Gap:
    """Something that the stack does not do yet.

    Attributes:
        text: What, in words.
        excuses: Regular expression: failures that it explains; any other one counts.
    """

    text: str
    excuses: str

    def explains(self, failures: Iterable[str]) -> bool:
        """Whether all of these failures are because of it."""
        return all(re.search(self.excuses, failure) for failure in failures)


@dataclass(frozen=True, slots=True)
class Expected:
    """What is expected in a phase.

    Attributes:
        reaction: What.
        deadline_s: By when after the fault's beginning, s.
        fence_m: How far outside the fence the vehicle may come, m.
        others: Whether all other vehicles carry on.
        ground_lands: Whether the ground may have to land a vehicle by its autopilot, past its onboard process.
        gap: What is missing in the stack for it; None when it holds.
    """

    reaction: Reaction = CARRIES_ON
    deadline_s: float = 0.0
    fence_m: float = FENCE_M
    others: bool = True
    ground_lands: bool = False
    gap: Gap | None = None


@dataclass(frozen=True, slots=True)
class Case:
    """A row of the table.

    Attributes:
        name: The fault in words.
        fault: What goes wrong, from when it is injected on.
        expected: By phase; phases that are left out are not flown.
        autopilot: What all vehicles are flown by.
    """

    name: str
    fault: FaultConfig
    expected: Mapping[Phase, Expected]
    autopilot: Firmware = "px4"

    def happening_to(self, vehicle_id: int) -> Case:
        """The same fault of one vehicle."""
        fault = self.fault.model_copy(update={"vehicles": (vehicle_id,)})
        return replace(self, fault=fault)

    @property
    def length_s(self) -> float | None:
        """How long the fault lasts, s; None for good."""
        return self.fault.until_s
