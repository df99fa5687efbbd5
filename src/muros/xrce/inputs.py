"""The receiving side of a session's streams (DDS-XRCE 1.0, 8.3.2.2 and 8.4): best effort and reliable.

A best-effort receiver takes what is newer than the last. A reliable receiver handles messages in order and keeps
those that came early, within a window of ``window`` messages; ``missing()`` is the bitmap of its ACKNACK. Sequence
numbers are 16 bit, compared as RFC 1982 says; both begin at 0.

Memory is taken for messages that came early only, and while they wait: on most lines none does.
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer
    from muros.xrce.fragments import Joiner

_STREAM_RELIABLE = const(0x80)
_BITS = const(16)


class Input:
    """A stream as its receiver sees it, reliable when its id is: then messages that come early are kept, less than
    ``window`` of them, each up to ``mtu`` bytes."""

    def __init__(self, stream_id: int, mtu: int = 0, window: int = 1) -> None:
        self.stream_id = stream_id
        self.reliable = stream_id >= _STREAM_RELIABLE
        self.mtu = mtu
        self.window = window
        self.lost = 0  # messages that a best-effort stream has skipped
        self.early: "dict[int, bytes]" = {}  # messages that are kept, by their numbers
        self.reset()

    def reset(self) -> None:
        """Expects number 0 again; kept messages are dropped."""
        self.expected = 0  # the number handled next
        self.known = 0  # how many messages from there on were seen or announced
        self.early.clear()
        self.resume_at = 0  # where handling of the expected message goes on, if it is held
        self.busy = False  # a message of it is being handled
        self.fragments: "Joiner | None" = None  # once a fragment came

    def accept(self, number: int, buf: "Buffer", off: int, n: int) -> bool:
        """Takes a message; whether it is to be handled now. One that came early is kept, others are dropped."""
        ahead = number - self.expected & 0xFFFF
        if not self.reliable:
            if ahead >= 0x7FFF:
                return False
            self.lost += ahead
            self.expected = number + 1 & 0xFFFF
            return True
        if ahead >= self.window:
            return False
        if ahead >= self.known:
            self.known = ahead + 1
        if ahead:
            self.keep(number, buf, off, n)
        return ahead == 0

    def keep(self, number: int, buf: "Buffer", off: int, n: int) -> None:
        """Keeps a message that came early, or is held; what is longer than the MTU or the heap is sent again."""
        if n <= self.mtu and number not in self.early:
            try:
                self.early[number] = bytes(memoryview(buf)[off : off + n])
            except MemoryError:
                pass

    def advance(self, count: int) -> None:
        """The next ``count`` messages are handled or given up."""
        self.expected = self.expected + count & 0xFFFF
        self.known = max(self.known - count, 0)
        self.resume_at = 0
        if self.early:
            for number in list(self.early):
                if number - self.expected & 0x8000:
                    del self.early[number]

    def announce(self, first: int, last: int) -> None:
        """Takes a HEARTBEAT: the peer keeps ``first`` to ``last`` and has given up what came before."""
        count = first - self.expected & 0xFFFF
        if 0 < count < 0x8000:
            self.advance(count)
            if self.fragments is not None:
                self.fragments.tear()
        count = last + 1 - self.expected & 0xFFFF
        if self.known < count < 0x8000:
            self.known = count

    def missing(self) -> int:
        """The bitmap of an ACKNACK: bit i set when ``expected + i`` is known to exist and not here."""
        bitmap = (1 << min(self.known, _BITS)) - 1
        for number in self.early:
            bitmap &= ~(1 << (number - self.expected & 0xFFFF))
        return bitmap
