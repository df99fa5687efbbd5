"""Streams by themselves: windows, numbers that wrap, bitmaps, repetitions. See also ``tests/xrce/test_streams.py``."""

from muros.compat import const
from muros.xrce.beginning import make_input, make_output
from muros.xrce.mending import accept, announce, missing, resend
from muros.xrce.requests import reset_input, reset_output
from tests.board.harness import allocates, raises
from tests.board.test_session import WRITE, End, idle, message, submessage

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer, Send
    from muros.xrce.streams import Input, Output

NEAR_WRAP = 65500


class Line:
    """Keeps what a stream sends."""

    def __init__(self) -> None:
        self.messages: "list[bytes]" = []

    def send(self, buf: "Buffer", off: int, n: int) -> None:
        self.messages.append(bytes(buf[off : off + n]))

    def numbers(self) -> "list[int]":
        """The sequence numbers sent since the last call."""
        taken = [message[2] | message[3] << 8 for message in self.messages]
        self.messages = []
        return taken


def output(history: int = 4, mtu: int = 32, start: int = 0) -> "Output":
    """A sender that has sent and got acknowledged everything before ``start``."""
    stream = make_output(0x80, mtu, bytearray(b"\x81\0\0\0"), history, 100)
    stream.next = stream.first = stream.sent = start
    return stream


def fill(stream: "Output", n: int = 8) -> bool:
    """Puts one submessage of ``n`` bytes into the stream, its bytes all equal to its number."""
    number = stream.next
    at = stream.place(n)
    if at < 0:
        return False
    for i in range(n):
        stream.buf[at + 4 + i] = number & 255
    stream.commit(at, WRITE, n)
    return True


def acknowledge(stream: "Output", first: int, bitmap: int, send: "Send", now: int) -> bool:
    """What a session does with an ACKNACK."""
    known = stream.acknowledge(first, send, now)
    if known and bitmap:
        resend(stream, bitmap, send, now)
    return known


def receiver(window: int = 16, start: int = 0) -> "Input":
    """A receiver that expects ``start``."""
    stream = make_input(0x80, 32, window)
    stream.expected = start
    return stream


def take(stream: "Input", number: int) -> "list[int]":
    """One message arrives; the numbers that were handled because of it."""
    number &= 0xFFFF
    handled: "list[int]" = []
    if accept(stream, number - stream.expected & 0xFFFF, bytes((number & 255, number >> 8)), 0, 2):
        handled.append(number)
        advance(stream)
        handled += kept(stream)
    return handled


def advance(stream: "Input") -> None:
    """What a session does when it has handled the expected message."""
    stream.early.pop(stream.expected, None)
    stream.expected = stream.expected + 1 & 0xFFFF
    if stream.known:
        stream.known -= 1


def kept(stream: "Input") -> "list[int]":
    """The numbers of messages that are kept and in order now, and are handled."""
    handled: "list[int]" = []
    while stream.expected in stream.early:
        body = stream.early[stream.expected]
        assert len(body) == 2
        handled.append(body[0] | body[1] << 8)
        advance(stream)
    return handled


def newer(end: End, *numbers: int) -> "list[bool]":
    """Whether a session handles each of these messages of a best-effort stream."""
    taken = []
    for number in numbers:
        end.tell(message(1, number, submessage(7, b"x")))
        taken.append(end.bodies() == [b"x"])
    return taken


# best effort


def test_best_effort_numbers_count_and_wrap() -> None:
    line = Line()
    stream = make_output(1, 32, bytearray(b"\x81\0\0\0"), 1, 0)
    stream.next = stream.first = stream.sent = 65534
    for _ in range(4):
        assert fill(stream)
        stream.flush(line.send, 0)
    assert line.messages[0][:4] == b"\x81\x01\xfe\xff"
    assert line.numbers() == [65534, 65535, 0, 1]


def test_best_effort_packs_until_the_mtu() -> None:
    line = Line()
    stream = make_output(1, 32, bytearray(b"\x81\0\0\0"), 1, 0)
    assert fill(stream, 5)  # 4 + 4 + 5 = 13
    assert fill(stream, 8)  # 16 + 4 + 8 = 28
    assert not fill(stream, 1)  # 28 + 4 + 1 = 33
    stream.flush(line.send, 0)
    assert len(line.messages) == 1
    assert len(line.messages[0]) == 28
    assert line.messages[0][13:16] == b"\0\0\0"


def test_best_effort_refuses_what_never_fits() -> None:
    stream = make_output(1, 32, bytearray(b"\x81\0\0\0"), 1, 0)
    assert stream.capacity == 24
    assert fill(stream, 24)
    reset_output(stream)
    assert not fill(stream, 25)


def test_best_effort_takes_only_what_is_newer() -> None:
    end = End()
    assert newer(end, 0, 0, 1, 5, 4, 6) == [True, False, True, True, False, True]
    assert end.inputs[1].lost == 3
    end.inputs[1].expected = 0
    assert newer(end, 65535, 65000, 0) == [False, False, True]


def test_best_effort_half_the_numbers_are_newer() -> None:
    end = End()
    newer(end, 0)
    assert newer(end, 0x8000, 0x7FFF) == [False, True]


# reliable, as sender


def test_history_must_be_a_power_of_two() -> None:
    for wrong in (0, 3, 5, 0x8000):
        with raises(ValueError):
            make_output(0x80, 32, bytearray(4), wrong, 100)


def test_a_full_history_takes_no_more() -> None:
    line = Line()
    stream = output(history=4, mtu=16)
    for _ in range(4):
        assert fill(stream)
    assert not fill(stream)
    stream.flush(line.send, 0)
    assert line.numbers() == [0, 1, 2, 3]
    assert not fill(stream)
    assert acknowledge(stream, 1, 0, line.send, 1)
    assert fill(stream)
    assert not fill(stream)
    stream.flush(line.send, 2)
    assert line.numbers() == [4]


def test_every_number_is_sent_once_and_acknowledged_across_the_wrap() -> None:
    line = Line()
    stream = output(history=4, mtu=16, start=NEAR_WRAP)
    sent: "list[int]" = []
    for now in range(80):
        assert fill(stream)
        stream.flush(line.send, now)
        sent += line.numbers()
        if now % 3 == 2:
            assert acknowledge(stream, (sent[-1] + 1) & 0xFFFF, 0, line.send, now)
            assert idle(stream)
    assert sent == [(NEAR_WRAP + i) & 0xFFFF for i in range(80)]
    assert line.messages == []


def test_messages_are_what_was_written() -> None:
    line = Line()
    stream = output(history=4, mtu=16, start=65534)
    for _ in range(4):
        fill(stream)
    stream.flush(line.send, 0)
    first = line.messages[:]
    line.messages = []
    acknowledge(stream, 65534, 0x000F, line.send, 50)
    assert line.messages == first
    assert first[1] == b"\x81\x80\xff\xff\x07\x01\x08\x00" + b"\xff" * 8
    assert first[2] == b"\x81\x80\x00\x00\x07\x01\x08\x00" + b"\x00" * 8


def test_bitmap_bits_name_the_messages_to_send_again() -> None:
    for start in (0, 65529):
        line = Line()
        stream = output(history=16, mtu=16, start=start)
        for _ in range(16):
            fill(stream)
        stream.flush(line.send, 0)
        line.numbers()
        for bit in range(16):
            now = 100 * (bit + 1)
            assert acknowledge(stream, start, 1 << bit, line.send, now)
            assert line.numbers() == [(start + bit) & 0xFFFF]
        acknowledge(stream, start, 0x8101, line.send, 5000)
        assert line.numbers() == [(start + bit) & 0xFFFF for bit in (0, 8, 15)]


def test_bits_of_what_was_never_sent_are_passed_over() -> None:
    line = Line()
    stream = output(history=16, mtu=16)
    fill(stream)
    fill(stream)
    stream.flush(line.send, 0)
    line.numbers()
    assert acknowledge(stream, 0, 0xFFFF, line.send, 50)
    assert line.numbers() == [0, 1]


def test_acknowledgements_of_numbers_never_sent_change_nothing() -> None:
    line = Line()
    stream = output(history=4, mtu=16, start=65535)
    fill(stream)
    fill(stream)
    stream.flush(line.send, 0)
    line.numbers()
    for wrong in (2, 100, 0x7FFF, 0x8000, 65534, 65000):
        assert not acknowledge(stream, wrong, 0xFFFF, line.send, 50), wrong
    assert stream.first == 65535
    assert line.numbers() == []
    assert acknowledge(stream, 1, 0, line.send, 60)
    assert idle(stream)


def test_old_acknowledgements_change_nothing() -> None:
    line = Line()
    stream = output(history=4, mtu=16)
    for _ in range(4):
        fill(stream)
    stream.flush(line.send, 0)
    acknowledge(stream, 3, 0, line.send, 1)
    line.numbers()
    assert not acknowledge(stream, 1, 0x0003, line.send, 100)
    assert stream.first == 3
    assert line.numbers() == []


def test_repeated_nacks_are_held_off() -> None:
    line = Line()
    stream = output(history=8, mtu=16)
    for _ in range(6):
        fill(stream)
    stream.flush(line.send, 1000)
    line.numbers()
    for now in (1001, 1002, 1010):
        acknowledge(stream, 0, 0x0001, line.send, now)
    assert line.numbers() == [0]
    acknowledge(stream, 0, 0x0005, line.send, 1011)
    assert line.numbers() == [2]
    acknowledge(stream, 2, 0x0001, line.send, 1012)  # number 2 was sent again just now
    assert line.numbers() == []
    acknowledge(stream, 2, 0x0001, line.send, 1040)
    assert line.numbers() == [2]
    assert stream.resends == 3


def test_a_heartbeat_is_due_a_period_after_sending_and_after_each_acknowledgement() -> None:
    line = Line()
    stream = output(history=4, mtu=16)
    fill(stream)
    fill(stream)
    stream.flush(line.send, 10_000)
    assert stream.due == 10_100
    fill(stream)
    stream.flush(line.send, 10_050)
    assert stream.due == 10_100
    acknowledge(stream, 1, 0, line.send, 10_070)
    assert stream.due == 10_170


def test_reset_begins_with_number_0() -> None:
    line = Line()
    stream = output(history=4, mtu=16, start=77)
    for _ in range(4):
        fill(stream)
    stream.flush(line.send, 0)
    reset_output(stream)
    assert idle(stream)
    line.messages = []
    fill(stream)
    stream.flush(line.send, 0)
    assert line.numbers() == [0]
    assert acknowledge(stream, 0, 0x0001, line.send, 500)
    assert line.numbers() == [0]


def test_what_is_kept_can_be_shown_in_order() -> None:
    line = Line()
    stream = output(history=4, mtu=16, start=65534)
    for _ in range(3):
        fill(stream)
    stream.flush(line.send, 0)
    acknowledge(stream, 65535, 0, line.send, 0)
    line.numbers()
    stream.transmit(stream.first, stream.next, line.send)
    assert line.numbers() == [65535, 0]


def test_sending_does_not_allocate() -> None:
    stream = output(history=4, mtu=16)

    def call() -> None:
        at = stream.place(8)
        stream.commit(at, WRITE, 8)
        stream.flush(quiet, 5)
        stream.acknowledge(stream.next, quiet, 6)

    assert allocates(call) == 0


def quiet(buf: "Buffer", off: int, n: int) -> None:
    """Sends nowhere."""


# reliable, as receiver


def test_in_order_across_the_wrap() -> None:
    stream = receiver(start=NEAR_WRAP)
    for i in range(80):
        assert take(stream, NEAR_WRAP + i) == [(NEAR_WRAP + i) & 0xFFFF]
        assert missing(stream) == 0
    assert stream.expected == NEAR_WRAP + 80 - 65536


def test_any_order_within_the_window_is_handled_in_order() -> None:
    for start in (0, 65528, 65535):
        stream = receiver(start=start)
        handled: "list[int]" = []
        for i in (3, 1, 15, 2, 14, 4, 8, 0, 5, 13, 6, 7, 12, 9, 11, 10):
            handled += take(stream, start + i)
        assert handled == [(start + i) & 0xFFFF for i in range(16)]
        assert missing(stream) == 0
        assert stream.early == {}


def test_duplicates_are_dropped() -> None:
    stream = receiver(start=65534)
    assert take(stream, 65534) == [65534]
    assert take(stream, 65534) == []
    assert take(stream, 1) == []
    assert take(stream, 1) == []
    assert take(stream, 65000) == []
    assert take(stream, 65535) == [65535]
    assert take(stream, 0) == [0, 1]
    assert take(stream, 1) == []


def test_outside_the_window_is_dropped() -> None:
    stream = receiver(window=16, start=65530)
    for number in (65530 + 16, 65529, 0x7000):
        assert take(stream, number) == []
    assert missing(stream) == 0
    assert stream.early == {}
    take(stream, 65530 + 15)
    assert list(stream.early) == [(65530 + 15) & 0xFFFF]


def test_missing_names_every_hole() -> None:
    for start in (0, 65530):
        stream = receiver(start=start)
        assert missing(stream) == 0
        take(stream, start + 2)
        assert missing(stream) == 0x0003
        take(stream, start + 9)
        assert missing(stream) == 0x01FB
        take(stream, start + 15)
        assert missing(stream) == 0x7DFB
        assert take(stream, start) == [start]
        assert missing(stream) == 0x3EFD
        assert take(stream, start + 1) == [start + 1, (start + 2) & 0xFFFF]
        assert missing(stream) == 0x0FBF


def test_heartbeat_announces() -> None:
    stream = receiver()
    announce(stream, 0, 2)
    assert missing(stream) == 0x0007
    announce(stream, 0, 1)
    assert missing(stream) == 0x0007
    announce(stream, 0, 15)
    assert missing(stream) == 0xFFFF
    assert take(stream, 0) == [0]
    assert missing(stream) == 0x7FFF


def test_announcements_far_ahead_are_asked_for_a_window_at_a_time() -> None:
    stream = receiver(start=65500)
    announce(stream, 65500, (65500 + 30_000) & 0xFFFF)
    assert missing(stream) == 0xFFFF
    assert take(stream, 65500) == [65500]
    assert missing(stream) == 0xFFFF
    for i in range(1, 200):
        assert take(stream, 65500 + i) == [(65500 + i) & 0xFFFF]
    assert missing(stream) == 0xFFFF


def test_an_announcement_of_what_is_past_changes_nothing() -> None:
    stream = receiver(start=100)
    announce(stream, 90, 99)
    assert stream.expected == 100
    assert missing(stream) == 0
    announce(stream, 0x9000, 50)
    assert stream.expected == 100
    assert missing(stream) == 0


def test_heartbeat_gives_messages_up() -> None:
    for start in (0, 65534):
        stream = receiver(start=start)
        take(stream, start + 3)
        take(stream, start + 6)
        announce(stream, (start + 3) & 0xFFFF, (start + 7) & 0xFFFF)
        assert stream.expected == (start + 3) & 0xFFFF
        assert kept(stream) == [(start + 3) & 0xFFFF]
        assert missing(stream) == 0b1011  # 4, 5 and 7
        assert take(stream, start + 4) == [(start + 4) & 0xFFFF]
        assert take(stream, start + 5) == [(start + 5) & 0xFFFF, (start + 6) & 0xFFFF]


def test_heartbeat_gives_everything_up() -> None:
    stream = receiver(start=65533)
    take(stream, 65535)
    announce(stream, 20, 19)
    assert stream.expected == 20
    assert stream.early == {}
    assert missing(stream) == 0
    assert take(stream, 20) == [20]


def test_reset_of_a_receiver() -> None:
    stream = receiver(start=500)
    take(stream, 503)
    reset_input(stream)
    assert missing(stream) == 0
    assert take(stream, 503) == []
    assert take(stream, 0) == [0]


def test_a_message_longer_than_a_slot_stays_missing() -> None:
    stream = receiver()
    assert not accept(stream, 1, bytes(40), 0, 40)
    assert missing(stream) == 0x0003
    assert take(stream, 0) == [0]
    assert take(stream, 1) == [1]


def test_a_window_of_one() -> None:
    stream = receiver(window=1, start=65535)
    assert take(stream, 0) == []
    assert take(stream, 65535) == [65535]
    assert take(stream, 0) == [0]
