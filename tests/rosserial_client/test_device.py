"""The board's side of a session, in virtual time: when it speaks, when it falls silent, what it counts."""

from __future__ import annotations

import struct
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.compat import ticks_add
from muros.rosserial.device import Device
from muros.rosserial.packets import ANY_VERSION, VERSION_GROOVY, VERSION_HYDRO, frame
from tests.rosserial_client.replay import Raw, opened

REQUEST = bytes.fromhex("fffe0000ff0000ff")


class Board:
    """A device and what it sends."""

    def __init__(self, **options: Any) -> None:
        self.sent: list[tuple[int, bytes]] = []
        self.device = Device(self._send, **options)

    def take(self) -> list[tuple[int, bytes]]:
        """What it sent since the last call."""
        sent, self.sent = self.sent, []
        return sent

    def hear(self, raw: bytes, now: int) -> None:
        self.device.feed(raw, len(raw), now)

    def _send(self, buf: Any, off: int, n: int) -> None:
        self.sent.append(opened(bytes(buf[off : off + n])))


def test_nothing_is_said_before_the_host_asks() -> None:
    board = Board()
    chatter = board.device.publisher("chatter", "std_msgs/String", "992c")
    board.device.subscriber("led", "std_msgs/Byte", "ad73", lambda buf, off, n: None)
    assert board.device.publish(chatter, Raw(b"x")) == 0
    for now in range(0, 20_000, 500):
        board.device.tick(now)
    assert board.take() == []
    assert board.device.log(1, b"but logs are") == 25
    board.hear(REQUEST, 20_000)
    assert [topic_id for topic_id, _ in board.take()] == [7, 10, 0, 1]
    assert board.device.publish(chatter, Raw(b"x")) == 9


def test_time_is_asked_every_two_and_a_half_seconds_and_silence_ends_the_session() -> None:
    start = 1 << 62  # ticks near where they wrap
    board = Board()
    board.hear(REQUEST, start)
    asked = []
    for passed in range(0, 13_000, 100):
        board.device.tick(ticks_add(start, passed))
        asked += [passed for topic_id, _ in board.take() if topic_id == 10]
    assert asked == [0, 2600, 5200, 7800, 10_400]
    assert not board.device.connected
    board.hear(REQUEST, ticks_add(start, 30_000))
    assert board.device.connected


def test_tick_says_when_it_wants_to_be_called() -> None:
    board = Board()
    assert board.device.tick(0) == 2500
    board.hear(REQUEST, 1000)
    assert board.device.tick(1000) == 2501
    assert board.device.tick(3500) == 1
    board.take()
    board.device.tick(3501)
    assert [topic_id for topic_id, _ in board.take()] == [10]
    board.hear(REQUEST[:4], 3600)
    assert 0 < board.device.tick(3600) <= 1000


def test_clock_stands_between_request_and_answer() -> None:
    board = Board()
    assert board.device.time(1500) == (1, 500_000_000)
    board.hear(REQUEST, 1000)
    board.hear(frame(10, struct.pack("<II", 1_700_000_000, 999_500_000)), 1040)
    assert board.device.time(1040) == (1_700_000_001, 19_500_000)
    assert board.device.time(2021) == (1_700_000_002, 500_000)
    assert board.device.time(1019) == (1_700_000_000, 998_500_000)


def test_tx_stop_silences_until_the_next_request() -> None:
    board = Board()
    chatter = board.device.publisher("chatter", "std_msgs/String", "992c")
    board.hear(REQUEST + bytes.fromhex("fffe0000ff0b00f4"), 0)
    assert not board.device.connected
    assert board.device.publish(chatter, Raw(b"x")) == 0
    board.hear(REQUEST, 10)
    assert board.device.publish(chatter, Raw(b"x")) > 0


def test_what_is_added_during_a_session_is_announced() -> None:
    board = Board()
    board.hear(REQUEST, 0)
    board.take()
    assert board.device.publisher("late", "std_msgs/String", "992c") == 125
    assert [topic_id for topic_id, _ in board.take()] == [0]


def test_ids_and_bounds() -> None:
    board = Board(max_subscribers=2)
    assert [board.device.publisher(f"p{i}", "t", "m") for i in range(3)] == [102, 103, 104]
    assert [board.device.subscriber(f"s{i}", "t", "m", lambda *_: None) for i in range(2)] == [100, 101]
    with pytest.raises(ValueError, match="max_subscribers"):
        board.device.subscriber("s2", "t", "m", lambda *_: None)
    with pytest.raises(ValueError, match="64 to 65535"):
        Device(lambda *_: None, output_size=63)
    with pytest.raises(ValueError, match="64 to 65535"):
        Device(lambda *_: None, input_size=1 << 16)
    small = Board(output_size=64)
    with pytest.raises(ValueError, match="cannot tell of a_topic"):
        small.device.publisher("a_topic_with_a_long_name", "std_msgs/String", "992c" * 8)
    with pytest.raises(ValueError, match="longer than the buffer"):
        small.device.request_parameter(b"p" * 60)
    assert small.device.log(1, b"x" * 100) == 64


@pytest.mark.parametrize("version", [VERSION_HYDRO, VERSION_GROOVY])
def test_the_largest_messages_pass_both_ways(version: int) -> None:
    overhead = 8 if version == VERSION_HYDRO else 7
    heard: list[int] = []
    board = Board(input_size=300, output_size=200, version=version)
    board.device.subscriber("s", "t", "m", lambda buf, off, n: heard.append(n))
    chatter = board.device.publisher("p", "t", "m")
    board.hear(frame(0, b"", version), 0)
    assert board.device.publish(chatter, Raw(bytes(200 - overhead))) == 200
    assert board.device.publish(chatter, Raw(bytes(201 - overhead))) == -1
    assert board.device.too_large == 1
    level, text = board.take()[-1][1][:1], board.device
    assert level == b"\x03"
    assert text.connected
    board.hear(frame(100, bytes(300), version), 1)
    board.hear(frame(100, bytes(301), version), 2)
    board.hear(frame(100, bytes(5), version), 3)
    assert heard == [300, 5]


def test_malformed_and_unknown_frames_are_counted() -> None:
    board = Board()
    for topic_id, payload in ((10, b"1234"), (6, b"\x01\0\0\0"), (10, bytes(9))):
        board.hear(frame(topic_id, payload), 0)
    board.hear(frame(300, b"") + frame(100, b"") + frame(7, b""), 0)
    assert (board.device.malformed, board.device.unknown_ids) == (3, 3)
    assert board.take() == []


@given(
    st.lists(
        st.tuples(st.sampled_from([0, 6, 10, 11, 100, 101, 125, 65535]), st.binary(max_size=40)), max_size=8
    )
)
def test_any_frames_leave_a_board_that_works(frames: list[tuple[int, bytes]]) -> None:
    board = Board()
    board.device.subscriber("s", "t", "m", lambda buf, off, n: None)
    for now, (topic_id, payload) in enumerate(frames):
        board.hear(frame(topic_id, payload), now)
    board.take()
    board.hear(REQUEST, 100)
    assert [topic_id for topic_id, _ in board.take()] == [10, 1]


@given(st.binary(max_size=300))
def test_any_bytes_leave_a_board_that_works(junk: bytes) -> None:
    board = Board(input_size=64)
    board.hear(junk, 0)
    for now in (50, 1100, 2200, 3300):
        board.device.tick(now)
    board.hear(REQUEST, 10_000)
    board.device.tick(11_500)
    assert board.device.connected or board.device.decoder.pending


@pytest.mark.parametrize("version", [VERSION_HYDRO, ANY_VERSION])
def test_an_unconnected_board_answers_who_looks_for_it(version: int) -> None:
    board = Board(version=version)
    board.hear(b"\xff\x00", 0)
    board.hear(b"\xff", 1)
    board.hear(b"\x00", 2)
    assert [topic_id for topic_id, _ in board.take()] == [10, 10]
    board.hear(b"\x00\x01\xff", 3)
    board.hear(REQUEST, 4)  # the FF before it was none of its own
    assert [topic_id for topic_id, _ in board.take()] == [10]
    assert board.device.connected
    board.hear(b"\xff\x00", 5)
    assert board.take() == []  # it is connected
    silent = Board(version=VERSION_GROOVY)
    silent.hear(b"\xff\x00", 0)
    assert silent.take() == []
