"""Robot middleware from a microcontroller to a fleet."""

__version__ = "0.1.0"
