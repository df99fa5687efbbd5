"""CREATE payloads, byte for byte against recorded ones, and against the agent's own parser."""

import json
from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.client import Qos, Session
from muros.client.hello import hello
from muros.client.names import dds_type, resolve, topic_name
from muros.client.qos import profile
from muros.xrce import create, create_text
from muros.xrce.representation import (
    DataReaderEntity,
    DataWriterEntity,
    encode_variant,
    parse_variant_untrusted,
)
from tests.client.replay import Wire

VECTORS = Path(__file__).parent.parent / "vectors" / "rmw"
BINARY: list[dict[str, Any]] = json.loads((VECTORS / "entities_bin.json").read_text())["cases"]
TEXT: list[dict[str, Any]] = json.loads((VECTORS / "entities_xml.json").read_text())["cases"]
NAMES: dict[str, Any] = json.loads((VECTORS / "names.json").read_text())
PROFILES: dict[str, Any] = json.loads((VECTORS / "qos_profiles.json").read_text())["profiles"]
KINDS = {"participant": 1, "topic": 2, "publisher": 3, "subscriber": 4, "datawriter": 5, "datareader": 6}
KINDS |= {"requester": 7, "replier": 8}


def zeroed(case: dict[str, Any]) -> bytes:
    """The recorded payload behind its ids, with zeros as padding."""
    payload = bytearray.fromhex(case["create_payload_hex"])
    for offset in case["pad_offsets_in_payload"]:
        payload[offset] = 0
    return bytes(payload[4:])


def qos(arguments: dict[str, Any]) -> Qos:
    """The QoS of a recorded case."""
    return Qos(
        arguments["reliability"] == "reliable",
        arguments["depth"],
        arguments["durability"],
        arguments["history"] == "keep_all",
    )


@pytest.mark.parametrize("case", BINARY, ids=[f"{c['entity']}-{c['object_id']}" for c in BINARY])
def test_binary(case: dict[str, Any]) -> None:
    arguments, kind = case["args"], KINDS[case["entity"]]
    parent = (arguments.get("parent", 0) << 4) | {5: 3, 6: 4}.get(kind, 1)
    if kind == 1:
        made = create.of_participant(arguments["name"], arguments["domain"])
    elif kind == 2:
        made = create.of_topic(arguments["topic"], arguments["type"], parent)
    elif kind in (3, 4):
        made = create.of_group(kind, parent)
    elif kind in (5, 6):
        made = create.of_endpoint(kind, arguments["topic_id"] << 4 | 2, qos(arguments["qos"]).asked, parent)
    else:
        names = [
            arguments[n] for n in ("service", "request_type", "reply_type", "request_topic", "reply_topic")
        ]
        made = create.of_service(kind, names[0], names[1], names[2], names[3], names[4], parent)
    assert made == zeroed(case)


@pytest.mark.parametrize("case", TEXT, ids=[f"{c['entity']}-{c['representation_format']}" for c in TEXT])
def test_text(case: dict[str, Any]) -> None:
    kind = KINDS[case["entity"]]
    xml = (
        create_text.Xml()
        if case["representation_format"] == 2
        else create_text.Reference("participant_profile")
    )
    chatter, string = "rt/chatter", "std_msgs::msg::dds_::String_"
    parent = int(case["create_payload_hex"][-4:], 16)
    if kind == 1:
        made = xml.of_participant("talker", 0)
    elif kind == 2:
        made = xml.of_topic(chatter, string, parent)
    elif kind in (3, 4):
        made = xml.of_group(kind, parent)
    elif kind in (5, 6):
        made = xml.of_endpoint(kind, 2, Qos(kind == 5, keep_all=True).asked, parent, chatter, string)
    else:
        add = "example_interfaces::srv::dds_::AddTwoInts_"
        made = xml.of_service(
            kind,
            "/add_two_ints",
            f"{add}Request_",
            f"{add}Response_",
            "rq/add_two_intsRequest",
            "rr/add_two_intsReply",
            parent,
        )
    assert made == zeroed(case)


@given(
    st.booleans(), st.integers(0, 65535), st.booleans(), st.integers(0, 2**32 - 1), st.integers(0, 2**32 - 1)
)
def test_every_qos_is_read_back(
    reliable: bool, depth: int, keep_all: bool, deadline: int, lifespan: int
) -> None:
    asked = Qos(reliable, depth, "transient_local", keep_all, deadline, lifespan).asked
    for kind in (5, 6):
        made = create.of_endpoint(kind, 0x0012, asked, 0x0013)
        entity = parse_variant_untrusted(made, 0, len(made), True).entity
        assert isinstance(entity, DataWriterEntity | DataReaderEntity)
        assert entity.qos is not None
        assert entity.qos.reliable == reliable
        assert entity.qos.keep_last == (not keep_all)
        assert entity.qos.depth == (None if keep_all or not depth else depth)
        assert entity.qos.deadline_ms == (deadline or None)
        assert entity.qos.lifespan_ms == (lifespan or None)


@given(
    st.text(st.characters(exclude_characters="\0", exclude_categories=["Cs"]), max_size=40),
    st.integers(-1, 232),
)
def test_names_of_any_letters_are_read_back(name: str, domain: int) -> None:
    made = create.of_participant(name, domain)
    variant = parse_variant_untrusted(made, 0, len(made), True)
    assert encode_variant(variant) == made
    assert variant.domain == domain


def test_names_of_ros() -> None:
    for case in NAMES["topics"]:
        if "(raw)" not in case["ros"]:
            assert topic_name("rt", case["ros"]) == case["dds"]
    for case in NAMES["services"]:
        assert topic_name("rq", case["ros"], "Request") == case["request"]
        assert topic_name("rr", case["ros"], "Reply") == case["reply"]
    for case in NAMES["types"]:
        if "dds" in case:
            assert dds_type(case["ros"]) == case["dds"]
        elif "/srv/" in case["ros"]:
            assert dds_type(case["ros"], "_Request") == case["request"]
            assert dds_type(case["ros"], "_Response") == case["reply"]
    for case in NAMES["rcl_expansion"]:
        assert resolve(case["input"], case["ns"], case["node"]) == case["out"]


def test_names_that_cannot_be() -> None:
    longest = NAMES["limits"]["derived"]["topic_name_incl_slash_max"]
    assert len(topic_name("rt", "/" + "x" * (longest - 1))) == NAMES["limits"]["topic_full_max_chars"]
    with pytest.raises(ValueError, match=r"too long: 60 characters .* at most 59"):
        topic_name("rt", "/" + "x" * longest)
    with pytest.raises(ValueError, match="too long"):
        dds_type("p/msg/" + "X" * 100)
    with pytest.raises(ValueError, match="should read like"):
        dds_type("String")
    with pytest.raises(ValueError, match="needs a name"):
        resolve("", "/", "n")


def test_profiles_of_ros() -> None:
    ours = {"default": "default", "sensor_data": "sensor_data", "services": "services_default"}
    ours |= {"parameters": "parameters", "status": "action_status_default", "rosout": "rosout_default"}
    for name, theirs in ours.items():
        expected, made = PROFILES[theirs], profile(name)
        assert bool(made.flags & 1) == (expected["reliability"] == "reliable")
        assert bool(made.flags & 8) == (expected["durability"] == "transient_local")
        assert made.depth == expected["depth"]
        assert made.lifespan == expected.get("lifespan_s", 0) * 1000
    assert profile("default") is profile("default")
    session = Session(Wire(), 1)
    for name in ("default", "services", "sensor_data", "parameters"):
        assert session.writer(session.participant("n"), "rt/a", "a/msg/B", name).qos == profile(name).asked
    with pytest.raises(ValueError, match="no QoS profile 'fast'"):
        profile("fast")
    with pytest.raises(ValueError, match="durability is one of"):
        Qos(durability="for ever")


def session(session_id: int, key: int, liveliness: int) -> Session:
    """A session that asks for itself without naming the attempt."""
    return Session(Wire(), key, session_id, properties=False, hard_liveliness=liveliness)


def test_hello_with_hard_liveliness() -> None:
    recorded = json.loads((VECTORS / "hard_liveliness.json").read_text())
    theirs = bytearray.fromhex(recorded["create_client_datagram"])
    theirs[6] = len(theirs) - 8  # the reference says 16
    theirs[-3] = 0  # padding
    assert hello(session(0x81, 0xCAFEBABE, 3000)) == bytes(theirs)


def test_hello_with_key_in_the_header() -> None:
    assert hello(session(1, 0xAABBCCDD, 0)).hex() == (
        "00000000aabbccdd00011000585243450100010faabbccdd0100fc01"
    )
