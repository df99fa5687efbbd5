"""A session without I/O, as both roles see it: messages in, answers out. See also ``tests/xrce/test_session.py``."""

from muros.compat import const
from muros.xrce.beginning import begin, make_input, make_output
from muros.xrce.fragments import Cutter
from muros.xrce.requests import reset
from muros.xrce.session import SessionCore, flush
from tests.board.harness import allocates

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer
    from muros.xrce.streams import Input, Output

MTU = 64
HANDLED, STOP, LATER = 0, 1, 2
WRITE = 0x0107  # WRITE_DATA and its flag
KEY = b"\xaa\xbb\xcc\xdd"


class End(SessionCore):
    """One end: keeps what it sends and what it handles. ``answers`` are given to submessages in turn, then HANDLED."""

    def __init__(self, session_id: int = 0x81, grows: bool = True, largest: int = 4096) -> None:
        begin(self, session_id, KEY, self._keep, largest)
        self.sent: "list[bytes]" = []
        self.got: "list[tuple[int, bytes, int]]" = []
        self.answers: "list[int]" = []
        self.passed_over: "list[int]" = []
        self._grows = grows
        self.outputs[0x80] = make_output(0x80, MTU, self.head, 4, 100)
        self.outputs[1] = make_output(1, MTU, self.head, 1, 0)

    def make_input(self, stream_id: int) -> "Input | None":
        if not self._grows:
            return None
        stream = make_input(stream_id, MTU, 16) if stream_id >= 0x80 else make_input(stream_id, 0, 1)
        self.inputs[stream_id] = stream
        return stream

    def flush(self, now: int) -> None:
        self.outputs[1].flush(self.send, now)
        flush(self, self.outputs[0x80], now)

    def stranger(self, buf: "Buffer", at: int) -> None:
        self.malformed += 1

    def too_long(self, n: int) -> None:
        self.passed_over.append(n)

    def take(self) -> "list[bytes]":
        """What was sent since the last call."""
        sent = self.sent
        self.sent = []
        return sent

    def bodies(self) -> "list[bytes]":
        """The payloads handled since the last call."""
        got = self.got
        self.got = []
        return [body for _, body, _ in got]

    def tell(self, message: bytes, now: int = 0) -> bool:
        """A message arrives."""
        return self.receive(message, 0, len(message), now)

    def write(self, body: bytes) -> bool:
        """Puts a WRITE_DATA into the reliable stream."""
        stream = self.outputs[0x80]
        at = stream.place(len(body))
        if at < 0:
            return False
        for i, byte in enumerate(body):
            stream.buf[at + 4 + i] = byte
        stream.commit(at, WRITE, len(body))
        return True

    def _keep(self, buf: "Buffer", off: int, n: int) -> None:
        self.sent.append(bytes(buf[off : off + n]))

    def handle(self, kind: int, buf: "Buffer", off: int, n: int) -> int:
        answer = self.answers.pop(0) if self.answers else HANDLED
        if answer != LATER:
            self.got.append((kind, bytes(buf[off : off + n]), self.stream.stream_id if self.stream else 0))
        return answer


def idle(stream: "Output") -> bool:
    """Whether everything is sent and acknowledged."""
    return stream.first == stream.next


def submessage(kind: int, body: bytes, flags: int = 1) -> bytes:
    return bytes((kind, flags, len(body) & 255, len(body) >> 8)) + body


def message(stream: int, number: int, *submessages: bytes) -> bytes:
    """A message of session 0x81; submessages begin at multiples of 4."""
    made = bytes((0x81, stream, number & 255, number >> 8 & 255))
    for one in submessages:
        made += bytes(-len(made) & 3) + one
    return made


def data(number: int, *bodies: bytes) -> bytes:
    """A message on the reliable stream with a WRITE_DATA for each body."""
    return message(0x80, number, *[submessage(7, body) for body in bodies])


def acknack(first: int, bitmap: int, stream: int = 0x80) -> bytes:
    body = bytes((first & 255, first >> 8, bitmap >> 8, bitmap & 255, stream))
    return message(0, 0, submessage(10, body))


def heartbeat(first: int, last: int, stream: int = 0x80) -> bytes:
    body = bytes((first & 255, first >> 8, last & 255, last >> 8, stream))
    return message(0, 0, submessage(11, body))


# messages


def test_of_another_session_is_refused() -> None:
    end = End()
    assert not end.tell(b"\x82\0\0\0")
    assert not end.tell(b"\x81\0\0")
    assert not end.tell(b"")
    assert end.tell(b"\x81\0\0\0")
    assert end.take() == []


def test_several_submessages_in_order_with_padding_between() -> None:
    end = End()
    end.tell(message(0, 0, submessage(7, b"a"), submessage(8, b"bcd"), submessage(7, b"")))
    assert end.got == [(7, b"a", 0), (8, b"bcd", 0), (7, b"", 0)]


def test_padding_at_the_end_may_be_garbage() -> None:
    for rest in (b"", b"\xff", b"\x07\x01", b"\xff\xff\xff"):
        end = End()
        end.tell(message(1, 0, submessage(7, b"abcd")) + rest)
        assert end.bodies() == [b"abcd"], rest
        assert end.malformed == 0


def test_a_length_beyond_the_message_is_counted() -> None:
    end = End()
    end.tell(message(0, 0, submessage(7, b"abcd"), b"\x07\x01\x05\x00abcd"))
    assert end.bodies() == [b"abcd"]
    assert end.malformed == 1


def test_length_0_of_data_runs_to_the_end() -> None:
    end = End()
    end.tell(message(1, 0, b"\x07\x01\0\0" + b"x" * 13))
    end.tell(message(1, 1, b"\x09\x01\0\0" + b"y" * 3))
    end.tell(message(1, 2, b"\x08\x01\0\0", submessage(7, b"z")))
    assert end.bodies() == [b"x" * 13, b"y" * 3, b"", b"z"]


def test_in_the_middle_of_a_buffer() -> None:
    end = End()
    told = data(0, b"abc", b"de")
    end.receive(b"###" + told + b"####", 3, len(told), 0)
    assert end.bodies() == [b"abc", b"de"]


def test_the_rest_of_a_message_is_passed_over_when_asked_to() -> None:
    for answer in (HANDLED, STOP):
        end = End()
        end.answers = [HANDLED, answer, HANDLED]
        end.tell(data(0, b"a", b"b", b"c"))
        assert end.bodies() == ([b"a", b"b"] if answer else [b"a", b"b", b"c"])
        assert end.take() == [acknack(1, 0)]


def test_streams_that_are_not_made_are_counted() -> None:
    end = End(grows=False)
    assert end.tell(message(5, 0, submessage(7, b"a")))
    assert end.tell(data(0, b"a"))
    end.tell(heartbeat(0, 3))
    assert end.got == []
    assert end.malformed == 2
    assert end.take() == []


# control messages


def test_control_messages_without_key() -> None:
    end = End()
    end.tell(data(0, b"a"))
    assert end.take() == [b"\x81\0\0\0\x0a\x01\x05\x00\x01\x00\x00\x00\x80"]
    end.tell(data(3, b"d"))
    assert end.take() == [b"\x81\0\0\0\x0a\x01\x05\x00\x01\x00\x00\x03\x80"]


def test_control_messages_with_key() -> None:
    end = End(session_id=1)
    end.tell(b"\x01\x80\x00\x00" + KEY + submessage(7, b"a"))
    assert end.bodies() == [b"a"]
    assert end.take() == [b"\x01\0\0\0" + KEY + b"\x0a\x01\x05\x00\x01\x00\x00\x00\x80"]
    end.write(b"b")
    end.flush(0)
    assert end.take() == [b"\x01\x80\0\0" + KEY + submessage(7, b"b")]
    end.flush(100)
    assert end.take() == [b"\x01\0\0\0" + KEY + b"\x0b\x01\x05\x00\x00\x00\x00\x00\x80"]


def test_bits_8_to_15_stand_in_the_first_byte() -> None:
    end = End()
    end.tell(data(12, b"m"))
    assert end.take() == [b"\x81\0\0\0\x0a\x01\x05\x00\x00\x00\x0f\xff\x80"]
    for number in range(4):
        end.write(bytes((number,)))
        end.flush(0)
    end.take()


def test_acknack_and_heartbeat_of_either_endianness() -> None:
    for flags in (0, 1):
        end = End()
        end.outputs[0x80].next = end.outputs[0x80].first = end.outputs[0x80].sent = 0x0102
        end.write(b"a")
        end.flush(0)
        sent = end.take()
        first = b"\x02\x01" if flags else b"\x01\x02"
        end.tell(message(0, 0, submessage(10, first + b"\x00\x01\x80", flags)), 50)
        assert end.take() == sent  # the bitmap is bytes, not a number
        following = b"\x03\x01" if flags else b"\x01\x03"
        end.tell(message(0, 0, submessage(10, following + b"\x00\x00\x80", flags)), 51)
        assert idle(end.outputs[0x80])
        end.tell(message(0, 0, submessage(11, first + following + b"\x80", flags)), 52)
        assert end.take() == [acknack(0x0102, 0x0003)]


def test_every_reliable_message_and_heartbeat_is_answered() -> None:
    end = End()
    end.tell(data(0, b"a"))
    end.tell(data(0, b"a"))
    end.tell(data(40, b"x"))
    end.tell(heartbeat(0, 0))
    assert end.take() == [acknack(1, 0)] * 4
    assert end.bodies() == [b"a"]


def test_heartbeat_of_a_best_effort_stream_is_answered_with_zeros() -> None:
    end = End()
    end.tell(message(0, 0, submessage(11, b"\xff\xff\xff\xff\x01")))
    assert end.take() == [acknack(0, 0, 1)]


def test_short_control_messages_are_passed_over() -> None:
    end = End()
    end.tell(message(0, 0, submessage(10, b"\0\0\0\0"), submessage(11, b"\0\0\0\0"), submessage(7, b"a")))
    assert end.bodies() == [b"a"]
    assert end.take() == []


def test_acknack_of_streams_that_are_not_there() -> None:
    end = End()
    end.write(b"a")
    end.flush(0)
    end.take()
    for stream in (0, 1, 2, 0x81, 0xFF):
        end.tell(acknack(1, 0xFFFF, stream), 100)
    assert end.take() == []
    assert not idle(end.outputs[0x80])


def test_acknack_of_numbers_never_sent_is_counted() -> None:
    end = End()
    end.write(b"a")
    end.flush(0)
    end.take()
    end.tell(acknack(2, 0xFFFF), 100)
    assert end.malformed == 1
    assert end.take() == []


def test_heartbeats_name_what_is_unacknowledged() -> None:
    end = End()
    end.outputs[0x80].next = end.outputs[0x80].first = end.outputs[0x80].sent = 65534
    for body in (b"a", b"b", b"c"):
        end.write(body * 40)
    end.flush(0)
    assert len(end.take()) == 3
    end.flush(99)
    assert end.take() == []
    end.flush(100)
    assert end.take() == [heartbeat(65534, 0)]
    end.tell(acknack(65535, 0), 150)
    end.flush(250)
    assert end.take() == [heartbeat(65535, 0)]
    end.tell(acknack(1, 0), 251)
    end.flush(1000)
    assert end.take() == []


# order


def test_out_of_order_is_handled_in_order() -> None:
    end = End()
    for number in (2, 1, 3):
        end.tell(data(number, bytes((number,))))
    assert end.bodies() == []
    end.tell(data(0, b"\0"))
    assert end.bodies() == [b"\0", b"\1", b"\2", b"\3"]
    assert end.take() == [acknack(0, 3), acknack(0, 1), acknack(0, 1), acknack(4, 0)]


def test_a_hole_given_up_frees_what_is_behind_it() -> None:
    end = End()
    end.tell(data(2, b"c"))
    end.tell(data(3, b"d"))
    end.take()
    end.tell(heartbeat(2, 3))
    assert end.bodies() == [b"c", b"d"]
    assert end.take() == [acknack(4, 0)]


def test_a_heartbeat_in_a_message_may_give_up_that_message() -> None:
    end = End()
    end.tell(data(6, b"g"))
    given_up = submessage(11, b"\x06\x00\x06\x00\x80")
    end.tell(message(0x80, 0, submessage(7, b"a"), given_up, submessage(7, b"b")))
    assert end.bodies() == [b"a", b"b", b"g"]
    assert end.take()[-1] == acknack(7, 0)


def test_reset_in_a_message_begins_with_number_0() -> None:
    end = End()

    def handle(kind: int, buf: "Buffer", off: int, n: int) -> int:
        if kind == 12:
            reset(end)
        else:
            end.got.append((kind, bytes(buf[off : off + n]), 0x80))
        return HANDLED

    end.handle = handle  # type: ignore[method-assign]
    end.tell(data(0, b"a"))
    end.tell(data(2, b"kept"))
    end.tell(message(0x80, 1, submessage(12, b"")))
    assert end.take()[-1] == acknack(0, 0)
    end.tell(data(0, b"new"))
    assert end.bodies() == [b"a", b"new"]


def test_an_error_in_a_handler_does_not_block_the_stream() -> None:
    end = End()

    def broken(kind: int, buf: "Buffer", off: int, n: int) -> int:
        raise ValueError("a user's callback")

    good = end.handle
    end.handle = broken  # type: ignore[method-assign]
    try:
        end.tell(data(0, b"a"))
        raise AssertionError("the error was hidden")
    except ValueError:
        pass
    end.handle = good  # type: ignore[method-assign]
    end.tell(data(0, b"a"))
    assert end.bodies() == [b"a"]


# fragments


def pieces(body: bytes, first: int, size: int = 20) -> "list[bytes]":
    """Messages with the fragments of ``body``, from number ``first`` on."""
    made: "list[bytes]" = []
    for start in range(0, len(body), size):
        last = start + size >= len(body)
        piece = submessage(13, body[start : start + size], 3 if last else 1)
        made.append(message(0x80, first + len(made) & 0xFFFF, piece))
    return made


def test_fragments_are_joined_across_the_wrap() -> None:
    end = End()
    end.make_input(0x80)
    end.inputs[0x80].expected = 65533
    body = bytes(range(200))
    for one in pieces(submessage(7, body), 65533):
        end.tell(one)
    assert end.bodies() == [body]
    assert end.malformed == 0


def test_fragments_in_any_order() -> None:
    end = End()
    body = bytes(range(100))
    for one in reversed(pieces(submessage(7, body), 0)):
        end.tell(one)
    assert end.bodies() == [body]


def test_fragments_on_best_effort_streams_are_passed_over() -> None:
    end = End()
    end.tell(message(1, 0, submessage(13, submessage(7, b"a"), 3), submessage(7, b"b")))
    end.tell(message(0, 0, submessage(13, submessage(7, b"a"), 3)))
    assert end.bodies() == [b"b"]


def test_a_joined_piece_may_hold_several_submessages() -> None:
    end = End()
    joined = submessage(7, b"a" * 30) + b"\0\0" + submessage(8, b"b" * 4) + submessage(7, b"c" * 5)
    for one in pieces(joined, 0):
        end.tell(one)
    assert [kind for kind, _, _ in end.got] == [7, 8, 7]
    assert end.bodies() == [b"a" * 30, b"b" * 4, b"c" * 5]


def test_the_first_fragment_may_stand_behind_other_submessages() -> None:
    end = End()
    whole = submessage(7, b"x" * 30)
    end.tell(message(0x80, 0, submessage(7, b"a"), submessage(13, whole[:10], 1)))
    end.tell(message(0x80, 1, submessage(13, whole[10:], 3), submessage(7, b"z")))
    assert end.bodies() == [b"a", b"x" * 30, b"z"]


def test_a_joined_sample_longer_than_the_limit_is_passed_over() -> None:
    end = End(largest=100)
    fits, long_one = submessage(7, b"f" * 96), submessage(7, b"l" * 97)
    at = 0
    for body in (fits, long_one, fits):
        for one in pieces(body, at):
            end.tell(one)
            at += 1
    assert end.bodies() == [b"f" * 96] * 2
    assert end.passed_over == [101]
    assert end.malformed == 1


def test_endless_fragments_keep_nothing() -> None:
    end = End(largest=100)
    for number in range(300):
        end.tell(message(0x80, number, submessage(13, b"e" * 40, 1)))
        assert len(end.inputs[0x80].fragments.data) <= 100
    end.tell(message(0x80, 300, submessage(13, b"e", 3)))
    assert end.passed_over == [300 * 40 + 1]
    end.tell(data(301, b"a"))
    assert end.bodies() == [b"a"]


def test_a_joined_piece_cut_short_is_counted() -> None:
    end = End()
    end.tell(message(0x80, 0, submessage(13, b"\x07\x01\xff\x00abc", 3)))
    end.tell(message(0x80, 1, submessage(13, b"\x07", 3)))
    end.tell(message(0x80, 2, submessage(13, b"", 3)))
    assert end.bodies() == []
    assert end.malformed == 1


def test_a_sample_whose_pieces_were_given_up_is_passed_over_to_its_end() -> None:
    end = End()
    torn = pieces(submessage(7, bytes(range(100))), 0)
    end.tell(torn[0])
    end.tell(torn[1])
    end.tell(heartbeat(4, 5))
    end.tell(torn[4])
    end.tell(torn[5])
    end.tell(data(6, b"next"))
    for one in pieces(submessage(7, bytes(range(100))), 7):
        end.tell(one)
    assert end.bodies() == [b"next", bytes(range(100))]
    assert end.malformed == 1
    assert end.passed_over == []


def test_a_sample_is_cut_as_acknowledgements_make_room() -> None:
    one, other = End(), End()
    body = bytes([i & 255 for i in range(1000)])
    cutter = Cutter(submessage(7, body))
    stream = one.outputs[0x80]
    done = False
    for now in range(100):
        if not done:
            done = cutter.pump(stream)
        one.flush(now)
        for told in one.take():
            assert len(told) <= MTU
            other.tell(told, now)
        for told in other.take():
            one.tell(told, now)
    assert done
    assert idle(stream)
    assert other.bodies() == [body]


def test_a_cut_sample_keeps_its_place_among_others() -> None:
    one, other = End(), End()
    one.write(b"before")
    cutter = Cutter(submessage(7, b"x" * 100))
    assert cutter.pump(one.outputs[0x80])
    one.write(b"behind")
    one.flush(0)
    for told in one.take():
        other.tell(told)
    assert other.bodies() == [b"before", b"x" * 100, b"behind"]


# memory


def test_receiving_a_sample_does_not_allocate() -> None:
    end = Quiet()
    stream = end.inputs[0x80] = make_input(0x80, MTU, 4)
    message_of_mine = bytearray(data(0, b"abcdefgh"))

    def call() -> None:
        message_of_mine[2] = stream.expected & 255
        message_of_mine[3] = stream.expected >> 8
        end.receive(message_of_mine, 0, len(message_of_mine), 1)

    assert allocates(call) == 0
    assert stream.expected >= 1


class Quiet(SessionCore):
    """A session that says nothing and handles everything."""

    def __init__(self) -> None:
        begin(self, 0x81, b"", quiet, 0)

    def handle(self, kind: int, buf: "Buffer", off: int, n: int) -> int:
        return HANDLED


def quiet(buf: "Buffer", off: int, n: int) -> None:
    """Sends nowhere."""
