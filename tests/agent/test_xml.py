"""XML of clients: the documents that were recorded, what profiles may say, and hostile text."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.agent.xml import MAX_DEPTH, XmlError, parse_document_untrusted, parse_profiles_untrusted
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    Kind,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    SubscriberEntity,
    TopicEntity,
)

VECTORS = Path(__file__).parent.parent / "vectors"

STRING = "std_msgs::msg::dds_::String_"
ADD = (
    "/add_two_ints",
    "example_interfaces::srv::dds_::AddTwoInts_Request_",
    "example_interfaces::srv::dds_::AddTwoInts_Response_",
    "rq/add_two_intsRequest",
    "rr/add_two_intsReply",
)
RMW: dict[str, Entity] = {
    "participant": ParticipantEntity("talker"),
    "topic": TopicEntity("rt/chatter", STRING),
    "publisher": PublisherEntity(),
    "subscriber": SubscriberEntity(),
    "datawriter": DataWriterEntity(
        topic_name="rt/chatter", type_name=STRING, qos=EndpointQos(reliable=True, keep_last=False)
    ),
    "datareader": DataReaderEntity(
        topic_name="rt/chatter", type_name=STRING, qos=EndpointQos(reliable=False, keep_last=False)
    ),
    "requester": RequesterEntity(*ADD),
    "replier": ReplierEntity(*ADD),
}


def read(kind: Kind, text: str) -> Entity:
    return parse_document_untrusted(kind, text).entity


def recorded_documents() -> list[dict[str, Any]]:
    cases = json.loads((VECTORS / "rmw/entities_xml.json").read_text())["cases"]
    return [case for case in cases if case["representation_format"] == 2]


@pytest.mark.parametrize("case", recorded_documents(), ids=lambda case: case["entity"])
def test_documents_of_the_rmw(case: dict[str, Any]) -> None:
    kind = Kind[case["entity"].upper()]
    assert read(kind, case["text"]) == RMW[case["entity"]]
    if case["entity"] in ("datawriter", "datareader"):
        tag = f"data_{case['entity'].removeprefix('data')}"
        assert parse_document_untrusted(kind, case["text"]).ignored == (f"{tag}/historyMemoryPolicy",)


@pytest.mark.parametrize("name", ["pubsub_xml_reliable", "request_reply_xml"])
def test_documents_the_reference_agent_took(name: str) -> None:
    """Every recorded XML was answered OK by the reference agent: all are understood."""
    seen = 0
    for packet in json.loads((VECTORS / f"xrce/{name}.json").read_text())["packets"]:
        for submessage in packet["decoded"]["submessages"]:
            described = submessage.get("fields", {}).get("object", {})
            if described.get("representation") == "XML":
                read(Kind[described["kind"]], described["text"])
                seen += 1
    assert seen == {"pubsub_xml_reliable": 6, "request_reply_xml": 3}[name]


WRITER = """
<dds>
  <data_writer profile_name="w">
    <qos>
      <ownershipStrength><value>9</value></ownershipStrength>
      <userData><value>4a.0.FF</value></userData>
      <partition><names><name>left</name><name>right</name></names></partition>
      <ownership><kind>EXCLUSIVE</kind></ownership>
      <lifespan><duration><sec>2</sec></duration></lifespan>
      <deadline><period><sec>1</sec><nanosec>500000000</nanosec></period></deadline>
      <durability><kind>TRANSIENT_LOCAL</kind></durability>
      <reliability><kind>BEST_EFFORT</kind><max_blocking_time><sec>1</sec></max_blocking_time></reliability>
      <publishMode><kind>ASYNCHRONOUS</kind></publishMode>
    </qos>
    <times><heartbeatPeriod><sec>1</sec></heartbeatPeriod></times>
    <topic>
      <historyQos><depth>10</depth><kind>KEEP_LAST</kind></historyQos>
      <dataType>Y</dataType>
      <name>T</name>
      <kind>WITH_KEY</kind>
    </topic>
  </data_writer>
</dds>"""


def test_a_writer_with_everything_in_any_order() -> None:
    description = parse_document_untrusted(Kind.DATAWRITER, WRITER)
    assert description.entity == DataWriterEntity(
        topic_name="T",
        type_name="Y",
        ownership_strength=9,
        qos=EndpointQos(
            reliable=False,
            depth=10,
            deadline_ms=1500,
            lifespan_ms=2000,
            durability=Durability.TRANSIENT_LOCAL,
            exclusive=True,
            user_data=b"\x4a\x00\xff",
            partitions=("left", "right"),
        ),
    )
    assert description.name == "w"
    assert description.ignored == (
        "data_writer/times",
        "qos/publishMode",
        "reliability/max_blocking_time",
    )


def test_a_reader_with_everything() -> None:
    text = """<dds><data_reader><topic><name>T</name></topic><qos>
        <timeBasedFilter><minimum_separation><sec>0</sec><nanosec>20000000</nanosec></minimum_separation></timeBasedFilter>
        <deadline><period>DURATION_INFINITY</period></deadline>
        <lifespan><duration><sec>DURATION_INFINITY</sec></duration></lifespan>
    </qos></data_reader></dds>"""
    expected = DataReaderEntity(topic_name="T", qos=EndpointQos(reliable=False), timebasedfilter_msec=20)
    assert read(Kind.DATAREADER, text) == expected


@pytest.mark.parametrize(
    ("kind", "text", "entity"),
    [
        (Kind.PARTICIPANT, "<dds><participant profile_name='p'/></dds>", ParticipantEntity()),
        (
            Kind.PARTICIPANT,
            "<dds><participant><domainId>7</domainId><rtps><name> n </name>"
            "<userData><value>1.2</value></userData></rtps></participant></dds>",
            ParticipantEntity("n", domain=7, user_data=b"\x01\x02"),
        ),
        (
            Kind.PARTICIPANT,
            "<dds><participant><rtps><builtin><domainId>3</domainId></builtin></rtps></participant></dds>",
            ParticipantEntity(domain=3),
        ),
        (Kind.TOPIC, "<profiles><topic><name>T</name></topic></profiles>", TopicEntity("T")),
        (
            Kind.TOPIC,
            '<?xml version="1.0" encoding="ISO-8859-1"?><!-- c --><dds xmlns="x"><profiles><topic>'
            "<kind>WITH_KEY</kind><name>&#xe9;é&lt;</name><dataType><![CDATA[Y]]></dataType>"
            "</topic></profiles></dds>",
            TopicEntity("éé<", "Y", with_key=True),
        ),
        (Kind.PUBLISHER, " \n ", PublisherEntity()),
        (Kind.PUBLISHER, "<dds><publisher name='p'/></dds>", PublisherEntity("p")),
        (
            Kind.SUBSCRIBER,
            "<dds><subscriber><name>s</name><qos><partition><names><name>a</name></names></partition></qos>"
            "</subscriber></dds>",
            SubscriberEntity("s", ("a",)),
        ),
        (
            Kind.DATAWRITER,
            "<dds><publisher><topic><name>T</name></topic></publisher></dds>",
            DataWriterEntity(topic_name="T", qos=EndpointQos()),
        ),
    ],
)
def test_other_documents(kind: Kind, text: str, entity: Entity) -> None:
    assert read(kind, text) == entity


@pytest.mark.parametrize("quote", ['"', "'"])
@pytest.mark.parametrize("tag", ["requester", "replier"])
def test_attributes_without_blanks_are_repaired(tag: str, quote: str) -> None:
    text = (
        f'<dds><{tag} profile_name="r"service_name="S>a=b"request_type="Q"reply_type="P"></{tag}></dds>'
    ).replace('"', quote)
    kind = Kind[tag.upper()]
    description = parse_document_untrusted(kind, text)
    expected: type[RequesterEntity | ReplierEntity] = RequesterEntity if tag == "requester" else ReplierEntity
    assert description.entity == expected("S>a=b", "Q", "P")
    assert description.name == "r"


def test_repair_leaves_the_rest_alone() -> None:
    text = (
        '<dds><requester profile_name="r"service_name="S"request_type="Q"reply_type="P">'
        '<request_topic_name>a="b"c="d"</request_topic_name></requester></dds>'
    )
    assert read(Kind.REQUESTER, text) == RequesterEntity("S", "Q", "P", 'a="b"c="d"')


@pytest.mark.parametrize(
    ("kind", "text", "reason"),
    [
        (Kind.TOPIC, "", "empty document for a topic"),
        (Kind.TYPE, "<dds/>", "object kind 0x0A cannot be described in XML"),
        (Kind.TOPIC, "<dds><topic>", "not well-formed: no element found"),
        (Kind.TOPIC, "hello", "not well-formed: syntax error"),
        (Kind.TOPIC, "<root/>", "the document is rooted at <root>; known here: dds, profiles"),
        (Kind.TOPIC, "<dds/>", "0 entities in the document, one is wanted"),
        (Kind.TOPIC, "<dds><topic/><topic/></dds>", "2 entities in the document, one is wanted"),
        (
            Kind.TOPIC,
            "<dds><participant/></dds>",
            "the document describes a <participant>, the object is a topic",
        ),
        (Kind.TOPIC, "<dds><topic/></dds>", "the <topic> has no <name>"),
        (
            Kind.TOPIC,
            "<dds><topic><name>T</name><nmae>T</nmae></topic></dds>",
            "unknown element <nmae> in <topic>; known here: kind, name, dataType, historyQos",
        ),
        (
            Kind.TOPIC,
            "<dds><topic><name>T</name><name>U</name></topic></dds>",
            "<name> stands twice in <topic>",
        ),
        (Kind.TOPIC, "<dds><topic>x<name>T</name></topic></dds>", "text 'x' between the elements of <topic>"),
        (Kind.TOPIC, "<dds><topic><name> </name></topic></dds>", "<name> is empty"),
        (Kind.TOPIC, "<dds><topic><name><b/></name></topic></dds>", "unknown element <b> in <name>"),
        (
            Kind.TOPIC,
            "<dds><topic><name>T</name><kind>KEYED</kind></topic></dds>",
            "<kind> is 'KEYED'; known here: NO_KEY, WITH_KEY",
        ),
        (
            Kind.TOPIC,
            "<dds><topic><name>T</name><historyQos><depth>-1</depth></historyQos></topic></dds>",
            "<depth> is '-1', not a number from 0 to 4294967295",
        ),
        (Kind.DATAWRITER, "<dds><data_writer/></dds>", "the <data_writer> has no <topic>"),
        (
            Kind.DATAREADER,
            "<dds><data_reader><topic><name>T</name></topic><qos><ownershipStrength/></qos></data_reader></dds>",
            "unknown element <ownershipStrength> in <qos>; known here: reliability, durability, deadline, lifespan,"
            " ownership, partition, userData, timeBasedFilter",
        ),
        (
            Kind.PARTICIPANT,
            "<dds><participant><rtps><userData><value>xyz</value></userData></rtps></participant></dds>",
            "<value> is 'xyz', not octets like 4a.0.ff",
        ),
        (
            Kind.REQUESTER,
            '<dds><requester service_name="S" request_type="Q"></requester></dds>',
            'the <requester> has no reply_type="..."',
        ),
        (Kind.TOPIC, "<dds>\ud800</dds>", "the text is not Unicode"),
        (Kind.TOPIC, f"<dds>{'x' * 65536}</dds>", "65547 bytes of XML, at most 65536 are taken"),
        (Kind.TOPIC, "<dds>" + "<a>" * 40, f"elements nested more than {MAX_DEPTH} deep"),
        (
            Kind.TOPIC,
            f"<{'t' * 60}/>",
            f"the document is rooted at <{'t' * 40}...>; known here: dds, profiles",
        ),
    ],
)
def test_what_is_wrong_is_said(kind: Kind, text: str, reason: str) -> None:
    with pytest.raises(XmlError) as caught:
        parse_document_untrusted(kind, text)
    assert str(caught.value) == reason


LAUGHS = """<!DOCTYPE lolz [<!ENTITY a "ha">
<!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;"><!ENTITY c "&b;&b;&b;&b;&b;&b;&b;&b;&b;&b;">]>
<dds><topic><name>&c;</name></topic></dds>"""


@pytest.mark.parametrize(
    "text",
    [
        LAUGHS,
        '<!DOCTYPE dds SYSTEM "file:///etc/passwd"><dds/>',
        '<!DOCTYPE dds [<!ENTITY x SYSTEM "file:///etc/passwd">]><dds><topic><name>&x;</name></topic></dds>',
    ],
)
def test_document_types_are_refused(text: str) -> None:
    with pytest.raises(XmlError, match=r"a document type declaration \(<!DOCTYPE>\) is not allowed"):
        parse_document_untrusted(Kind.TOPIC, text)
    with pytest.raises(XmlError, match="DOCTYPE"):
        parse_profiles_untrusted(text.encode())


def test_entities_nobody_declared_are_refused() -> None:
    with pytest.raises(XmlError, match="not well-formed: undefined entity"):
        parse_document_untrusted(Kind.TOPIC, "<dds><topic><name>&lol;</name></topic></dds>")


PIECES = """< > </ /> <dds> </dds> <profiles> <topic> </topic> <name> </name> T <data_writer> </data_writer> <qos>
    </qos> <requester service_name="S"request_type="Q" reply_type='P'> </requester> <kind> </kind> NO_KEY = "
    &lt; &x; <!-- --> <![CDATA[ ]]> <?xml version="1.0"?> <!DOCTYPE <rtps> <participant> </participant>
    é \x01"""
fragments = st.sampled_from(PIECES.split())


@given(st.sampled_from(Kind), st.lists(fragments, max_size=14).map("".join) | st.text(max_size=80))
def test_any_text_raises_one_type_only(kind: Kind, text: str) -> None:
    try:
        description = parse_document_untrusted(kind, text)
    except XmlError as error:
        message = str(error)
    else:
        message = ""
        assert description.kind is kind
    assert message.isprintable()


@given(st.binary(max_size=120) | st.lists(fragments, max_size=14).map(lambda parts: "".join(parts).encode()))
def test_any_file_raises_one_type_only(data: bytes) -> None:
    try:
        parse_profiles_untrusted(data)
    except XmlError as error:
        message = str(error)
    else:
        message = ""
    assert message.isprintable()


@given(
    st.text(st.characters(exclude_categories=("Cs", "Cc", "Cn")), min_size=1).filter(
        lambda t: t == t.strip() and t
    )
)
def test_any_name_comes_through(name: str) -> None:
    escaped = name.replace("&", "&amp;").replace("<", "&lt;").replace(">", "&gt;")
    text = f"<dds><topic><name>{escaped}</name></topic></dds>"
    assert read(Kind.TOPIC, text) == TopicEntity(name)


def test_long_documents_of_attributes_are_repaired_in_linear_time() -> None:
    """A document of the greatest size made of what the repair looks for; a quadratic one would take minutes."""
    text = "<dds><a " + 'b="c"' * 13000 + "/>"
    with pytest.raises(XmlError):
        parse_document_untrusted(Kind.TOPIC, text)
    with pytest.raises(XmlError):
        parse_document_untrusted(Kind.TOPIC, "<dds>" + "<a b='" * 10000)
