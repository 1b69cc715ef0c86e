"""How the planner's kernels are compiled: cached on disk, with the GIL released, and never stale."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

import numba

__all__ = ["entry_kernel", "inlined_kernel", "is_cached", "kernel", "source_digest"]

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def source_digest(folder: Path = Path(__file__).parent) -> str:
    """A digest of the sources in a folder, the planner's unless told otherwise."""
    digest = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


# Kernels own no memory: callers keep all arrays alive. Without Numba's reference counts (_nrt) they run at two to three
# times the speed, for each array handed from one kernel to the next would cost two atomic operations.
# No fast-math: IEEE arithmetic in the written order gives the same plan on every machine.
_OPTIONS: dict[str, Any] = {"nogil": True, "error_model": "numpy", "_nrt": False}
_compile: Any = numba.njit


def kernel(function: Function) -> Function:
    """Compile a function that runs without the interpreter (no objects, no exceptions, no GIL, no new arrays)."""
    return cast(Function, _compile(**_OPTIONS)(function))


def inlined_kernel(function: Function) -> Function:
    """A kernel that becomes part of its caller: it is compiled once and not also by itself."""
    return cast(Function, _compile(**_OPTIONS, inline="always")(function))


def entry_kernel(function: Function) -> Function:
    """Compile a kernel that Python calls, and keep its machine code on disk.

    Numba looks only at the file of the function itself when it decides whether cached code is still valid, and would
    go on running old code after a change in a kernel that this one calls. So the stamp is replaced by a digest of all
    of the planner's sources, and of those beside the function.
    """
    dispatcher = _compile(**_OPTIONS, cache=True)(function)
    stamp = source_digest(), source_digest(Path(function.__code__.co_filename).parent)
    dispatcher._cache._cache_file._source_stamp = stamp
    return cast(Function, dispatcher)


def is_cached(dispatcher: Callable[..., Any]) -> bool:
    """Whether the disk holds machine code of an entry kernel that is current."""
    cache_file: Any = cast(Any, dispatcher)._cache._cache_file
    return bool(cache_file._load_index())
