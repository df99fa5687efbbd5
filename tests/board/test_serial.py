"""Serial frames: the same bytes with and without native code. See also ``tests/xrce/test_framing.py``."""

from array import array

from muros.compat import MPY, const
from muros.xrce import _codec
from muros.xrce.serial import SerialDeframer, SerialFramer
from tests.board.harness import allocates

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.xrce._types import Buffer

MESSAGE = b"\x80\x00\x00\x00\x00\x01\x10\x00XRCE\x01\x00\x01\x0f\x7e\x7d\x7e\x7d\x81\x00\xfc\x01"
FRAME = (
    b"\x7e\x01\x00\x18\x00\x80\x00\x00\x00\x00\x01\x10\x00XRCE\x01\x00\x01\x0f\x7d\x5e\x7d\x5d\x7d\x5e\x7d\x5d"
    b"\x81\x00\xfc\x01"
)


def codecs() -> "list[Any]":
    """The modules with the per-byte loops that this runtime has."""
    found: "list[Any]" = [_codec]
    if MPY:
        try:
            from muros.xrce import _viper

            found.append(_viper)
        except (SyntaxError, ValueError, ImportError):
            pass  # no native code on this runtime
    return found


def noise(n: int, seed: int) -> bytearray:
    """Bytes in which flags and escapes are frequent, the same for the same seed."""
    made = bytearray(n)
    for i in range(n):
        seed = (seed * 1103 + 12345) & 0xFFFFFF
        k = seed >> 8 & 255
        made[i] = (0x7E, 0x7D, 0x5E, 0x5D)[k & 3] if k < 64 else k
    return made


def test_crc_check_value() -> None:
    for codec in codecs():
        assert codec.crc16(b"123456789", 0, 9) == 0xBB3D
        assert codec.crc16(b"??123456789?", 2, 9) == 0xBB3D
        assert codec.crc16(b"", 0, 0) == 0
        assert codec.crc16(b"xx6789", 2, 4, codec.crc16(b"12345", 0, 5)) == 0xBB3D


def test_every_codec_does_the_same() -> None:
    for n in (0, 1, 2, 17, 64, 200):
        data = noise(n, n)
        results: "list[Any]" = []
        for codec in codecs():
            out = bytearray(2 * n + 3)
            end = codec.stuff(data, 0, n, out, 3)
            back = bytearray(n)
            state = array("i", (3, 0, n, 0))
            flag = codec.unstuff(out, end, back, state)
            results.append((codec.crc16(data, 0, n), end, out, flag, back, list(state)))
            assert back == data
        for result in results:
            assert result == results[0]


def test_every_codec_stops_at_a_flag_and_at_the_end() -> None:
    for codec in codecs():
        out = bytearray(8)
        state = array("i", (0, 0, 8, 0))
        assert codec.unstuff(b"ab\x7d", 3, out, state) == 0
        assert list(state) == [3, 2, 8, 1]
        state[0] = 0
        assert codec.unstuff(b"\x5ec\x7ed", 4, out, state) == 1
        assert list(state) == [3, 4, 8, 0]
        assert out[:4] == b"ab\x7ec"
        state = array("i", (0, 6, 8, 0))
        assert codec.unstuff(b"xyz", 3, out, state) == 0
        assert list(state) == [2, 8, 8, 0]


class Line:
    """What a framer writes, and what a deframer reads from it."""

    def __init__(self) -> None:
        self.written = bytearray()
        self.got: "list[bytes]" = []

    def write(self, buf: bytearray, n: int) -> None:
        self.written += buf[:n]

    def take(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self.got.append(bytes(buf[off : off + n]))


def test_a_frame_is_written_as_peers_expect_it() -> None:
    line = Line()
    SerialFramer(1, 0, line.write).send(MESSAGE, 0, len(MESSAGE))
    assert bytes(line.written[:-2]) == FRAME
    crc = _codec.crc16(MESSAGE, 0, len(MESSAGE))
    assert line.written[-2:] == bytes((crc & 255, crc >> 8))


def test_frames_in_any_pieces() -> None:
    line = Line()
    framer = SerialFramer(1, 0, line.write)
    sent = [bytes(noise(n, n)) for n in (1, 2, 60, 63, 64, 65, 128, 300)]
    for message in sent:
        framer.send(b"#" + message, 1, len(message))
        line.written += b"garbage"
    for step in (1, 2, 7, 64, 2000):
        line.got = []
        deframer = SerialDeframer(0, 300, line.take)
        for at in range(0, len(line.written), step):
            piece = line.written[at : at + step]
            deframer.feed(piece, len(piece))
        assert line.got == sent, step
        assert deframer.garbage == 7 * len(sent)
        assert deframer.bad_crc == 0


def test_a_damaged_frame_is_dropped_and_the_next_one_taken() -> None:
    line = Line()
    SerialFramer(1, 0, line.write).send(b"first message", 0, 13)
    n = len(line.written)
    SerialFramer(1, 0, line.write).send(b"second", 0, 6)
    for at in range(n):
        if at == 1:
            continue  # the source address, which no CRC protects
        line.got = []
        damaged = bytearray(line.written)
        damaged[at] ^= 0x04
        SerialDeframer(0, 64, line.take).feed(damaged, len(damaged))
        assert line.got == [b"second"], at


def test_framing_does_not_allocate() -> None:
    message = bytearray(MESSAGE)
    framer = SerialFramer(1, 0, drop)
    deframer = SerialDeframer(0, 64, ignore)
    frame = bytearray(FRAME + b"\0\0")
    crc = _codec.crc16(MESSAGE, 0, len(MESSAGE))
    frame[-2] = crc & 255
    frame[-1] = crc >> 8

    def call() -> None:
        framer.send(message, 0, len(message))
        deframer.feed(frame, len(frame))

    assert allocates(call) == 0
    assert deframer.frames >= 1


def drop(buf: bytearray, n: int) -> None:
    """Writes nowhere."""


def ignore(buf: "Buffer", off: int, n: int, source: int) -> None:
    """Takes a frame."""
