"""Submessages of a participant for one place, gathered while a call does its work, and sent together at its end.

Discovery with a process of many participants is many small submessages to one place. Each brings its destination.
"""

from typing import Any, Final

from muros.rtps._endpoint import Place, Send
from muros.rtps._values import GuidPrefix
from muros.rtps._wire import info_dst

__all__ = ["Gather"]

SIZE: Final = 1300
"""Bytes that are sent together; what is larger goes alone."""

_EVERYBODY: Final = info_dst(bytes(12))


class Gather:
    """Stands before a `Send`; `flush` lets go what has been gathered."""

    __slots__ = ("_pending", "_send", "_sizes")

    def __init__(self, send: Send) -> None:
        self._send = send
        self._pending: dict[Place, list[bytes]] = {}
        self._sizes: dict[Place, int] = {}

    def __call__(self, submessages: list[bytes], destination: GuidPrefix | None, place: Any) -> None:
        size = sum(map(len, submessages)) + len(_EVERYBODY)
        filled = self._sizes.get(place, 0)
        if filled and filled + size > SIZE:
            self._let_go(place)
            filled = 0
        gathered = self._pending.setdefault(place, [])
        gathered.append(_EVERYBODY if destination is None else info_dst(destination))
        gathered += submessages
        self._sizes[place] = filled + size

    def flush(self) -> None:
        """Send what has been gathered."""
        for place in tuple(self._pending):
            self._let_go(place)

    def _let_go(self, place: Place) -> None:
        del self._sizes[place]
        self._send(self._pending.pop(place), None, place)
