"""Writers and readers over networks that lose, double, shuffle, delay and part: what is promised holds, from seeds."""

from __future__ import annotations

import random
from itertools import pairwise

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.links.testing import SimulatedNetwork
from muros.rtps._endpoint import Problem
from muros.rtps._settings import ReaderSettings, WriterSettings
from tests.rtps.nodes import MS, READER, SECOND, SMALL_WRITER, WRITER, Node, match, payload, run

SIMULATIONS = 30
"""Networks tried by each property; every one has its own seed."""

seeds = st.integers(0, 2**32)


def rough(seed: int, loss: float = 0.2) -> SimulatedNetwork:
    """A network on which much goes wrong."""
    return SimulatedNetwork(seed, loss=loss, duplicate=0.1, reorder=0.2, delay=(MS / 5, MS))


def at_rest(*nodes: Node) -> bool:
    """Nothing is kept, nothing is due."""
    return all(core.deadline is None and core.held == 0 for node in nodes for core in node.cores)


@settings(max_examples=SIMULATIONS)
@given(
    seeds,
    st.sampled_from([0.0, 0.1, 0.35]),
    st.sampled_from([0, 2 * MS]),
    st.lists(st.sampled_from([8, 60, 300, 2000]), min_size=20, max_size=60),
    st.sampled_from([1, 4, 60]),
)
def test_everything_arrives_once_and_in_order(
    seed: int, loss: float, response_delay: int, sizes: list[int], burst: int
) -> None:
    network = rough(seed, loss=loss)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=SMALL_WRITER)
    b.reader(settings=ReaderSettings(response_delay=response_delay))
    match(a, b)
    written = [payload(number, size) for number, size in enumerate(sizes)]
    for number, sample in enumerate(written):
        assert writer.write(sample, a.now) == number + 1
        if number % burst == 0:
            run(network, MS, a, b)
    run(network, 60 * SECOND, a, b)
    assert b.payloads() == written
    assert writer.acknowledged == len(written)
    assert at_rest(a, b)
    assert a.problems == b.problems == []


@settings(max_examples=SIMULATIONS)
@given(seeds, st.lists(st.tuples(st.integers(1, 400), st.booleans()), max_size=6))
def test_a_parted_network_only_delays(seed: int, phases: list[tuple[int, bool]]) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=SMALL_WRITER)
    b.reader()
    match(a, b)
    for span, parted in phases:
        if parted:
            network.partition(["a"])
        else:
            network.heal()
        for _ in range(10):
            assert writer.write(payload(writer.last, 500), a.now) is not None
            run(network, span * MS, a, b)
    network.heal()
    run(network, 60 * SECOND, a, b)
    assert b.numbers() == list(range(1, writer.last + 1))
    assert at_rest(a, b)


@settings(max_examples=SIMULATIONS)
@given(seeds, st.integers(1, 30), st.sampled_from([0, SECOND]))
def test_a_full_writer_waits_for_its_readers(seed: int, limit: int, pause: int) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=WriterSettings(limit=limit, fragment_size=200))
    b.reader()
    match(a, b)
    refused = 0
    while writer.last < 150:
        if writer.write(payload(writer.last), a.now) is None:
            refused += 1
            assert writer.held == limit
            room = a.room
            while a.room == room:
                run(network, MS, a, b)
        elif pause and writer.last % 50 == 0:
            run(network, pause, a, b)
    run(network, 60 * SECOND, a, b)
    assert refused > 0
    assert b.numbers() == list(range(1, 151))
    assert at_rest(a, b)


@settings(max_examples=SIMULATIONS)
@given(seeds, st.integers(1, 40))
def test_a_slow_receiver_stops_a_writer_that_keeps_all(seed: int, limit: int) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    dice = random.Random(seed)
    open_for = 5

    def accepts() -> bool:
        nonlocal open_for
        open_for -= 1
        return open_for >= 0

    b.accepts = accepts
    writer = a.writer(depth=None, settings=WriterSettings(limit=limit, fragment_size=200))
    reader = b.reader()
    match(a, b)
    for _ in range(20_000):
        if writer.last == 100 and len(b.numbers()) == 100:
            break
        if writer.last < 100:
            writer.write(payload(writer.last, 300), a.now)
        # Everything not delivered is kept by the writer: the reader has acknowledged nothing it had refused.
        assert writer.acknowledged <= len(b.numbers())
        run(network, MS, a, b)
        if dice.random() < 0.2:
            open_for = dice.randint(0, 3)
            reader.resume(b.now)
    assert b.numbers() == list(range(1, 101))
    open_for = 1000
    run(network, 60 * SECOND, a, b)
    assert at_rest(a, b)


@settings(max_examples=SIMULATIONS)
@given(seeds, st.integers(0, 40), st.integers(1, 30), st.sampled_from([0, 3 * MS]))
def test_a_late_reader_gets_history_then_live(seed: int, before: int, depth: int, lag: int) -> None:
    network = rough(seed)
    a, b, c = Node(network, "a"), Node(network, "b"), Node(network, "c")
    writer = a.writer(transient_local=True, depth=depth, settings=SMALL_WRITER)
    b.reader()
    c.reader()
    match(a, b, history=True)
    for number in range(before):
        writer.write(payload(number, 300 if number % 3 else 12), a.now)
        run(network, 20 * MS, a, b)
    run(network, 10 * SECOND, a, b)
    match(a, c, history=True, late=lambda: run(network, lag, a, b, c))
    live = depth  # as many as are kept, so that none of them is ever lost
    for number in range(before, before + live):
        writer.write(payload(number), a.now)
    run(network, 60 * SECOND, a, b, c)
    assert b.numbers()[-live:] == list(range(before + 1, before + live + 1))
    numbers = c.numbers()
    assert numbers[-live:] == list(range(before + 1, before + live + 1))
    assert numbers == list(range(numbers[0], before + live + 1))
    assert writer.held == min(depth, before + live)
    assert writer.deadline is None


def test_on_a_calm_network_all_of_the_history_comes_first() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(transient_local=True, depth=40)
    b.reader()
    for number in range(50):
        writer.write(payload(number), a.now)
    match(a, b, history=True, late=lambda: run(network, 3 * MS, a, b))
    writer.write(payload(50), a.now)
    assert b.numbers() == []
    run(network, 5 * MS, a, b)
    assert b.numbers() == list(range(12, 52))  # the sample just written has pushed one out
    for number in range(51, 60):
        writer.write(payload(number), a.now)
        run(network, MS, a, b)
    assert b.numbers() == list(range(12, 61))


@pytest.mark.parametrize("what", ["volatile writer", "volatile reader", "best effort reader"])
def test_history_is_for_those_who_want_it_of_those_who_have_it(what: str) -> None:
    network = SimulatedNetwork(1, duplicate=0.1, delay=(MS / 5, MS))
    a, b, c = Node(network, "a"), Node(network, "b"), Node(network, "c")
    writer = a.writer(transient_local=what != "volatile writer", depth=None)
    b.accepts = lambda: False  # so that a volatile writer has something, too
    b.reader()
    c.reader(reliable=what != "best effort reader")
    match(a, b, history=True)
    for number in range(10):
        writer.write(payload(number), a.now)
    run(network, SECOND, a, b, c)
    assert writer.held == 10
    match(a, c, history=what != "volatile reader")
    run(network, SECOND, a, b, c)
    for number in range(10, 20):
        writer.write(payload(number), a.now)
    run(network, SECOND, a, b, c)
    assert c.numbers() == list(range(11, 21))
    assert c.problems == []


@settings(max_examples=SIMULATIONS)
@given(seeds, st.integers(1, 5), st.booleans())
def test_a_writer_that_keeps_the_last_ends_with_the_last(seed: int, depth: int, retains: bool) -> None:
    network = rough(seed, loss=0.5)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=depth, transient_local=retains, settings=SMALL_WRITER)
    b.reader()
    match(a, b)
    for number in range(60):
        writer.write(payload(number, 500 if number % 2 else 16), a.now)
        run(network, MS, a, b)
    run(network, 60 * SECOND, a, b)
    numbers = b.numbers()
    assert all(one < other for one, other in pairwise(numbers))
    assert numbers[-depth:] == list(range(61 - depth, 61))
    assert writer.held == (depth if retains else 0)
    assert b.readers[READER].held == 0
    lost = sum(number for problem, _, number in b.problems if problem is Problem.SAMPLES_LOST)
    assert lost <= 60 - len(numbers)


@settings(max_examples=SIMULATIONS)
@given(seeds, st.booleans())
def test_best_effort_brings_what_comes_newest_first_to_last(seed: int, reliable_writer: bool) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(reliable=reliable_writer, settings=SMALL_WRITER)
    b.reader(reliable=False)
    match(a, b)
    for number in range(200):
        writer.write(payload(number, 500 if number % 5 == 0 else 16), a.now)
        run(network, MS // 2, a, b)
    run(network, 60 * SECOND, a, b)
    numbers = b.numbers()
    assert all(one < other for one, other in pairwise(numbers))
    assert len(numbers) > 90
    assert b.payloads() == [payload(n - 1, 500 if (n - 1) % 5 == 0 else 16) for n in numbers]
    assert at_rest(a, b)


def test_best_effort_on_a_calm_network_loses_nothing() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(reliable=False, settings=SMALL_WRITER)
    b.reader(reliable=False)
    match(a, b)
    for number in range(50):
        writer.write(payload(number, 16 + 40 * number), a.now)
    run(network, SECOND, a, b)
    assert b.numbers() == list(range(1, 51))
    assert network.counters["sent"] == 5 + sum(-(-(16 + 40 * number) // 200) for number in range(5, 50))


@settings(max_examples=6)
@given(seeds)
def test_many_readers_and_writers_meet_over_one_lossy_network(seed: int) -> None:
    network = rough(seed)
    nodes = [Node(network, f"n{number}") for number in range(5)]
    entities = range(2)
    for node in nodes:
        for entity in entities:
            node.writer(WRITER + 0x100 * entity, depth=None, settings=SMALL_WRITER)
            node.reader(READER + 0x100 * entity)
    for one in nodes:
        for other in nodes:
            for entity in entities:
                for reading in entities:
                    match(one, other, writer=WRITER + 0x100 * entity, reader=READER + 0x100 * reading)
    for number in range(20):
        for node in nodes:
            for writer in node.writers.values():
                assert writer.write(payload(number, 16 if number % 4 else 600), node.now) is not None
        run(network, 2 * MS, *nodes)
    run(network, 60 * SECOND, *nodes)
    for node in nodes:
        for got in node.got.values():
            assert len(got) == 5 * 2 * 20
            for other in nodes:
                for writer in other.writers.values():
                    assert [n for guid, n, _ in got if guid == writer.guid] == list(range(1, 21))
    assert at_rest(*nodes)


def test_a_lost_reader_holds_nobody_for_ever() -> None:
    network = rough(3)
    a, b, c = Node(network, "a"), Node(network, "b"), Node(network, "c")
    writer = a.writer(depth=None, settings=WriterSettings(limit=20, patience=5 * SECOND))
    for node in (b, c):
        node.reader()
        match(a, node)
    run(network, SECOND, a, b, c)
    network.partition(["c"])
    accepted = 0
    for _ in range(100):
        accepted += writer.write(payload(writer.last), a.now) is not None
        run(network, 100 * MS, a, b, c)
    assert [problem for problem, _, _ in a.problems] == [Problem.READER_STALLED]
    assert a.problems[0][1:] == (c.readers[READER].guid, 20)
    assert 40 < accepted < 60  # 20 at once, those of three seconds from 7 s on
    assert a.room >= 1
    run(network, 10 * SECOND, a, b)
    assert b.numbers() == list(range(1, accepted + 1))
    # It comes back: what is gone is lost to it, what is kept and what is new it gets.
    network.heal()
    for _ in range(2):
        assert writer.write(payload(writer.last), a.now) is not None
        run(network, 20 * SECOND, a, b, c)
    assert a.problems[1][:2] == (Problem.READER_RETURNED, c.readers[READER].guid)
    assert c.numbers()[-1] == b.numbers()[-1] == accepted + 2
    assert at_rest(a, b, c)


def test_a_lost_reader_that_is_unmatched_makes_room() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=WriterSettings(limit=5))
    b.reader()
    match(a, b)
    network.partition(["b"])
    results = [writer.write(payload(0), a.now) for _ in range(6)]
    assert results == [1, 2, 3, 4, 5, None]
    writer.unmatch(b.readers[READER].guid, a.now)
    assert a.room == 1
    assert writer.write(payload(0), a.now) == 6
    assert writer.held == 0
    assert writer.tick(a.now + 60 * SECOND) is None


def test_the_network_is_silent_when_all_is_acknowledged() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(transient_local=True, depth=10)
    b.reader()
    match(a, b, history=True)
    for number in range(100):
        writer.write(payload(number), a.now)
        run(network, 5 * MS, a, b)
    run(network, 100 * MS, a, b)
    assert b.numbers() == list(range(1, 101))
    sent = network.counters["sent"]
    # At 200 Hz a sample in a few asks for acknowledgement.
    assert sent < 100 + 100
    run(network, 3600 * SECOND, a, b)
    assert network.counters["sent"] == sent


def test_a_reader_that_never_answers_is_asked_less_and_less() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None)
    b.reader()
    match(a, b)
    network.partition(["b"])
    run(network, SECOND, a)
    before = network.counters["sent"]
    writer.write(payload(0), a.now)
    run(network, 60 * SECOND, a)
    assert 60 <= network.counters["sent"] - before <= 70


def test_a_writer_that_is_not_there_is_asked_for_a_while() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    b = Node(network, "b")
    reader = b.reader()
    reader.match_writer(b"a" * 12 + b"\0\0\1\3", ["a"], b.now, reliable=True)
    run(network, 3600 * SECOND, b)
    assert dict(network.counters) == {"sent": 8, "nowhere": 8}
    assert reader.deadline is None


@pytest.mark.parametrize("retains", [False, True])
def test_large_samples_survive_heavy_loss(retains: bool) -> None:
    network = rough(7, loss=0.1)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(transient_local=retains, depth=2, settings=WriterSettings(fragment_size=1300))
    b.reader()
    match(a, b)
    for number in range(2):
        assert writer.write(payload(number, 1_000_000), a.now) == number + 1
    run(network, 60 * SECOND, a, b)
    assert b.payloads() == [payload(0, 1_000_000), payload(1, 1_000_000)]
    assert b.readers[READER].held == 0
    # 770 fragments each; with a tenth lost and a tenth doubled, little more is needed.
    assert network.counters["sent"] < 2 * 770 * 1.5


def test_large_samples_leave_in_bursts() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(
        depth=None, settings=WriterSettings(fragment_size=1000, window=1, burst=10_000, pace=2 * MS)
    )
    b.reader()
    match(a, b)
    run(network, 10 * MS, a, b)
    before = network.counters["sent"]
    for number in range(3):
        writer.write(payload(number, 50_000), a.now)
    assert network.counters["sent"] - before == 11  # and the one that the window has always room for
    for step in range(1, 15):
        run(network, 2 * MS, a, b)
        left = network.counters["sent"] - before
        assert left <= 10 * (step + 1) + 9  # heartbeats and acknowledgements
    run(network, 100 * MS, a, b)
    assert b.numbers() == [1, 2, 3]
    assert at_rest(a, b)


def test_what_is_refused_for_its_size_does_not_stop_the_rest() -> None:
    network = SimulatedNetwork(delay=(MS, MS))
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=SMALL_WRITER)
    b.reader(settings=ReaderSettings(memory=10_000))
    match(a, b)
    for size in (16, 20_000, 16):
        writer.write(payload(0, size), a.now)
    run(network, SECOND, a, b)
    assert b.numbers() == [1, 3]
    assert b.problems == [(Problem.SAMPLE_TOO_LARGE, writer.guid, 20_000)]
    assert at_rest(a, b)


@settings(max_examples=SIMULATIONS)
@given(seeds, st.integers(1, 1024))
def test_little_memory_only_delays(seed: int, window: int) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    writer = a.writer(depth=None, settings=SMALL_WRITER)
    limit = 6000
    reader = b.reader(settings=ReaderSettings(memory=limit, window=window))
    match(a, b)
    most = 0
    for number in range(60):
        writer.write(payload(number, 1800 if number % 3 == 0 else 100), a.now)
        for _ in range(4):
            run(network, MS // 4, a, b)
            most = max(most, reader.held)
    for _ in range(600):
        run(network, 100 * MS, a, b)
        most = max(most, reader.held)
    assert b.numbers() == list(range(1, 61))
    assert most <= limit
    assert at_rest(a, b)
    assert {problem for problem, _, _ in b.problems} <= {Problem.MEMORY_FULL}


@settings(max_examples=SIMULATIONS)
@given(seeds)
def test_numbers_are_64_bit_and_counts_wrap(seed: int) -> None:
    network = rough(seed)
    a, b = Node(network, "a"), Node(network, "b")
    start = 2**32 - 20
    writer = a.writer(depth=None, last=start, settings=SMALL_WRITER)
    writer._beats._count = 2**32 - 12
    reader = b.reader()
    match(a, b)
    proxy = reader.writers[0]
    proxy.sent_count = proxy.sent_fragment_count = 2**32 - 6
    for number in range(60):
        writer.write(payload(number, 500 if number % 4 == 0 else 16), a.now)
        run(network, 15 * MS, a, b)
    run(network, 60 * SECOND, a, b)
    assert b.numbers() == list(range(start + 1, start + 61))
    assert writer._beats._count > 2**32
    assert proxy.sent_count < 1000
    assert at_rest(a, b)


def test_several_places_of_one_reader_all_get_it_and_it_counts_once() -> None:
    network = rough(5)
    a, b = Node(network, "a"), Node(network, "b")
    network.endpoint("b'", b._receive)
    writer = a.writer(depth=None)
    reader = b.reader()
    reader.match_writer(writer.guid, ["a"], 0, reliable=True)
    writer.match(reader.guid, ["b", "b'"], 0, reliable=True)
    for number in range(50):
        writer.write(payload(number), a.now)
        run(network, MS, a, b)
    run(network, 60 * SECOND, a, b)
    assert b.numbers() == list(range(1, 51))
    # The second place goes: matching again only changes the places.
    writer.match(reader.guid, ["b"], a.now, reliable=True)
    before = network.counters["sent"]
    writer.write(payload(50), a.now)
    assert network.counters["sent"] == before + 1
    run(network, SECOND, a, b)
    assert b.numbers() == list(range(1, 52))
