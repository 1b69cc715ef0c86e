"""What is wrong with a configuration file."""

from onboard.errors import OnboardError

__all__ = ["ConfigError"]


class ConfigError(OnboardError):
    """A configuration file that cannot be used; the text has one line for each mistake."""
