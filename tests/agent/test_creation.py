"""Creating and deleting: the status of every mode for every kind, in every format, and what refusals say."""

import json
from typing import Any

import pytest

from muros.agent import EntityCreated
from muros.agent.profiles import NamedReferences, Profiles, ReferenceChain, References
from muros.agent.xml import parse_profiles_untrusted
from muros.client.qos import Qos
from muros.space import Reliability, Service, identity_of
from muros.xrce import create
from muros.xrce.constants import (
    KIND_DATAREADER,
    KIND_DATAWRITER,
    KIND_PUBLISHER,
    KIND_REPLIER,
    KIND_REQUESTER,
    KIND_SUBSCRIBER,
    REPLACE,
    REUSE,
    STATUS_ERR_ALREADY_EXISTS,
    STATUS_ERR_DDS_ERROR,
    STATUS_ERR_INVALID_DATA,
    STATUS_ERR_MISMATCH,
    STATUS_ERR_RESOURCES,
    STATUS_ERR_UNKNOWN_REFERENCE,
    STATUS_OK,
    STATUS_OK_MATCHED,
    STREAM_BEST_EFFORT,
    STREAM_RELIABLE,
)
from muros.xrce.representation import Format, Kind, Variant, encode_variant
from tests.agent.raw import (
    BEST_EFFORT,
    PARTICIPANT,
    PUBLISHER,
    READER,
    RELIABLE,
    REPLIER,
    REQUESTER,
    SUBSCRIBER,
    TOPIC,
    WRITER,
    Raw,
    submessage,
)
from tests.agent.replay import PROFILES, VECTORS, Bench

OTHER_TOPIC = 0x0022


def service(kind: int, name: str) -> bytes:
    return create.of_service(kind, name, "Q", "P", f"rq{name}Request", f"rr{name}Reply", PARTICIPANT)


# (object id, one description, another): every kind that is made
KINDS = {
    "participant": (PARTICIPANT, create.of_participant("node", 0), create.of_participant("other", 0)),
    "participant's domain": (PARTICIPANT, create.of_participant("node", 0), create.of_participant("node", 1)),
    "topic": (TOPIC, create.of_topic("rt/chatter", "T", PARTICIPANT), create.of_topic("rt/other", "T", PARTICIPANT)),
    "topic's type": (
        TOPIC,
        create.of_topic("rt/chatter", "T", PARTICIPANT),
        create.of_topic("rt/chatter", "U", PARTICIPANT),
    ),
    "datawriter": (
        WRITER,
        create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER),
        create.of_endpoint(KIND_DATAWRITER, TOPIC, BEST_EFFORT, PUBLISHER),
    ),
    "datawriter's topic": (
        WRITER,
        create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER),
        create.of_endpoint(KIND_DATAWRITER, OTHER_TOPIC, RELIABLE, PUBLISHER),
    ),
    "datareader": (
        READER,
        create.of_endpoint(KIND_DATAREADER, TOPIC, RELIABLE, SUBSCRIBER),
        create.of_endpoint(KIND_DATAREADER, TOPIC, BEST_EFFORT, SUBSCRIBER),
    ),
    "requester": (REQUESTER, service(KIND_REQUESTER, "/add"), service(KIND_REQUESTER, "/sub")),
    "replier": (REPLIER, service(KIND_REPLIER, "/add"), service(KIND_REPLIER, "/sub")),
}  # fmt: skip


@pytest.mark.parametrize("kind", KINDS)
def test_modes_of_every_kind(kind: str) -> None:
    """The table of DDS-XRCE 1.0, 7.8.3.1, as the reference agent keeps to it."""
    bench = Bench()
    client = Raw(bench).tree()
    client.make(OTHER_TOPIC, create.of_topic("rt/second", "T", PARTICIPANT))
    client.service_kinds()
    object_id, first, second = KINDS[kind]
    client.delete(object_id)
    session = bench.core.clients[client.key]

    for flags in (0, REPLACE, REUSE, REUSE | REPLACE):
        assert client.make(object_id, first, flags) == STATUS_OK, "new, whatever the flags"
        if flags != REUSE | REPLACE:
            client.delete(object_id)
    made = session.objects[object_id]
    assert client.make(object_id, first, 0) == STATUS_ERR_ALREADY_EXISTS
    assert client.make(object_id, second, 0) == STATUS_ERR_ALREADY_EXISTS
    assert client.make(object_id, first, REUSE) == STATUS_OK_MATCHED
    assert client.make(object_id, first, REUSE | REPLACE) == STATUS_OK_MATCHED
    assert client.make(object_id, second, REUSE) == STATUS_ERR_MISMATCH
    assert session.objects[object_id] is made
    assert client.make(object_id, second, REUSE | REPLACE) == STATUS_OK
    replaced = session.objects[object_id]
    assert replaced is not made
    assert client.make(object_id, second, REPLACE) == STATUS_OK
    assert session.objects[object_id] is not replaced


@pytest.mark.parametrize("object_id", [PUBLISHER, SUBSCRIBER])
def test_modes_of_groups(object_id: int) -> None:
    """Publishers and subscribers are all alike."""
    bench = Bench()
    client = Raw(bench).tree()
    variant = create.of_group(object_id & 15, PARTICIPANT)
    assert client.make(object_id, variant, 0) == STATUS_ERR_ALREADY_EXISTS
    assert client.make(object_id, variant, REUSE) == STATUS_OK_MATCHED
    assert client.make(object_id, variant, REPLACE) == STATUS_OK
    client.read()
    client.write(b"children live on")
    assert client.samples() == [b"children live on"]


@pytest.mark.parametrize("stream", [0, STREAM_BEST_EFFORT, 5, STREAM_RELIABLE, 0x93])
def test_the_stream_of_the_answer(stream: int) -> None:
    bench = Bench()
    client = Raw(bench)
    client.connect()
    ids = client.ids(PARTICIPANT)
    client.send(stream, submessage(1, ids + create.of_participant("n", 0)))
    answers = [(got.stream, got.status) for got in client.got() if got.kind == 5]
    assert answers == [(STREAM_RELIABLE if stream >= 0x80 else STREAM_BEST_EFFORT, STATUS_OK)]


def test_the_kind_of_the_representation_wins_over_the_id() -> None:
    bench = Bench()
    client = Raw(bench)
    client.connect()
    assert client.make(0x0000, create.of_participant("n", 0)) == STATUS_OK
    assert list(bench.core.clients[client.key].objects) == [0x0001]
    assert client.delete(0x0000) == STATUS_ERR_UNKNOWN_REFERENCE
    assert client.delete(0x0001) == STATUS_OK


@pytest.mark.parametrize("kind", [Kind.TYPE, Kind.QOSPROFILE, Kind.APPLICATION])
def test_kinds_that_are_taken_and_not_made(kind: Kind) -> None:
    bench = Bench()
    client = Raw(bench).tree()
    before = dict(bench.core.clients[client.key].objects)
    assert client.make(0x10 | kind, bytes((kind, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0x11))) == STATUS_OK
    assert bench.core.clients[client.key].objects == before
    assert client.delete(0x10 | kind) == STATUS_ERR_UNKNOWN_REFERENCE


@pytest.mark.parametrize(
    ("object_id", "variant", "status"),
    [
        (TOPIC, create.of_topic("t", "T", 0x0991), STATUS_ERR_UNKNOWN_REFERENCE),
        (PUBLISHER, create.of_group(KIND_PUBLISHER, 0x0991), STATUS_ERR_UNKNOWN_REFERENCE),
        (WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, 0x0993), STATUS_ERR_UNKNOWN_REFERENCE),
        (WRITER, create.of_endpoint(KIND_DATAWRITER, 0x0992, RELIABLE, PUBLISHER), STATUS_ERR_DDS_ERROR),
        (READER, create.of_endpoint(KIND_DATAREADER, 0x0992, RELIABLE, SUBSCRIBER), STATUS_ERR_DDS_ERROR),
        (WRITER, b"\x05\x03\0\0\xff\0\0\0", STATUS_ERR_INVALID_DATA),
        (WRITER, b"\x99\x03\0\0\xff\0\0\0", STATUS_ERR_INVALID_DATA),
    ],
)  # fmt: skip
def test_refusals_say_why_and_what_to_do(object_id: int, variant: bytes, status: int) -> None:
    bench = Bench()
    client = Raw(bench).base()
    assert client.make(object_id, variant) == status
    finding = bench.findings.snapshot()[-1]
    assert finding.code == "entity-refused"
    assert finding.who == client.who
    assert finding.why
    assert finding.remedy
    assert f"0x{object_id:04X}"[:5] in finding.what


def test_too_many_entities() -> None:
    bench = Bench(max_objects=6)
    client = Raw(bench).base()
    for n in range(2, 4):
        assert client.make(n << 4 | 2, create.of_topic(f"t{n}", "T", PARTICIPANT)) == STATUS_OK
    assert client.make(0x42, create.of_topic("t4", "T", PARTICIPANT)) == STATUS_ERR_RESOURCES
    assert client.make(0x32, create.of_topic("again", "T", PARTICIPANT), REPLACE) == STATUS_OK
    assert "max_objects" in bench.findings.snapshot()[-1].remedy


def test_recorded_statuses_of_edge_cases() -> None:
    """The statuses that the middleware of micro-ROS met, see tests/vectors/rmw/agent_status.json."""
    cases = json.loads((VECTORS / "rmw" / "agent_status.json").read_text())["cases"]
    expected: dict[str, list[int]] = {}
    for case in cases:
        expected.setdefault(case["case"], []).append(case["code"])
    bench = Bench()
    client = Raw(bench).base()
    both = REUSE | REPLACE
    talker, other = create.of_participant("talker", 0), create.of_participant("other", 0)
    given = {
        "bin datawriter unknown topic": [
            client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, 0x0992, RELIABLE, PUBLISHER), both)
        ],
        "bin publisher unknown participant": [
            client.make(0x23, create.of_group(KIND_PUBLISHER, 0x0991), both)
        ],
        "again participant identical talker": [
            client.make(0x21, talker, both),
            client.make(0x21, talker, both),
        ],
        "participant other name same id talker": [client.make(0x21, other, both)],
        "participant same id mode 0 talker": [client.make(0x21, talker, 0)],
        "participant same id reuse talker": [client.make(0x21, other, REUSE)],
        "participant other name reuse talker": [client.make(0x21, talker, REUSE)],
        "delete unknown": [client.delete(0x0995)],
        "read_data unknown": [client.status_of(client.read(0x0996))],
    }
    ids = client.write(b"x", 0x0995)
    given["write unknown datawriter"] = [client.status_of(ids) & 0xFF]
    assert given == expected


# Domains


@pytest.mark.parametrize("default", [0, 7])
def test_domain_255_is_the_agents_choice(default: int) -> None:
    bench = Bench()
    bench.core.default_domain = default
    client = Raw(bench)
    client.connect()
    assert client.make(PARTICIPANT, create.of_participant("n", 255)) == STATUS_OK
    assert [one.domain for one in bench.space.graph.participants] == [default]
    assert client.make(PARTICIPANT, create.of_participant("n", 255), REUSE) == STATUS_OK_MATCHED
    assert client.make(PARTICIPANT, create.of_participant("n", default), REUSE) == STATUS_OK_MATCHED
    assert client.make(PARTICIPANT, create.of_participant("n", 9), REUSE) == STATUS_ERR_MISMATCH


def test_domains_are_worlds_of_their_own() -> None:
    bench = Bench()
    clients = []
    for domain in (0, 1):
        client = Raw(bench, f"c{domain}", 1 + domain)
        client.connect()
        client.make(PARTICIPANT, create.of_participant("n", domain))
        client.make(TOPIC, create.of_topic("rt/a", "T", PARTICIPANT))
        client.make(PUBLISHER, create.of_group(KIND_PUBLISHER, PARTICIPANT))
        client.make(SUBSCRIBER, create.of_group(KIND_SUBSCRIBER, PARTICIPANT))
        client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER))
        client.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, RELIABLE, SUBSCRIBER))
        client.read()
        clients.append(client)
    clients[0].write(b"zero")
    assert clients[0].samples() == [b"zero"]
    assert clients[1].samples() == []


# Text


def text(kind: Kind, content: str, form: Format = Format.XML) -> bytes:
    """The variant of a document or a reference."""
    parent = {Kind.DATAWRITER: PUBLISHER, Kind.DATAREADER: SUBSCRIBER}.get(kind, PARTICIPANT)
    if kind is Kind.PARTICIPANT:
        return encode_variant(Variant(kind, form, None, content, domain=0), 12)
    return encode_variant(Variant(kind, form, None, content, parent_id=parent), 12)


def recorded_texts(form: int) -> list[dict[str, Any]]:
    cases = json.loads((VECTORS / "rmw" / "entities_xml.json").read_text())["cases"]
    order = [kind.name.lower() for kind in Kind]
    found = [case for case in cases if case["representation_format"] == form]
    return sorted(found, key=lambda case: order.index(case["entity"]))


def test_every_recorded_document_makes_its_entity() -> None:
    bench = Bench()
    client = Raw(bench)
    client.connect()
    for case in recorded_texts(2):
        kind = Kind[case["entity"].upper()]
        assert client.make(0x10 | kind, text(kind, case["text"])) == STATUS_OK, case["entity"]
    graph = bench.space.graph
    assert [node.full_name for node in graph.nodes] == ["/talker"]
    topic = graph.topic("rt/chatter")
    assert topic is not None
    assert topic.types == ("std_msgs::msg::dds_::String_",)
    assert [each.qos.reliability for each in topic.writers] == [Reliability.RELIABLE]
    assert [each.qos.reliability for each in topic.readers] == [Reliability.BEST_EFFORT]
    assert [(one.name, len(one.servers), len(one.clients)) for one in graph.services] == [
        ("/add_two_ints", 1, 1)
    ]
    client.read()
    client.write(b"through documents")
    assert client.samples() == [b"through documents"]


def test_references_of_names_and_of_profiles() -> None:
    profiles = Profiles(parse_profiles_untrusted(PROFILES), "probe.refs")
    chains: list[References] = [profiles, NamedReferences(), ReferenceChain(profiles, NamedReferences())]
    for references in chains:
        bench = Bench(references)
        client = Raw(bench)
        client.connect()
        for kind, name in (
            (Kind.PARTICIPANT, "default_xrce_participant"),
            (Kind.TOPIC, "ProbeTopic__t"),
            (Kind.PUBLISHER, ""),
            (Kind.SUBSCRIBER, ""),
            (Kind.DATAWRITER, "ProbeTopic__dw"),
            (Kind.DATAREADER, "ProbeTopic__dr"),
        ):
            assert client.make(0x10 | kind, text(kind, name, Format.REFERENCE)) == STATUS_OK, name
        client.read()
        client.write(b"by reference")
        assert client.samples() == [b"by reference"]


@pytest.mark.parametrize(
    ("kind", "content", "form", "says"),
    [
        (Kind.PARTICIPANT, "not xml at all", Format.XML, "XML is refused"),
        (Kind.PARTICIPANT, "<dds><participant><rtps><name>x</dds>", Format.XML, "XML is refused"),
        (Kind.TOPIC, "<dds><topic><nmae>x</nmae></topic></dds>", Format.XML, "nmae"),
        (Kind.TOPIC, "<!DOCTYPE a [<!ENTITY b 'c'>]><dds/>", Format.XML, "XML is refused"),
        (Kind.PARTICIPANT, "", Format.XML, "XML is refused"),
        (Kind.TOPIC, "Probe", Format.REFERENCE, "no topic profile 'Probe' in probe.refs"),
        (Kind.TOPIC, "ProbeTpoic__t", Format.REFERENCE, "did you mean 'ProbeTopic__t'"),
        (
            Kind.DATAWRITER,
            "<dds><data_writer><topic><kind>NO_KEY</kind><name>nowhere</name><dataType>T</dataType></topic>"
            "</data_writer></dds>",
            Format.XML,
            "no topic named 'nowhere'",
        ),
    ],
)
def test_refused_documents_give_a_finding_with_a_remedy(
    kind: Kind, content: str, form: Format, says: str
) -> None:
    bench = Bench(Profiles(parse_profiles_untrusted(PROFILES), "probe.refs"))
    client = Raw(bench).base()
    assert client.make(0x50 | kind, text(kind, content, form)) == STATUS_ERR_DDS_ERROR
    finding = bench.findings.snapshot()[-1]
    assert finding.code == "entity-refused"
    assert says in finding.format()
    assert finding.remedy
    assert client.ping()


# Services


def pair(bench: Bench) -> tuple[Raw, Raw]:
    """A requester's client and a replier's."""
    asker = Raw(bench, "asker", 1).service(KIND_REQUESTER)
    server = Raw(bench, "server", 2).service(KIND_REPLIER)
    asker.read(REQUESTER)
    server.read(REPLIER)
    asker.got()
    server.got()
    return asker, server


def test_requests_and_replies_keep_their_identities() -> None:
    bench = Bench()
    asker, server = pair(bench)
    requests = {asker.write(bytes((n,)), REQUESTER): bytes((n,)) for n in range(5)}
    asked = server.samples()
    assert [data[24:] for data in asked] == list(requests.values())
    assert len({data[:24] for data in asked}) == 5
    for data in reversed(asked):
        server.write(data[:24] + b"reply to " + data[24:], REPLIER)
    replies = asker.samples()
    assert [data[4:] for data in replies] == [b"reply to " + bytes((n,)) for n in reversed(range(5))]
    assert {data[:4]: data[4:] for data in replies} == {
        ids: b"reply to " + body for ids, body in requests.items()
    }


def test_replies_go_to_whoever_asked() -> None:
    bench = Bench()
    asker, server = pair(bench)
    second = Raw(bench, "second", 3).service(KIND_REQUESTER)
    second.read(REQUESTER)
    second.got()
    asker.write(b"1", REQUESTER)
    second.write(b"2", REQUESTER)
    for data in server.samples():
        server.write(data[:24] + data[24:] * 2, REPLIER)
    assert [data[4:] for data in asker.samples()] == [b"11"]
    assert [data[4:] for data in second.samples()] == [b"22"]


def test_replies_nobody_asked_for_are_told() -> None:
    bench = Bench()
    asker, server = pair(bench)
    server.write(identity_of(bytes(16), 1) + b"to nobody", REPLIER)
    server.write(b"too short", REPLIER)
    asker.write(b"once", REQUESTER)
    (asked,) = server.samples()
    for _ in range(3):
        server.write(asked[:24] + b"answered thrice", REPLIER)
    assert [data[4:] for data in asker.samples()] == [b"answered thrice"]
    assert bench.findings.counts()["malformed"] == 1


def test_requests_wait_for_a_server() -> None:
    bench = Bench()
    asker = Raw(bench, "asker", 1).service(KIND_REQUESTER)
    asker.read(REQUESTER)
    asker.write(b"early", REQUESTER)
    bench.advance(100)
    server = Raw(bench, "server", 2).service(KIND_REPLIER)
    server.read(REPLIER)
    bench.advance(200)
    assert [data[24:] for data in server.samples()] == [b"early"]


def test_requests_that_are_never_answered_are_bounded() -> None:
    bench = Bench(outstanding_requests=5)
    asker, server = pair(bench)
    for n in range(8):
        asker.write(bytes((n,)), REQUESTER)
    for data in server.samples():
        server.write(data[:24] + data[24:], REPLIER)
    assert [data[4:] for data in asker.samples()] == [bytes((n,)) for n in range(3, 8)]
    assert bench.findings.counts()["request-given-up"] == 3


def test_a_service_meets_the_space() -> None:
    bench = Bench()
    participant = bench.space.participant("host")
    server = Raw(bench, "server", 2).service(KIND_REPLIER)
    server.read(REPLIER)
    got: list[tuple[int, bytes]] = []
    requester = participant.requester(
        Service("/add", "rq/addRequest", "rr/addReply", "Q", "P"),
        on_reply=lambda number, data: got.append((number, bytes(data))),
    )
    number = requester.send(b"from the space")
    bench.space.tick()
    (asked,) = server.samples()
    server.write(asked[:24] + b"pong", REPLIER)
    bench.space.tick()
    assert got == [(number, b"pong")]


# QoS


@pytest.mark.parametrize(
    ("qos", "words"),
    [
        (Qos(reliable=True, depth=3).asked, "reliable, volatile, keep last 3"),
        (Qos(reliable=False, depth=1).asked, "best effort, volatile, keep last 1"),
        (Qos(keep_all=True, durability="transient_local").asked, "reliable, transient local, keep all"),
        (
            Qos(depth=2, deadline=100, lifespan=50).asked,
            "reliable, volatile, keep last 2, deadline 100 ms, lifespan 50 ms",
        ),
    ],
)
def test_qos_in_binary_reaches_the_space(qos: tuple[int, int, int, int], words: str) -> None:
    bench = Bench()
    client = Raw(bench).base()
    assert client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, qos, PUBLISHER)) == STATUS_OK
    assert client.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, qos, SUBSCRIBER)) == STATUS_OK
    (writer,), (reader,) = bench.space.graph.writers, bench.space.graph.readers
    assert str(writer.qos) == words
    assert str(reader.qos) == words


@pytest.mark.parametrize("whose", ["endpoint", "group"])
def test_partitions_in_xml_reach_the_space(whose: str) -> None:
    """Clients write them with the endpoint, as Fast DDS profiles do, or with its publisher or subscriber."""
    names = "<qos><partition><names><name>left</name></names></partition></qos>"
    of_group, own = (names, "") if whose == "group" else ("", names)
    topic = "<topic><kind>NO_KEY</kind><name>rt/chatter</name><dataType>T</dataType></topic>"
    bench = Bench()
    client = Raw(bench).base("rt/chatter", "T")
    for group, end, group_id, object_id in (
        (Kind.PUBLISHER, Kind.DATAWRITER, PUBLISHER, WRITER),
        (Kind.SUBSCRIBER, Kind.DATAREADER, SUBSCRIBER, READER),
    ):
        tag = group.name.lower()
        document = f"<dds><{tag}><name>group</name>{of_group}</{tag}></dds>"
        assert client.make(group_id, text(group, document)) == STATUS_OK
        tag = "data_writer" if end is Kind.DATAWRITER else "data_reader"
        document = f"<dds><{tag}>{topic}{own}</{tag}></dds>"
        assert client.make(object_id, text(end, document)) == STATUS_OK
    (writer,), (reader,) = bench.space.graph.writers, bench.space.graph.readers
    assert (writer.qos.partitions, reader.qos.partitions) == (("left",), ("left",))


def test_a_late_reader_gets_what_was_kept_for_it() -> None:
    bench = Bench()
    qos = Qos(depth=3, durability="transient_local").asked
    writer = Raw(bench, "w", 1).base()
    writer.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, qos, PUBLISHER))
    for n in range(5):
        writer.write(bytes((n,)))
    reader = Raw(bench, "r", 2).base()
    reader.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, qos, SUBSCRIBER))
    reader.read()
    assert reader.samples() == [bytes((n,)) for n in range(2, 5)]


# Parents and children


def test_children_live_on_when_their_parents_go() -> None:
    bench = Bench()
    client = Raw(bench).tree()
    client.read()
    for object_id in (PARTICIPANT, TOPIC, PUBLISHER, SUBSCRIBER):
        assert client.delete(object_id) == STATUS_OK
    client.write(b"orphans")
    assert client.samples() == [b"orphans"]
    assert client.make(0x25, create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER)) == (
        STATUS_ERR_UNKNOWN_REFERENCE
    )
    assert client.delete(WRITER) == STATUS_OK
    assert len(bench.space.graph.participants) == 1
    assert client.delete(READER) == STATUS_OK
    assert not bench.space.graph.participants


def test_a_publisher_outlives_its_participant_and_makes_nothing_any_more() -> None:
    bench = Bench()
    client = Raw(bench).base()
    assert client.delete(PARTICIPANT) == STATUS_OK
    assert client.make(WRITER, create.of_endpoint(KIND_DATAWRITER, TOPIC, RELIABLE, PUBLISHER)) == (
        STATUS_ERR_DDS_ERROR
    )
    assert client.make(READER, create.of_endpoint(KIND_DATAREADER, TOPIC, RELIABLE, SUBSCRIBER)) == (
        STATUS_ERR_DDS_ERROR
    )
    assert not bench.space.graph.participants
    assert bench.findings.snapshot()[-1].remedy
    assert client.ping()


def test_events_tell_what_was_made() -> None:
    bench = Bench()
    client = Raw(bench).tree(name="greenhouse/thermometer")
    bench.advance(1000)
    kinds = [event.kind for event in bench.events if isinstance(event, EntityCreated)]
    assert kinds == [1, 2, 3, 4, 5, 6]
    assert bench.events[-1].text() == f"{client.who}: node /greenhouse/thermometer: 1 writer, 1 reader"


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        (
            "58524346 0100 010f aabbccdd 81",
            "ERR_INVALID_DATA: its cookie, key or session id is none of DDS-XRCE.",
        ),
        ("58524345 0100 010f 00000000 81", "Give it a key other than 0."),
        ("58524345 0200 010f aabbccdd 81", "ERR_INCOMPATIBLE: it speaks another version than DDS-XRCE 1."),
    ],
)
def test_a_refused_client_is_told_with_its_cause(wrong: str, why: str) -> None:
    bench = Bench()
    bench.receive(bytes.fromhex(f"80000000 00011000 {wrong} 00 fc01"))
    (finding,) = bench.findings.snapshot()
    assert finding.code == "client-refused"
    assert why in finding.format()
    assert "max_clients" not in finding.format()


def test_refused_clients_of_one_address_are_one_finding_whatever_their_keys() -> None:
    bench = Bench()
    for key in range(1, 6):
        bench.receive(bytes.fromhex(f"80000000 00011000 58524345 0200 010f 000000{key:02x} 81 00 fc01"))
    (finding,) = bench.findings.snapshot()
    assert (finding.code, finding.count) == ("client-refused", 5)
