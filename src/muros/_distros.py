"""Distributions of ROS 2, by what their processes tell of nodes.

This stands below the rooms that ask, as `_kinds` does.
"""

from typing import Final

__all__ = ["NEW_DISTROS", "OLD_DISTROS"]

OLD_DISTROS: Final = ("foxy", "galactic", "humble")
"""Those that write gids of 24 bytes."""

NEW_DISTROS: Final = ("iron", "jazzy", "kilted", "lyrical", "rolling")
"""Those that write 16."""
