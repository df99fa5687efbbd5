"""What the commands for RT components share."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from typing import Final

__all__ = ["MISSING", "fail", "has_extra"]

MISSING: Final = 1
"""The exit status where the extra is not installed."""


def has_extra() -> bool:
    """Whether RT components can run here; if not, it is said how to get what they need."""
    if find_spec("jeteve_omniorb") is not None and find_spec("rtctree") is not None:
        return True
    fail("RT components need an ORB, which is an extra: pip install 'muros[rtc]'")
    return False


def fail(text: object) -> None:
    """Say what is wrong."""
    print(f"muros: {text}", file=sys.stderr)
