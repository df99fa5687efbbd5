"""Samples that readers of the same process are given by hand: they come as those that go by datagrams do."""

from collections.abc import Callable
from random import Random
from typing import Any

import pytest

from muros.rtps import EndpointQos, LocalReader, LocalWriter, Received, inline_qos
from muros.rtps._local import TIME_END
from muros.rtps._parser import parse_untrusted
from muros.rtps._qos import Durability, History
from tests.rtps.domains import BEST_EFFORT, MS, RELIABLE, Process, World, payload

KEEP_ALL = EndpointQos(history=History.KEEP_ALL)
LATE = EndpointQos(durability=Durability.TRANSIENT_LOCAL, depth=5)

Seen = list[tuple[bytes, int, bytes, int | None, bytes]]


@pytest.fixture
def datagrams(monkeypatch: pytest.MonkeyPatch) -> list[bytes]:
    """What participants of a process send each other, from the first on."""
    sent: list[bytes] = []

    def parse(datagram: bytes) -> Any:
        sent.append(datagram)
        return parse_untrusted(datagram)

    monkeypatch.setattr("muros.rtps._domain.parse_untrusted", parse)
    return sent


def pair(qos: EndpointQos = RELIABLE, **options: Any) -> tuple[World, Process, LocalWriter, LocalReader]:
    """A writer and a reader of one process that have met."""
    world = World()
    process = world.process()
    writer = process.writer(process.participant(), qos=qos)
    reader = process.reader(process.participant(), qos=qos, **options)
    world.run(50 * MS)
    return world, process, writer, reader


@pytest.mark.parametrize("qos", [RELIABLE, BEST_EFFORT, KEEP_ALL])
@pytest.mark.parametrize("size", [4, 16, 200_000])
def test_no_datagram_is_made(datagrams: list[bytes], qos: EndpointQos, size: int) -> None:
    _, process, writer, reader = pair(qos)
    datagrams.clear()
    for number in range(1, 20):
        content = payload(number, size)
        assert writer.write((content[:4], content[4:]), process.now, source_time=number) == number
    assert datagrams == []
    assert [(r.sequence, r.payload, r.source_time) for r in process.got[reader.guid]] == [
        (number, payload(number, size), number) for number in range(1, 20)
    ]
    assert writer.acknowledged
    assert writer.core.held == 0


@pytest.mark.parametrize(
    "spoil",
    [
        lambda world, process: world.process().reader(world.processes[-1].participant()),
        lambda world, process: process.reader(process.participant(), qos=EndpointQos(deadline=10 * MS)),
    ],
    ids=["a reader elsewhere", "a reader with more to it"],
)
def test_with_others_all_go_the_common_way(
    datagrams: list[bytes], spoil: Callable[[World, Process], LocalReader]
) -> None:
    world, process, writer, reader = pair(EndpointQos(deadline=5 * MS))
    other = spoil(world, process)
    world.run(100 * MS)
    assert len(writer.matched) == 2
    datagrams.clear()
    writer.write(payload(1), process.now)
    assert datagrams
    world.run(10 * MS)
    other.close(world.processes[-1].now if len(world.processes) > 1 else process.now)
    world.run(500 * MS)
    assert [received.sequence for received in process.got[reader.guid]] == [1]


def test_what_is_kept_for_late_readers_goes_the_common_way(datagrams: list[bytes]) -> None:
    world, process, writer, _ = pair(LATE)
    datagrams.clear()
    writer.write(payload(1), process.now)
    assert datagrams
    late = process.reader(process.participant(), qos=LATE)
    world.run(50 * MS)
    assert [received.sequence for received in process.got[late.guid]] == [1]


def test_inline_qos_and_one_reader_alone() -> None:
    world = World()
    process = world.process()
    writer = process.writer(process.participant())
    readers = [process.reader(process.participant()) for _ in range(2)]
    world.run(50 * MS)
    related = bytes(range(24))
    for _ in range(3):
        writer.write(payload(1), process.now, inline_qos=inline_qos(related=related))
    writer.write(payload(2), process.now, to=readers[1].guid)
    writer.write(payload(3), process.now)
    got = [process.got[reader.guid] for reader in readers]
    assert [received.sequence for received in got[0]] == [1, 2, 3, 5]
    assert [received.sequence for received in got[1]] == [1, 2, 3, 4, 5]
    assert got[0][0].inline_qos is not None
    assert got[0][3].inline_qos is None


@pytest.mark.parametrize(
    "options",
    [{"source_time": TIME_END}, {"source_time": -1}, {"to": bytes(16)}, {"inline_qos": bytes(70_000)}],
)
def test_what_cannot_be_written_is_refused_as_ever(options: dict[str, Any]) -> None:
    _, process, writer, reader = pair()
    with pytest.raises(ValueError, match=r"does not fit|not matched|do not fit|parameter"):
        writer.write(payload(1), process.now, **options)
    assert writer.write(payload(2), process.now)
    assert [received.payload for received in process.got[reader.guid]] == [payload(2)]


def test_a_reader_that_refuses_gets_it_later() -> None:
    open_ = False
    got: list[int] = []

    def take(received: Received) -> bool:
        if open_:
            got.append(received.sequence)
        return open_

    world, process, writer, reader = pair(KEEP_ALL, on_sample=take)
    for number in range(1, 6):
        assert writer.write(payload(number), process.now) == number
    world.run(50 * MS)
    assert not writer.acknowledged
    open_ = True
    reader.resume(process.now)
    world.run(500 * MS)
    assert got == [1, 2, 3, 4, 5]
    assert writer.acknowledged
    assert writer.write(payload(6), process.now) == 6
    assert got[-1] == 6


def test_writing_and_closing_while_a_sample_comes() -> None:
    """Callbacks may do what they like: what they write comes behind, those that they close get no more."""
    world = World()
    process = world.process()
    writer = process.writer(process.participant())
    got: list[tuple[str, int]] = []

    def first(received: Received) -> None:
        got.append(("first", received.sequence))
        if received.sequence == 1:
            assert writer.write(payload(2), process.now) == 2
            second.close(process.now)

    def late(received: Received) -> None:
        got.append(("third", received.sequence))
        if received.sequence == 2:
            writer.close(process.now)

    process.reader(process.participant(), on_sample=first)
    second = process.reader(
        process.participant(), on_sample=lambda received: got.append(("second", received.sequence))
    )
    process.reader(process.participant(), on_sample=late)
    world.run(50 * MS)
    assert writer.write(payload(1), process.now) == 1
    assert got == [("first", 1), ("third", 1), ("first", 2), ("third", 2)]
    assert writer.closed


class Story:
    """Things that happen to the writers and readers of two processes, by chance but the same for each seed."""

    def __init__(self, seed: int) -> None:
        self.random = Random(seed)
        self.world = World(seed)
        self.here, self.there = self.world.process(), self.world.process()
        self.writers: list[LocalWriter] = []
        self.readers: list[LocalReader] = []
        self.got: dict[bytes, Seen] = {}
        self.shut: set[bytes] = set()
        self.wrote = 0

    def run(self) -> tuple[list[Seen], list[tuple[bool, int]]]:
        """What all readers have got, and how all writers stand."""
        for _ in range(60):
            act, weight = zip(
                (self.write, 30), (self.add_writer, 2), (self.add_reader, 4), (self.close, 1),
                (self.shut_or_open, 3), (self.wait, 6), strict=True,
            )  # fmt: skip
            self.random.choices(act, weight)[0]()
        for reader in self.readers:
            self.shut.discard(reader.guid)
            reader.resume(self.here.now)
        self.world.run(10_000 * MS)
        return list(self.got.values()), [(writer.acknowledged, writer.last) for writer in self.writers]

    def write(self) -> None:
        if self.writers:
            writer = self.random.choice(self.writers)
            self.wrote += 1
            matched = sorted(writer.matched)
            to = self.random.choice(matched) if matched and self.random.random() < 0.2 else None
            size = self.random.choice((8, 100, 5000))
            qos = inline_qos(related=bytes(24)) if self.random.random() < 0.3 else b""
            writer.write(
                payload(self.wrote, size), self.here.now, source_time=self.wrote, inline_qos=qos, to=to
            )

    def add_writer(self) -> None:
        qos = self.random.choice((RELIABLE, BEST_EFFORT, EndpointQos(depth=50), KEEP_ALL, LATE))
        self.writers.append(self.here.writer(self.here.participant(), self.topic(), qos))

    def add_reader(self) -> None:
        qos = self.random.choice((RELIABLE, BEST_EFFORT, KEEP_ALL))
        process = self.here if self.random.random() < 0.95 else self.there
        seen: Seen = []

        def take(received: Received) -> bool:
            if made.guid in self.shut:
                return False
            related = b"" if received.inline_qos is None else b"related"
            seen.append((received.writer, received.sequence, received.payload, received.source_time, related))
            if self.wrote < 400 and received.sequence % 7 == 0 and self.writers and process is self.here:
                self.wrote += 1
                self.writers[0].write(payload(self.wrote), self.here.now, source_time=self.wrote)
            return True

        made = process.reader(process.participant(), self.topic(), qos, on_sample=take)
        self.got[made.guid] = seen
        if process is self.here:
            self.readers.append(made)

    def close(self) -> None:
        chosen: list[Any] = self.random.choice((self.writers, self.readers))
        if chosen:
            chosen.pop(self.random.randrange(len(chosen))).close(self.here.now)

    def shut_or_open(self) -> None:
        if self.readers:
            reader = self.random.choice(self.readers)
            if reader.guid in self.shut:
                self.shut.remove(reader.guid)
                reader.resume(self.here.now)
            elif reader.qos.reliable:
                self.shut.add(reader.guid)

    def wait(self) -> None:
        self.world.run(self.random.choice((1, 20, 300)) * MS)

    def topic(self) -> str:
        return self.random.choice(("rt/a", "rt/b"))


@pytest.mark.parametrize("seed", range(40))
def test_readers_get_the_same_either_way(seed: int, monkeypatch: pytest.MonkeyPatch) -> None:
    by_hand = Story(seed).run()
    monkeypatch.setattr(LocalWriter, "_look_around", lambda self: None)
    common = Story(seed).run()
    assert by_hand == common
