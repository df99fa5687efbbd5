"""How much leaves a writer at once: an allowance of bytes, and submessages that share a datagram."""

from muros.rtps._endpoint import Send
from muros.rtps._reader_proxy import ReaderProxy
from muros.rtps._values import EntityId
from muros.rtps._wire import gap, split_numbers

__all__ = ["Allowance", "Packet", "gaps"]


class Allowance:
    """`burst` bytes may be sent at any time, and again after `pace` ns.

    What is sent while anything is left may overdraw it; the debt is paid before more is allowed.
    """

    __slots__ = ("_burst", "_left", "_pace", "_since")

    def __init__(self, burst: int, pace: int) -> None:
        self._burst = burst
        self._pace = pace
        self._left = burst
        self._since = 0

    def allows(self, now: int) -> bool:
        """Whether something may be sent."""
        if self._left <= 0:
            earned = (now - self._since) * self._burst // self._pace
            if earned > 0:
                self._left = min(self._burst, self._left + earned)
                self._since = now
        elif self._left == self._burst:
            self._since = now
        return self._left > 0

    def spend(self, size: int) -> None:
        """`size` bytes were sent."""
        self._left -= size


class Packet:
    """Submessages for one reader, sent together as long as they fit a datagram."""

    __slots__ = ("_filled", "_proxy", "_send", "_submessages", "size")

    def __init__(self, send: Send, proxy: ReaderProxy, size: int) -> None:
        self.size = size
        self._send = send
        self._proxy = proxy
        self._submessages: list[bytes] = []
        self._filled = 0

    def add(self, *submessages: bytes) -> None:
        """These go into one datagram, the one begun or the next."""
        size = sum(map(len, submessages))
        if self._submessages and self._filled + size > self.size:
            self.flush()
        self._submessages += submessages
        self._filled += size

    def flush(self) -> None:
        """Send what was begun."""
        if self._submessages:
            for place in self._proxy.places:
                self._send(self._submessages, self._proxy.prefix, place)
            self._submessages = []
            self._filled = 0


def gaps(reader: EntityId, writer: EntityId, gone: list[int]) -> list[bytes]:
    """GAPs for these rising numbers: as few as they fit (DDSI-RTPS 2.3, 8.3.7.4)."""
    submessages = []
    for base, numbers in split_numbers(gone):
        end = base + 1
        while end - base < len(numbers) and numbers[end - base] == end:
            end += 1
        submessages.append(gap(reader, writer, base, end, numbers[end - base :]))
    return submessages
