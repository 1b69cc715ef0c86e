"""What the filter refuses."""

from onboard.errors import OnboardError

__all__ = ["EstimationError"]


class EstimationError(OnboardError):
    """A belief or a call that the filter cannot use; the text names what is wrong with it."""
