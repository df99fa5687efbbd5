"""Attempts to connect that are over: a CREATE_CLIENT that the network repeats late does not begin a session again.

muros clients give each attempt a name of its own, in the property `PROPERTY`; other clients give none and are not
remembered.
"""

from typing import Final

__all__ = ["PROPERTY", "Attempts"]

PROPERTY: Final = "muros_id"
"""The property of a CREATE_CLIENT that names the attempt."""
MEMORY: Final = 10_000
"""How long an attempt is remembered, in ms."""


class Attempts:
    """The attempts of the last `MEMORY` ms, `most` of them at most, by client key and name; the oldest stand first."""

    __slots__ = ("_most", "_until")

    def __init__(self, most: int) -> None:
        self._most = most
        self._until: dict[tuple[bytes, str], int] = {}

    def __contains__(self, attempt: tuple[bytes, str]) -> bool:
        return attempt in self._until

    def __len__(self) -> int:
        return len(self._until)

    def remember(self, key: bytes, name: str, now: int) -> int:
        """An attempt is over at ``now``. Returns when it may be forgotten."""
        self._until.pop((key, name), None)
        self._until[key, name] = now + MEMORY
        if len(self._until) > self._most:
            del self._until[next(iter(self._until))]
        return now + MEMORY

    def tick(self, now: int) -> int | None:
        """Forgets what is older; returns when to call again, None while there is nothing to forget."""
        while (due := next(iter(self._until.values()), None)) is not None and due <= now:
            del self._until[next(iter(self._until))]
        return due
