"""Samples larger than a message, cut and joined by either role, at any MTU."""

import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.xrce.fragments import Cutter
from tests.xrce.ends import RELIABLE, End

sizes = st.integers(0, 700)
mtus = st.integers(20, 80)


def submessage(body: bytes) -> bytes:
    """A WRITE_DATA of any length; length 0 says that it runs to the end."""
    return struct.pack("<BBH", 7, 1, len(body) if len(body) < 0x10000 else 0) + body


def carry(sender: End, receiver: End, bodies: list[bytes], dice: random.Random, loss: float) -> None:
    """Brings large samples from one end to the other; each is begun when the one before is in the stream."""
    todo = [submessage(body) for body in bodies]
    cutter: Cutter | None = None
    stream = sender.outputs[RELIABLE]
    for now in range(0, 2_000_000, 10):
        if sender.hosts:
            while todo and sender.has_room():
                stream.post(todo.pop(0), sender.send, now)
        else:
            while todo or cutter is not None:
                cutter = cutter or Cutter(todo.pop(0))
                if not cutter.pump(stream):
                    break
                cutter = None
        sender.flush(now)
        for end, peer in ((sender, receiver), (receiver, sender)):
            for message in end.take():
                if dice.random() >= loss:
                    peer.tell(message, now)
        if not todo and cutter is None and stream.first == stream.next:
            return
    raise AssertionError("it does not end")


@given(
    st.lists(sizes, max_size=5),
    mtus,
    st.booleans(),
    st.booleans(),
    st.sampled_from([0, 65530]),
    st.integers(0, 99),
)
@settings(max_examples=80)
def test_any_sizes_at_any_mtu(
    lengths: list[int], mtu: int, hosts: bool, keyed: bool, start: int, seed: int
) -> None:
    dice = random.Random(seed)
    sender = End(hosts=hosts, mtu=mtu, keyed=keyed, start=start)
    receiver = End(hosts=not hosts, mtu=mtu, keyed=keyed, start=start)
    bodies = [dice.randbytes(n) for n in lengths]
    carry(sender, receiver, bodies, dice, loss=0.2)
    assert receiver.got == bodies
    assert receiver.malformed == 0


@pytest.mark.parametrize("hosts", [False, True])
@pytest.mark.parametrize("size", [65_530, 65_535, 65_536, 70_000])
def test_samples_around_and_over_64_kb(hosts: bool, size: int) -> None:
    sender, receiver = End(hosts=hosts, mtu=512, window=16), End(hosts=not hosts, mtu=512, window=16)
    body = random.Random(size).randbytes(size)
    carry(sender, receiver, [body, b"small"], random.Random(1), loss=0.05)
    assert receiver.got == [body, b"small"]


@pytest.mark.parametrize("hosts", [False, True])
@pytest.mark.parametrize("keyed", [False, True])
def test_sizes_just_around_one_message(hosts: bool, keyed: bool) -> None:
    mtu = 64
    for size in range(mtu - 20, mtu + 60):
        sender = End(hosts=hosts, mtu=mtu, keyed=keyed)
        receiver = End(hosts=True, mtu=mtu, keyed=keyed)
        body = bytes(size)
        carry(sender, receiver, [body], random.Random(0), loss=0.0)
        assert receiver.got == [body]


def test_pieces_are_as_long_as_they_can_be() -> None:
    """Piece size is mtu - header - 4, and the last piece is flagged (as recorded from the reference agent)."""
    for keyed in (False, True):
        end = End(hosts=True, mtu=64, keyed=keyed, window=16)
        end.outputs[RELIABLE].post(submessage(bytes(204)), end.send, 0)
        head = 8 if keyed else 4
        sent = end.take()
        assert [len(message) for message in sent[:-1]] == [64] * (len(sent) - 1)
        assert [message[head + 1] for message in sent] == [1] * (len(sent) - 1) + [3]
        assert b"".join(message[head + 4 :] for message in sent) == submessage(bytes(204))


def feed(end: End, piece: bytes, last: bool = False) -> None:
    """A FRAGMENT comes on the reliable stream."""
    told = bytes((13, 3 if last else 1, len(piece), 0)) + piece + b"#"
    end.stream = end.inputs[RELIABLE]
    end._on_fragment(told, 4, len(piece), end.inputs[RELIABLE])


@given(st.lists(st.tuples(st.binary(max_size=30), st.booleans()), max_size=30), st.integers(0, 60))
def test_a_joiner_keeps_what_fits_and_passes_over_what_does_not(
    pieces: list[tuple[bytes, bool]], limit: int
) -> None:
    end = End(hosts=True, largest=limit)
    stream = end.inputs[RELIABLE]
    told: list[int] = []
    end.too_long = told.append  # type: ignore[method-assign,assignment]
    expected = b""
    for piece, last in pieces:
        feed(end, piece, last)
        joiner = stream.fragments
        expected += piece
        if not last:
            assert joiner.data == (expected if len(expected) <= limit else b"")
            continue
        assert joiner is None
        assert told == ([len(expected)] if len(expected) > limit else [])
        told.clear()
        expected = b""


def test_a_torn_joiner_waits_for_the_end() -> None:
    end = End(hosts=True)
    stream = end.inputs[RELIABLE]
    whole = submessage(b"whole")
    feed(end, whole[:6])
    stream.fragments.limit = -1
    feed(end, b"more")
    assert stream.fragments.data == b""
    feed(end, whole[6:], last=True)
    assert (end.got, end.malformed, stream.fragments) == ([], 1, None)
    feed(end, whole[:6])
    feed(end, whole[6:], last=True)
    assert (end.got, end.malformed, stream.fragments) == ([b"whole"], 1, None)


def test_a_piece_that_comes_again_after_an_error_is_passed_over() -> None:
    """The message with the last piece is not acknowledged, so it does come again."""
    end = End(hosts=True)
    stream = end.inputs[RELIABLE]
    whole = submessage(b"whole")

    def broken() -> bool:
        raise ValueError("a user's callback")

    end.is_busy, good = broken, end.is_busy
    with pytest.raises(ValueError, match="callback"):
        feed(end, whole, last=True)
    end.is_busy = good
    feed(end, whole, last=True)
    assert (end.got, end.malformed, stream.fragments) == ([], 1, None)
