"""What several readers at one place have missed."""

from typing import Any

from muros.rtps._endpoint import MILLISECOND as MS
from muros.rtps._settings import WriterSettings
from muros.rtps._values import guid_of
from muros.rtps._wire import AckNack, Data, Event, Heartbeat, message, parse_untrusted
from muros.rtps._writer import WriterCore
from tests.rtps.nodes import payload

READERS = [bytes([number]) * 12 for number in range(1, 4)]
SETTINGS = WriterSettings(together=5 * MS, fragment_size=1000)


class Bench:
    def __init__(
        self, *, places: tuple[str, ...] = ("here",) * 3, settings: WriterSettings = SETTINGS
    ) -> None:
        self.sent: list[tuple[Any, bytes | None, list[Event]]] = []
        self.core = WriterCore(
            guid_of(bytes(12), 0x103), self._send, transient_local=True, depth=None, settings=settings
        )
        for number in range(3):
            self.core.write(payload(number, 100), 0)
        self.core.write(payload(3, 5000), 0)
        for prefix, place in zip(READERS, places, strict=bool(places)):
            self.core.match(guid_of(prefix, 0x104), [place], 0, reliable=True, transient_local=True)
        self.sent.clear()

    def _send(self, submessages: list[bytes], destination: bytes | None, place: Any) -> None:
        content = parse_untrusted(message(bytes(12), *submessages))
        self.sent.append((place, destination, content.submessages))

    def miss(self, reader: int, *missing: int, now: int = MS) -> None:
        prefix = READERS[reader]
        self.core.on_acknack(AckNack(prefix, None, 0x104, 0x103, min(missing), missing, 10, True), now)

    def data(self) -> list[tuple[bytes | None, int, int]]:
        return [
            (destination, event.reader, event.sequence)
            for _, destination, events in self.sent
            for event in events
            if isinstance(event, Data)
        ]


def test_what_several_miss_is_sent_to_all_of_them_at_once() -> None:
    bench = Bench()
    bench.miss(0, 1, 2, 3)
    bench.miss(1, 2, 3)
    bench.miss(2, 3, 4)
    assert bench.sent == []
    assert bench.core.due == MS
    bench.core.tick(MS)
    assert bench.data() == [(None, 0, 2), (None, 0, 3), (READERS[0], 0x104, 1)]
    fragments = [
        destination for _, destination, events in bench.sent if type(events[0]).__name__ == "DataFrag"
    ]
    assert set(fragments) == {READERS[2]}
    asked = [
        destination
        for _, destination, events in bench.sent
        for event in events
        if isinstance(event, Heartbeat)
    ]
    assert asked == READERS


def test_readers_at_different_places_are_served_alone() -> None:
    bench = Bench(places=("here", "there", "elsewhere"))
    for reader in range(3):
        bench.miss(reader, 1)
    bench.core.tick(6 * MS)
    assert bench.data() == [(prefix, 0x104, 1) for prefix in READERS]


def test_others_are_served_at_once_each_for_itself() -> None:
    bench = Bench(settings=WriterSettings(fragment_size=1000))
    for reader in range(3):
        bench.miss(reader, 1)
    assert bench.data() == [(prefix, 0x104, 1) for prefix in READERS]


def test_one_that_goes_before_it_is_served_leaves_nothing_due() -> None:
    bench = Bench()
    bench.miss(0, 1)
    for prefix in READERS:
        bench.core.unmatch(guid_of(prefix, 0x104), 2 * MS)
    bench.core.tick(6 * MS)
    assert bench.sent == []
    assert bench.core.deadline is None


class TestPatience:
    """Readers that may be served a little later than at once, with those that come next."""

    def bench(self, *, places: str = "hhh") -> Bench:
        bench = Bench(places=())
        for prefix, place in zip(READERS, places, strict=True):
            reader = guid_of(prefix, 0x104)
            bench.core.match(reader, [place], MS, reliable=True, transient_local=True, patient=True)
        assert bench.sent == []
        assert bench.core.due == 5 * MS
        bench.core.tick(bench.core.due)
        return bench

    def beats(self, bench: Bench) -> list[tuple[Any, bytes | None, bool]]:
        return [
            (place, destination, event.final)
            for place, destination, events in bench.sent
            for event in events
            if isinstance(event, Heartbeat)
        ]

    def test_what_is_kept_comes_unasked_and_once_for_all_at_a_place(self) -> None:
        bench = self.bench()
        assert bench.data() == [(None, 0, 1), (None, 0, 2), (None, 0, 3)]
        fragments = {
            destination for _, destination, events in bench.sent if type(events[0]).__name__ == "DataFrag"
        }
        assert fragments == set(READERS), "what is cut to pieces is sent to each"
        assert self.beats(bench) == [("h", None, False)]
        assert bench.core.due > 20 * MS, "then it is their turn"

    def test_one_that_comes_alone_is_served_by_itself(self) -> None:
        bench = self.bench(places="abc")
        assert [destination for destination, _, _ in bench.data()] == [
            prefix for prefix in READERS for _ in range(3)
        ]
        assert self.beats(bench) == [
            (place, prefix, False) for place, prefix in zip("abc", READERS, strict=True)
        ]

    def test_few_of_many_at_a_place_are_asked_by_name(self) -> None:
        bench = self.bench()
        for prefix in READERS[1:]:
            bench.core.on_acknack(AckNack(prefix, None, 0x104, 0x103, 5, (), 10, True), 6 * MS)
        bench.sent.clear()
        bench.core.tick(40 * MS)
        assert self.beats(bench) == [("h", READERS[0], False)]

    def test_who_has_everything_already_is_sent_nothing(self) -> None:
        bench = Bench(places=())
        for prefix in READERS:
            reader = guid_of(prefix, 0x104)
            bench.core.match(reader, ["h"], MS, reliable=True, transient_local=True, patient=True)
            bench.core.on_acknack(AckNack(prefix, None, 0x104, 0x103, 5, (), 10, True), 2 * MS)
        bench.core.tick(20 * MS)
        assert bench.sent == []
        assert bench.core.deadline is None

    def test_a_writer_with_nothing_to_say_asks_once_whether_anybody_is_there(self) -> None:
        sent: list[Heartbeat] = []

        def send(submessages: list[bytes], destination: bytes | None, place: Any) -> None:
            content = parse_untrusted(message(bytes(12), *submessages))
            sent.extend(event for event in content.submessages if isinstance(event, Heartbeat))

        core = WriterCore(guid_of(bytes(12), 0x103), send, transient_local=True, settings=SETTINGS)
        core.match(guid_of(READERS[0], 0x104), ["h"], 0, reliable=True, transient_local=True, patient=True)
        while (due := core.deadline) is not None:
            core.tick(due)
        assert [(beat.first, beat.last, beat.final) for beat in sent] == [(1, 0, False)]
        assert not core.is_heard_by(guid_of(READERS[0], 0x104))
        core.on_acknack(AckNack(READERS[0], None, 0x104, 0x103, 1, (), 10, True), 6 * MS)
        assert core.is_heard_by(guid_of(READERS[0], 0x104))
        assert core.deadline is None
