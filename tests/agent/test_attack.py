"""One client works while somebody else misbehaves: its traffic is untouched, and what the agent keeps stays bounded.

What the protocol itself allows is stated by tests too (`TestAllowedByTheProtocol`): it has no authentication, so
whoever knows a client's key can take its session over, and whoever can forge a source address is that client.
"""

import random
import struct
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from muros.agent import ClientBack
from muros.xrce import create
from muros.xrce.constants import READ_DATA, REUSE, STATUS_ERR_RESOURCES, STATUS_OK
from tests.agent.raw import PARTICIPANT, WRITER, Raw, submessage
from tests.agent.replay import Bench

VICTIM = 0x11223344
ROUNDS = 40


def garbage(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """Anything."""
    while True:
        yield dice.randbytes(dice.randint(0, 80))


def forged_headers(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """The victim's session id and stream numbers, from another address, with submessages that would harm it."""
    number = 0
    while True:
        harm = dice.choice(
            [
                submessage(3, b"\0\2\xff\xfe"),
                submessage(12, b""),
                submessage(3, struct.pack(">HH", 99, WRITER)),
                submessage(7, struct.pack(">HH", 99, WRITER) + b"forged"),
                submessage(10, b"\xff\xff\0\0\x80"),
                submessage(11, b"\xff\x7f\xff\x7f\x80"),
                submessage(READ_DATA, b"\0\x63\0\x16" + create.read_data(0x80, 0, 0, 0, 0)),
            ]
        )
        yield struct.pack("<BBH", 0x81, dice.choice([0, 1, 0x80]), number & 0xFFFF) + harm
        number += 1


def other_keys(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """CREATE_CLIENT with ever new keys, each of which ends the one before it; each attempt is named."""
    while True:
        yield create_client(dice, dice.choice([0x81, 0x90]))


def keyed_sessions(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """CREATE_CLIENT with ever new keys that share the address."""
    while True:
        yield create_client(dice, 0x01)


def create_client(dice: random.Random, session: int) -> bytes:
    """CREATE_CLIENT with a new key and the property muros_id."""
    key = dice.randbytes(4)
    attempt = dice.randbytes(4).hex().encode() + b"\0"
    body = b"XRCE\1\0\1\x0f" + key + bytes((session, 1))
    start = 8 if session >= 0x80 else 12  # payloads are aligned as the message is
    body += bytes(-(start + len(body)) & 3) + struct.pack("<II", 1, 9) + b"muros_id\0" + bytes(3)
    body += struct.pack("<I", len(attempt)) + attempt
    body += bytes(-(start + len(body)) & 1) + struct.pack("<H", 508)
    head = b"\x80\0\0\0" if session >= 0x80 else b"\0\0\0\0" + key
    return head + submessage(0, body)


def many_entities(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """A client of its own that creates without end and acknowledges nothing."""
    own = Raw(bench, "mallory", 0x66666666, acknowledges=False)
    own.connect()
    number = 0
    while True:
        ids = struct.pack(">HH", number & 0xFFFF, (number & 0xFFF) << 4 | 1)
        yield own.message(
            0x80, number, submessage(1, ids + create.of_participant(f"m{number}", 0), REUSE | 1)
        )
        number += 1


def endless_fragments(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """A sample that never ends."""
    own = Raw(bench, "mallory", 0x66666666)
    own.connect()
    number = 0
    while True:
        yield own.message(0x80, number, submessage(13, bytes(400), 1))
        number += 1


def far_announcements(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """HEARTBEATs about tens of thousands of messages, on every stream there could be."""
    own = Raw(bench, "mallory", 0x66666666)
    own.connect()
    while True:
        first = dice.randrange(0x10000)
        last = first + 32_766 & 0xFFFF
        yield own.message(0, 0, submessage(11, struct.pack("<HHB", first, last, dice.randrange(0x80, 0x100))))


def acknowledgements_of_nothing(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """ACKNACKs that ask for everything again, for numbers that were never sent."""
    own = Raw(bench, "mallory", 0x66666666)
    own.connect()
    while True:
        yield own.message(0, 0, submessage(10, dice.randbytes(4) + bytes((dice.randrange(0x80, 0x100),))))


def endless_reads(bench: Bench, dice: random.Random) -> Iterator[bytes]:
    """READ_DATA over and over, as slow as can be or on a stream that is full; nothing is acknowledged."""
    own = Raw(bench, "mallory", 0x66666666).tree("rt/mallory")
    number = own.numbers[0x80]
    while True:
        ids = struct.pack(">H", number & 0xFFFF)
        stream, rate, pace = dice.choice([(1, 1, 0), (1, 0, 65535), (0x80, 0, 0)])
        read = ids + b"\0\x16" + create.read_data(stream, 0xFFFF, 0, rate, pace)
        write = submessage(7, ids + b"\0\x15" + b"much to read")
        yield own.message(0x80, number, write, write, submessage(READ_DATA, read), write)
        number += 1


ATTACKS: list[Callable[[Bench, random.Random], Iterator[bytes]]] = [
    garbage,
    forged_headers,
    other_keys,
    keyed_sessions,
    many_entities,
    endless_fragments,
    far_announcements,
    acknowledgements_of_nothing,
    endless_reads,
]


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
@pytest.mark.parametrize("keyed", [False, True], ids=["by address", "by key"])
def test_a_victims_traffic_is_untouched(attack: Any, keyed: bool) -> None:
    bench = Bench(max_clients=100, max_sample=10_000, max_objects=200, max_waiting=100)
    victim = Raw(bench, "victim", VICTIM, session_id=0x01 if keyed else 0x81).tree("rt/victim")
    victim.read()
    blows = attack(bench, random.Random(1))
    for n in range(ROUNDS):
        for _ in range(20):
            bench.port.receive(next(blows), "mallory", bench.now)
        victim.write(struct.pack("<I", n))
        assert victim.samples() == [struct.pack("<I", n)]
        assert victim.ping()
        bench.advance(bench.now + 10)
        bench.wire.sent = [entry for entry in bench.wire.sent if entry[1] == "victim"]
    victim.acknack(victim.expected[0x80])
    assert bench.core.clients[victim.key].outputs[0x80].idle()
    assert not bench.findings.counts().keys() & {"callback-failed", "watcher-failed"}


@pytest.mark.parametrize("attack", ATTACKS, ids=lambda attack: attack.__name__)
def test_what_an_attack_makes_the_agent_keep_is_bounded(attack: Any) -> None:
    """After the first thousand blows, thousands more make it keep nothing more."""
    bench = Bench(max_clients=20, max_sample=10_000, max_objects=20, max_waiting=50)
    bench.core.on_event = None
    blows = attack(bench, random.Random(2))

    def strike(n: int) -> int:
        for k in range(n):
            bench.port.receive(next(blows), "mallory", bench.now)
            if k % 50 == 0:
                bench.now += 10
                bench.core.tick(bench.now)
                bench.space.tick()
                bench.wire.sent.clear()
        return kept(bench.core)

    settled = max(strike(1000) for _ in range(3))
    assert strike(3000) <= settled * 1.25 + 20_000


def kept(root: Any) -> int:
    """Bytes of what is reachable from an object, without modules, classes and functions."""
    seen: set[int] = set()
    total, todo = 0, [root]
    while todo:
        one = todo.pop()
        if id(one) in seen or isinstance(one, (type, type(sys))) or type(one).__name__ == "function":
            continue
        seen.add(id(one))
        total += sys.getsizeof(one)
        if isinstance(one, dict):
            todo += [*one.keys(), *one.values()]
        elif isinstance(one, (list, tuple, set, frozenset)) or type(one).__name__ == "deque":
            todo += one
        else:
            todo += list(getattr(one, "__dict__", {}).values())
            for cls in type(one).__mro__:
                todo += [getattr(one, name) for name in getattr(cls, "__slots__", ()) if hasattr(one, name)]
            if hasattr(one, "__self__"):
                todo.append(one.__self__)
    return total


def test_a_flood_of_clients_stops_at_the_limit_and_locks_nobody_out_who_is_in() -> None:
    bench = Bench(max_clients=5)
    clients = [Raw(bench, f"c{n}", 100 + n) for n in range(8)]
    assert [client.connect() for client in clients] == [STATUS_OK] * 5 + [STATUS_ERR_RESOURCES] * 3
    assert clients[0].connect() == STATUS_OK
    assert clients[1].goodbye() == STATUS_OK
    assert clients[7].connect() == STATUS_OK
    text = next(f for f in bench.findings.snapshot() if f.code == "client-refused").format()
    assert "c5" in text
    assert "max_clients" in text


def test_an_attacker_cannot_make_findings_grow() -> None:
    bench = Bench()
    for n in range(5000):
        bench.port.receive(b"\x99\0\0\0\x07\1\0\0", f"spoofed {n}", 0)
    assert len(bench.findings.snapshot()) <= bench.findings.capacity + 1
    assert bench.findings.counts() == {"unknown-session": 5000}


def test_streams_are_limited_by_client() -> None:
    bench = Bench(max_streams=8)
    client = Raw(bench).tree()
    for stream in range(1, 256):
        client.send(stream, submessage(7, client.ids(WRITER) + b"x"))
    assert len(bench.core.clients[client.key].inputs) == 8
    assert bench.findings.counts()["too-many-streams"] > 200
    client.read()
    client.write(b"still")
    assert b"still" in client.samples()


class TestAllowedByTheProtocol:
    """What a peer that knows the key or owns the address can do: it is that client, as far as the protocol goes."""

    def test_the_key_from_another_address_takes_the_session_over(self) -> None:
        bench = Bench()
        victim = Raw(bench, "victim", VICTIM).tree("rt/victim")
        victim.read()
        other = Raw(bench, "mallory", VICTIM)
        assert other.connect() == STATUS_OK
        assert list(bench.core.clients) == [victim.key]
        other.write(b"mine now")
        assert other.samples() == [b"mine now"]
        assert not victim.ping()
        back = [event for event in bench.events if isinstance(event, ClientBack)]
        assert [(event.address, event.restarted) for event in back] == [("mallory", True)]

    def test_the_victim_takes_it_back_the_same_way(self) -> None:
        bench = Bench()
        victim = Raw(bench, "victim", VICTIM).tree("rt/victim")
        victim.read()
        Raw(bench, "mallory", VICTIM).connect()
        assert victim.connect() == STATUS_OK
        victim.write(b"back")
        assert victim.samples() == [b"back"]
        assert len(bench.port.sessions) == 1

    def test_a_key_in_headers_moves_a_session_to_where_it_is_heard(self) -> None:
        """This is what lets a client roam; only the key protects it."""
        bench = Bench()
        victim = Raw(bench, "home", VICTIM, session_id=1).tree("rt/victim")
        victim.read()
        victim.address = "roaming"
        victim.write(b"here")
        assert victim.samples() == [b"here"]
        assert list(bench.port.sessions) == ["roaming"]
        assert bench.core.clients[victim.key].address == "roaming"

    def test_another_key_from_the_same_address_replaces_the_client(self) -> None:
        bench = Bench()
        Raw(bench, "shared", VICTIM).tree()
        newcomer = Raw(bench, "shared", 0x7777)
        assert newcomer.connect() == STATUS_OK
        assert list(bench.core.clients) == [newcomer.key]
        assert not bench.space.graph.participants
        assert any("took its address" in event.text() for event in bench.events)


def test_keyed_sessions_share_an_address() -> None:
    bench = Bench()
    clients = [Raw(bench, "line", 0x10 + n, session_id=1 + n % 2).tree(f"rt/t{n}") for n in range(5)]
    for client in clients:
        client.read()
    for n, client in enumerate(clients):
        client.write(bytes((n,)))
    sent = bench.take()
    for n, client in enumerate(clients):
        bench.wire.sent = [(0, "line", message) for message in sent]
        assert client.samples() == [bytes((n,))]
        sent += bench.take()
    assert clients[2].goodbye() == STATUS_OK
    assert len(bench.core.clients) == 4
    assert clients[0].ping()
    assert clients[4].ping()


def test_a_keyed_client_at_the_address_of_one_without_key_leaves_no_ghost() -> None:
    bench = Bench()
    Raw(bench, "a", 1).tree()
    keyed = Raw(bench, "a", 2, session_id=1).tree()
    assert list(bench.core.clients) == [keyed.key]
    assert len(bench.space.graph.participants) == 1
    assert keyed.goodbye() == STATUS_OK
    assert not bench.port.sessions


def test_a_participant_of_the_same_key_is_made_again_while_old_endpoints_live() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    assert client.delete(PARTICIPANT) == STATUS_OK
    assert client.make(PARTICIPANT, create.of_participant("again", 0)) == STATUS_OK
    client.read()
    client.write(b"old endpoints live on")
    assert client.samples() == [b"old endpoints live on"]
    assert client.goodbye() == STATUS_OK
    assert not bench.space.graph.participants
