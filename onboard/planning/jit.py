"""How the planner's kernels are compiled: cached on disk, with the GIL released, and never stale."""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import cache
from pathlib import Path
from typing import Any, TypeVar, cast

from numba import njit

__all__ = ["entry_kernel", "inlined_kernel", "kernel", "source_digest"]

Function = TypeVar("Function", bound=Callable[..., Any])


@cache
def source_digest(folder: Path = Path(__file__).parent) -> str:
    """A digest of all sources of a package, by default the planner's: its kernels are valid for exactly this text."""
    digest = hashlib.sha256()
    for path in sorted(folder.glob("*.py")):
        digest.update(path.name.encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


def kernel(function: Function) -> Function:
    """Compile a function that runs without the interpreter (no objects, no exceptions, no GIL).

    No fast-math: IEEE arithmetic in the written order gives the same plan on every machine.
    """
    return cast(Function, njit(nogil=True, _nrt=False, error_model="numpy")(function))


def inlined_kernel(function: Function) -> Function:
    """A kernel that becomes part of its caller: it is compiled once and not also by itself."""
    return cast(Function, njit(nogil=True, _nrt=False, error_model="numpy", inline="always")(function))


def entry_kernel(function: Function) -> Function:
    """Compile a kernel that Python calls, and keep its machine code on disk.

    Numba looks only at the file of the function itself when it decides whether cached code is still valid, and would
    go on running old code after a change in a kernel that this one calls. So the stamp is replaced by a digest of all
    sources of the function's package.
    """
    dispatcher = njit(nogil=True, _nrt=False, error_model="numpy", cache=True)(function)
    dispatcher._cache._cache_file._source_stamp = source_digest(Path(function.__code__.co_filename).parent)
    return cast(Function, dispatcher)
