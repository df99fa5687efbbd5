"""Foreign bytes: whatever comes, the agent raises nothing, keeps little, and serves the next client."""

import json
import random
import struct
import zlib
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.agent._messages import (
    InvalidMessage,
    parse_create_client_untrusted,
    parse_read_data_untrusted,
)
from muros.agent.xml import XmlError, parse_document_untrusted, parse_profiles_untrusted
from muros.xrce import create
from muros.xrce.constants import KIND_DATAREADER, KIND_DATAWRITER
from muros.xrce.representation import InvalidRepresentation, parse_variant_untrusted
from tests.agent.raw import PARTICIPANT, PUBLISHER, RELIABLE, SUBSCRIBER, TOPIC, Raw
from tests.agent.replay import VECTORS, Bench, load, references_for

SCENARIOS = sorted(path.stem for path in (VECTORS / "xrce").glob("*.json"))
MUTANTS = 4
"""Mutated replays of each recorded session."""


def serves(bench: Bench) -> None:
    """The agent serves a client that has just come."""
    client = Raw(bench, ("fresh", bench.now), 0x5EED0000 + len(bench.events) % 0xFFFF).tree("rt/fresh")
    client.read()
    client.write(b"hello")
    assert client.samples() == [b"hello"]
    assert client.goodbye() == 0
    counts = bench.findings.counts()
    assert not counts.keys() & {"callback-failed", "watcher-failed"}, bench.findings.snapshot()


def is_bounded(bench: Bench) -> None:
    """What the agent keeps is within its limits."""
    core = bench.core
    assert len(bench.findings.snapshot()) <= bench.findings.capacity + 200
    assert len(core._attempts) <= core.limits.max_clients
    assert len(core._calls) < 2000
    for session in core.clients.values():
        assert len(session.objects) <= core.limits.max_objects
        assert len(session.inputs) <= core.limits.max_streams
        assert len(session.outputs) <= core.limits.max_streams + 2
        for number, stream in session.inputs.items():
            if number >= 0x80:
                assert all(n - stream.expected & 0xFFFF < core.limits.window for n in stream.early)
                assert stream.fragments is None or len(stream.fragments.data) <= core.limits.max_sample
        for number, stream in session.outputs.items():
            if number >= 0x80:
                assert (stream.next - stream.first & 0xFFFF) <= core.limits.window
                assert (stream.next - stream.first & 0xFFFF) == len(stream._kept or ())


# Parsers


@given(st.binary(max_size=120), st.integers(0, 20), st.integers(0, 20), st.booleans(), st.booleans())
def test_create_client_of_any_bytes(data: bytes, at: int, cut: int, little: bool, plausible: bool) -> None:
    if plausible:
        data = bytes(at) + b"XRCE\1\0\1\x0fkeyk\x81\1" + data
    try:
        asked = parse_create_client_untrusted(data, at, max(0, len(data) - cut), little)
    except InvalidMessage:
        return
    assert len(asked.key) == 4
    assert len(asked.properties) <= 32
    assert all(len(text) <= 256 for pair in asked.properties.items() for text in pair)


@given(st.binary(max_size=80), st.integers(0, 20), st.integers(0, 20), st.booleans())
def test_read_data_of_any_bytes(data: bytes, at: int, cut: int, little: bool) -> None:
    with suppress(InvalidMessage):
        parse_read_data_untrusted(data, at, max(0, len(data) - cut), little)


def test_parsers_look_at_nothing_behind_the_end() -> None:
    """What follows a submessage in its message is not part of it."""
    asked = b"XRCE\1\0\1\x0f\1\2\3\4\x81\1\0\0" + struct.pack("<II", 1, 2) + b"a\0\0\0" + struct.pack("<I", 2)
    asked += b"b\0" + struct.pack("<H", 508)
    for end in range(len(asked)):
        with pytest.raises(InvalidMessage):
            parse_create_client_untrusted(asked, 0, end, True)
    assert parse_create_client_untrusted(asked, 0, len(asked), True).properties == {"a": "b"}
    read = b"\x80\0\1\0" + struct.pack("<I", 3) + b"ab\0\1" + struct.pack("<4H", 1, 2, 3, 4)
    for end in range(len(read)):
        with pytest.raises(InvalidMessage):
            parse_read_data_untrusted(read, 0, end, True)
    assert parse_read_data_untrusted(read, 0, len(read), True).content_filter == "ab"


@given(st.binary(max_size=120), st.integers(1, 14), st.integers(1, 3), st.booleans())
def test_representations_of_any_bytes(data: bytes, kind: int, format_: int, little: bool) -> None:
    for candidate in (data, bytes((kind, format_, 0, 0, len(data), 0, 0, 0)) + data + data):
        with suppress(InvalidRepresentation):
            parse_variant_untrusted(candidate, 0, len(candidate), little)


@given(
    st.text(max_size=80) | st.sampled_from(["<dds>", "<dds/>", "<dds><topic/></dds>", "<!DOCTYPE x>"]),
    st.integers(0, 20),
)
def test_documents_of_any_text(text: str, kind: int) -> None:
    for read in (
        lambda: parse_document_untrusted(kind, text),
        lambda: parse_profiles_untrusted(text.encode("utf-8", "replace")),
    ):
        with suppress(XmlError):
            read()


# Messages

ids = st.binary(min_size=4, max_size=4) | st.tuples(
    st.integers(0, 0xFFFF), st.integers(0, 3), st.integers(0, 15)
).map(lambda t: struct.pack(">HH", t[0], t[1] << 4 | t[2]))
variants = st.sampled_from(
    [
        create.of_participant("n", 0),
        create.of_participant("m", 255),
        create.of_topic("rt/a", "T", PARTICIPANT),
        create.of_group(3, PARTICIPANT),
        create.of_group(4, PARTICIPANT),
        create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER),
        create.of_endpoint(KIND_DATAREADER, TOPIC, RELIABLE, SUBSCRIBER),
        create.of_service(7, "/s", "Q", "P", "rq/s", "rr/s", PARTICIPANT),
        create.of_service(8, "/s", "Q", "P", "rq/s", "rr/s", PARTICIPANT),
    ]
)
numbers = st.integers(0, 20) | st.integers(0, 0xFFFF)
reads = st.builds(
    create.read_data,
    st.sampled_from([0, 1, 2, 0x80, 0x81]),
    numbers,
    st.integers(0, 3),
    st.integers(0, 300),
    st.integers(0, 300),
)
controls = st.tuples(numbers, numbers, st.sampled_from([0, 1, 0x80, 0x81, 0xFF])).map(
    lambda t: struct.pack("<HHB", *t)
)
bodies = (
    st.binary(max_size=40)
    | controls
    | st.tuples(ids, variants | reads | st.binary(max_size=60)).map(lambda t: t[0] + t[1])
    | st.just(b"XRCE\1\0\1\x0f\xaa\xbb\xcc\xdd\x81\0\xfc\1")
)


@st.composite
def submessages(draw: st.DrawFn) -> bytes:
    kind = draw(
        st.sampled_from([1, 1, 1, 3, 7, 7, 8, 8, 10, 11, 13, 13]) | st.integers(0, 17) | st.integers(0, 255)
    )
    body = draw(bodies)
    if draw(st.integers(0, 9)) == 0 and kind != 13:
        body = draw(st.sampled_from([1, 3])).to_bytes(1, "little") + body
    size = len(body) if draw(st.integers(0, 19)) else draw(st.integers(0, 0xFFFF))
    return struct.pack("<BBH", kind, draw(st.integers(0, 7)), size) + body


@st.composite
def messages(draw: st.DrawFn) -> bytes:
    if draw(st.integers(0, 9)) == 0:
        return draw(st.binary(max_size=60))
    session = draw(st.sampled_from([0x81, 0x81, 0x81, 0x80, 0, 1, 0x7F]))
    stream = draw(st.sampled_from([0, 1, 0x80, 0x80, 0x80, 0x81]))
    made = struct.pack("<BBH", session, stream, draw(numbers))
    if session < 0x80:
        made += draw(st.sampled_from([b"\xaa\xbb\xcc\xdd", b"\0\0\0\0", b"abcd"]))
    for one in draw(st.lists(submessages(), max_size=5)):
        made += bytes(-len(made) & 3) + one
    return made


@given(st.lists(st.tuples(messages(), st.integers(0, 2), st.integers(0, 300)), max_size=25))
@settings(max_examples=150)
def test_any_messages(told: list[tuple[bytes, int, int]]) -> None:
    bench = Bench(window=4, max_waiting=20, max_clients=10, max_streams=4, max_sample=500)
    Raw(bench, 0).connect()
    for message, address, wait in told:
        bench.receive(message, address)
        bench.now += wait
        bench.core.tick(bench.now)
        is_bounded(bench)
    bench.take()
    serves(bench)


@given(st.lists(st.binary(max_size=80), max_size=30), st.sampled_from([0, 1, 0x80]))
def test_any_bytes_in_a_session(told: list[bytes], stream: int) -> None:
    """Behind a good header with the right number, so that every byte is looked at."""
    bench = Bench()
    client = Raw(bench).tree()
    for body in told:
        client.send(stream, body)
    is_bounded(bench)
    bench.take()
    serves(bench)


# Mutations of what was recorded


def flip(message: bytes, dice: random.Random) -> list[bytes]:
    """Some bits change."""
    changed = bytearray(message)
    for _ in range(dice.randint(1, 4)):
        changed[dice.randrange(len(changed))] ^= 1 << dice.randrange(8)
    return [bytes(changed)]


def truncate(message: bytes, dice: random.Random) -> list[bytes]:
    """The end is missing."""
    return [message[: dice.randrange(len(message))]]


def double(message: bytes, dice: random.Random) -> list[bytes]:
    """It comes several times."""
    return [message] * dice.randint(2, 4)


def lengthen(message: bytes, dice: random.Random) -> list[bytes]:
    """Something follows."""
    return [message + dice.randbytes(dice.randint(1, 40))]


def lose(message: bytes, dice: random.Random) -> list[bytes]:
    """It does not come."""
    return []


def extreme(message: bytes, dice: random.Random) -> list[bytes]:
    """A 16-bit number becomes one that is hard to take."""
    at = dice.randrange(max(1, len(message) - 1))
    return [message[:at] + dice.choice((b"\0\0", b"\xff\xff", b"\xff\x7f", b"\0\x80")) + message[at + 2 :]]


MUTATIONS: list[Callable[[bytes, random.Random], list[bytes]]] = [
    flip,
    truncate,
    double,
    lengthen,
    lose,
    extreme,
]


def mutate(told: list[tuple[bytes, Any]], dice: random.Random) -> list[tuple[bytes, Any]]:
    """The messages of a session with one in four changed, some spliced or in another order."""
    made: list[tuple[bytes, Any]] = []
    for message, client in told:
        if dice.random() < 0.75 or not message:
            made.append((message, client))
        elif dice.random() < 0.15:
            other = dice.choice(told)[0]
            made.append(
                (
                    message[: dice.randrange(len(message))] + other[dice.randrange(max(1, len(other))) :],
                    client,
                )
            )
        else:
            made += [(changed, client) for changed in dice.choice(MUTATIONS)(message, dice)]
    for _ in range(len(made) // 10):
        i, j = dice.randrange(len(made)), dice.randrange(len(made))
        made[i], made[j] = made[j], made[i]
    return made


@pytest.mark.parametrize("scenario", SCENARIOS)
def test_mutations_of_a_recorded_session(scenario: str) -> None:
    recorded = load(scenario)
    told = [
        (bytes.fromhex(packet["hex"]), packet.get("client", 0))
        for packet in recorded["packets"]
        if packet["dir"] == "c>a"
    ]
    for mutant in range(MUTANTS):
        dice = random.Random(zlib.crc32(scenario.encode()) + mutant)
        bench = Bench(references_for(recorded), stop_at_failure=bool(mutant & 1))
        for message, client in mutate(told, dice):
            bench.receive(message, client)
            bench.now += dice.randint(0, 60)
            bench.core.tick(bench.now)
        is_bounded(bench)
        bench.take()
        serves(bench)


def test_the_messages_of_the_agent_sent_back_to_it() -> None:
    """A loop in somebody's wiring: what the agent says comes back to it."""
    for scenario in ("pubsub_bin_reliable", "raw_get_info", "timesync", "fragments"):
        bench = Bench()
        for packet in json.loads(Path(VECTORS / "xrce" / f"{scenario}.json").read_text())["packets"]:
            bench.receive(bytes.fromhex(packet["hex"]), 0)
            for _ in range(3):
                for message in bench.take():
                    bench.receive(message, 0)
        bench.take()
        serves(bench)
