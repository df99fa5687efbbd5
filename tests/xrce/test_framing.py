"""Framings: byte for byte as recorded, the same frames from any pieces, and no wrong message out of noise."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.xrce import _codec
from muros.xrce._crc import crc16
from muros.xrce.framing import (
    CAN_MTU,
    TCP_MTU,
    SerialDeframer,
    SerialFramer,
    TcpDeframer,
    can_frame,
    can_message_untrusted,
    serial_frame,
    tcp_frame,
)

VECTORS = Path(__file__).parent.parent / "vectors" / "xrce"
CAPACITY = 600

messages = st.binary(min_size=1, max_size=80)
# bytes that matter to the framing come up often
hard_bytes = st.lists(st.sampled_from(b"\x7e\x7d\x5e\x5d\x00\x01\xff\x20") | st.integers(0, 255), max_size=80)
hard_messages = hard_bytes.map(bytes).filter(bool)


def serial(
    local_address: int = 0, capacity: int = CAPACITY
) -> tuple[SerialDeframer, list[tuple[bytes, int]]]:
    got: list[tuple[bytes, int]] = []
    return SerialDeframer(
        local_address, capacity, lambda buf, off, n, source: got.append((bytes(buf[off : off + n]), source))
    ), got


def tcp(capacity: int = TCP_MTU) -> tuple[TcpDeframer, list[bytes]]:
    got: list[bytes] = []
    return TcpDeframer(capacity, lambda buf, off, n, source: got.append(bytes(buf[off : off + n]))), got


def whole(data: bytes) -> list[bytes]:
    return [data]


def byte_by_byte(data: bytes) -> list[bytes]:
    return [data[i : i + 1] for i in range(len(data))]


@st.composite
def cuts(draw: st.DrawFn) -> Callable[[bytes], list[bytes]]:
    """A way to cut any bytes into pieces; empty ones are among them."""
    sizes = draw(st.lists(st.integers(0, 13), min_size=1, max_size=8).filter(any))

    def cut(data: bytes) -> list[bytes]:
        pieces, at, k = [], 0, 0
        while at < len(data):
            pieces.append(data[at : at + sizes[k % len(sizes)]])
            at += sizes[k % len(sizes)]
            k += 1
        return pieces

    return cut


ways = st.sampled_from([whole, byte_by_byte]) | cuts()


def recorded(prefix: str) -> list[dict[str, Any]]:
    packets = []
    for path in sorted(VECTORS.glob(f"*{prefix}_*.json")):
        packets += [p for p in json.loads(path.read_text())["packets"] if "frame_hex" in p]
    assert len(packets) > 10, prefix
    return packets


# The CRC


def test_crc_check_value() -> None:
    """The check value of CRC-16/ARC in every catalogue of CRCs."""
    assert crc16(b"123456789", 0, 9) == 0xBB3D
    assert _codec.crc16(b"123456789", 0, 9) == 0xBB3D


@given(st.binary(max_size=200), st.data())
def test_crc_in_parts(data: bytes, draw: st.DataObject) -> None:
    cut = draw.draw(st.integers(0, len(data)))
    for crc in (crc16, _codec.crc16):
        parts = crc(data, cut, len(data) - cut, crc(data, 0, cut))
        assert parts == crc(data, 0, len(data)) == crc16(data, 0, len(data))


# Serial


def test_serial_frames_as_recorded() -> None:
    for packet in recorded("serial"):
        message, frame = bytes.fromhex(packet["hex"]), bytes.fromhex(packet["frame_hex"])
        source, destination = packet["source"], packet["destination"]
        assert serial_frame(message, source, destination) == frame
        written = bytearray()
        framer = SerialFramer(source, destination, lambda buf, n, to=written: to.extend(buf[:n]))  # type: ignore[misc]
        framer.send(b"??" + message + b"?", 2, len(message))
        assert bytes(written) == frame
        deframer, got = serial(destination)
        deframer.feed(frame, len(frame))
        assert got == [(message, source)]


def test_serial_recordings_as_one_stream() -> None:
    packets = [p for p in recorded("serial") if p["dir"] == "c>a"]
    line = b"".join(bytes.fromhex(p["frame_hex"]) for p in packets)
    for way in (whole, byte_by_byte):
        deframer, got = serial()
        for piece in way(line):
            deframer.feed(piece, len(piece))
        assert got == [(bytes.fromhex(p["hex"]), p["source"]) for p in packets]
        assert deframer.garbage == deframer.cut == deframer.bad_crc == 0


@given(st.lists(hard_messages, min_size=1, max_size=5), st.integers(0, 255), st.integers(0, 255), ways)
def test_serial_round_trip_in_any_pieces(
    sent: list[bytes], source: int, destination: int, way: Callable[[bytes], list[bytes]]
) -> None:
    written = bytearray()
    framer = SerialFramer(source, destination, lambda buf, n: written.extend(buf[:n]))
    for message in sent:
        framer.send(message, 0, len(message))
    assert bytes(written) == b"".join(serial_frame(message, source, destination) for message in sent)
    deframer, got = serial(destination)
    for piece in way(bytes(written)):
        deframer.feed(piece, len(piece))
    assert got == [(message, source) for message in sent]
    assert deframer.frames == len(sent)


@given(
    st.lists(hard_messages, min_size=1, max_size=4),
    st.lists(st.binary(max_size=30), min_size=5, max_size=5),
    ways,
)
def test_garbage_between_serial_frames_loses_none(
    sent: list[bytes], noise: list[bytes], way: Callable[[bytes], list[bytes]]
) -> None:
    """Whatever noise looks like, the flag of the next frame ends it, and it makes no message but by its CRC."""
    line = bytearray()
    for message, rubbish in zip(sent, noise, strict=False):
        line += rubbish.replace(b"\x7e", b"\x7f") + serial_frame(message, 1, 0)
    line += noise[-1].replace(b"\x7e", b"\x7f")
    deframer, got = serial()
    for piece in way(bytes(line)):
        deframer.feed(piece, len(piece))
    assert got == [(message, 1) for message in sent]


@given(st.lists(hard_messages, min_size=1, max_size=4), st.binary(max_size=60), ways)
def test_a_serial_receiver_is_in_step_again_at_the_next_frame(
    sent: list[bytes], noise: bytes, way: Callable[[bytes], list[bytes]]
) -> None:
    line = noise + b"".join(serial_frame(message, 1, 0) for message in sent)
    deframer, got = serial()
    for piece in way(line):
        deframer.feed(piece, len(piece))
    assert got[-len(sent) :] == [(message, 1) for message in sent]


@given(hard_messages, hard_messages, st.data())
def test_one_corrupted_byte_on_a_serial_line(message: bytes, following: bytes, draw: st.DataObject) -> None:
    """A changed byte behind the addresses never yields a wrong message: CRC-16 sees any burst of up to 16 bits, and
    what turns a byte into a flag, an escape or another length does not fit its CRC but by chance.

    The frame behind it comes through unless the damage made the bad frame longer, which the flag of the frame ends.
    """
    frame = serial_frame(message, 1, 0)
    at = draw.draw(st.integers(0, len(frame) - 1))
    flip = draw.draw(st.integers(1, 255))
    damaged = bytearray(frame)
    damaged[at] ^= flip
    line = bytes(damaged) + serial_frame(following, 1, 0)
    deframer, got = serial()
    deframer.feed(line, len(line))
    assert (following, 1) in got
    for content, _ in got:
        assert content in (message, following) or _crc_by_chance(content, line)


def _crc_by_chance(content: bytes, line: bytes) -> bool:
    """Whether the line really holds this content with its CRC: one in 65536 wrong frames does."""
    crc = crc16(content, 0, len(content))
    stuffed = serial_frame(content, 0, 0)[1 + 4 :]
    return stuffed in line or content + bytes((crc & 255, crc >> 8)) in line


def test_every_single_bit_error_in_a_recorded_frame_is_seen() -> None:
    frame = bytes.fromhex(recorded("serial")[0]["frame_hex"])
    message = bytes.fromhex(recorded("serial")[0]["hex"])
    for bit in range(8 * len(frame)):
        damaged = bytearray(frame)
        damaged[bit >> 3] ^= 1 << (bit & 7)
        deframer, got = serial()
        deframer.feed(damaged, len(damaged))
        deframer.feed(frame, len(frame))
        assert got[-1] == (message, 1), bit
        # the source address is not protected by the CRC
        assert all(content == message for content, _ in got), bit


def test_serial_counters_tell_what_was_passed_over() -> None:
    deframer, got = serial(local_address=0, capacity=8)
    for part in (
        b"noise",
        b"\x7e\x7e",
        serial_frame(b"good", 1, 0),
        serial_frame(b"for another", 1, 7),
        serial_frame(b"to everybody"[:8], 1, 255),
        serial_frame(b"too long!", 1, 0),
        serial_frame(b"bad", 1, 0)[:-1] + b"\0",
        serial_frame(b"cut", 1, 0)[:-3],
        serial_frame(b"last", 2, 0),
    ):
        deframer.feed(part, len(part))
    assert [content for content, _ in got] == [b"good", b"to every", b"last"]
    assert deframer.frames == 3
    assert deframer.wrong_address == 1
    assert deframer.bad_length == 1
    assert deframer.bad_crc == 1
    assert deframer.cut == 1
    assert deframer.garbage == 5 + len(b"for another") + 2 + len(b"too long!") + 2


@given(st.lists(st.binary(max_size=300), max_size=6))
def test_any_bytes_on_a_serial_line(parts: list[bytes]) -> None:
    deframer, got = serial(-1, 100)
    size = len(deframer._buf)
    for part in parts:
        deframer.feed(part, len(part))
    assert len(deframer._buf) == size
    assert all(len(content) <= 100 for content, _ in got)


@given(hard_bytes.map(bytes), st.integers(0, 7))
def test_stuff_and_unstuff_are_inverse(data: bytes, offset: int) -> None:
    out = bytearray(offset + 2 * len(data))
    end = _codec.stuff(data, 0, len(data), out, offset)
    stuffed = bytes(out[offset:end])
    assert b"\x7e" not in stuffed
    back = bytearray(len(data))
    state = [0, 0, len(data), 0]
    assert _codec.unstuff(stuffed, len(stuffed), back, state) == 0
    assert bytes(back) == data
    assert state == [len(stuffed), len(data), len(data), 0]


# TCP


def test_tcp_frames_as_recorded() -> None:
    packets = recorded("tcp")
    for packet in packets:
        assert tcp_frame(bytes.fromhex(packet["hex"])).hex() == packet["frame_hex"]
    line = b"".join(bytes.fromhex(packet["frame_hex"]) for packet in packets)
    for way in (whole, byte_by_byte):
        deframer, got = tcp()
        for piece in way(line):
            deframer.feed(piece, len(piece))
        assert got == [bytes.fromhex(packet["hex"]) for packet in packets]


@given(st.lists(messages, max_size=6), ways)
def test_tcp_round_trip_in_any_pieces(sent: list[bytes], way: Callable[[bytes], list[bytes]]) -> None:
    deframer, got = tcp()
    for piece in way(b"".join(map(tcp_frame, sent))):
        deframer.feed(piece, len(piece))
    assert got == sent
    assert deframer.frames == len(sent)
    assert deframer._rest == b""


@given(st.lists(messages, max_size=6), st.integers(1, 60), ways)
def test_tcp_messages_that_are_too_long_are_passed_over_whole(
    sent: list[bytes], capacity: int, way: Callable[[bytes], list[bytes]]
) -> None:
    deframer, got = tcp(capacity)
    for piece in way(b"".join(map(tcp_frame, sent))):
        deframer.feed(piece, len(piece))
        assert len(deframer._rest) <= capacity + 2
    assert got == [message for message in sent if len(message) <= capacity]
    assert deframer.bad_length == len(sent) - len(got)


@given(st.binary(max_size=400), ways)
def test_any_bytes_on_a_tcp_connection(data: bytes, way: Callable[[bytes], list[bytes]]) -> None:
    at_once, expected = tcp(50)
    at_once.feed(data, len(data))
    deframer, got = tcp(50)
    for piece in way(data):
        deframer.feed(piece, len(piece))
        assert len(deframer._rest) <= 52
    assert got == expected
    assert (deframer.frames, deframer.bad_length) == (at_once.frames, at_once.bad_length)


def test_tcp_empty_messages_are_counted() -> None:
    deframer, got = tcp()
    line = b"\0\0" + tcp_frame(b"a") + b"\0\0\0\0" + tcp_frame(b"b")
    deframer.feed(line, len(line))
    assert got == [b"a", b"b"]
    assert deframer.bad_length == 3


def test_tcp_frame_has_a_limit() -> None:
    assert tcp_frame(bytes(TCP_MTU))[:2] == b"\xff\xff"
    with pytest.raises(ValueError, match="65536 B does not fit a TCP frame: at most 65535 B"):
        tcp_frame(bytes(TCP_MTU + 1))


# CAN FD


@given(st.binary(min_size=1, max_size=CAN_MTU), st.binary(max_size=10))
def test_can_round_trip_with_padding(message: bytes, padding: bytes) -> None:
    """CAN FD frames come in sizes 0-8, 12, 16, 20, 24, 32, 48, 64: the length byte tells the padding."""
    frame = can_frame(message)
    assert len(frame) == len(message) + 1 <= 64
    assert can_message_untrusted(frame + padding) == message


@given(st.binary(max_size=64))
def test_any_bytes_in_a_can_frame(data: bytes) -> None:
    message = can_message_untrusted(data)
    assert message is None or (len(message) == data[0] and message == data[1 : 1 + data[0]])


def test_can_frames_that_do_not_fit_their_length() -> None:
    for data in (b"", b"\0", b"\0abc", b"\4abc", b"\1"):
        assert can_message_untrusted(data) is None
    with pytest.raises(ValueError, match="64 B does not fit a CAN FD frame: at most 63 B"):
        can_frame(bytes(64))
