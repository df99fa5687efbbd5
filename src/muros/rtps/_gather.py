"""Submessages for one place, gathered while a call does its work, and sent together at its end.

Discovery between processes of many participants is many small submessages to one place. Each brings its destination.
Where the other side is of this kind, too, those of several participants of ours share a datagram: INFO_SRC says whose
the next ones are (DDSI-RTPS 2.3, 8.3.7.9). Others get a message of one participant, which all of them understand.
"""

from collections.abc import Callable
from typing import Final

from muros.rtps._values import GuidPrefix, Locator
from muros.rtps._wire import info_dst, info_src, message

__all__ = ["SIZE", "SIZE_HERE", "Gather"]

SIZE: Final = 1300
"""Bytes that are sent together over a network; what is larger goes alone."""

SIZE_HERE: Final = 16384
"""The same to a place on this host, where nothing cuts datagrams to pieces."""

EVERYBODY: Final = bytes(12)
"""As destination: whoever listens."""

INFO_SIZE: Final = 40
"""Bytes that say whose a submessage is, and for whom."""


class Gather:
    """Sends through `transmit`. `pending` is what has been gathered since the last `flush`."""

    __slots__ = ("_transmit", "pending")

    def __init__(self, transmit: Callable[[bytes, Locator], object]) -> None:
        self._transmit = transmit
        self.pending: dict[tuple[GuidPrefix, Locator], _Bundle] = {}

    def add(
        self,
        prefix: GuidPrefix,
        submessages: list[bytes],
        destination: GuidPrefix | None,
        place: Locator,
        joint: bool,
        size: int = SIZE,
    ) -> None:
        """Send these of the participant `prefix`. joint: together with those of others, up to `size` bytes."""
        key = (EVERYBODY if joint else prefix), place
        bundle = self.pending.get(key)
        added = sum(map(len, submessages)) + INFO_SIZE
        if bundle is not None and bundle.size + added > size:
            self._let_go(key)
            bundle = None
        if bundle is None:
            bundle = self.pending[key] = _Bundle(prefix)
        bundle.add(prefix, destination or EVERYBODY, submessages)

    def flush(self) -> None:
        """Send what has been gathered."""
        for key in tuple(self.pending):
            self._let_go(key)

    def _let_go(self, key: tuple[GuidPrefix, Locator]) -> None:
        self._transmit(b"".join(self.pending.pop(key).parts), key[1])


class _Bundle:
    """A message that grows."""

    __slots__ = ("_destination", "_prefix", "parts", "size")

    def __init__(self, prefix: GuidPrefix) -> None:
        self._prefix = prefix
        self._destination = EVERYBODY
        self.parts = [message(prefix)]
        self.size = len(self.parts[0])

    def add(self, prefix: GuidPrefix, destination: GuidPrefix, submessages: list[bytes]) -> None:
        parts = list(submessages)
        if destination != self._destination:
            self._destination = destination
            parts.insert(0, info_dst(destination))
        if prefix != self._prefix:
            self._prefix = prefix
            parts.insert(0, info_src(prefix))
        self.parts += parts
        self.size += sum(map(len, parts))
