"""Partitions: which writers and readers of a topic may meet by the names of their groups (DDS 1.4, 2.2.3.13).

It stands below the rooms that ask, as `_kinds` does.
"""

from fnmatch import fnmatchcase
from typing import Final

__all__ = ["partitions_meet", "partitions_text"]

MAX_PARTITION: Final = 256
"""Characters of the name of a partition; longer ones meet nobody, for patterns cost time."""

MAX_PARTITION_PAIRS: Final = 10_000
"""Comparisons of partition names of one writer and one reader; pairs with more do not meet."""


def partitions_meet(ours: tuple[str, ...], theirs: tuple[str, ...]) -> bool:
    """Whether two have a partition in common. Names may be patterns, but not both of them; none is the one named ""."""
    if not (ours or theirs):
        return True
    mine, yours = ours or ("",), theirs or ("",)
    if len(mine) * len(yours) > MAX_PARTITION_PAIRS:
        return False
    return any(_meet(one, other) for one in mine for other in yours)


def partitions_text(names: tuple[str, ...]) -> str:
    """In words: "partition 'left', 'right'"."""
    words = ", ".join(repr(name) for name in names)
    return f"partition {words}" if words else "the default partition"


def _meet(one: str, other: str) -> bool:
    if len(one) > MAX_PARTITION or len(other) > MAX_PARTITION:
        return False
    if _is_pattern(one):
        return not _is_pattern(other) and fnmatchcase(other, one)
    if _is_pattern(other):
        return fnmatchcase(one, other)
    return one == other


def _is_pattern(name: str) -> bool:
    return "*" in name or "?" in name or "[" in name
