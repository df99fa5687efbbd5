"""Entity representations: byte for byte as recorded, round trips of any value, and any bytes at all."""

import json
import random
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.xrce import constants
from muros.xrce.representation import (
    KIND_OF,
    PARENT_OF,
    READER_DEFAULTS,
    WRITER_DEFAULTS,
    DataReaderEntity,
    DataWriterEntity,
    Durability,
    EndpointQos,
    Entity,
    Format,
    InvalidRepresentation,
    Kind,
    Limits,
    ParticipantEntity,
    PublisherEntity,
    ReplierEntity,
    RequesterEntity,
    SubscriberEntity,
    TopicEntity,
    Variant,
    encode_binary,
    encode_variant,
    parse_binary_untrusted,
    parse_variant_untrusted,
)

VECTORS = Path(__file__).parent.parent / "vectors"


def load(name: str) -> Any:
    return json.loads((VECTORS / name).read_text())


# -- values of every shape -------------------------------------------------------------------------

words = st.text(st.characters(exclude_characters="\0", codec="utf-8"), max_size=40)
maybe_words = st.none() | words
u16 = st.integers(0, 0xFFFF)
u32 = st.integers(0, 0xFFFFFFFF)
octets = st.binary(max_size=40)
topic_ids = st.integers(0, 0xFFF).map(lambda n: n << 4 | Kind.TOPIC)
partitions = st.lists(words, max_size=4).map(tuple)

qos_values = st.builds(
    EndpointQos,
    reliable=st.booleans(),
    keep_last=st.booleans(),
    depth=st.none() | u16,
    deadline_ms=st.none() | u32,
    lifespan_ms=st.none() | u32,
    durability=st.sampled_from(Durability),
    exclusive=st.booleans(),
    user_data=st.none() | octets,
)
writers = st.builds(DataWriterEntity, topic_id=topic_ids) | st.builds(
    DataWriterEntity, topic_id=topic_ids, qos=qos_values, ownership_strength=st.none() | u32
)
readers = st.builds(DataReaderEntity, topic_id=topic_ids) | st.builds(
    DataReaderEntity,
    topic_id=topic_ids,
    qos=qos_values,
    timebasedfilter_msec=st.none() | u32,
    contentbased_filter=maybe_words,
)
groups = {"name": maybe_words, "partitions": partitions, "group_data": st.none() | octets}
services = {
    "service_name": words,
    "request_type": words,
    "reply_type": words,
    "request_topic": maybe_words,
    "reply_topic": maybe_words,
}
entities: st.SearchStrategy[Entity] = st.one_of(
    st.builds(ParticipantEntity, name=maybe_words, domain_reference=maybe_words),
    st.builds(TopicEntity, name=words, type_name=maybe_words, type_reference=maybe_words),
    st.builds(PublisherEntity, **groups),
    st.builds(SubscriberEntity, **groups),
    writers,
    readers,
    st.builds(RequesterEntity, **services),
    st.builds(ReplierEntity, **services),
)


@st.composite
def variants(draw: st.DrawFn) -> Variant:
    format_ = draw(st.sampled_from(Format))
    entity = draw(entities) if format_ is Format.BINARY else None
    text = None if entity else draw(words)
    kind = KIND_OF[type(entity)] if entity else draw(st.sampled_from(list(KIND_OF.values())))
    if kind is Kind.PARTICIPANT:
        return Variant(kind, format_, entity, text, domain=draw(st.integers(-0x8000, 0x7FFF)))
    parent = draw(st.integers(0, 0xFFF)) << 4 | PARENT_OF[kind]
    return Variant(kind, format_, entity, text, parent_id=parent)


# -- as recorded -----------------------------------------------------------------------------------

SERVICE = (
    "/add_two_ints",
    "example_interfaces::srv::dds_::AddTwoInts_Request_",
    "example_interfaces::srv::dds_::AddTwoInts_Response_",
    "rq/add_two_intsRequest",
    "rr/add_two_intsReply",
)


def expected(case: dict[str, Any]) -> Entity:
    """The value a recorded case describes, from its arguments alone."""
    args = case["args"]
    if "topic_id" in args:
        asked = args["qos"]
        qos = EndpointQos(
            reliable=asked["reliability"] == "reliable",
            keep_last=asked["history"] == "keep_last",
            depth=asked["depth"] or None,
            durability=Durability(asked["durability"]),
        )
        topic_id = args["topic_id"] << 4 | Kind.TOPIC
        if case["entity"] == "datawriter":
            return DataWriterEntity(topic_id, qos=qos)
        return DataReaderEntity(topic_id, qos=qos)
    values: dict[str, Entity] = {
        "participant": ParticipantEntity(args.get("name")),
        "topic": TopicEntity(args.get("topic", ""), args.get("type")),
        "publisher": PublisherEntity(),
        "subscriber": SubscriberEntity(),
        "requester": RequesterEntity(*SERVICE),
        "replier": ReplierEntity(*SERVICE),
    }
    return values[case["entity"]]


@pytest.mark.parametrize(
    "case", load("rmw/entities_bin.json")["cases"], ids=lambda case: f"{case['object_id']}-{case['entity']}"
)
def test_rmw_binary_entities_to_the_byte(case: dict[str, Any]) -> None:
    entity = expected(case)
    kind = Kind[case["entity"].upper()]
    payload = bytes.fromhex(case["create_payload_hex"])
    args = case["args"]
    variant = parse_variant_untrusted(payload, 4, len(payload), True)
    assert variant.entity == entity
    assert (variant.kind, variant.format, variant.text) == (kind, Format.BINARY, None)
    if kind is Kind.PARTICIPANT:
        assert (variant.domain, variant.parent_id) == (args["domain"], None)
    else:
        assert (variant.domain, variant.parent_id) == (None, args["parent"] << 4 | PARENT_OF[kind])

    blob = bytes.fromhex(case["binary_representation_hex"])
    assert parse_binary_untrusted(kind, blob, True) == entity
    zeroed = bytearray(payload)
    for pad in case["pad_offsets_in_payload"]:
        if pad < len(zeroed):
            zeroed[pad] = 0
    assert encode_variant(variant, 4) == bytes(zeroed[4:])


@pytest.mark.parametrize("case", load("rmw/entities_xml.json")["cases"], ids=lambda case: case["object_id"])
def test_rmw_texts_to_the_byte(case: dict[str, Any]) -> None:
    payload = bytes.fromhex(case["create_payload_hex"])
    variant = parse_variant_untrusted(payload, 4, len(payload), True)
    assert variant.kind is Kind[case["entity"].upper()]
    assert variant.format == case["representation_format"]
    assert variant.text == case["text"]
    assert variant.entity is None
    zeroed = bytearray(payload)
    for pad in case["pad_offsets_in_payload"]:
        zeroed[pad] = 0
    assert encode_variant(variant, 4) == bytes(zeroed[4:])


def recorded_creates() -> Iterator[tuple[str, bytes, dict[str, Any]]]:
    """Each CREATE of the recorded sessions: its name, its message, its annotation."""
    for path in sorted((VECTORS / "xrce").glob("*.json")):
        for number, packet in enumerate(json.loads(path.read_text())["packets"]):
            for submessage in packet.get("decoded", {}).get("submessages", ()):
                if submessage.get("name") == "CREATE" and packet["dir"] == "c>a":
                    name = f"{path.stem}-{number}-{submessage['offset']}"
                    yield name, bytes.fromhex(packet["hex"]), submessage


RECORDED = list(recorded_creates())


@pytest.mark.parametrize(("message", "submessage"), [r[1:] for r in RECORDED], ids=[r[0] for r in RECORDED])
def test_recorded_creates(message: bytes, submessage: dict[str, Any]) -> None:
    start = submessage["offset"] + 8
    end = submessage["offset"] + 4 + submessage["length"]
    little = bool(submessage["flags"] & 1)
    variant = parse_variant_untrusted(message, start, end, little)
    said = submessage["fields"]["object"]
    assert variant.kind.name == said["kind"]
    assert variant.format.name == said["representation"]
    assert variant.text == said.get("text")
    assert variant.domain == said.get("domain_id")
    parent = next((value for key, value in said.items() if key.endswith("_id") and key != "domain_id"), None)
    assert variant.parent_id == (parent and int(parent["raw"], 16))
    if "binary" in said:
        assert annotation(variant.entity) == said["binary"]
        # What we write for the value reads as the same value, at any place a submessage can stand.
        again = encode_variant(variant, start, little)
        assert parse_variant_untrusted(bytes(start) + again, start, start + len(again), little) == variant
        assert len(again) == end - start


def annotation(entity: Entity | None) -> dict[str, Any]:
    """An entity in the words the recordings are annotated with."""
    match entity:
        case ParticipantEntity():
            return {"domain_reference": entity.domain_reference, "qos_profile_reference": entity.name}
        case TopicEntity():
            names = {"topic_name": entity.name, "type_name": entity.type_name}
            return names | {"type_reference": entity.type_reference}
        case PublisherEntity() | SubscriberEntity():
            return {"name": entity.name, "qos": None}
        case RequesterEntity() | ReplierEntity():
            return {
                "service_name": entity.service_name,
                "request_type": entity.request_type,
                "reply_type": entity.reply_type,
                "request_topic_name": entity.request_topic,
                "reply_topic_name": entity.reply_topic,
            }
        case DataWriterEntity() | DataReaderEntity():
            assert entity.topic_id is not None
            assert entity.qos is not None
            durable = entity.qos.durability is Durability.TRANSIENT_LOCAL
            qos: dict[str, object] = {
                "qos_flags": entity.qos.reliable | entity.qos.keep_last << 1 | durable << 3,
                "history_depth": entity.qos.depth,
                "deadline_msec": entity.qos.deadline_ms,
                "lifespan_msec": entity.qos.lifespan_ms,
                "user_data": entity.qos.user_data,
            }
            if isinstance(entity, DataWriterEntity):
                qos["ownership_strength"] = entity.ownership_strength
            else:
                qos["timebasedfilter_msec"] = entity.timebasedfilter_msec
                qos["contentbased_filter"] = entity.contentbased_filter
            topic = {"raw": f"{entity.topic_id:04x}", "id": entity.topic_id >> 4, "kind": "TOPIC"}
            return {"topic_id": topic, "qos": qos}
        case None:
            raise AssertionError("a binary representation without an entity")


def test_a_representation_by_hand_in_both_endiannesses() -> None:
    qos = EndpointQos(
        reliable=False, depth=7, deadline_ms=0x01020304, lifespan_ms=5, user_data=b"ab", exclusive=True
    )
    little = (
        "0012 01 00 0600 01 00 0700 01 00 04030201 01 000000 05000000 01 000000 02000000 6162 01 00 09000000"
    )
    big = (
        "0012 01 00 0006 01 00 0007 01 00 01020304 01 000000 00000005 01 000000 00000002 6162 01 00 00000009"
    )
    entity = DataWriterEntity(0x0012, qos=qos, ownership_strength=9)
    for text, is_little in ((little, True), (big, False)):
        blob = bytes.fromhex(text)
        assert encode_binary(entity, is_little) == blob
        assert parse_binary_untrusted(Kind.DATAWRITER, blob, is_little) == entity


# -- round trips -----------------------------------------------------------------------------------


@given(entities, st.booleans())
def test_binary_round_trip(entity: Entity, little: bool) -> None:
    blob = encode_binary(entity, little)
    assert parse_binary_untrusted(KIND_OF[type(entity)], blob, little) == entity
    assert parse_binary_untrusted(KIND_OF[type(entity)], memoryview(bytearray(blob)), little) == entity


@given(variants(), st.booleans(), st.integers(0, 10), st.binary(max_size=3))
def test_variant_round_trip(variant: Variant, little: bool, words_before: int, padding: bytes) -> None:
    offset = 4 * words_before
    data = bytes(offset) + encode_variant(variant, offset, little) + padding
    assert parse_variant_untrusted(data, offset, len(data), little) == variant


@given(variants(), st.booleans())
def test_any_cut_is_told(variant: Variant, little: bool) -> None:
    data = encode_variant(variant, 0, little)
    for end in range(len(data)):
        with pytest.raises(InvalidRepresentation):
            parse_variant_untrusted(data, 0, end, little)
        with pytest.raises(InvalidRepresentation):
            parse_variant_untrusted(data[:end], 0, len(data), little)


@given(variants(), st.booleans())
def test_garbage_in_the_padding_changes_nothing(variant: Variant, little: bool) -> None:
    data = encode_variant(variant, 0, little)
    dirty = bytearray(data)
    dirty[2:4] = b"\xa5\x5a"
    assert parse_variant_untrusted(dirty, 0, len(dirty), little) == variant


# -- any bytes -------------------------------------------------------------------------------------


@given(st.binary(max_size=200), st.integers(0, 20), st.booleans())
def test_arbitrary_bytes_raise_one_type_only(data: bytes, offset: int, little: bool) -> None:
    for view in (data, memoryview(data)):
        try:
            variant = parse_variant_untrusted(view, offset, len(data), little)
        except InvalidRepresentation:
            continue
        assert variant.kind in Kind


@given(st.sampled_from(Kind), st.binary(max_size=120), st.booleans())
def test_arbitrary_blobs_raise_one_type_only(kind: Kind, blob: bytes, little: bool) -> None:
    try:
        entity = parse_binary_untrusted(kind, blob, little)
    except InvalidRepresentation:
        return
    assert KIND_OF[type(entity)] is kind


@given(entities, st.booleans(), st.randoms(use_true_random=False))
def test_damaged_blobs_raise_one_type_only(entity: Entity, little: bool, chance: random.Random) -> None:
    blob = bytearray(encode_binary(entity, little))
    for _ in range(1 + len(blob) // 8):
        blob[chance.randrange(len(blob))] = chance.randrange(256)
    try:
        again = parse_binary_untrusted(KIND_OF[type(entity)], blob, little)
    except InvalidRepresentation:
        return
    assert type(again) is type(entity)


@pytest.mark.parametrize(
    ("payload", "reason"),
    [
        ("09030000 00000000 0000", "object kind 0x09 is not known"),
        ("0e030000 00000000 0000", "object kind 0x0E is not known"),
        ("01000000 00000000 0000", "representation format 0x00 is not known"),
        ("01030000 ffffffff 0000", "binary representation: cut short, 4294967295 bytes needed, 2 there"),
        ("01030000 02000000 0200 0000", "domain reference: 2 is no boolean"),
        ("01020000 03000000 41ff00 00 0000", "representation: not UTF-8 (byte 1)"),
        ("01020000 03000000 410042 00 0000", "representation: a NUL in the middle of the text"),
        ("02030000 04000000 ffffffff 0011", "topic name: cut short, 4294967295 bytes needed, 0 there"),
        ("02030000 02000000 0000 0011", "topic name: cut short, 4 bytes needed, 2 there"),
        ("05030000 03000000 0012 01 0013", "qos flags: cut short, 2 bytes needed, 0 there"),
        (
            "03030000 0c000000 00 01 01 00 ffffffff 00000000 0011",
            "partitions: 4294967295 of them, at most 64 are taken",
        ),
        ("02030000 02000000", "binary representation: cut short, 2 bytes needed, 0 there"),
    ],
)
def test_what_is_wrong_is_said(payload: str, reason: str) -> None:
    data = bytes.fromhex(payload)
    with pytest.raises(InvalidRepresentation) as caught:
        parse_variant_untrusted(data, 0, len(data), True)
    assert str(caught.value) == reason


@pytest.mark.parametrize(
    ("limits", "entity", "reason"),
    [
        (Limits(string=4), ParticipantEntity("probe"), "participant name: 5 bytes, at most 4 are taken"),
        (
            Limits(partitions=1),
            PublisherEntity(partitions=("a", "b")),
            "partitions: 2 of them, at most 1 are taken",
        ),
        (Limits(octets=2), PublisherEntity(group_data=b"abc"), "group data: 3 bytes, at most 2 are taken"),
    ],
)
def test_limits(limits: Limits, entity: Entity, reason: str) -> None:
    blob = encode_binary(entity)
    assert parse_binary_untrusted(KIND_OF[type(entity)], blob, True) == entity
    with pytest.raises(InvalidRepresentation) as caught:
        parse_binary_untrusted(KIND_OF[type(entity)], blob, True, limits)
    assert str(caught.value) == reason


def test_a_long_text_is_refused() -> None:
    data = encode_variant(Variant(Kind.TOPIC, Format.XML, text="x" * 100, parent_id=0x0011))
    with pytest.raises(InvalidRepresentation, match="representation: 100 bytes, at most 99 are taken"):
        parse_variant_untrusted(data, 0, len(data), True, Limits(text=99))


def test_strings_as_other_clients_write_them() -> None:
    """Length 0 is the empty string, and the closing NUL may be missing."""
    assert parse_binary_untrusted(Kind.TOPIC, bytes.fromhex("00000000 00 00"), True) == TopicEntity("")
    assert parse_binary_untrusted(Kind.TOPIC, bytes.fromhex("02000000 4142 00 00"), True) == TopicEntity("AB")


def test_kind_bits_of_parents_and_topics_are_forced() -> None:
    data = bytes.fromhex("05030000 03000000 001f 00 009c")
    variant = parse_variant_untrusted(data, 0, len(data), True)
    assert variant.parent_id == 0x0093
    assert variant.entity == DataWriterEntity(topic_id=0x0012)
    assert DataWriterEntity(0x12).effective_qos is WRITER_DEFAULTS
    assert DataReaderEntity(0x12).effective_qos is READER_DEFAULTS


@pytest.mark.parametrize("kind", [Kind.TYPE, Kind.QOSPROFILE, Kind.APPLICATION])
def test_kinds_nothing_is_made_for(kind: Kind) -> None:
    text = encode_variant(Variant(kind, Format.REFERENCE, text="some"))
    assert parse_variant_untrusted(text, 0, len(text), True) == Variant(kind, Format.REFERENCE, text="some")
    binary = encode_variant(Variant(kind, Format.BINARY))
    assert parse_variant_untrusted(binary, 0, len(binary), True) == Variant(kind, Format.BINARY)
    with pytest.raises(InvalidRepresentation, match="no binary representation is known"):
        parse_binary_untrusted(kind, b"", True)


@pytest.mark.parametrize(
    ("entity", "reason"),
    [
        (DataWriterEntity(topic_name="T"), "binary cannot say topic_name"),
        (DataWriterEntity(), "an object id is needed"),
        (DataReaderEntity(0x12, qos=EndpointQos(partitions=("a",))), "binary cannot say partitions"),
        (DataReaderEntity(0x12, qos=EndpointQos(depth=70000)), "70000 does not fit 2 bytes"),
        (TopicEntity("T", with_key=True), "binary cannot say with_key"),
        (TopicEntity("T\0"), "a NUL cannot stand in a string"),
        (ParticipantEntity(domain=3), "binary cannot say domain"),
    ],
)
def test_what_cannot_be_written_is_told(entity: Entity, reason: str) -> None:
    with pytest.raises(ValueError, match=reason) as caught:
        encode_binary(entity)
    assert not isinstance(caught.value, InvalidRepresentation)


def test_a_variant_without_its_parts_is_told() -> None:
    with pytest.raises(ValueError, match="REFERENCE needs a text"):
        encode_variant(Variant(Kind.TOPIC, Format.REFERENCE, parent_id=1))
    with pytest.raises(ValueError, match="an object id is needed, not None"):
        encode_variant(Variant(Kind.TOPIC, Format.XML, text=""))


def test_service_topics_follow_from_the_name() -> None:
    assert RequesterEntity("svc", "Q", "P").request_topic_name == "svc_Request"
    assert ReplierEntity("svc", "Q", "P").reply_topic_name == "svc_Reply"
    assert ReplierEntity(*SERVICE).request_topic_name == "rq/add_two_intsRequest"
    assert RequesterEntity(*SERVICE).reply_topic_name == "rr/add_two_intsReply"


def test_kinds_and_formats_are_those_of_the_table() -> None:
    for kind in Kind:
        assert kind == getattr(constants, f"KIND_{kind.name}")
    assert (Format.REFERENCE, Format.XML, Format.BINARY) == (
        constants.BY_REFERENCE,
        constants.AS_XML,
        constants.IN_BINARY,
    )
