"""Frames of serial lines as Micro XRCE-DDS peers send them: HDLC-like, with escaping and CRC-16/ARC.

A frame is ``7E``, then with every 7E and 7D escaped as ``7D (byte xor 20)``: source address, destination address,
length of the message (u16 little endian), the message, its CRC (u16 little endian, over the unescaped message
only). There is no closing flag. A 7E inside a frame starts a new one, so a receiver is in step again at the next
frame after any noise.
"""

from array import array

from muros.compat import MPY, const

if MPY:
    try:
        from muros.xrce._viper import NATIVE as NATIVE
        from muros.xrce._viper import crc16, stuff, unstuff
    except (SyntaxError, ValueError, ImportError):  # this build has no native emitter
        from muros.xrce._codec import crc16, stuff, unstuff
else:
    from muros.xrce._codec import stuff, unstuff
    from muros.xrce._crc import crc16

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.xrce._types import Buffer

_FLAG = const(0x7E)
_HEAD = const(4)
_CRC = const(2)
_CHUNK = const(32)  # bytes escaped at a time
_BROADCAST = const(255)


class SerialDeframer:
    """Takes the bytes of a line as they come and hands on the messages of good frames.

    ``on_frame(buf, off, n, source)`` is called for each; ``buf[off:off + n]`` is valid until it returns.
    ``local_address`` is ours: frames for others are passed over (-1 takes every frame). ``capacity`` is the longest
    message taken, in bytes. Counters: ``frames`` good ones, ``bad_crc``, ``bad_length`` (longer than the capacity),
    ``wrong_address``, ``cut`` (a new frame began inside one), ``garbage`` bytes outside frames.
    """

    def __init__(
        self,
        local_address: int,
        capacity: int,
        on_frame: "Callable[[bytearray, int, int, int], object] | None" = None,
    ) -> None:
        self.on_frame = on_frame
        self.capacity = capacity
        self.frames = 0
        self.bad_crc = 0
        self.bad_length = 0
        self.wrong_address = 0
        self.cut = 0
        self.garbage = 0
        self._local = local_address
        self._buf = bytearray(_HEAD + capacity + _CRC)
        self._state = array("i", (0, 0, _HEAD, 0))
        self._inside = False

    def feed(self, data: "Buffer", n: int) -> None:
        """Takes ``data[:n]``; calls ``on_frame`` for each frame that it completes."""
        state = self._state
        state[0] = 0
        while state[0] < n:
            start = state[0]
            flag = unstuff(data, n, self._buf, state)
            if not self._inside:
                self.garbage += state[0] - start - flag
                state[1] = 0
            elif flag and state[1]:  # two flags in a row are fill between frames, nothing is lost
                self.cut += 1
            if flag:
                state[1] = state[3] = 0
                state[2] = _HEAD
                self._inside = True
            elif self._inside and state[1] == state[2]:
                self._advance(state)

    def _advance(self, state: "array[int]") -> None:
        """The head or the whole of a frame is there."""
        buf = self._buf
        n = buf[2] | buf[3] << 8
        end = _HEAD + n
        self._inside = False
        if state[2] == _HEAD:
            if self._local >= 0 and buf[1] != self._local and buf[1] != _BROADCAST:
                self.wrong_address += 1
            elif n > self.capacity:
                self.bad_length += 1
            else:
                state[2] = end + _CRC
                self._inside = True
        elif crc16(buf, _HEAD, n) != buf[end] | buf[end + 1] << 8:
            self.bad_crc += 1
        else:
            self.frames += 1
            if self.on_frame is not None:
                self.on_frame(buf, _HEAD, n, buf[0])


class SerialFramer:
    """Frames messages for a line through a small buffer, so that a board needs no second copy of a message.

    ``write(buf, n)`` takes ``n`` bytes of ``buf`` to the line and returns when they are taken.
    """

    def __init__(self, source: int, destination: int, write: "Callable[[bytearray, int], object]") -> None:
        self._write = write
        self._head = bytearray((source, destination, 0, 0))
        self._out = bytearray(4 * _CHUNK + 2 * _CRC)

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        """Sends ``buf[off:off + n]`` as one frame."""
        out = self._out
        head = self._head
        head[2] = n & 255
        head[3] = n >> 8
        out[0] = _FLAG
        pos = stuff(head, 0, _HEAD, out, 1)
        crc = crc16(buf, off, n)
        n += off
        while off < n:
            if pos > 2 * _CHUNK:
                self._write(out, pos)
                pos = 0
            k = min(n - off, _CHUNK)
            pos = stuff(buf, off, k, out, pos)
            off += k
        head[2] = crc & 255
        head[3] = crc >> 8
        self._write(out, stuff(head, 2, _CRC, out, pos))
