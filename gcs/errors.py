"""The root of every error that this package raises on purpose."""

__all__ = ["GroundError"]


class GroundError(Exception):
    """Something the operator can act on; its text says what was wrong, where, and what would be right."""
