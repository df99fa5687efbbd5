"""Sessions of both roles against each other on bad lines: once and in order, whatever happens."""

import random

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from tests.xrce.ends import NUMBERS, RELIABLE, End, converse

windows = st.sampled_from([1, 2, 4, 16])
starts = st.sampled_from([0, 65500, 65535])


@given(
    st.integers(0, 2**32),
    windows,
    windows,
    st.booleans(),
    starts,
    st.sampled_from([0.0, 0.2, 0.5]),
    st.lists(st.binary(min_size=1, max_size=40), max_size=40),
)
@settings(max_examples=60)
def test_both_ways_on_a_bad_line(
    seed: int, window: int, other_window: int, keyed: bool, start: int, loss: float, bodies: list[bytes]
) -> None:
    """A device and a host with different windows, each sending to the other."""
    device = End(hosts=False, window=window, keyed=keyed, start=start)
    host = End(hosts=True, window=other_window, keyed=keyed, start=start)
    converse(device, host, random.Random(seed), bodies, loss=loss)
    assert device.got == bodies
    assert host.got == bodies


@given(st.integers(0, 2**32), windows, st.lists(st.binary(min_size=1, max_size=30), min_size=1, max_size=30))
@settings(max_examples=40)
def test_receivers_that_are_busy_now_and_then(seed: int, window: int, bodies: list[bytes]) -> None:
    """LATER at any submessage, resumed at any time: nothing is handled twice or passed over."""
    dice = random.Random(seed)
    device, host = End(hosts=False, window=window), End(hosts=True, window=window)
    for end in (device, host):
        end.is_busy = lambda: dice.random() < 0.5
    converse(device, host, dice, bodies, loss=0.2)
    assert device.got == bodies
    assert host.got == bodies


@pytest.mark.parametrize("hosts", [False, True])
def test_a_whole_round_of_numbers(hosts: bool) -> None:
    """All 65536 numbers and some more."""
    sender, receiver = End(hosts=hosts, window=16), End(hosts=not hosts, window=16)
    sent = 0
    while sent < NUMBERS + 100:
        while sender.has_room() and sender.post(b"", sent):
            sent += 1
            sender.flush(0)
        for message in sender.take():
            receiver.tell(message, 0)
        for message in receiver.take():
            sender.tell(message, 0)
    assert len(receiver.got) == sent
    assert sender.outputs[RELIABLE].resends == 0


@given(st.lists(st.binary(max_size=80), max_size=20), st.booleans(), st.booleans())
def test_any_bytes_leave_a_session_in_order(told: list[bytes], hosts: bool, keyed: bool) -> None:
    """Foreign bytes behind a good header: no exception, and the streams stay consistent."""
    end = End(hosts=hosts, keyed=keyed, largest=200)
    for n, body in enumerate(told):
        end.now = n
        end.receive(
            bytes((end.head[0], 0x80, n, 0)) + bytes(end.head[4:]) + body, 0, len(end.head) + len(body), n
        )
        for stream_id, stream in end.inputs.items():
            if stream_id >= 0x80:
                assert not stream.busy
                assert len(stream.early) <= stream.window
                assert 0 <= stream.known < 0x8000
                assert stream.fragments is None or len(stream.fragments.data) <= 200


@given(st.integers(0, 2**32), st.booleans())
@settings(max_examples=30)
def test_a_reset_at_both_ends_begins_anew(seed: int, hosts: bool) -> None:
    dice = random.Random(seed)
    device, host = End(hosts=hosts), End(hosts=True)
    for _ in range(3):
        bodies = [dice.randbytes(dice.randint(1, 30)) for _ in range(10)]
        converse(device, host, dice, bodies, loss=0.3)
        assert device.got == host.got == bodies
        for end in (device, host):
            end.reset()
            end.got.clear()
            end.take()
            assert end.inputs[RELIABLE].expected == end.outputs[RELIABLE].next == 0
