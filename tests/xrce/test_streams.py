"""Streams do what the book says, those of hosts as those of boards; queues lose nothing behind the window."""

import struct
from typing import Any

from hypothesis import example, given
from hypothesis import strategies as st

from muros.xrce._types import Buffer, Send
from muros.xrce.beginning import make_input, make_output
from muros.xrce.mending import accept, announce, missing, resend
from muros.xrce.queues import QueuedBestEffortOutput, QueuedReliableOutput
from muros.xrce.requests import reset_input
from muros.xrce.streams import Input, Output
from tests.xrce.ends import write

HEAD = b"\x81\0\0\0"
starts = st.sampled_from([0, 65500, 65530, 65535])
windows = st.sampled_from([1, 2, 4, 16])


class Line:
    """Keeps what is sent."""

    def __init__(self) -> None:
        self.sent: list[bytes] = []

    def send(self, buf: Buffer, off: int, n: int) -> None:
        """Keeps a message."""
        self.sent.append(bytes(buf[off : off + n]))


def submessage(body: bytes) -> bytes:
    return struct.pack("<BBH", 7, 1, len(body)) + body


class Model:
    """A reliable receiver by the book: numbers without end, a set of what is known."""

    def __init__(self, start: int, window: int) -> None:
        self.expected = start
        self.window = window
        self.end = start
        self.early: dict[int, bytes] = {}

    def take(self, number: int, content: bytes) -> list[bytes]:
        """A message arrives; what is handled because of it."""
        if not self.expected <= number < self.expected + self.window:
            return []
        self.end = max(self.end, number + 1)
        self.early.setdefault(number, content)
        return self.handle()

    def announce(self, first: int, last: int) -> list[bytes]:
        """A HEARTBEAT arrives; what is handled because of it."""
        self.expected = max(self.expected, self.near(first))
        self.early = {n: content for n, content in self.early.items() if n >= self.expected}
        self.end = max(self.end, self.expected, self.near(last + 1))
        return self.handle()

    def near(self, number: int) -> int:
        """What 16 bits of a number mean: the one nearest to the expected."""
        return self.expected - 0x8000 + (number - self.expected + 0x8000 & 0xFFFF)

    def handle(self) -> list[bytes]:
        """What is in order."""
        handled = []
        while self.expected in self.early:
            handled.append(self.early.pop(self.expected))
            self.expected += 1
        return handled

    def missing(self) -> int:
        """The bitmap of the ACKNACK."""
        wanted = range(self.expected, min(self.end, self.expected + 16))
        return sum(1 << n - self.expected for n in wanted if n not in self.early)


def acknowledge(stream: Output, first: int, bitmap: int, send: Send, now: int) -> bool:
    """What a session does with an ACKNACK."""
    known = stream.acknowledge(first, send, now)
    if known and bitmap:
        resend(stream, bitmap, send, now)
    return known


def feed(stream: Input, number: int, content: bytes) -> list[bytes]:
    """A message arrives; what is handled because of it."""
    if not accept(stream, number - stream.expected & 0xFFFF, content, 0, len(content)):
        return []
    advance(stream)
    return [content, *kept(stream)]


def advance(stream: Input) -> None:
    """What a session does when it has handled the expected message."""
    stream.early.pop(stream.expected, None)
    stream.expected = stream.expected + 1 & 0xFFFF
    if stream.known:
        stream.known -= 1


def kept(stream: Input) -> list[bytes]:
    """What is kept and in order now."""
    handled = []
    while stream.expected in stream.early:
        handled.append(stream.early[stream.expected])
        advance(stream)
    return handled


steps = st.lists(
    st.tuples(st.just("message"), st.integers(-3, 18), st.binary(min_size=1, max_size=8))
    | st.tuples(st.just("heartbeat"), st.integers(-3, 20), st.integers(0, 20))
    | st.tuples(st.just("far"), st.integers(-40000, 40000), st.integers(0, 40000))
    | st.tuples(st.just("reset"), st.just(0), st.just(0)),
    max_size=60,
)


@given(starts, windows, steps)
@example(0, 2, [("message", 1, b"\0"), ("message", 1, b"\0\0"), ("heartbeat", 1, 0)])
def test_a_receiver_does_what_the_book_says(start: int, window: int, told: list[Any]) -> None:
    stream, model = make_input(0x80, 8, window), Model(start, window)
    stream.expected = start
    for what, first, second in told:
        if what == "message":
            handled = model.take(model.expected + first, second)
            assert feed(stream, stream.expected + first, second) == handled
        elif what == "reset":
            reset_input(stream)
            model = Model(0, window)
        else:
            at = stream.expected
            handled = model.announce(model.expected + first, model.expected + first + second)
            announce(stream, at + first & 0xFFFF, at + first + second & 0xFFFF)
            assert kept(stream) == handled
        assert stream.expected == model.expected & 0xFFFF
        assert missing(stream) == model.missing()
        assert set(stream.early) == {n & 0xFFFF for n in model.early}


acknowledgements = st.tuples(st.integers(-3, 20), st.integers(0, 0xFFFF), st.integers(0, 40))


@given(starts, windows, st.lists(st.binary(max_size=12) | acknowledgements, max_size=60))
def test_senders_of_boards_and_hosts_are_alike(start: int, window: int, told: list[Any]) -> None:
    lines = [Line(), Line()]
    board = make_output(0x80, 20, bytearray(HEAD), window, 100)
    host = QueuedReliableOutput(0x80, 20, bytearray(HEAD), window, 100)
    now = 1000
    for stream in (board, host):
        stream.next = stream.first = stream.sent = start
    for one in told:
        if isinstance(one, bytes):
            if host.free() > 0:
                assert write(board, submessage(one))
                board.flush(lines[0].send, now)
                assert host.post(submessage(one), lines[1].send, now)
            else:
                assert not write(board, submessage(one))
        else:
            ahead, bitmap, wait = one
            now += wait
            first = board.first + ahead & 0xFFFF
            taken = [acknowledge(board, first, bitmap, lines[0].send, now)]
            taken.append(acknowledge(host, first, bitmap, lines[1].send, now))
            assert taken[0] == taken[1]
        assert lines[0].sent == lines[1].sent
        assert (board.first, board.next, board.sent, board.resends) == (
            host.first,
            host.next,
            host.sent,
            host.resends,
        )
        idle = board.first == board.next
        assert idle or board.due == host.due
        assert idle == host.idle()
    shown = [Line(), Line()]
    board.transmit(board.first, board.next, shown[0].send)
    host.transmit(host.first, host.next, shown[1].send)
    assert shown[0].sent == shown[1].sent


@given(
    starts, windows, st.lists(st.binary(max_size=12), max_size=60), st.lists(st.integers(0, 5), max_size=80)
)
def test_what_waits_behind_the_window_goes_in_order(
    start: int, window: int, bodies: list[bytes], acknowledged: list[int]
) -> None:
    line = Line()
    stream = QueuedReliableOutput(0x80, 20, bytearray(HEAD), window, 100)
    stream.next = stream.first = stream.sent = start
    for body in bodies:
        assert stream.post(submessage(body), line.send, 0)
    for count in [*acknowledged, *[window] * len(bodies)]:
        in_flight = stream.next - stream.first & 0xFFFF
        assert in_flight <= window
        assert in_flight + stream.waiting() <= len(bodies)
        acknowledge(stream, stream.first + min(count, in_flight) & 0xFFFF, 0, line.send, 0)
    assert [message[8:] for message in line.sent] == bodies
    assert [message[2] | message[3] << 8 for message in line.sent] == [
        start + n & 0xFFFF for n in range(len(bodies))
    ]
    assert stream.idle()
    assert stream._kept is None
    assert stream._waiting is None


def test_a_queue_that_is_reset_forgets_what_waits() -> None:
    line = Line()
    stream = QueuedReliableOutput(0x80, 20, bytearray(HEAD), 2, 100)
    for _ in range(5):
        stream.post(submessage(b"old"), line.send, 0)
    assert stream.waiting() == 3
    stream.reset()
    assert stream.waiting() == 0
    assert stream.free() == 2
    line.sent.clear()
    stream.post(submessage(b"new"), line.send, 0)
    acknowledge(stream, 1, 0, line.send, 0)
    assert line.sent == [b"\x81\x80\0\0" + submessage(b"new")]


@given(st.lists(st.binary(max_size=20), max_size=20), st.sampled_from([0, 65530]))
def test_best_effort_of_boards_and_hosts_are_alike(bodies: list[bytes], start: int) -> None:
    lines = [Line(), Line()]
    board = make_output(1, 20, bytearray(HEAD), 1, 0)
    host = QueuedBestEffortOutput(1, 20, bytearray(HEAD))
    for stream in (board, host):
        stream.next = stream.first = stream.sent = start
    for body in bodies:
        fits = write(board, submessage(body))
        if fits:
            board.flush(lines[0].send, 0)
        assert host.post(submessage(body), lines[1].send, 0) == fits
    assert lines[0].sent == lines[1].sent
    assert board.next == host.next


def test_an_early_message_that_the_heap_has_no_room_for_is_asked_for_again() -> None:
    class Full(dict[int, bytes]):
        def __setitem__(self, number: int, message: bytes) -> None:
            raise MemoryError

    stream = make_input(0x80, 64, 4)
    stream.early = Full()
    assert not accept(stream, 1, b"early", 0, 5)
    assert missing(stream) == 0b11
    stream.early = {}
    assert not accept(stream, 1, b"early", 0, 5)
    assert missing(stream) == 0b01
