"""The root of every error that this package raises on purpose."""

__all__ = ["BridgeError"]


class BridgeError(Exception):
    """Something the caller can act on; its text says what was wrong, where, and what would be right."""
