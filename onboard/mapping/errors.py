"""What the map refuses."""

from onboard.errors import OnboardError

__all__ = ["MappingError"]


class MappingError(OnboardError):
    """A grid that cannot be made or a tile that does not fit it; the text says why."""
