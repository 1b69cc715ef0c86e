"""How the commands of ``arvi`` end; 0 is fine."""

from __future__ import annotations

__all__ = ["EXIT_BAD_INPUT", "EXIT_FAILED", "EXIT_INTERRUPTED"]

EXIT_FAILED = 1
"""Something went wrong while it ran."""

EXIT_BAD_INPUT = 2
"""What was given cannot be used."""

EXIT_INTERRUPTED = 130
"""By Ctrl-C."""
