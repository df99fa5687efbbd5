"""rosserial frames and messages on every runtime. See also ``tests/rosserial/test_packets.py``."""

from muros.compat import const
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    Values,
    log_untrusted,
    parameter_request_untrusted,
    time_untrusted,
    topic_info_untrusted,
    values_untrusted,
    write_log,
    write_string,
    write_time,
)
from muros.rosserial.packets import (
    ANY_VERSION,
    VERSION_GROOVY,
    VERSION_HYDRO,
    Decoder,
    finish,
    frame,
    head_size,
)
from tests.board.harness import allocates, raises

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer

TOPIC_REQUEST = b"\xff\xfe\x00\x00\xff\x00\x00\xff"
GROOVY_REQUEST = b"\xff\xff\x00\x00\x00\x00\xff"
TIME_REQUEST = b"\xff\xfe\x08\x00\xf7\x0a\x00\0\0\0\0\0\0\0\0\xf5"


class Line:
    """A decoder and what it has found."""

    def __init__(self, version: int = VERSION_HYDRO, capacity: int = 512) -> None:
        self.found: "list[tuple[int, bytes]]" = []
        self.decoder = Decoder(capacity, self.take, version)

    def take(self, topic_id: int, buf: "Buffer", off: int, n: int) -> None:
        self.found.append((topic_id, bytes(buf[off : off + n])))

    def feed(self, data: bytes, now: int = 0) -> "list[tuple[int, bytes]]":
        self.decoder.feed(data, len(data), now)
        found, self.found = self.found, []
        return found


def test_known_frames() -> None:
    assert frame(0, b"") == TOPIC_REQUEST
    assert frame(11, b"") == b"\xff\xfe\x00\x00\xff\x0b\x00\xf4"
    assert frame(10, bytes(8)) == TIME_REQUEST
    assert frame(127, b"") == b"\xff\xfe\x00\x00\xff\x7f\x00\x80"
    assert frame(0, b"", VERSION_GROOVY) == GROOVY_REQUEST


def test_a_frame_made_in_place_is_the_same() -> None:
    for version in (VERSION_HYDRO, VERSION_GROOVY):
        payload = bytes(range(200)) + b"\xff\xfe"
        buf = bytearray(300)
        head = head_size(version)
        buf[5 + head : 5 + head + len(payload)] = payload
        end = finish(buf, 5, 0x1234, len(payload), version)
        assert bytes(buf[5:end]) == frame(0x1234, payload, version)


def test_frames_are_found_whole_or_byte_by_byte() -> None:
    for version in (VERSION_HYDRO, VERSION_GROOVY):
        stream = b"".join(
            (
                frame(100, b"one", version),
                b"noise \xff\xff",
                frame(0x201, b"", version),
                frame(7, bytes(100), version),
            )
        )
        expected = [(100, b"one"), (0x201, b""), (7, bytes(100))]
        assert Line(version).feed(stream) == expected
        line = Line(version)
        found = []
        for i in range(len(stream)):
            found += line.feed(stream[i : i + 1])
        assert found == expected
        assert line.decoder.frames == 3 and line.decoder.pending == 0


def test_either_version_is_heard_where_none_is_agreed() -> None:
    line = Line(ANY_VERSION)
    assert line.feed(b"\xff" + frame(100, b"new") + frame(100, b"old", VERSION_GROOVY)) == [
        (100, b"new"),
        (100, b"old"),
    ]
    assert line.decoder.heard == VERSION_GROOVY
    line.feed(TIME_REQUEST)
    assert line.decoder.heard == VERSION_HYDRO


def test_a_good_frame_inside_a_damaged_one_is_found() -> None:
    damaged = bytearray(frame(100, b"lost" + frame(101, b"found") + b"tail"))
    damaged[-1] ^= 1
    line = Line()
    assert line.feed(bytes(damaged)) == [(101, b"found")]
    assert line.decoder.bad_checksum == 1


def test_lone_sync_bytes_cost_nothing() -> None:
    for n in range(5):
        line = Line()
        assert line.feed(b"\xff" * n + TOPIC_REQUEST) == [(0, b"")]


def test_a_damaged_length_is_not_waited_for_longer_than_the_line_pauses() -> None:
    line = Line()
    announced = b"\xff\xfe\xf4\x01" + bytes((~(0xF4 + 1) & 255,)) + b"\x64\x00"  # 500 bytes that never come
    assert line.feed(announced + frame(100, b"good"), 1000) == []
    wait = line.decoder.tick(1000)
    assert 0 < wait <= 50
    line.decoder.tick(1000 + wait)
    assert line.found == [(100, b"good")]
    assert line.decoder.cut == 1 and line.decoder.pending == 0


def test_a_frame_with_a_frame_inside_arrives_whole_over_a_line_that_pauses() -> None:
    outer = frame(100, b"a" * 20 + frame(101, b"inner") + b"b" * 20)
    line = Line()
    now = 0
    for i in range(len(outer)):
        now += 30
        line.decoder.byte_us = 30000  # a line so slow that each byte takes as long
        line.decoder.feed(outer[i : i + 1], 1, now)
        line.decoder.tick(now)
    assert len(line.found) == 1 and line.found[0][0] == 100


def test_what_is_never_completed_is_forgotten() -> None:
    line = Line()
    assert line.feed(TIME_REQUEST[:9], 0) == []
    now = 0
    for _ in range(100):
        wait = line.decoder.tick(now)
        if wait < 0:
            break
        now += wait
    assert line.decoder.pending == 0 and now <= 2000
    assert line.feed(TIME_REQUEST) == [(10, bytes(8))]


def test_longer_than_agreed_is_refused_at_once() -> None:
    line = Line()
    line.decoder.limit = 16
    assert line.feed(frame(100, bytes(17)) + frame(100, bytes(16))) == [(100, bytes(16))]
    assert line.decoder.too_long == 1


def test_receiving_allocates_nothing() -> None:
    decoder = Decoder(64)
    data = frame(100, b"0123456789")

    def receive() -> None:
        decoder.feed(data, len(data), 5)

    assert allocates(receive) <= 16  # a bound method


def test_topic_info() -> None:
    info = TopicInfo(125, "b/str", "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", 1024)
    buf = bytearray(info.size() + 3)
    assert info.write(buf, 3) == len(buf)
    back = topic_info_untrusted(buf, 3, len(buf) - 3)
    assert (back.topic_id, back.topic_name, back.message_type) == (125, "b/str", "std_msgs/String")
    assert (back.md5sum, back.buffer_size) == ("992ce8a1687cec8c8bd883ec73ca41d1", 1024)
    for n in range(len(buf) - 3):
        with raises(MessageError):
            topic_info_untrusted(buf, 3, n)


def test_logs_names_and_time() -> None:
    buf = bytearray(32)
    end = write_log(buf, 2, 3, b"ouch")
    assert log_untrusted(buf, 2, end - 2) == (3, b"ouch")
    with raises(MessageError):
        log_untrusted(buf, 2, end - 3)
    end = write_string(buf, 1, b"~gain")
    assert parameter_request_untrusted(buf, 1, end - 1) == "~gain"
    with raises(MessageError):
        parameter_request_untrusted(buf, 1, end)
    buf[5] = 0x80
    with raises(MessageError):
        parameter_request_untrusted(buf, 1, end - 1)
    assert write_time(buf, 4, 1700000000, 999999999) == 12
    assert time_untrusted(buf, 4, 8) == (1700000000, 999999999)
    with raises(MessageError):
        time_untrusted(buf, 4, 7)


def test_values_of_parameters() -> None:
    values = Values([1, -2], [0.5], [b"a", b""])
    buf = bytearray(values.size())
    assert values.write(buf, 0) == len(buf)
    back = values_untrusted(buf, 0, len(buf))
    assert back.ints == [1, -2] and back.floats == [0.5] and back.strings == [b"a", b""]
    for n in range(len(buf)):
        with raises(MessageError):
            values_untrusted(buf, 0, n)
    empty = bytearray(12)
    assert Values().write(empty, 0) == 12 and not any(empty)
    with raises(MessageError):
        values_untrusted(b"\xff\xff\xff\x7f" + bytes(8), 0, 12)
