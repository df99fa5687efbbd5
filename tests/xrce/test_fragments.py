"""Samples larger than a message, cut and joined by either role, at any MTU."""

import random
import struct

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.xrce.fragments import Cutter, Joiner
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
        sender.heartbeats(now)
        for end, peer in ((sender, receiver), (receiver, sender)):
            for message in end.take():
                if dice.random() >= loss:
                    peer.tell(message, now)
        if not todo and cutter is None and stream.idle():
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


@given(st.lists(st.tuples(st.binary(max_size=30), st.booleans()), max_size=30), st.integers(0, 60))
def test_a_joiner_keeps_what_fits_and_passes_over_what_does_not(
    pieces: list[tuple[bytes, bool]], limit: int
) -> None:
    joiner = Joiner(limit)
    expected = b""
    for piece, last in pieces:
        expected += piece
        whole = joiner.add(piece, 0, len(piece), last)
        assert len(joiner.data) <= limit
        assert whole == (last and len(expected) <= limit)
        if whole:
            assert joiner.data == expected
            assert joiner.add(piece, 0, len(piece), last), "asked again about the same piece"
            assert joiner.data == expected
        if last:
            assert (joiner.too_long > 0) == (len(expected) > limit)
            assert joiner.too_long in (0, len(expected))
            joiner.clear()
            expected = b""


def test_a_torn_joiner_waits_for_the_end() -> None:
    joiner = Joiner(100)
    joiner.tear()
    assert joiner.add(b"whole", 0, 5, True), "nothing had begun"
    joiner.clear()
    joiner.add(b"begun", 0, 5, False)
    joiner.tear()
    joiner.tear()
    assert not joiner.add(b"more", 0, 4, False)
    assert not joiner.add(b"last", 0, 4, True)
    assert joiner.data == b""
    joiner.clear()
    assert joiner.add(b"next", 0, 4, True)
    assert joiner.data == b"next"
