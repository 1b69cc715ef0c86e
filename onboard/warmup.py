"""Compile or load every kernel of the onboard process: ``python -m onboard.warmup``.

The first time takes seconds and must not happen in flight; the launcher does it once before the team starts.
"""

from __future__ import annotations

import sys

from onboard.planning.warmup import warm_kernels

__all__ = ["main"]


def main() -> int:
    """Warm the kernels; the exit code."""
    warm_kernels()
    return 0


if __name__ == "__main__":
    sys.exit(main())
