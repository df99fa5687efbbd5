"""A client that does exactly what it is told, so that tests can be as wrong as they like.

It sends raw submessages to a `Bench`, acknowledges what it gets unless told not to, and hands out what it got.
"""

import struct
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from muros.client.qos import Qos
from muros.xrce import create
from muros.xrce.constants import (
    ACKNACK,
    CREATE,
    CREATE_CLIENT,
    DATA,
    DELETE,
    FRAGMENT,
    HEARTBEAT,
    INFO,
    KIND_DATAREADER,
    KIND_DATAWRITER,
    KIND_PUBLISHER,
    KIND_REPLIER,
    KIND_REQUESTER,
    KIND_SUBSCRIBER,
    READ_DATA,
    REPLACE,
    REUSE,
    STATUS,
    STATUS_AGENT,
    STREAM_RELIABLE,
    UNLIMITED_SAMPLES,
    WRITE_DATA,
)
from tests.agent.replay import Bench

if TYPE_CHECKING:
    from muros.xrce.create import Asked

PARTICIPANT, TOPIC, PUBLISHER, SUBSCRIBER, WRITER, READER = 0x0011, 0x0012, 0x0013, 0x0014, 0x0015, 0x0016
REQUESTER, REPLIER = 0x0017, 0x0018
RELIABLE = Qos(reliable=True, depth=10).asked
KEEP_ALL = Qos(reliable=True, keep_all=True).asked
BEST_EFFORT = Qos(reliable=False, depth=5).asked


@dataclass(frozen=True)
class Got:
    """A submessage from the agent, whole."""

    stream: int
    kind: int
    body: bytes

    @property
    def ids(self) -> bytes:
        """Request id and object id."""
        return self.body[:4]

    @property
    def status(self) -> int:
        """The result of a STATUS."""
        return self.body[4]

    @property
    def data(self) -> bytes:
        """The sample of a DATA."""
        return self.body[4:]


def submessage(kind: int, body: bytes, flags: int = 1) -> bytes:
    """Header and payload."""
    return struct.pack("<BBH", kind, flags, len(body) & 0xFFFF) + body


class Raw:
    """One client at ``address`` of a bench."""

    def __init__(
        self,
        bench: Bench,
        address: Any = "client",
        key: int = 0xAABBCCDD,
        *,
        session_id: int = 0x81,
        mtu: int = 508,
        acknowledges: bool = True,
    ) -> None:
        self.bench = bench
        self.address = address
        self.key = key.to_bytes(4, "big")
        self.session_id = session_id
        self.mtu = mtu
        self.acknowledges = acknowledges
        self.numbers: dict[int, int] = {}
        self.expected: dict[int, int] = {}
        self.request = 10
        self._joined = b""

    @property
    def who(self) -> str:
        """How findings call it."""
        return f"client 0x{self.key.hex().upper()}"

    # Sending

    def tell(self, message: bytes) -> None:
        """Sends these bytes."""
        self.bench.receive(message, self.address)

    def head(self, stream: int = 0, number: int = 0) -> bytes:
        """The header of a message."""
        tail = self.key if self.session_id < 0x80 else b""
        return struct.pack("<BBH", self.session_id, stream, number & 0xFFFF) + tail

    def send(self, stream: int, *submessages: bytes) -> int:
        """Sends a message; returns its number."""
        number = self.numbers.get(stream, 0) if stream else 0
        if stream:
            self.numbers[stream] = number + 1 & 0xFFFF
        self.tell(self.message(stream, number, *submessages))
        return number

    def message(self, stream: int, number: int, *submessages: bytes) -> bytes:
        """A message with submessages at multiples of 4."""
        made = self.head(stream, number)
        for one in submessages:
            made += bytes(-len(made) & 3) + one
        return made

    def connect(self, *properties: tuple[str, str]) -> int:
        """Sends CREATE_CLIENT; the status of the answer (-1: none)."""
        self.numbers.clear()
        self.expected.clear()
        body = b"XRCE\1\0\1\x0f" + self.key + bytes((self.session_id, 1 if properties else 0))
        if properties:
            body += bytes(-len(body) & 3) + struct.pack("<I", len(properties))
            for text in (text for pair in properties for text in pair):
                body += bytes(-len(body) & 3) + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
            body += bytes(-len(body) & 1)
        body += struct.pack("<H", self.mtu)
        session = 0x80 if self.session_id >= 0x80 else 0
        self.tell(
            bytes((session, 0, 0, 0)) + (b"" if session else self.key) + submessage(CREATE_CLIENT, body)
        )
        return next((got.body[0] for got in self.got() if got.kind == STATUS_AGENT), -1)

    def goodbye(self) -> int:
        """Sends DELETE of the client; the status."""
        self.send(0, submessage(DELETE, b"\0\2\xff\xfe"))
        return self.statuses()[-1]

    def ids(self, object_id: int) -> bytes:
        """A new request id, then the object id."""
        self.request += 1
        return struct.pack(">HH", self.request & 0xFFFF, object_id)

    def make(
        self, object_id: int, variant: bytes, flags: int = REPLACE, stream: int = STREAM_RELIABLE
    ) -> int:
        """Sends CREATE; the status (-1: none came)."""
        ids = self.ids(object_id)
        self.send(stream, submessage(CREATE, ids + variant, flags | 1))
        return self.status_of(ids)

    def delete(self, object_id: int, stream: int = STREAM_RELIABLE) -> int:
        """Sends DELETE; the status (-1: none came)."""
        ids = self.ids(object_id)
        self.send(stream, submessage(DELETE, ids))
        return self.status_of(ids)

    def write(self, data: bytes, writer: int = WRITER, stream: int = STREAM_RELIABLE) -> bytes:
        """Sends a sample, in fragments where it is too long for a message; the ids."""
        ids = self.ids(writer)
        whole = submessage(WRITE_DATA, ids + data)
        if len(ids + data) > 0xFFFF:
            whole = whole[:2] + b"\0\0" + whole[4:]
        room = self.mtu - len(self.head())
        if len(whole) <= room:
            self.send(stream, whole)
            return ids
        for start in range(0, len(whole), room - 4):
            last = start + room - 4 >= len(whole)
            self.send(stream, submessage(FRAGMENT, whole[start : start + room - 4], 3 if last else 1))
        return ids

    def read(
        self,
        reader: int = READER,
        stream: int = STREAM_RELIABLE,
        samples: int = UNLIMITED_SAMPLES,
        seconds: int = 0,
        rate: int = 0,
        pace: int = 0,
    ) -> bytes:
        """Sends READ_DATA; the ids."""
        ids = self.ids(reader)
        self.send(
            STREAM_RELIABLE,
            submessage(READ_DATA, ids + create.read_data(stream, samples, seconds, rate, pace)),
        )
        return ids

    def acknack(self, first: int, bitmap: int = 0, stream: int = STREAM_RELIABLE) -> None:
        """Sends an ACKNACK."""
        self.send(
            0, submessage(ACKNACK, struct.pack("<H", first & 0xFFFF) + struct.pack(">HB", bitmap, stream))
        )

    def heartbeat(self, first: int, last: int, stream: int = STREAM_RELIABLE) -> None:
        """Sends a HEARTBEAT."""
        self.send(0, submessage(HEARTBEAT, struct.pack("<HHB", first & 0xFFFF, last & 0xFFFF, stream)))

    # Entities of a usual client

    def tree(
        self, topic: str = "rt/chatter", type_name: str = "T", qos: "Asked" = RELIABLE, name: str = "node"
    ) -> "Raw":
        """Makes a participant, a topic, a publisher with a writer and a subscriber with a reader."""
        self.base(topic, type_name, name)
        assert self.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, qos, PUBLISHER)) == 0
        assert self.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, qos, SUBSCRIBER)) == 0
        return self

    def base(self, topic: str = "rt/chatter", type_name: str = "T", name: str = "node") -> "Raw":
        """Connects and makes everything but the endpoints."""
        assert self.connect() == 0
        assert self.make(PARTICIPANT, create.of_participant(name, 0)) == 0
        assert self.make(TOPIC, create.of_topic(topic, type_name, PARTICIPANT)) == 0
        assert self.make(PUBLISHER, create.of_group(KIND_PUBLISHER, PARTICIPANT)) == 0
        assert self.make(SUBSCRIBER, create.of_group(KIND_SUBSCRIBER, PARTICIPANT)) == 0
        return self

    def service(self, kind: int, name: str = "/add", domain: int = 0) -> "Raw":
        """Connects and makes a participant with a requester or a replier."""
        assert kind in (KIND_REQUESTER, KIND_REPLIER)
        assert self.connect() == 0
        assert self.make(PARTICIPANT, create.of_participant("node", domain)) == 0
        variant = create.of_service(kind, name, "Q", "P", f"rq{name}Request", f"rr{name}Reply", PARTICIPANT)
        assert self.make(0x10 | kind, variant, REUSE | REPLACE) == 0
        return self

    def service_kinds(self) -> None:
        """Makes a requester and a replier in the participant that is there."""
        for kind in (KIND_REQUESTER, KIND_REPLIER):
            variant = create.of_service(kind, "/x", "Q", "P", "rq/xRequest", "rr/xReply", PARTICIPANT)
            assert self.make(0x10 | kind, variant) == 0

    # What the agent sent

    def got(self) -> list[Got]:
        """What has come since the last call, in order, fragments joined; duplicates and what is early passed over."""
        found: list[Got] = []
        while mine := [message for _, address, message in self.bench.wire.sent if address == self.address]:
            self.bench.wire.sent = [entry for entry in self.bench.wire.sent if entry[1] != self.address]
            for message in mine:
                found += self._submessages(message)
        return found

    def statuses(self) -> list[int]:
        """The results of the STATUS that have come since the last call; everything else is dropped."""
        return [got.status for got in self.got() if got.kind == STATUS]

    def status_of(self, ids: bytes) -> int:
        """The result of the request with these ids, -1 if none has come; everything else is dropped."""
        return next((got.status for got in self.got() if got.kind == STATUS and got.ids == ids), -1)

    def samples(self) -> list[bytes]:
        """The samples that have come since the last call; everything else is dropped."""
        return [got.data for got in self.got() if got.kind == DATA]

    def ping(self) -> bool:
        """Whether the agent answers in this session."""
        self.send(0, submessage(2, b"\0\x0a\xff\xfd\2\0\0\0"))
        return any(got.kind == INFO and got.body[5] == 1 for got in self.got())

    def _submessages(self, message: bytes) -> list[Got]:
        size = len(self.head())
        if message[0] != self.session_id or message[4:size] != self.key[: size - 4]:
            return []
        assert len(message) <= self.mtu or message[1] == 0, "longer than the MTU"
        stream = message[1]
        number = message[2] | message[3] << 8
        if stream >= 0x80:
            expected = self.expected.get(stream, 0)
            if number != expected:
                return []
            self.expected[stream] = expected + 1 & 0xFFFF
            if self.acknowledges:
                self.acknack(expected + 1, 0, stream)
        kind, flags, n = struct.unpack_from("<BBH", message, size)
        body = message[size + 4 :]
        assert n in (len(body), 0), "one submessage a message"
        if kind != FRAGMENT:
            return [Got(stream, kind, body)]
        self._joined += body
        if not flags & 2:
            return []
        whole, self._joined = self._joined, b""
        return [Got(stream, whole[0], whole[4:])]
