"""Writers and readers on a simulated network, in virtual time: what a participant with sockets will be, for tests."""

from collections.abc import Callable
from typing import Any

from muros.links.testing import SimulatedNetwork
from muros.rtps._endpoint import Problem
from muros.rtps._events import AckNack, Data, DataFrag, Gap, Heartbeat, HeartbeatFrag, NackFrag
from muros.rtps._reader import ReaderCore
from muros.rtps._settings import ReaderSettings, WriterSettings
from muros.rtps._values import Guid, GuidPrefix, guid_of
from muros.rtps._wire import info_dst, message, parse_untrusted
from muros.rtps._writer import WriterCore

MS = 10**6
SECOND = 10**9

WRITER = 0x103  # without a key
READER = 0x104

SMALL_WRITER = WriterSettings(fragment_size=200)
"""Makes fragments of samples one can print."""


class Node:
    """One participant. `got` keeps (writer, sequence number, payload) of what its readers delivered, by reader."""

    def __init__(self, network: SimulatedNetwork, name: str) -> None:
        self.network = network
        self.name = name
        self.prefix: GuidPrefix = name.encode().ljust(12, b".")
        self.endpoint = network.endpoint(name, self._receive)
        self.writers: dict[int, WriterCore] = {}
        self.readers: dict[int, ReaderCore] = {}
        self.got: dict[int, list[tuple[Guid, int, bytes]]] = {}
        self.samples: list[Data] = []
        self.problems: list[tuple[Problem, Guid, int]] = []
        self.accepts: Callable[[], bool] = lambda: True
        self.room = 0

    @property
    def now(self) -> int:
        return int(self.network.now)

    @property
    def cores(self) -> list[WriterCore | ReaderCore]:
        """Its writers and readers."""
        return [*self.writers.values(), *self.readers.values()]

    def writer(self, entity: int = WRITER, **options: Any) -> WriterCore:
        """A new writer."""
        made = self.writers[entity] = WriterCore(
            guid_of(self.prefix, entity), self._send, report=self._report, on_room=self._on_room, **options
        )
        return made

    def reader(
        self, entity: int = READER, *, settings: ReaderSettings | None = None, reliable: bool = True
    ) -> ReaderCore:
        """A new reader."""
        got = self.got[entity] = []

        def deliver(writer: Guid, sample: Data) -> bool:
            if not self.accepts():
                return False
            got.append((writer, sample.sequence, sample.payload))
            self.samples.append(sample)
            return True

        made = self.readers[entity] = ReaderCore(
            guid_of(self.prefix, entity),
            self._send,
            deliver,
            reliable=reliable,
            settings=settings or ReaderSettings(),
            report=self._report,
        )
        return made

    def act(self, _now: float) -> float | None:
        """What is due, as an actor of `SimulatedNetwork.run`."""
        deadlines = []
        for core in self.cores:
            if core.deadline is not None and core.deadline <= self.now:
                core.tick(self.now)
            if core.deadline is not None:
                deadlines.append(core.deadline)
        return min(deadlines, default=None)

    def payloads(self, entity: int = READER) -> list[bytes]:
        """What a reader delivered."""
        return [payload for _, _, payload in self.got[entity]]

    def numbers(self, entity: int = READER) -> list[int]:
        """The sequence numbers of what a reader delivered."""
        return [number for _, number, _ in self.got[entity]]

    def _send(self, submessages: list[bytes], destination: GuidPrefix | None, place: Any) -> None:
        head = [] if destination is None else [info_dst(destination)]
        self.endpoint.send(message(self.prefix, *head, *submessages), place)

    def _receive(self, datagram: bytes, _sender: Any) -> None:
        content = parse_untrusted(datagram)
        assert content.trouble == ""
        for event in content.submessages:
            if event.destination not in (None, self.prefix):
                continue
            if isinstance(event, AckNack):
                if event.writer in self.writers:
                    self.writers[event.writer].on_acknack(event, self.now)
            elif isinstance(event, NackFrag):
                if event.writer in self.writers:
                    self.writers[event.writer].on_nack_frag(event, self.now)
            elif isinstance(event, Data | DataFrag | Heartbeat | HeartbeatFrag | Gap):
                for entity, reader in self.readers.items():
                    if event.reader in (0, entity):
                        tell(reader, event, self.now)

    def _report(self, problem: Problem, peer: Guid, number: int) -> None:
        self.problems.append((problem, peer, number))

    def _on_room(self) -> None:
        self.room += 1


def tell(reader: ReaderCore, event: Data | DataFrag | Heartbeat | HeartbeatFrag | Gap, now: int) -> None:
    """Hand an event to the reader's method for it."""
    if isinstance(event, Data):
        reader.on_data(event, now)
    elif isinstance(event, DataFrag):
        reader.on_data_frag(event, now)
    elif isinstance(event, Heartbeat):
        reader.on_heartbeat(event, now)
    elif isinstance(event, HeartbeatFrag):
        reader.on_heartbeat_frag(event, now)
    else:
        reader.on_gap(event, now)


def match(
    writing: Node,
    reading: Node,
    *,
    writer: int = WRITER,
    reader: int = READER,
    history: bool = False,
    late: Callable[[], None] = lambda: None,
) -> None:
    """The two meet, as discovery would have it: the reader learns of the writer, then `late` things happen, then the
    writer learns of the reader."""
    w, r = writing.writers[writer], reading.readers[reader]
    r.match_writer(w.guid, [writing.name], writing.now, reliable=w.reliable)
    late()
    w.match(r.guid, [reading.name], writing.now, reliable=r.reliable, transient_local=history)


def run(network: SimulatedNetwork, span: int, *nodes: Node) -> None:
    """Let `span` ns of virtual time pass."""
    network.run(network.now + span, *[node.act for node in nodes])


def payload(number: int, size: int = 16) -> bytes:
    """A recognizable payload, encapsulation included; `size` a multiple of 4, since DATA is padded to that."""
    head = b"\0\1\0\0" + number.to_bytes(8, "little")
    return (head * (size // len(head) + 1))[:size]
