"""Streams that a slow reader holds, and that go on where they were. See also ``tests/board/test_session.py``."""

from muros.xrce._types import Buffer
from muros.xrce.constants import FAILED, HANDLED, LATER
from muros.xrce.queues import HostSession, resume
from tests.board import test_session
from tests.board.test_session import acknack, data, heartbeat, message, pieces, submessage


class End(HostSession, test_session.End):
    """One end, on a host."""

    def answer(self, kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        return test_session.End.handle(self, kind, buf, off, n)


def test_failure_ends_the_message_only_when_asked_to() -> None:
    for stops in (False, True):
        end = End()
        end.stop_at_failure = stops
        end.answers = [HANDLED, FAILED, HANDLED]
        end.tell(data(0, b"a", b"b", b"c"))
        assert end.bodies() == ([b"a", b"b"] if stops else [b"a", b"b", b"c"])
        assert end.take() == [acknack(1, 0)]


def test_later_holds_the_stream_until_resumed() -> None:
    end = End()
    end.answers = [HANDLED, LATER]
    end.tell(data(0, b"a", b"b", b"c"))
    end.tell(data(1, b"d"))
    assert end.bodies() == [b"a"]
    assert end.take() == [acknack(0, 0), acknack(0, 0)]
    end.answers = [LATER]
    resume(end, 0x80, 1)
    assert end.bodies() == []
    end.answers = [HANDLED, HANDLED, HANDLED]
    resume(end, 0x80, 2)
    assert end.bodies() == [b"b", b"c", b"d"]
    assert end.take() == [acknack(0, 0), acknack(2, 0)]
    resume(end, 0x80, 3)
    resume(end, 0x90, 3)
    resume(end, 1, 3)
    assert end.take() == []
    assert end.bodies() == []


def test_a_kept_message_may_be_held_too() -> None:
    end = End()
    end.tell(data(1, b"c", b"d", b"e"))
    end.answers = [HANDLED, HANDLED, LATER]
    end.tell(data(0, b"a"))
    assert end.bodies() == [b"a", b"c"]
    resume(end, 0x80, 1)
    assert end.bodies() == [b"d", b"e"]
    end.tell(data(2, b"f"))
    assert end.bodies() == [b"f"]


def test_resuming_from_inside_goes_on_outside() -> None:
    end = End()
    depth = [0, 0]

    def handle(kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        body = bytes(buf[off : off + n])
        if body == b"b" and depth[0] == 0:
            depth[0] = 1
            return LATER
        depth[1] += 1
        assert depth[1] == 1, "nested"
        end.got.append((kind, body, stream_id))
        resume(end, 0x80, 5)
        depth[1] -= 1
        return HANDLED

    end.answer = handle  # type: ignore[method-assign]
    end.tell(data(0, b"a", b"b", b"c"))
    end.tell(data(1, b"d"))
    resume(end, 0x80, 1)
    assert end.bodies() == [b"a", b"b", b"c", b"d"]


def test_later_inside_a_joined_piece() -> None:
    end = End()
    joined = submessage(7, b"a" * 28) + submessage(7, b"b" * 4) + submessage(7, b"c" * 4)
    messages = pieces(joined, 0)
    end.answers = [HANDLED, LATER, LATER, LATER]
    for one in messages:
        end.tell(one)
    assert end.bodies() == [b"a" * 28]
    end.tell(data(len(messages), b"z"))
    end.tell(messages[-1])
    resume(end, 0x80, 1)
    assert end.bodies() == []
    assert end.take()[-1] == acknack(len(messages) - 1, 0)
    resume(end, 0x80, 2)
    assert end.bodies() == [b"b" * 4, b"c" * 4, b"z"]
    assert end.take()[-1] == acknack(len(messages) + 1, 0)


def test_a_held_message_that_is_sent_again_goes_on_where_it_was() -> None:
    end = End()
    end.answers = [HANDLED, LATER, LATER]
    end.tell(data(0, b"a", b"b", b"c"))
    end.tell(data(0, b"a", b"b", b"c"))
    assert end.bodies() == [b"a"]
    end.tell(data(0, b"a", b"b", b"c"))
    assert end.bodies() == [b"b", b"c"]
    assert end.take() == [acknack(0, 0), acknack(0, 0), acknack(1, 0)]


def test_a_heartbeat_for_a_held_stream_goes_on_where_it_was() -> None:
    end = End()
    end.answers = [HANDLED, LATER]
    end.tell(data(0, b"a", b"b"))
    end.tell(heartbeat(0, 0))
    assert end.bodies() == [b"a", b"b"]
    assert end.take() == [acknack(0, 0), acknack(1, 0)]


def test_a_held_message_that_is_given_up_leaves_nothing() -> None:
    end = End()
    end.answers = [HANDLED, LATER]
    end.tell(data(0, b"a", b"b"))
    end.tell(data(2, b"c", b"d"))
    end.tell(heartbeat(2, 2))
    assert end.bodies() == [b"a", b"c", b"d"]


def test_a_held_message_whose_pieces_are_given_up_leaves_nothing() -> None:
    end = End()
    joined = submessage(7, b"a" * 28) + submessage(7, b"b" * 4)
    messages = pieces(joined, 0)
    end.answers = [HANDLED, LATER]
    for one in messages:
        end.tell(one)
    end.tell(heartbeat(len(messages), len(messages)))
    for one in pieces(submessage(7, b"c" * 30), len(messages)):
        end.tell(one)
    assert end.bodies() == [b"a" * 28, b"c" * 30]
    assert end.malformed == 0


def test_a_message_that_resets_its_stream_is_not_held() -> None:
    end = End()
    end.outputs.clear()  # they are a board's

    def handle(kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        if kind == 12:
            end.reset()
            return HANDLED
        return LATER

    end.answer = handle  # type: ignore[method-assign]
    end.tell(message(0x80, 0, submessage(12, b""), submessage(7, b"a")))
    assert end.inputs[0x80].early == {}
    assert end.take() == [acknack(0, 0)]
