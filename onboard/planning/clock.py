"""The clock that compiled kernels read, the same as ``time.perf_counter``."""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import types
from numpy.typing import NDArray

from onboard.planning.jit import kernel

__all__ = ["now_s"]

_CLOCK_MONOTONIC = 1  # Linux; time.perf_counter reads the same clock there

# Linked by its symbol, so that kernels which read the clock can be cached on disk.
_types: Any = types
_clock_gettime: Any = types.ExternalFunction("clock_gettime", _types.intc(_types.intc, _types.CPointer(_types.int64)))


@kernel
def now_s(timespec: NDArray[np.int64]) -> float:
    """The time on ``time.perf_counter``'s clock, s.

    Args:
        timespec: (2,) scratch that receives seconds and nanoseconds.
    """
    _clock_gettime(_CLOCK_MONOTONIC, timespec.ctypes)
    return float(timespec[0]) + 1e-9 * float(timespec[1])
