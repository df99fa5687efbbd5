"""A puppet that does with our client core what the reference client was seen doing, and what both put on the wire.

The recorded packets of the client say what it did (create this, write that), those of the agent are fed to our core.
Compared are, by session and stream: kinds, flags, ids, sequence numbers and contents. Left out: padding (the reference
leaves garbage there, we write zeros and none at the end), moments, HEARTBEATs (a matter of time), and repetitions:
after a NACK the reference sends everything again, ours what was asked for.
"""

import json
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NamedTuple

from muros.client import Session, TimeSync, making, ping
from muros.client._types import Deliver
from muros.client.closing import leave
from muros.client.creating import submit
from muros.client.link import CONNECTED
from muros.client.qos import Qos
from muros.client.raw import Raw
from muros.client.session import Entity
from muros.xrce import create, create_text
from muros.xrce._types import Buffer
from muros.xrce.constants import (
    ACKNACK,
    CREATE,
    CREATE_CLIENT,
    DELETE,
    FRAGMENT,
    GET_INFO,
    HEARTBEAT,
    INFO,
    OBJECT_CLIENT,
    READ_DATA,
    TIMESTAMP,
    WRITE_DATA,
)
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    Format,
    ParticipantEntity,
    ReplierEntity,
    RequesterEntity,
    TopicEntity,
    Variant,
    encode_variant,
    parse_variant_untrusted,
)
from muros.xrce.session import flush as flush_reliable

VECTORS = Path(__file__).parent.parent / "vectors"


def load(path: str) -> dict[str, Any]:
    """A file of the vectors."""
    loaded: dict[str, Any] = json.loads((VECTORS / path).read_text())
    return loaded


class Submessage(NamedTuple):
    """One submessage as it stood on the wire."""

    kind: int
    flags: int
    body: bytes


class Wire:
    """A transport that keeps what is sent and hands on what it is given."""

    def __init__(self, mtu: int = 512) -> None:
        self.mtu = mtu
        self.sent: list[bytes] = []
        self.inbox: list[bytes] = []

    def open(self) -> bool:
        """Always open."""
        return True

    def close(self) -> None:
        """Nothing to close."""

    def send(self, buf: Buffer, off: int, n: int) -> None:
        """Keeps a copy."""
        self.sent.append(bytes(memoryview(buf)[off : off + n]))

    def receive(self, deliver: Deliver) -> int:
        """Hands on what is there."""
        taken, self.inbox = self.inbox, []
        for message in taken:
            deliver(message, 0, len(message))
        return len(taken)

    def wait(self, timeout: int) -> None:
        """Nothing will come."""


def submessages(message: bytes) -> Iterator[Submessage]:
    """The submessages of a message."""
    pos = 4 if message[0] >= 0x80 else 8
    while len(message) - pos >= 4:
        kind, flags = message[pos], message[pos + 1]
        n = int.from_bytes(message[pos + 2 : pos + 4], "little")
        if kind == CREATE_CLIENT:
            n = len(message) - pos - 4  # the reference says 16 even when there are properties
        yield Submessage(kind, flags, message[pos + 4 : pos + 4 + n])
        pos += 4 + n
        pos += -pos % 4


def canonical(submessage: Submessage) -> Submessage:
    """With zeros as padding."""
    kind, flags, body = submessage
    if kind == CREATE:
        variant = parse_variant_untrusted(body, 4, len(body), True)
        body = body[:4] + encode_variant(variant, 4)
    elif kind == TIMESTAMP:
        nanoseconds = int.from_bytes(body[4:], "little")  # our clock counts microseconds
        body = body[:4] + (nanoseconds // 1000 * 1000).to_bytes(4, "little")
    elif kind == CREATE_CLIENT and body == bytes(4):
        kind, flags, body = (
            INFO,
            1,
            bytes.fromhex("0000fffe00000000"),
        )  # the reference's torn answer to a probe, mended
    elif kind == CREATE_CLIENT and len(body) > 16:
        body = body[:-3] + b"\0" + body[-2:]  # padding before the MTU
    return Submessage(kind, flags, body)


def by_stream(messages: list[bytes]) -> dict[Any, Any]:
    """Numbered streams by number, the rest in order, by kind. A session that begins again opens a new epoch."""
    streams: dict[Any, Any] = {}
    epochs: dict[tuple[int, int], int] = {}
    for message in messages:
        session, stream = message[0], message[1]
        found = [canonical(submessage) for submessage in submessages(message)]
        if stream == 0:
            for submessage in found:
                if submessage.kind == HEARTBEAT:
                    continue
                said = streams.setdefault((session, 0, submessage.kind), [])
                if submessage.kind != DELETE or submessage not in said:  # asked again, for want of an answer
                    said.append(submessage)
            continue
        number = int.from_bytes(message[2:4], "little")
        key = (session, stream)
        known = streams.get((*key, epochs.setdefault(key, 0)), {}).get(number)
        if known is not None and known != found and number == 0:
            epochs[key] += 1
        streams.setdefault((*key, epochs[key]), {}).setdefault(number, found)
    return streams


def flush(session: Any, now: int) -> None:
    """Sends what was built on any stream, and the HEARTBEAT that is due."""
    for stream in session.outputs.values():
        if stream.reliable:
            flush_reliable(session, stream, now)
        else:
            stream.flush(session.send, now)


class Held:
    """A stream that is not flushed by each sample: the reference packs what is written between two runs."""

    def __init__(self, stream: Any) -> None:
        self.stream = stream
        self.reliable = stream.reliable
        self.place = stream.place
        self.commit = stream.commit
        self.mtu = stream.mtu
        self._start = stream._start
        self.capacity = stream.capacity

    @property
    def buf(self) -> bytearray:
        """The stream's."""
        buf: bytearray = self.stream.buf
        return buf

    def flush(self, send: object, now: int) -> None:
        """Later."""


class Puppet:
    """A client of ours on a wire, that does what a recorded one did."""

    def __init__(self, hello: bytes, mtu: int = 512, history: int = 16) -> None:
        body = next(iter(submessages(hello))).body
        self.wire = Wire(mtu)
        self.got: list[bytes] = []
        self.key = body[8:12]
        liveliness = int(body[36:42]) if body[13] else 0
        self.session = Session(
            self.wire,
            body[8:12],
            body[12],
            mtu,
            history,
            properties=False,
            hard_liveliness=liveliness,
            keepalive=0,
            retry=1_000_000,
            creation_timeout=1_000_000,
            largest=1_000_000,
        )
        self.time = TimeSync(self.session)
        self.now = 0
        self.session.spin_once(0)

    def feed(self, message: bytes, now: int) -> None:
        """The agent says something."""
        self.now = now
        for submessage in whole(message, self):
            if submessage.kind == 9:
                object_id = int.from_bytes(submessage.body[2:4], "big")
                self.session.objects[object_id] = SimpleNamespace(
                    deliver=lambda buf, off, n: self.got.append(bytes(buf[off : off + n]))
                )
        self.session.now = now
        self.session.deliver(message, 0, len(message))
        if not self.session.away:
            self.session.lead().turn(self.session, now)
            if self.session.backlog is not None:
                self.session.backlog.pump()
            flush(self.session, now)

    def act(self, message: bytes, now: int) -> None:
        """Does what the recorded client did when it said ``message``."""
        self.now = now
        session = self.session
        session.now = now
        for submessage in submessages(message):
            kind, flags, body = submessage
            object_id = int.from_bytes(body[2:4], "big")
            if kind == CREATE:
                variant = parse_variant_untrusted(body, 4, len(body), True)
                self.submit(CREATE, flags, object_id, written(variant))
            elif kind == READ_DATA:
                numbers = [int.from_bytes(body[i : i + 2], "little") for i in (8, 10, 12, 14)]
                self.submit(READ_DATA, flags, object_id, create.read_data(body[4], *numbers))
            elif kind == DELETE and object_id == OBJECT_CLIENT:
                leave(session)
            elif kind == DELETE:
                self.submit(DELETE, flags, object_id, b"")
            elif kind == WRITE_DATA:
                self.write(message[1], object_id, body[4:])
            elif kind == GET_INFO:
                session.request, request = 9, session.request
                session.ask()
                session.request = request
                session._ping = 0
            elif kind == TIMESTAMP:
                seconds, nanoseconds = (int.from_bytes(body[i : i + 4], "little") for i in (0, 4))
                self.time.request(seconds * 1_000_000 + nanoseconds // 1000)
        flush(session, now)

    def submit(self, kind: int, flags: int, object_id: int, payload: bytes) -> None:
        """A request."""
        assert submit(self.session, kind | flags << 8, self.session.number(), object_id, payload)

    def write(self, stream_id: int, object_id: int, data: bytes) -> None:
        """A sample."""
        session = self.session
        writer = SimpleNamespace(
            session=session,
            stream=Held(session.reliable if stream_id & 0x80 else making.best_effort(session)),
            id=object_id,
            todo=0,
            status=0,
            name="written",
        )
        assert session.state == CONNECTED
        assert Entity.publish(writer, Raw(data))  # type: ignore[arg-type]


def whole(message: bytes, owner: Any) -> Iterator[Submessage]:
    """The submessages of a message, those in fragments once they are complete."""
    parts = owner.__dict__.setdefault("_parts", {})
    for submessage in submessages(message):
        if submessage.kind != FRAGMENT:
            yield submessage
            continue
        number = int.from_bytes(message[2:4], "little")
        parts[number] = submessage
        if submessage.flags & 2 or any(part.flags & 2 for part in parts.values()):
            numbers = sorted(parts)
            run = b"".join(parts[n].body for n in numbers)
            if numbers[-1] - numbers[0] + 1 == len(numbers) and parts[numbers[-1]].flags & 2:
                parts.clear()
                yield Submessage(run[0], run[1], run[4:])


def written(variant: Variant) -> bytes:
    """The variant as our writers make it."""
    parent = variant.parent_id or 0
    if variant.format != Format.BINARY:
        text = variant.text or ""
        if variant.kind == 1:
            return create_text.participant_by_text(variant.format, text, variant.domain or 0)
        return create_text.by_text(variant.kind, variant.format, text, parent)
    entity = variant.entity
    if (getattr(entity, "name", "") is None and variant.kind == 1) or getattr(entity, "qos", 0) is None:
        return encode_variant(variant, 4)  # without a name, without QoS: nothing that ours writes
    if isinstance(entity, ParticipantEntity):
        return create.of_participant(entity.name or "", variant.domain or 0)
    if isinstance(entity, TopicEntity):
        return create.of_topic(entity.name, entity.type_name or "", parent)
    if isinstance(entity, DataWriterEntity | DataReaderEntity):
        assert entity.qos is not None
        qos = Qos(
            entity.qos.reliable,
            entity.qos.depth or 0,
            {
                Durability.VOLATILE: "volatile",
                Durability.TRANSIENT_LOCAL: "transient_local",
                Durability.TRANSIENT: "transient",
                Durability.PERSISTENT: "persistent",
            }[entity.qos.durability],
            not entity.qos.keep_last,
        ).asked
        return create.of_endpoint(variant.kind, entity.topic_id or 0, qos, parent)
    if isinstance(entity, RequesterEntity | ReplierEntity):
        return create.of_service(
            variant.kind,
            entity.service_name,
            entity.request_type,
            entity.reply_type,
            entity.request_topic or "",
            entity.reply_topic or "",
            parent,
        )
    return create.of_group(variant.kind, parent)


def replay(recorded: dict[str, Any], client: int = 0, history: int = 16) -> tuple[Any, Any, list[Puppet]]:
    """Plays one client of a recording; both sides' messages by stream, and the puppets (one a CREATE_CLIENT)."""
    theirs: list[bytes] = []
    ours: list[bytes] = []
    puppets: list[Puppet] = []
    fragments = SimpleNamespace()
    seen: set[bytes] = set()
    for packet in recorded["packets"]:
        if packet.get("client", 0) != client:
            continue
        message = bytes.fromhex(packet["hex"])
        now = round(packet["t_ms"])
        first = next(submessages(message), Submessage(INFO, 0, b""))
        if packet["dir"] == "a>c":
            if not packet.get("dropped") and puppets:
                puppets[-1].feed(message, now)
        else:
            theirs.append(message)
            if message[1] and message in seen:
                continue  # sent again
            seen.add(message)
            if first.kind == CREATE_CLIENT and len(first.body) >= 16:
                if puppets:
                    ours += puppets[-1].wire.sent
                puppets.append(Puppet(message, history=history))
                seen.clear()
            elif not puppets:
                wire = Wire()
                ping(wire, 1, 1)
                ours += wire.sent
            elif first.kind not in (ACKNACK, HEARTBEAT):
                if first.kind == FRAGMENT:
                    for complete in whole(message, fragments):
                        again = bytes((complete.kind, complete.flags)) + len(complete.body).to_bytes(
                            2, "little"
                        )
                        puppets[-1].act(message[:4] + again + complete.body, now)
                else:
                    puppets[-1].act(message, now)
    ours += puppets[-1].wire.sent
    return by_stream(theirs), by_stream(ours), puppets
