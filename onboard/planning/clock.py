"""The clocks that compiled kernels read; :class:`onboard.planning.plan.SearchClock` says which there are."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import types
from numpy.typing import NDArray

from onboard.planning.jit import inlined_kernel, kernel

__all__ = ["Deadline", "is_past", "now_s"]


class Deadline(NamedTuple):
    """When a search must end.

    Attributes:
        at_s: The instant, s; ∞ for none.
        clock: On which clock, a ``SearchClock``.
    """

    at_s: float
    clock: int


# Linked by its symbol, so that kernels which read the clock can be cached on disk.
_types: Any = types
_clock_gettime: Any = types.ExternalFunction("clock_gettime", _types.intc(_types.intc, _types.CPointer(_types.int64)))


@kernel
def now_s(clock: int, timespec: NDArray[np.int64]) -> float:
    """The time on a clock, s.

    Args:
        clock: Which ``SearchClock``.
        timespec: (2,) scratch that receives seconds and nanoseconds.
    """
    _clock_gettime(clock, timespec.ctypes)
    return float(timespec[0]) + 1e-9 * float(timespec[1])


@inlined_kernel
def is_past(deadline: Deadline, timespec: NDArray[np.int64]) -> bool:
    """Whether a deadline is over; ``timespec`` as for :func:`now_s`."""
    return now_s(deadline.clock, timespec) > deadline.at_s
