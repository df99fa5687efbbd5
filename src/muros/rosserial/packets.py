"""Frames of rosserial, both versions: made, and found in a stream of bytes that may be damaged.

Version 0xFE: ``FF FE``, length (u16), checksum of the length, topic id (u16), payload, checksum of id and payload.
Version 0xFF: ``FF FF``, topic id, length, payload, one checksum of all three. Numbers are little endian; a checksum
makes the sum of what it covers and itself 255 modulo 256. Nothing is escaped, so a frame may begin inside another.

How the decoder stays in step: whatever looks like a frame and proves not to be one costs its first byte only; the
search goes on right behind it, so that a good frame is found wherever it begins, also inside a damaged one. What
looks like a frame and is not complete yet has to be waited for, though a damaged length may announce bytes that
never come. Such a one is given up when the line has paused since it began, in all longer than a sender would within
a frame, *and* a whole good frame stands behind its beginning; or after a long pause in any case. And as adding up is
what costs time, each byte received pays for a few bytes added; bytes that are made up to cost more are skipped over.
"""

from muros.compat import MPY, const, copy, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.xrce._types import Buffer

VERSION_HYDRO = const(0xFE)
VERSION_GROOVY = const(0xFF)
ANY_VERSION = const(0)

_SYNC = const(0xFF)
_VERSION_HYDRO = const(0xFE)
_VERSION_GROOVY = const(0xFF)
_MAX_PAYLOAD = const(0xFFFF)
_OVERHEAD = const(8)
_PAUSE = const(40)
_SILENCE = const(1000)
_WORK = const(16)

_MORE = const(0)
_NO_FRAME = const(-1)
_BAD_LENGTH = const(-2)
_TOO_LONG = const(-3)
_BAD_CHECKSUM = const(-4)


def head_size(version: int = _VERSION_HYDRO) -> int:
    """Bytes of a frame before its payload; one more stands behind it."""
    return 7 if version == _VERSION_HYDRO else 6


def frame(topic_id: int, payload: "Buffer", version: int = _VERSION_HYDRO) -> bytes:
    """The frame that carries ``payload`` to ``topic_id``. ValueError if it is longer than 65535 bytes."""
    n = len(payload)
    if n > _MAX_PAYLOAD:
        raise ValueError("a rosserial payload has at most 65535 bytes, this one has " + str(n))
    if version == _VERSION_HYDRO:
        head = bytes(
            (255, 254, n & 255, n >> 8, ~(n + (n >> 8)) & 255, topic_id & 255, topic_id >> 8),
        )
        total = sum(payload) + topic_id + (topic_id >> 8)
    else:
        head = bytes((255, 255, topic_id & 255, topic_id >> 8, n & 255, n >> 8))
        total = sum(payload) + topic_id + (topic_id >> 8) + n + (n >> 8)
    return head + payload + bytes((~total & 255,))


def finish(buf: bytearray, off: int, topic_id: int, n: int, version: int = _VERSION_HYDRO) -> int:
    """Makes a frame at ``off`` around the payload of ``n`` bytes that stands at ``off + head_size(version)``.

    Returns the offset behind the frame. Allocates nothing.
    """
    buf[off] = 255
    buf[off + 1] = version
    if version == _VERSION_HYDRO:
        buf[off + 2] = n & 255
        buf[off + 3] = n >> 8
        buf[off + 4] = ~(n + (n >> 8)) & 255
        off += 5
    else:
        buf[off + 4] = n & 255
        buf[off + 5] = n >> 8
        off += 2
    buf[off] = topic_id & 255
    buf[off + 1] = topic_id >> 8
    end = off + 2 + n + (0 if version == _VERSION_HYDRO else 2)
    buf[end] = ~_total(buf, off, end) & 255
    return end + 1


class Decoder:
    """Takes the bytes of a line as they come and hands on the payloads of good frames.

    ``on_frame(topic_id, buf, off, n)`` is called for each; ``buf[off:off + n]`` is valid until it returns. When it
    returns False, the frame makes no sense: it may be damage that the checksum lets through, and the search goes on
    inside it.
    ``capacity`` is the longest payload taken, in bytes; ``limit`` may be lowered to what was negotiated, so that
    a damaged length shows at once. ``version`` is what is spoken, or ``ANY_VERSION``; ``heard`` is the version of the
    last good frame. ``byte_us`` is how long a byte takes on the line, in microseconds, 0 if that is no matter.

    Counters: ``frames`` good ones, ``refused`` by ``on_frame``, ``bad_checksum``, ``bad_length`` (the length's
    checksum), ``too_long`` (beyond ``limit``), ``cut`` (given up before they were complete), ``garbage`` bytes outside
    good frames.
    """

    def __init__(
        self,
        capacity: int = _MAX_PAYLOAD,
        on_frame: "Callable[[int, bytearray, int, int], object] | None" = None,
        version: int = _VERSION_HYDRO,
        byte_us: int = 0,
    ) -> None:
        self.on_frame = on_frame
        self.limit = capacity
        self.version = version
        self.heard = 0
        self.byte_us = byte_us
        self.frames = 0
        self.refused = 0
        self.bad_checksum = 0
        self.bad_length = 0
        self.too_long = 0
        self.cut = 0
        self.garbage = 0
        self._buf = bytearray(capacity + _OVERHEAD)
        self._end = 0
        self._since = 0
        self._had = 0
        self._last = 0
        self._need = 0
        self._credit = 0

    @property
    def pending(self) -> int:
        """Bytes kept of a frame that is not complete; ``tick`` is to be called while there are some."""
        return self._end

    def feed(self, data: "Buffer", n: int, now: int) -> None:
        """Takes ``data[:n]``, which came at ``now`` (ticks in ms); calls ``on_frame`` for each frame it completes."""
        buf = self._buf
        room = len(buf)
        self._credit = min(self._credit + _WORK * n, _WORK * room)
        self._last = now
        at = 0
        while at < n:
            end = self._end
            if end == 0:
                self._since = now
                self._had = 0
            take = min(n - at, room - end)
            copy(buf, end, data, at, take)
            at += take
            self._drop(self._scan(0, end + take), end + take, now)

    def tick(self, now: int) -> int:
        """Gives up what will never be complete; returns in how many ms to call again, -1: when more bytes came."""
        while self._end:
            quiet = ticks_diff(now, self._last)
            busy = (self._end - self._had) * self.byte_us // 1000
            due = _PAUSE - max(quiet, ticks_diff(now, self._since) - busy)
            if quiet >= _SILENCE or (due <= 0 and self._another()):
                self.cut += 1
                self.garbage += 1
                self._drop(self._scan(1, self._end), self._end, now)
            else:
                return due if due > 0 else max(1, _SILENCE - quiet)
        return -1

    def reset(self) -> None:
        """Forgets what is not complete, as when the line was opened anew; the counters stay."""
        self._end = 0

    def _drop(self, off: int, end: int, now: int) -> None:
        """The bytes before ``off`` are done with; what is left up to ``end`` moves to the front."""
        rest = end - off
        if off:
            if rest:
                self._buf[:rest] = self._buf[off:end]
            self._since = now
            self._had = rest
        self._end = rest

    def _scan(self, off: int, end: int) -> int:
        """Hands on the good frames from ``off`` on; returns where one begins that is not complete, or ``end``."""
        buf = self._buf
        while off < end:
            at = _find_sync(buf, off, end)
            if at != off:
                self.garbage += at - off
                off = at
                continue
            size = self._look(off, end)
            if size > 0:
                self.heard = version = buf[off + 1]
                taken: object = None
                if self.on_frame is not None:
                    if version == _VERSION_HYDRO:
                        taken = self.on_frame(buf[off + 5] | buf[off + 6] << 8, buf, off + 7, size - 8)
                    else:
                        taken = self.on_frame(buf[off + 2] | buf[off + 3] << 8, buf, off + 6, size - 7)
                if taken is False and self._credit >= 0:
                    self.refused += 1
                    self.garbage += 1
                    off += 1
                    continue
                self.frames += 1
                off += size
                continue
            if size == _MORE:
                break
            skip = 1
            if size == _BAD_LENGTH:
                self.bad_length += 1
            elif size == _TOO_LONG:
                self.too_long += 1
            elif size == _BAD_CHECKSUM:
                self.bad_checksum += 1
                if self._credit < 0:
                    skip = self._need
            self.garbage += skip
            off += skip
        return off

    def _look(self, off: int, end: int) -> int:
        """The size of the good frame at ``off``, ``_MORE`` if it may become one, or what is wrong with it."""
        buf = self._buf
        left = end - off
        self._need = _OVERHEAD
        if left < 2:
            return _MORE
        version = self.version
        if buf[off + 1] == _VERSION_HYDRO and version != _VERSION_GROOVY:
            if left < 5:
                return _MORE
            n = buf[off + 2] | buf[off + 3] << 8
            if (buf[off + 2] + buf[off + 3] + buf[off + 4]) & 255 != 255:
                return _BAD_LENGTH
            start = off + 5
            size = n + 8
        elif buf[off + 1] == _VERSION_GROOVY and version != _VERSION_HYDRO:
            if left < 6:
                return _MORE
            if (
                version == ANY_VERSION
                and buf[off + 2] == _VERSION_HYDRO
                and (buf[off + 3] + buf[off + 4] + buf[off + 5]) & 255 == 255
            ):
                return _NO_FRAME  # FF before FF FE
            n = buf[off + 4] | buf[off + 5] << 8
            start = off + 2
            size = n + 7
        else:
            return _NO_FRAME
        if n > self.limit:
            return _TOO_LONG
        self._need = size
        if left < size:
            return _MORE
        self._credit -= size
        if _total(buf, start, off + size) & 255 != 255:
            return _BAD_CHECKSUM
        return size

    def _another(self) -> bool:
        """Whether a whole good frame stands behind the beginning of what is waited for."""
        end = self._end
        need = self._need
        off = _find_sync(self._buf, 1, end)
        found = False
        while off < end and not found:
            found = self._look(off, end) > 0
            off = _find_sync(self._buf, off + 1, end)
        self._need = need
        return found


if MPY:

    def _total(buf: bytearray, start: int, end: int) -> int:
        total = 0
        for i in range(start, end):
            total += buf[i]
        return total

    def _find_sync(buf: bytearray, off: int, end: int) -> int:
        while off < end and buf[off] != _SYNC:
            off += 1
        return off

else:

    def _total(buf: bytearray, start: int, end: int) -> int:
        return sum(buf[start:end])

    def _find_sync(buf: bytearray, off: int, end: int) -> int:
        at = buf.find(_SYNC, off, end)
        return end if at < 0 else at
