"""Samples whose end comes from the program piece by piece, so that nobody holds them whole.

    frames = Streamer(publisher, camera.read)
    frames.publish(Image(height=400, width=500, encoding="mono8", step=500), 200_000)

Theory of operation. A sample larger than a message of the session goes out in fragments, as many at a time as the
agent has acknowledged room for. Of a usual sample the session keeps all bytes until the last fragment is acknowledged.
Of a streamed one it keeps the message and asks for the rest when there is room for one more fragment; the fragments
on their way lie in the stream's own buffer, from where lost ones are sent again. Only when the session begins anew in
between, the sample begins again too, and the program is asked for its bytes from the first on.
"""

from muros.compat import const, copy
from muros.rclc.errors import RclError

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client._types import Outgoing

_PIECE = const(1024)  # bytes asked for at once where a sample is put together whole


class Streamer:
    """Publishes messages on ``publisher`` that are followed by bytes of ``fill``, one at a time.

    ``fill(buf, off, n, at)`` puts the ``n`` bytes from the ``at``-th on into ``buf[off:off + n]``; ``at`` goes up from
    0, and begins there again when the session had to begin anew. With ``element``, 1, 2, 4 or 8, messages end with an
    empty sequence whose elements take so many bytes: its count is set, and it is what ``fill`` gives. With 0 bytes
    are appended as they are. ``more()`` gives the number of bytes where ``publish`` is not told.

    ``on_end(sent)`` is called once for each sample that was taken: with True when the agent has all of it, with False
    when it was given up, by ``cancel``, by closing the context or since ``fill`` has raised; what that was comes out of
    the executor. Until then ``busy`` is true. Straight in a data space samples are put together at once.
    """

    def __init__(
        self,
        publisher: "Any",
        fill: "Callable[[bytearray, int, int, int], object]",
        element: int = 1,
        more: "Callable[[], int] | None" = None,
        on_end: "Callable[[bool], object] | None" = None,
    ) -> None:
        if element not in (0, 1, 2, 4, 8):
            raise ValueError(
                "element is %r, not the bytes of one: 1, 2, 4, 8, or 0 for no sequence" % element
            )
        self.publisher = publisher
        self.busy = False
        self.cancelled = False
        self._fill = fill
        self._element = element
        self._more = more
        self._on_end = on_end
        self._begun = False
        self._head = bytearray()
        self._n = 0

    def publish(self, message: "Outgoing", more: "int | None" = None) -> bool:
        """Sends a message and ``more`` bytes behind it; returns at once, whether that was taken.

        It is refused as any message is, and where another large one is still on its way. Raises RclError while the one
        before is, ValueError for a message without a sequence at its end, and for bytes that are no whole elements.
        """
        if self.busy:
            raise RclError("a sample is still being streamed: wait for on_end, or cancel it")
        if more is None:
            more = self._more() if self._more is not None else 0
        self._head = self._begin(message, more)
        self._n = len(self._head) + more
        self._begun = False
        kind = getattr(message, "TYPE", None)
        if kind is not None:
            self.TYPE = kind
        taken: bool = self.publisher.publish(self)
        if not self._begun:
            self._head = bytearray()
            if taken and self._on_end is not None:
                self._on_end(True)
        return taken

    def cancel(self) -> None:
        """Gives up the sample that is on its way, at its next piece."""
        self.cancelled = self.busy

    # For the middleware, to which we are the message

    def size(self) -> int:
        """Bytes of the body."""
        return self._n

    def write(self, buf: bytearray, off: int) -> int:
        """Writes the body whole; returns the offset behind it."""
        for at in range(0, self._n, _PIECE):
            self.piece(buf, off + at, min(self._n - at, _PIECE), at)
        return off + self._n

    def piece(self, buf: bytearray, off: int, n: int, at: int) -> None:
        """Writes ``n`` bytes of the body, from its ``at``-th on."""
        head = len(self._head)
        if at < head:
            k = min(head - at, n)
            copy(buf, off, self._head, at, k)
            off += k
            at += k
            n -= k
        if n:
            self._fill(buf, off, n, at - head)

    def begin(self) -> None:
        """It was taken and goes out piece by piece."""
        self.busy = self._begun = True

    def end(self, sent: bool) -> None:
        """All of it was sent, or it was given up."""
        self.busy = self.cancelled = False
        self._head = bytearray()
        if self._on_end is not None:
            self._on_end(sent)

    def _begin(self, message: "Outgoing", more: int) -> bytearray:
        """The body up to what is streamed."""
        element = self._element
        n = message.size()
        if more < 0 or (element and more % element):
            raise ValueError("%d bytes are no number of elements of %d B" % (more, element))
        head = bytearray(n + (-n % element if element and more else 0))
        message.write(head, 0)
        if element:
            if n < 4 or any(head[n - 4 : n]):
                raise ValueError("the message does not end with an empty sequence; see element")
            more //= element
            for i in range(n - 4, n):
                head[i] = more & 255
                more >>= 8
        return head
