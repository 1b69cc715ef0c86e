"""The version of this program."""

from __future__ import annotations

from importlib.metadata import PackageNotFoundError, version

__all__ = ["program_version"]


def program_version() -> str:
    """As installed."""
    try:
        return version("arvi-flight-stack")
    except PackageNotFoundError:  # run from a source tree that was never installed
        return "(not installed)"
