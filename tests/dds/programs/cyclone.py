"""A Cyclone DDS process under remote control, which behaves as rmw_cyclonedds does on the wire.

The lines and commands are those of `ros.py`, as far as they go. Messages are written and read here by hand, so that
nothing of muros judges muros: std_msgs String and UInt8MultiArray, test_msgs BasicTypes. A service's payload is a
16-byte header (client id, sequence number) and the body, and a node tells of itself on ros_discovery_info.
"""

import itertools
import json
import os
import struct
import sys
import time
import traceback
import zlib
from collections.abc import Callable
from typing import Any

from cyclonedds.builtin import BuiltinDataReader, BuiltinTopicDcpsPublication, BuiltinTopicDcpsSubscription
from cyclonedds.core import Listener, Policy, Qos
from cyclonedds.domain import DomainParticipant
from cyclonedds.idl import make_idl_struct
from cyclonedds.pub import DataWriter
from cyclonedds.sub import DataReader
from cyclonedds.topic import Topic
from cyclonedds.util import duration

LE = bytes((0, 1, 0, 0))
WAIT = 30.0  # seconds that something may take on a machine that is busy
LONG = 64
CLASSES: dict[str, Any] = {}
BASIC = struct.Struct("<?BBxfdbBhHxxiIqQ")
BASIC_FIELDS = (
    *(
        "bool_value byte_value char_value float32_value float64_value int8_value uint8_value int16_value".split()
    ),
    *("uint16_value int32_value uint32_value int64_value uint64_value".split()),
)


def opaque(type_name: str) -> Any:
    """A type without fields whose samples are bytes with encapsulation."""
    if type_name not in CLASSES:
        made: Any = make_idl_struct("Opaque", type_name, {}, dataclassify=False)
        made.__init__ = lambda self, raw=b"": setattr(self, "raw", raw)
        made.serialize = made.serialize_key = lambda self, **_: self.raw
        made.deserialize = made.deserialize_key = classmethod(lambda cls, data, **_: cls(bytes(data)))
        CLASSES[type_name] = made
    return CLASSES[type_name]


class Node:
    """A DDS participant with the name of a node."""

    def __init__(self, name: str, domain: int, namespace: str, gid_size: int) -> None:
        self.name, self.namespace, self.gid_size = name, namespace, gid_size
        self.participant = DomainParticipant(domain, Qos(Policy.Userdata(b"enclave=/;")))
        self.readers: list[Any] = []
        self.writers: list[Any] = []
        self.graph = None
        if name:
            qos = policies({"reliability": "reliable", "durability": "transient_local", "depth": 1})
            kind = opaque("rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_")
            topic = Topic(self.participant, "ros_discovery_info", kind)
            self.graph = DataWriter(self.participant, topic, qos)
            self.tell()

    def tell(self) -> None:
        """Say on ros_discovery_info what the node has (gids have 16 bytes since Iron, 24 before)."""
        if self.graph is None:
            return
        data = bytearray(self.gid(self.participant)) + struct.pack("<I", 1)
        for text in (self.namespace, self.name):
            data += bytes(-len(data) % 4) + struct.pack("<I", len(text) + 1) + text.encode() + b"\0"
        for entities in (self.readers, self.writers):
            data += bytes(-len(data) % 4) + struct.pack("<I", len(entities))
            data += b"".join(map(self.gid, entities))
        self.graph.write(opaque("rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_")(LE + bytes(data)))

    def gid(self, entity: Any) -> bytes:
        return bytes(entity.guid.bytes).ljust(self.gid_size, b"\0")

    def writer(self, topic: str, type_name: str, qos: Any) -> Any:
        made = DataWriter(self.participant, Topic(self.participant, topic, opaque(type_name)), qos)
        self.writers.append(made)
        self.tell()
        return made

    def reader(self, topic: str, type_name: str, qos: Any, listener: Any = None) -> Any:
        about = Topic(self.participant, topic, opaque(type_name))
        made = DataReader(self.participant, about, qos, listener)
        self.readers.append(made)
        self.tell()
        return made

    def forget(self, *entities: Any) -> None:
        """Keep no hold of these."""
        self.writers = [writer for writer in self.writers if writer not in entities]
        self.readers = [reader for reader in self.readers if reader not in entities]
        self.tell()


class Publisher:
    def __init__(self, node: Node, topic: str, type: str, qos: Any) -> None:
        self.type = type
        self.kind = opaque(dds_name(type))
        self.writer = node.writer("rt" + topic, dds_name(type), policies(qos))

    def send(self, message: dict[str, Any]) -> None:
        self.writer.write(self.kind(LE + encode(self.type, message)))


class Subscription:
    def __init__(self, node: Node, topic: str, type: str, qos: Any) -> None:
        self.type = type
        self.heard = Heard()
        self.reader = node.reader("rt" + topic, dds_name(type), policies(qos), self.heard)

    def matched(self) -> int:
        return len(self.reader.get_matched_publications())


class Heard(Listener):  # type: ignore[misc]
    """What a reader is told of its writers."""

    def __init__(self) -> None:
        super().__init__()
        self.events: list[str] = []

    def on_requested_deadline_missed(self, reader: Any, status: Any) -> None:
        self.events.append("deadline")

    def on_liveliness_changed(self, reader: Any, status: Any) -> None:
        self.events.append(f"{status.alive_count} alive")


class Caller:
    """A client, or a server, in the dialect of rmw_cyclonedds."""

    def __init__(self, node: Node, name: str, type: str, server: bool, rule: str = "{}") -> None:
        self.rule = compile(rule, "rule", "eval")
        self.id = node.participant.guid.bytes[4:12]
        self.sequence = itertools.count(1)
        self.type = type
        request, reply = dds_name(type + "_Request"), dds_name(type + "_Response")
        qos = policies(10)
        outgoing, incoming = (("rr", reply), ("rq", request)) if server else (("rq", request), ("rr", reply))
        ending = {"rq": "Request", "rr": "Reply"}
        self.kind = opaque(outgoing[1])
        self.writer = node.writer(f"{outgoing[0]}{name}{ending[outgoing[0]]}", outgoing[1], qos)
        self.reader = node.reader(f"{incoming[0]}{name}{ending[incoming[0]]}", incoming[1], qos)

    def matched(self) -> int:
        readers = len(self.writer.get_matched_subscriptions())
        return min(readers, len(self.reader.get_matched_publications()))

    def serve(self) -> int:
        done = 0
        for sample in self.reader.take(100):
            raw = getattr(sample, "raw", None)
            if raw is None:
                continue
            header, request = raw[4:20], decode(self.type, raw[20:])
            answer = eval(self.rule, {}, {"request": type("Request", (), request)})
            self.writer.write(self.kind(LE + header + encode(self.type, answer)))
            done += 1
        return done


class Cyclone:
    """What the other side can ask for."""

    def __init__(self) -> None:
        self.things: dict[int, Any] = {}
        self.numbers = itertools.count(1)

    def node(self, name: str, domain: int, namespace: str = "/", gid_size: int = 16) -> int:
        return self._keep(Node(name, domain, namespace, gid_size))

    def told(self, node: int, count: int = 1, wait: float = WAIT) -> list[str]:
        """What others say on ros_discovery_info, hexadecimal: waits for `count`."""
        thing = self.things[node]
        qos = policies({"reliability": "reliable", "durability": "transient_local", "depth": 100})
        topic = Topic(
            thing.participant,
            "ros_discovery_info",
            opaque("rmw_dds_common::msg::dds_::ParticipantEntitiesInfo_"),
        )
        reader = DataReader(thing.participant, topic, qos)
        own = thing.participant.guid.bytes
        got: list[str] = []

        def enough() -> bool:
            for sample in reader.take(100):
                if hasattr(sample, "raw") and sample.raw[4:20] != own:
                    got.append(sample.raw.hex())
            return len(got) >= count

        wait_for(enough, wait)
        return got

    def reset(self) -> None:
        self.things.clear()

    def destroy(self, thing: int) -> None:
        """Take a publisher or subscription out."""
        gone = self.things.pop(thing)
        for node in self.things.values():
            if isinstance(node, Node):
                node.forget(getattr(gone, "writer", None), getattr(gone, "reader", None))

    def publisher(self, node: int, topic: str, type: str, qos: dict[str, Any] | int = 10) -> int:
        return self._keep(Publisher(self.things[node], topic, type, qos))

    def publish(
        self, publisher: int, message: dict[str, Any], count: int = 1, period: float = 0.0, number: str = ""
    ) -> None:
        start = message.get(number, "")
        for n in range(count):
            more = {number: f"{start}{n}" if isinstance(start, str) else n} if number else {}
            self.things[publisher].send(message | more)
            time.sleep(period)

    def publish_bytes(self, publisher: int, size: int, count: int = 1, period: float = 0.0) -> None:
        for n in range(count):
            data = bytearray((bytes(range(251)) * (size // 251 + 1))[:size])
            data[0] = n % 251
            self.things[publisher].send({"data": bytes(data)})
            time.sleep(period)

    def subscription(self, node: int, topic: str, type: str, qos: dict[str, Any] | int = 10) -> int:
        return self._keep(Subscription(self.things[node], topic, type, qos))

    def take(self, subscription: int, count: int = 1, wait: float = WAIT) -> list[Any]:
        thing = self.things[subscription]
        got: list[Any] = []

        def enough() -> bool:
            for sample in thing.reader.take(1000):
                if hasattr(sample, "raw"):
                    got.append(decode(thing.type, sample.raw[4:]))
            return len(got) >= count

        wait_for(enough, wait)
        return [plain(message) for message in got]

    def matched(self, thing: int, count: int = 1, wait: float = WAIT) -> int:
        entity = self.things[thing]
        present: Callable[[], int] = (
            entity.matched
            if hasattr(entity, "matched")
            else lambda: len(entity.writer.get_matched_subscriptions())
        )
        wait_for(lambda: present() == count, wait)
        return present()

    def events(self, subscription: int, last: str, wait: float = WAIT) -> list[str]:
        """What it was told, "deadline" or "1 alive": waits for `last` to be the last."""
        seen = self.things[subscription].heard.events
        wait_for(lambda: seen[-1:] == [last], wait)
        return list(seen)

    def service(self, node: int, name: str, type: str, rule: str = "{}") -> int:
        return self._keep(Caller(self.things[node], name, type, True, rule))

    def serve(self, service: int, count: int = 1, wait: float = WAIT) -> int:
        """Answer requests until `count` were answered."""
        done = 0

        def enough() -> bool:
            nonlocal done
            done += self.things[service].serve()
            return bool(done >= count)

        wait_for(enough, wait)
        return done

    def client(self, node: int, name: str, type: str) -> int:
        return self._keep(Caller(self.things[node], name, type, False))

    def call(
        self,
        client: int,
        request: dict[str, Any],
        count: int = 1,
        wait: float = WAIT,
        number: str = "",
        window: int = 5,
    ) -> list[Any]:
        thing = self.things[client]
        wait_for(lambda: thing.matched() > 0, wait)
        asked: list[int] = []
        answers: dict[int, Any] = {}

        def proceed() -> bool:
            for sample in thing.reader.take(1000):
                raw = getattr(sample, "raw", b"")
                if raw[4:12] == thing.id:
                    answers[struct.unpack_from("<q", raw, 12)[0]] = decode(thing.type, raw[20:])
            while len(asked) < count and len(asked) < len(answers) + window:
                body = encode(thing.type, request | ({number: len(asked)} if number else {}))
                asked.append(next(thing.sequence))
                thing.writer.write(thing.kind(LE + thing.id + struct.pack("<q", asked[-1]) + body))
            return len(answers) >= count

        wait_for(proceed, wait)
        return [answers.get(number) for number in asked]

    def endpoints(
        self, node: int, topic: str, publishers: int = 0, subscriptions: int = 0, wait: float = WAIT
    ) -> dict[str, list[dict[str, Any]]]:
        """What discovery told of a topic's endpoints."""
        seen: dict[str, dict[str, Any]] = {"publishers": {}, "subscriptions": {}}
        readers = {
            side: BuiltinDataReader(self.things[node].participant, kind)
            for side, kind in (
                ("publishers", BuiltinTopicDcpsPublication),
                ("subscriptions", BuiltinTopicDcpsSubscription),
            )
        }

        def enough() -> bool:
            for side, reader in readers.items():
                for sample in reader.read(1000):
                    if getattr(sample, "topic_name", "") == "rt" + topic:
                        seen[side][str(sample.key)] = {
                            "type": sample.type_name,
                            "gid": sample.key.bytes.hex(),
                            "user_data": bytes(
                                getattr(sample.qos[Policy.Userdata], "data", b"") or b""
                            ).decode("latin-1"),
                        }
            return len(seen["publishers"]) >= publishers and len(seen["subscriptions"]) >= subscriptions

        wait_for(enough, wait)
        return {side: list(found.values()) for side, found in seen.items()}

    def _keep(self, thing: Any) -> int:
        number = next(self.numbers)
        self.things[number] = thing
        return number


def wait_for(condition: Callable[[], bool], wait: float) -> None:
    end = time.monotonic() + wait
    while not condition() and time.monotonic() < end:
        time.sleep(0.002)


def dds_name(type: str) -> str:
    package, kind, short = type.split("/")
    return f"{package}::{kind}::dds_::{short}_"


def policies(qos: dict[str, Any] | int) -> Any:
    if isinstance(qos, int):
        qos = {"depth": qos}
    depth = qos.get("depth", 10)
    best_effort = qos.get("reliability", "reliable") == "best_effort"
    latched = qos.get("durability", "volatile") == "transient_local"
    keep = Policy.History.KeepAll if qos.get("history") == "keep_all" else Policy.History.KeepLast(depth)
    return Qos(
        Policy.Reliability.BestEffort
        if best_effort
        else Policy.Reliability.Reliable(duration(milliseconds=100)),
        Policy.Durability.TransientLocal if latched else Policy.Durability.Volatile,
        keep,
        *([Policy.DurabilityService(0, keep, -1, -1, -1)] if latched else []),
        Policy.DataRepresentation(True, False),
        *(make(qos[name]) for name, make in FURTHER.items() if name in qos),
        *(
            [LIVELINESS[qos["liveliness"]](period(qos["liveliness_lease_duration"]))]
            if "liveliness" in qos
            else []
        ),
    )


def period(seconds: float) -> int:
    return int(duration(milliseconds=seconds * 1000))


FURTHER: dict[str, Callable[[Any], Any]] = {
    "deadline": lambda seconds: Policy.Deadline(period(seconds)),
    "lifespan": lambda seconds: Policy.Lifespan(period(seconds)),
    "strength": lambda strength: Policy.OwnershipStrength(strength),
    "ownership": lambda kind: getattr(Policy.Ownership, kind.capitalize()),
}
LIVELINESS: dict[str, Callable[[int], Any]] = {
    "automatic": Policy.Liveliness.Automatic,
    "manual_by_topic": Policy.Liveliness.ManualByTopic,
}


def encode(type: str, message: dict[str, Any]) -> bytes:
    """CDR, padded to 4 bytes (the writer adds what the header's option bits would have to tell)."""
    short = type.rsplit("/", 1)[1]
    data: bytes
    if short == "String":
        text = message["data"].encode() + b"\0"
        data = struct.pack("<I", len(text)) + text
    elif short == "UInt8MultiArray":
        data = struct.pack("<III", 0, 0, len(message["data"])) + bytes(message["data"])
    elif short == "BasicTypes":
        text = message.get("string_value", "").encode() + b"\0"
        data = (
            BASIC.pack(*(message.get(name, 0) for name in BASIC_FIELDS)) + struct.pack("<I", len(text)) + text
        )
    else:
        raise ValueError(f"no codec for {type}")
    return data + bytes(-len(data) % 4)


def decode(type: str, data: bytes) -> dict[str, Any]:
    short = type.rsplit("/", 1)[1]
    if short == "String":
        (size,) = struct.unpack_from("<I", data)
        return {"data": data[4 : 4 + size - 1].decode()}
    if short == "UInt8MultiArray":
        (size,) = struct.unpack_from("<I", data, 8)
        return {"data": data[12 : 12 + size]}
    if short == "BasicTypes":
        message: dict[str, Any] = dict(zip(BASIC_FIELDS, BASIC.unpack_from(data), strict=True))
        (size,) = struct.unpack_from("<I", data, BASIC.size)
        message["string_value"] = data[BASIC.size + 4 : BASIC.size + 4 + size - 1].decode()
        return message
    raise ValueError(f"no codec for {type}")


def plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: plain(item) for key, item in value.items()}
    if isinstance(value, bytes):
        return list(value) if len(value) <= LONG else {"size": len(value), "sum": zlib.crc32(value)}
    return value


def main() -> None:
    """Serve until there are no more commands."""
    answers = os.fdopen(os.dup(1), "w", buffering=1)
    os.dup2(2, 1)
    cyclone = Cyclone()
    for line in sys.stdin:
        command = json.loads(line)
        try:
            answer = {"result": getattr(cyclone, command.pop("do"))(**command)}
        except Exception:
            answer = {"error": traceback.format_exc()}
        answers.write(json.dumps(answer) + "\n")


if __name__ == "__main__":
    main()
