"""The receiving side of a session's streams (DDS-XRCE 1.0, 8.3.2.2 and 8.4): best effort and reliable.

A best-effort receiver takes what is newer than the last. A reliable receiver handles messages in order and keeps
those that came early, within a window of ``window`` messages; ``missing()`` is the bitmap of its ACKNACK. Sequence
numbers are 16 bit, compared as RFC 1982 says; both begin at 0.
"""

from array import array

from muros.compat import const, copy

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer
    from muros.xrce.fragments import Joiner

_BITS = const(16)

ACCEPT_DROP = 0
ACCEPT_NOW = 1
ACCEPT_LATER = 2


class BestEffortInput:
    """Takes messages that are newer than the last one."""

    reliable = False

    def __init__(self, stream_id: int) -> None:
        self.stream_id = stream_id
        self.last = 0xFFFF
        self.lost = 0

    def accept(self, number: int) -> int:
        """``ACCEPT_NOW`` for a newer message, else ``ACCEPT_DROP``; counts the numbers it skips in ``lost``."""
        ahead = number - self.last & 0xFFFF
        if ahead == 0 or ahead >= 0x8000:
            return ACCEPT_DROP
        self.lost += ahead - 1
        self.last = number
        return ACCEPT_NOW

    def reset(self) -> None:
        """Expects number 0 again."""
        self.last = 0xFFFF


class ReliableInput:
    """Takes every message once and in order; up to ``window`` may come early and are kept, each up to ``mtu`` bytes."""

    reliable = True

    def __init__(self, stream_id: int, mtu: int, window: int) -> None:
        if window & (window - 1) or not 0 < window <= 0x4000:
            raise ValueError("window is %d: it must be a power of two up to 16384" % window)
        self.stream_id = stream_id
        self.window = window
        self.expected = 0  # the number handled next
        self.end = 0  # behind the highest number seen or announced
        self.fragments: "Joiner | None" = None  # once a fragment came
        self.resume_at = 0  # where handling of the expected message goes on, if it is held
        self.busy = False  # a message of it is being handled
        self.stored = 0  # bit i: message expected + i is kept
        self._mtu = mtu
        self._make(mtu, window)

    def accept(self, number: int) -> int:
        """``ACCEPT_NOW`` (handle it, then call ``advance``), ``ACCEPT_LATER`` (call ``store``) or ``ACCEPT_DROP``."""
        ahead = number - self.expected & 0xFFFF
        if ahead >= self.window:
            return ACCEPT_DROP
        if ahead >= (self.end - self.expected & 0xFFFF):
            self.end = number + 1 & 0xFFFF
        if ahead == 0:
            return ACCEPT_NOW
        if self.stored >> ahead & 1:
            return ACCEPT_DROP
        return ACCEPT_LATER

    def store(self, number: int, buf: "Buffer", off: int, n: int) -> None:
        """Keeps a message that came early; one longer than the MTU is left to be sent again."""
        if n > self._mtu:
            return
        slot = number & self.window - 1
        self._sizes[slot] = n
        copy(self._slots, slot * self._mtu, buf, off, n)
        self.stored |= 1 << (number - self.expected & 0xFFFF)

    def advance(self) -> bool:
        """The expected message is handled. Whether the next one is kept, as ``ready`` says."""
        self.stored >>= 1
        self.resume_at = 0
        self.expected = self.expected + 1 & 0xFFFF
        if self.end - self.expected & 0x8000:
            self.end = self.expected
        return self.ready()

    def ready(self) -> bool:
        """Whether the expected message is kept: then it is ``buf[base:base + size]``."""
        if not self.stored & 1:
            return False
        slot = self.expected & self.window - 1
        self.base = slot * self._mtu
        self.size = self._sizes[slot]
        return True

    def announce(self, first: int, last: int) -> None:
        """Takes a HEARTBEAT: the peer keeps ``first`` to ``last`` and has given up what came before."""
        skip = first - self.expected & 0xFFFF
        if 0 < skip < 0x8000:
            self.stored >>= skip
            self.expected = first
            self.resume_at = 0
            if self.fragments is not None:
                self.fragments.tear()
            if self.end - first & 0x8000:
                self.end = first
        ahead = last + 1 - self.expected & 0xFFFF
        if (self.end - self.expected & 0xFFFF) < ahead < 0x8000:
            self.end = last + 1 & 0xFFFF

    def missing(self) -> int:
        """The bitmap of an ACKNACK: bit i set when ``expected + i`` is known to exist and not here."""
        known = self.end - self.expected & 0xFFFF
        if known == 0:
            return 0
        if known >= _BITS:
            return ~self.stored & 0xFFFF
        return ~self.stored & (1 << known) - 1

    def reset(self) -> None:
        """Expects number 0 again; kept messages are dropped."""
        self.expected = self.end = self.stored = self.resume_at = 0
        self.busy = False
        self.fragments = None

    def _make(self, mtu: int, window: int) -> None:
        self._slots = bytearray(mtu * window)
        self.buf: "Buffer" = self._slots
        self._sizes = array("H", bytearray(2 * window))
        self.base = 0
        self.size = 0
