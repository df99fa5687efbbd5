"""Whatever bytes come, a domain neither raises nor grows, and goes on working."""

import random
from collections import Counter
from collections.abc import Callable

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from muros.rtps import DomainCore, DomainSettings, EndpointQos, ParticipantData, udp4
from muros.rtps._constants import (
    ENTITYID_PARTICIPANT_MESSAGE_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_READER,
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    ENTITYID_SPDP_READER,
    ENTITYID_SPDP_WRITER,
)
from muros.rtps._discovery_data import EndpointData
from muros.rtps._parameters import status_info
from muros.rtps._wire import (
    Data,
    acknack,
    data,
    data_frag,
    gap,
    heartbeat,
    info_dst,
    info_reply,
    info_src,
    message,
    nack_frag,
    parse_untrusted,
)
from tests.rtps.domains import MS, SECOND, TYPE, World, payload
from tests.rtps.vectors import LOSSES, PEERS, datagrams, domain_of, samples

STRANGER = udp4("10.9.9.9", 7412)
PREFIX = b"the stranger"


def domain() -> tuple[DomainCore, list[bytes]]:
    """A domain with a writer, a reader and a stranger that matches both."""
    sent: list[bytes] = []
    core = DomainCore(0, lambda datagram, _: sent.append(datagram), settings=DomainSettings(peers=20))
    participant = core.participant(b"participant.", now=0)
    participant.writer("rt/a", TYPE, EndpointQos(depth=10), now=0, entity=0x103)
    participant.reader("rt/b", TYPE, EndpointQos(), lambda _: None, now=0, entity=0x104)
    told = ParticipantData(prefix=PREFIX, metatraffic_unicast=(STRANGER,), default_unicast=(STRANGER,))
    reader = EndpointData(guid=PREFIX + b"\0\0\1\4", topic="rt/a", type_name=TYPE, qos=EndpointQos())
    writer = EndpointData(guid=PREFIX + b"\0\0\1\3", topic="rt/b", type_name=TYPE, qos=EndpointQos())
    core.receive(
        message(
            PREFIX,
            data(ENTITYID_SPDP_READER, ENTITYID_SPDP_WRITER, 1, told.payload()),
            data(0, ENTITYID_SEDP_PUBLICATIONS_WRITER, 1, writer.payload()),
            data(0, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER, 1, reader.payload()),
        ),
        STRANGER,
        0,
    )
    assert len(participant.endpoints) == 2
    assert participant.writers[0].matched
    return core, sent


def size_of(core: DomainCore) -> int:
    """How much it holds."""
    return (
        len(core.peers)
        + len(core.agenda)
        + len(core._routes)
        + len(core._replies)
        + len(core.inside)
        + len(core.news)
        + sum(len(participant.endpoints) for participant in core.participants)
    )


@settings(max_examples=60)
@given(st.lists(st.binary(max_size=200), max_size=20))
def test_arbitrary_bytes(texts: list[bytes]) -> None:
    core, _ = domain()
    before = size_of(core)
    for index, datagram in enumerate(texts):
        core.receive(datagram, STRANGER, index)
        core.receive(b"RTPS\x02\x03\0\0" + PREFIX + datagram, STRANGER, index)
    core.tick(SECOND)
    assert size_of(core) <= before + 5


ENTITIES = st.sampled_from([
    0, 0x103, 0x104, 0x1C1, ENTITYID_SPDP_WRITER, ENTITYID_SPDP_READER, ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_READER, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER, ENTITYID_PARTICIPANT_MESSAGE_WRITER,
])  # fmt: skip
NUMBERS = st.one_of(st.integers(1, 20), st.integers(1, 2**63 - 300))
COUNTS = st.integers(0, 2**32 - 1)
SMALL = st.integers(0, 200)
PREFIXES = st.sampled_from([PREFIX, b"participant.", b"another one.", bytes(12)])


@st.composite
def submessages(draw: st.DrawFn) -> bytes:
    """Any that is well formed."""
    reader, writer, number, small = draw(ENTITIES), draw(ENTITIES), draw(NUMBERS), draw(SMALL)
    count, prefix = draw(COUNTS), draw(PREFIXES)
    makers: list[Callable[[], bytes]] = [
        lambda: data(reader, writer, number, bytes(small), key=bool(count & 1)),
        lambda: data_frag(reader, writer, number, 1 + small % 12, 1, 8, 100, bytes(8)),
        lambda: heartbeat(reader, writer, number, number + small - 1, count, final=bool(count & 1)),
        lambda: gap(reader, writer, number, number + small, [number + small + 3]),
        lambda: acknack(reader, writer, number, [number, number + small], count),
        lambda: nack_frag(reader, writer, number, small + 1, [small + 1], count),
        lambda: info_src(prefix),
        lambda: info_dst(prefix),
        lambda: info_reply([udp4("10.8.8.8", count & 0xFFFF)]),
    ]
    return draw(st.sampled_from(makers))()


@settings(max_examples=150, deadline=None)
@given(st.lists(st.tuples(PREFIXES, st.lists(submessages(), max_size=6)), max_size=20))
def test_any_talk(messages: list[tuple[bytes, list[bytes]]]) -> None:
    core, sent = domain()
    writer = core.participants[0].writers[0]
    for number in range(8):
        writer.write(payload(number), 0)
    sent.clear()
    for index, (prefix, submessages) in enumerate(messages):
        core.receive(message(prefix, *submessages), STRANGER, index * MS)
        core.tick(index * MS)
    core.tick(SECOND)
    assert len(sent) < 60 + 20 * sum(len(submessages) for _, submessages in messages)
    assert len(core.agenda) < 100


def mutated(datagram: bytes, draw: random.Random, others: tuple[bytes, ...]) -> bytes:
    """A datagram with up to three changes."""
    changed = bytearray(datagram)
    for _ in range(draw.randrange(4)):
        where = draw.randrange(len(changed))
        kind = draw.randrange(4)
        if kind == 0:
            changed[where] = draw.randrange(256)
        elif kind == 1:
            changed[where] ^= 1 << draw.randrange(8)
        elif kind == 2:
            del changed[where + 1 :]
        else:
            other = draw.choice(others)
            changed[where:] = other[draw.randrange(len(other)) :]
    return bytes(changed)


def addressee(name: str) -> bytes:
    """The participant that is told of endpoints most often, or anybody where they are told to all."""
    told = Counter(event.destination for event in samples(name, ENTITYID_SEDP_PUBLICATIONS_WRITER))
    return told.most_common(1)[0][0] or b"participant."


def is_farewell(datagram: bytes) -> bool:
    """Whether somebody or something leaves by it."""
    return any(
        isinstance(event, Data) and status_info(event.inline_qos)
        for event in parse_untrusted(datagram).submessages
    )


@pytest.mark.parametrize("name", PEERS)
def test_mutated_datagrams_of_real_peers(name: str) -> None:
    draw = random.Random(name)
    sent: list[bytes] = []
    originals = datagrams(name) + datagrams(LOSSES[0]) + datagrams(LOSSES[1])
    core = DomainCore(domain_of(name), lambda datagram, _: sent.append(datagram))
    participant = core.participant(addressee(name), now=0)
    for datagram in datagrams(name):
        if not is_farewell(datagram):
            core.receive(datagram, STRANGER, 0)
    assert participant.participants
    assert participant.endpoints
    for endpoint in participant.endpoints:
        options = {"topic": endpoint.topic, "type_name": endpoint.type_name, "qos": endpoint.qos, "now": 0}
        if endpoint.is_writer:
            participant.reader(**options, on_sample=lambda _: None)  # type: ignore[arg-type]
        else:
            participant.writer(**options).write(payload(1), 0)  # type: ignore[arg-type]
    before = size_of(core)
    sent.clear()
    count = 1000
    for index in range(count):
        core.receive(mutated(draw.choice(originals), draw, originals), STRANGER, index * MS)
        core.receive(draw.choice(originals), STRANGER, index * MS)
        if index % 20 == 0:
            core.tick(index * MS)
    assert core.counters["malformed"] > count / 20
    assert size_of(core) < before + 100
    assert len(sent) < 4 * count + 500
    now = count * MS
    for _ in range(2000):
        now = max(now, core.deadline or 0)
        core.tick(now)
        if not participant.participants:
            break
    assert participant.endpoints == ()  # those who are silent are forgotten


@pytest.mark.parametrize("seed", range(3))
def test_those_who_talk_are_not_disturbed(seed: int) -> None:
    """Two exchange samples while mutations of what they send come in between."""
    draw = random.Random(seed)
    world = World(seed)
    left, right = world.process(), world.process()
    writer = left.writer(left.participant(), qos=EndpointQos(depth=1000))
    reader = right.reader(right.participant())
    sent = world.record()
    world.run(SECOND)
    for number in range(200):
        writer.write(payload(number), left.now)
        datagram = bytearray(draw.choice(sent).data)
        # The header stays, so that it counts as theirs; the entities of what is mutated are not the writer's own, for
        # nothing in RTPS protects a writer from one who speaks with its tongue.
        for _ in range(3):
            datagram[draw.randrange(20, len(datagram))] = draw.randrange(256)
        datagram[8] ^= 0xFF
        right.core.receive(bytes(datagram), left.user, right.now)
        left.core.receive(bytes(datagram), right.user, left.now)
        world.run(MS)
    world.run(SECOND)
    assert [sample.payload for sample in right.got[reader.guid]] == [payload(number) for number in range(200)]
