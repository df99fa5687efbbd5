"""A byte stream on a file descriptor, driven by the loop's readiness: serial lines, TCP connections, ptys.

Two layers. `ByteStream` moves bytes: it reads at most one buffer a wake-up, so that streams take turns, and it
writes at once what the system takes and keeps the rest, whole frames only, up to a limit. `Channel` adds the
framing and speaks in messages. Neither owns the descriptor: who opened it closes it, after `stop`.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable

from muros.links._framing import Cutter, Framing

READ_BYTES = 65536
"""Most bytes read from a stream in one wake-up, unless it is said otherwise."""


class ByteStream:
    """Reads and writes a non-blocking descriptor.

    ``on_bytes(data)`` gets what comes; ``on_end(reason)`` is called once when the stream has ended, never from
    within `write`; ``on_room()`` when what was queued has left. ``queue_bytes`` bounds what waits for a slow far end,
    yet an empty queue takes a frame of any size.
    """

    def __init__(
        self,
        fd: int,
        queue_bytes: int,
        on_bytes: Callable[[bytes], None],
        on_end: Callable[[str], None],
        read_bytes: int = READ_BYTES,
        on_room: Callable[[], None] | None = None,
    ) -> None:
        self._fd = fd
        self._on_room = on_room
        self._read_bytes = read_bytes
        self._limit = queue_bytes
        self._on_bytes = on_bytes
        self._on_end = on_end
        self._queue = bytearray()
        self._running = True
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(fd, self._readable)

    @property
    def queued(self) -> int:
        """Bytes that wait for the far end to take them."""
        return len(self._queue)

    def write(self, frame: bytes) -> bool:
        """Sends or queues the whole frame; False when the queue has no room for it or the stream has ended."""
        queue = self._queue
        if queue:
            if len(queue) + len(frame) > self._limit:
                return False
            queue += frame
            return True
        if not self._running:
            return False
        try:
            done = os.write(self._fd, frame)
        except (BlockingIOError, InterruptedError):
            done = 0
        except OSError as error:
            self._loop.call_soon(self._end, error.strerror or str(error))
            return False
        if done < len(frame):
            queue += memoryview(frame)[done:]
            self._loop.add_writer(self._fd, self._writable)
        return True

    def stop(self) -> None:
        """Ends without a call of ``on_end``; what is queued is lost."""
        if self._running:
            self._running = False
            self._loop.remove_reader(self._fd)
            self._loop.remove_writer(self._fd)
            self._queue.clear()

    def _readable(self) -> None:
        try:
            data = os.read(self._fd, self._read_bytes)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._end(error.strerror or str(error))
            return
        if data:
            self._on_bytes(data)
        else:
            self._end("closed by the far end")

    def _writable(self) -> None:
        queue = self._queue
        try:
            done = os.write(self._fd, queue)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._end(error.strerror or str(error))
            return
        del queue[:done]
        if not queue:
            self._loop.remove_writer(self._fd)
            if self._on_room is not None:
                self._on_room()

    def _end(self, reason: str) -> None:
        if self._running:
            self.stop()
            self._on_end(reason)


class Channel:
    """A byte stream that carries messages.

    ``on_messages`` gets each batch of (message, peer number), ``on_damage`` the kinds and numbers of framing errors
    that a read has shown, ``on_end`` the reason why the stream has ended; ``on_room`` is called when what was queued
    has left.
    """

    def __init__(
        self,
        fd: int,
        framing: Framing,
        queue_bytes: int,
        on_messages: Callable[[list[tuple[bytes, int]]], None],
        on_damage: Callable[[dict[str, int]], None],
        on_end: Callable[[str], None],
        read_bytes: int = READ_BYTES,
        on_room: Callable[[], None] | None = None,
    ) -> None:
        self._framing = framing
        self._cutter = Cutter(framing)
        self._on_messages = on_messages
        self._on_damage = on_damage
        self._stream = ByteStream(fd, queue_bytes, self._take, on_end, read_bytes, on_room)

    @property
    def queued(self) -> int:
        """Bytes that wait for the far end to take them."""
        return self._stream.queued

    def send(self, message: bytes, peer: int) -> bool:
        """Sends or queues one message; False when there is no room for it."""
        return self._stream.write(self._framing.frame(message, peer))

    def stop(self) -> None:
        """Ends in silence."""
        self._stream.stop()

    def _take(self, data: bytes) -> None:
        messages = self._framing.feed_untrusted(data)
        errors = self._cutter.fresh_errors()
        if errors:
            self._on_damage(errors)
        if messages:
            self._on_messages(messages)
