"""What may be on its way: bounded, as quick as the readers take it, less when it gets lost, never shut for good."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.links.testing import SimulatedNetwork
from muros.rtps._events import Data, Heartbeat
from muros.rtps._sending import CHECKPOINTS_MOST, OVERHEAD, WINDOW_FIRST, WINDOW_LEAST, Window
from muros.rtps._settings import WriterSettings
from tests.rtps.nodes import MS, READER, SECOND, Node, match, payload
from tests.rtps.nodes import run as run_nodes
from tests.rtps.test_writer import Bench

MOST = 1 << 20
LARGE = 60_000


def test_it_begins_small_grows_with_what_arrives_and_is_halved_by_losses() -> None:
    window = Window(MOST)
    assert window.size == WINDOW_FIRST
    for number in range(1, 200):
        window.out = window.end
        window.asked(number, number)
        window.acknowledged(number, number)
    assert window.size == MOST
    window.lost(10 * MS, MS)
    window.lost(10 * MS + 1, MS)  # of the same cause
    assert window.size == MOST // 2
    for times in range(2, 20):
        window.lost(10 * MS * times, MS)
    assert window.size == WINDOW_LEAST


def test_what_is_acknowledged_in_part_opens_it_in_part() -> None:
    window = Window(WINDOW_FIRST)
    for number in (1, 2, 3):
        window.out += 50_000
        window.asked(number, number)
    window.out = window.end
    assert window.waits(5, 10) == 6
    window.acknowledged(1, 5)
    assert window.end - window.out == 50_000
    assert window.waits(5, 10) == 0
    window.acknowledged(1, 6)
    assert window.end - window.out == 50_000
    window.completed(7)
    assert window.end - window.out == window.size


def test_one_that_stays_shut_opens_by_itself() -> None:
    window = Window(1000)
    window.out = 1000
    window.asked(1, 0)
    assert window.waits(4, 10) == 6
    assert window.waits(10, 10) == 0
    assert window.end == 2000
    window.out = 2000
    assert window.waits(19, 10) == 1


@given(st.lists(st.tuples(st.integers(1, 5000), st.integers(0, 500), st.booleans()), max_size=300))
def test_it_stays_in_bounds_whatever_happens(steps: list[tuple[int, int, bool]]) -> None:
    window = Window(100_000)
    for number, (size, acknowledged, lost) in enumerate(steps, 1):
        window.out += size
        window.asked(number, number)
        if acknowledged <= number:
            window.acknowledged(acknowledged, number)
        if lost:
            window.lost(number, 3)
        assert WINDOW_LEAST <= window.size <= 100_000
        assert len(window._asked) <= CHECKPOINTS_MOST
        assert window.ask <= window.out + window.size


@pytest.mark.parametrize("depth", [None, 100])
def test_large_samples_wait_for_acknowledgement(depth: int | None) -> None:
    bench = Bench(depth=depth)
    bench.match()
    for _ in range(50):
        assert bench.core.write(bytes(LARGE), bench.now)
    sent = bench.sent_data()
    assert len(sent) == -(-WINDOW_FIRST // (LARGE + OVERHEAD))
    # Acknowledgement was asked for while there was still room:
    assert {beat.last for beat in bench.take(Heartbeat)} >= {1, 3}
    bench.acknack(len(sent))
    assert len(bench.sent_data()) == 3  # what was asked for and acknowledged gives room
    bench.acknack(len(sent) + 4)
    assert len(bench.sent_data()) > 6
    assert [data.sequence for data in bench.take(Data)][-1] == bench.core.sent


def test_small_ones_wait_only_where_nothing_pushes_them_out() -> None:
    for depth, most in ((None, 300), (10, 1000)):
        bench = Bench(depth=depth)
        bench.match()
        for number in range(1000):
            bench.core.write(payload(number), bench.now)
        assert len(bench.sent_data()) <= most
        bench.core.write(payload(0), bench.now)
        assert (len(bench.sent_data()) == 1001) is (depth == 10)


def test_best_effort_is_not_held() -> None:
    bench = Bench(depth=None)
    bench.match(reliable=False)
    for _ in range(50):
        bench.core.write(bytes(LARGE), bench.now)
    assert len(bench.sent_data()) == 50


def test_a_reader_that_says_nothing_slows_down_but_does_not_stop() -> None:
    bench = Bench(depth=None)
    bench.match()
    for _ in range(100):
        bench.core.write(bytes(LARGE), bench.now)
    begun = len(bench.sent_data())
    bench.wait(100 * MS)
    assert len(bench.sent_data()) >= begun + 10 * 3
    bench.wait(SECOND)
    assert bench.core.sent == 100


def test_one_that_goes_holds_nobody_any_more() -> None:
    bench = Bench(depth=None)
    bench.match("gone")
    bench.match("here")
    for _ in range(10):
        bench.core.write(bytes(LARGE), bench.now)
    bench.acknack(4, name="here")
    assert bench.core.sent < 10
    bench.core.unmatch(b"gone........" + READER.to_bytes(4, "big"), bench.now)
    bench.acknack(bench.core.sent + 1, name="here")
    assert bench.core.sent > 4


@pytest.mark.parametrize("buffer", [200_000, 400_000, 2_000_000])
@pytest.mark.parametrize("size", [LARGE, 200_000])
def test_a_receiver_with_a_small_buffer_gets_everything_without_a_storm(buffer: int, size: int) -> None:
    """The receiver takes 64 kB a millisecond, and what does not fit its buffer is lost."""
    network = SimulatedNetwork(delay=(MS // 10, MS // 10))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=WriterSettings(limit=1000))
    b.reader()
    match(a, b)
    run_nodes(network, 10 * MS, a, b)
    hear = b._receive
    waiting: list[tuple[bytes, object]] = []
    lost = 0

    def into_buffer(datagram: bytes, sender: object) -> None:
        nonlocal lost
        if sum(len(each) for each, _ in waiting) + len(datagram) > buffer:
            lost += 1
        else:
            waiting.append((datagram, sender))

    vars(b.endpoint)["_on_message"] = into_buffer
    assert hear is not None
    for number in range(100):
        assert writer.write(payload(number, size), a.now)
    for _ in range(3000):
        taken = 0
        while waiting and taken < 65_536:
            datagram, sender = waiting.pop(0)
            taken += len(datagram)
            hear(datagram, sender)
        run_nodes(network, MS, a, b)
        if len(b.numbers()) == 100:
            break
    assert b.numbers() == list(range(1, 101))
    assert lost < 100 * (size // 65_000 + 1) // 2
