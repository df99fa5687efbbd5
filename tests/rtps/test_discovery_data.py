"""What participants and endpoints say of themselves, ours and that of other implementations."""

import struct
from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps import _qos as q
from muros.rtps._constants import (
    BUILTIN_ENDPOINTS,
    ENTITYID_PARTICIPANT,
    ENTITYID_PARTICIPANT_MESSAGE_WRITER,
    ENTITYID_SEDP_PUBLICATIONS_WRITER,
    ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
    ENTITYID_SPDP_WRITER,
    VENDOR_CYCLONE,
    VENDOR_EPROSIMA,
    BuiltinEndpoint,
    Pid,
    StatusInfo,
)
from muros.rtps._discovery_data import (
    MAX_LOCATORS,
    Assertion,
    EndpointData,
    InvalidDiscoveryData,
    ParticipantData,
    departure,
    key_untrusted,
    user_values,
)
from muros.rtps._parameters import ParameterBuilder, parse_untrusted, related_identity, status_info
from muros.rtps._qos import EndpointQos
from muros.rtps._values import INFINITE, Locator, guid_of, udp4
from muros.rtps._wire import Data
from tests.rtps.vectors import LOSSES, PEERS, messages, samples

A = bytes(range(12))
SECOND = 10**9

texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
names = st.text(st.characters(codec="utf-8", exclude_characters="\0"), min_size=1, max_size=40)
durations = st.one_of(st.just(INFINITE), st.just(0), st.integers(0, 10**17))
longs = st.integers(-(2**31), 2**31 - 1)
ulongs = st.integers(0, 2**32 - 1)
addresses = st.builds(Locator, longs, ulongs, st.binary(min_size=16, max_size=16))
places = st.lists(addresses, max_size=3).map(tuple)
limits = st.builds(q.ResourceLimits, longs, longs, longs)
qualities = st.builds(
    EndpointQos,
    reliability=st.sampled_from(q.Reliability),
    max_blocking=durations,
    durability=st.sampled_from(q.Durability),
    durability_service=st.none()
    | st.builds(q.DurabilityService, durations, st.sampled_from(q.History), longs, limits),
    limits=st.none() | limits,
    deadline=durations,
    latency_budget=durations,
    lifespan=durations,
    liveliness=st.sampled_from(q.Liveliness),
    lease=durations,
    ownership=st.sampled_from(q.Ownership),
    strength=longs,
    partitions=st.lists(texts, max_size=3).map(tuple),
    time_based_filter=durations,
    destination_order=st.sampled_from(q.DestinationOrder),
    access_scope=st.sampled_from(q.AccessScope),
    coherent=st.booleans(),
    ordered=st.booleans(),
    transport_priority=longs,
    representations=st.lists(st.integers(-1, 3), max_size=3).map(tuple),
).flatmap(
    lambda qos: (
        st.just(qos) | st.builds(replace, st.just(qos), history=st.sampled_from(q.History), depth=longs)
    )
)
participants = st.builds(
    ParticipantData,
    prefix=st.binary(min_size=12, max_size=12),
    version=st.tuples(st.integers(0, 255), st.integers(0, 255)),
    vendor=st.binary(min_size=2, max_size=2),
    lease=durations,
    builtin_endpoints=ulongs.map(BuiltinEndpoint),
    metatraffic_unicast=places,
    metatraffic_multicast=places,
    default_unicast=places,
    default_multicast=places,
    name=texts,
    user_data=st.binary(max_size=30),
    properties=st.lists(st.tuples(texts, texts), max_size=3).map(tuple),
    domain=st.none() | ulongs,
    domain_tag=texts,
    expects_inline_qos=st.booleans(),
    manual_liveliness_count=ulongs,
)
endpoints = st.builds(
    EndpointData,
    guid=st.builds(
        lambda key, kind: key + bytes((kind,)),
        st.binary(min_size=15, max_size=15),
        st.sampled_from(b"\2\3\4\7\xc2\xc7"),
    ),
    participant=st.just(b"") | st.binary(min_size=16, max_size=16),
    topic=names,
    type_name=names,
    qos=qualities,
    user_data=st.binary(max_size=30),
    topic_data=st.binary(max_size=30),
    group_data=st.binary(max_size=30),
    unicast=places,
    multicast=places,
    expects_inline_qos=st.booleans(),
)


class TestOurs:
    """What is written is read again."""

    @given(participants)
    def test_participant(self, data: ParticipantData) -> None:
        assert ParticipantData.parse_untrusted(data.payload()) == data

    @given(endpoints)
    def test_endpoint(self, data: EndpointData) -> None:
        assert EndpointData.parse_untrusted(data.payload()) == data

    def test_the_least_that_can_be_said(self) -> None:
        data = ParticipantData.parse_untrusted(
            _list((Pid.PARTICIPANT_GUID, guid_of(A, ENTITYID_PARTICIPANT)))
        )
        assert data == ParticipantData(prefix=A, builtin_endpoints=BuiltinEndpoint(0))
        assert data.lease == 100 * SECOND
        assert data.guid == A + b"\0\0\1\xc1"

    @pytest.mark.parametrize(("kind", "qos"), [(b"\3", q.WRITER_QOS), (b"\4", q.READER_QOS)])
    def test_the_defaults_of_writers_and_readers(self, kind: bytes, qos: EndpointQos) -> None:
        guid = A + b"\0\0\1" + kind
        data = EndpointData.parse_untrusted(
            _list((Pid.ENDPOINT_GUID, guid), (Pid.TOPIC_NAME, _text("t")), (Pid.TYPE_NAME, _text("T")))
        )
        assert data == EndpointData(guid=guid, topic="t", type_name="T", qos=qos)
        assert data.participant == A + b"\0\0\1\xc1"
        assert data.is_writer == data.qos.reliable == (kind == b"\3")

    def test_no_type_information(self) -> None:
        payload = EndpointData(guid=A + b"\0\0\1\3", topic="t", type_name="T", qos=q.WRITER_QOS).payload()
        found, end = parse_untrusted(payload, 4)
        assert end == len(payload)
        assert Pid.TYPE_INFORMATION not in found
        assert found[Pid.PARTICIPANT_GUID] == [A + b"\0\0\1\xc1"]
        assert found[Pid.KEY_HASH] == [A + b"\0\0\1\3"]

    @given(st.binary(min_size=12, max_size=12), st.booleans())
    def test_assertion(self, prefix: bytes, manual: bool) -> None:
        assert Assertion.parse_untrusted(Assertion(prefix, manual).payload()) == (prefix, manual)

    @pytest.mark.parametrize("guid", [A + b"\0\0\1\xc1", A + b"\0\0\1\3", A + b"\0\0\1\4"])
    def test_keys(self, guid: bytes) -> None:
        hashed, _ = parse_untrusted(departure(guid))
        assert status_info(hashed) == StatusInfo.DISPOSED | StatusInfo.UNREGISTERED
        assert key_untrusted(b"", hashed) == guid
        pid = Pid.PARTICIPANT_GUID if guid.endswith(b"\xc1") else Pid.ENDPOINT_GUID
        assert key_untrusted(_list((pid, guid)), None) == guid

    def test_the_key_of_an_endpoint_that_names_its_participant_too(self) -> None:
        guid = A + b"\0\0\1\3"
        assert (
            key_untrusted(_list((Pid.PARTICIPANT_GUID, A + b"\0\0\1\xc1"), (Pid.ENDPOINT_GUID, guid)), None)
            == guid
        )


class TestRefused:
    """Foreign bytes: data, or the one exception."""

    @pytest.mark.parametrize(
        ("payload", "why"),
        [
            (b"", "has 0 bytes"),
            (bytes(70000), "has 70000 bytes"),
            (b"\0\1\0\0\1\0\0\0", "representation 0x0001"),
            (b"\0\3\0\0", "has no end"),
            (b"\0\3\0\0\1\0\0\0", "no GUID"),
        ],
    )
    def test_either(self, payload: bytes, why: str) -> None:
        for parse in (ParticipantData.parse_untrusted, EndpointData.parse_untrusted):
            with pytest.raises(InvalidDiscoveryData, match=why):
                parse(payload)

    def test_participant(self) -> None:
        with pytest.raises(
            InvalidDiscoveryData, match="a participant is refused: the GUID has entity id 0x00000103"
        ):
            ParticipantData.parse_untrusted(_list((Pid.PARTICIPANT_GUID, A + b"\0\0\1\3")))

    @pytest.mark.parametrize(
        ("changed", "why"),
        [
            ({Pid.ENDPOINT_GUID: A + b"\0\0\1\xc1"}, "neither a writer's nor a reader's"),
            ({Pid.TOPIC_NAME: b""}, "needs 4"),
            ({Pid.TOPIC_NAME: struct.pack("<I", 0)}, "no topic name"),
            ({Pid.TYPE_NAME: b"\xff\xff\xff\xff"}, "ends within a string"),
            ({Pid.TYPE_NAME: struct.pack("<I", 2000) + b"x" * 2000}, "type name has 2000 characters"),
            ({Pid.RELIABILITY: struct.pack("<III", 7, 0, 0)}, "7 is no kind of reliability"),
            ({Pid.DURABILITY: struct.pack("<I", 4)}, "4 is no kind of durability"),
            ({Pid.LIVELINESS: struct.pack("<II", 0, 0)}, "has 8 bytes, it needs 12"),
            ({Pid.HISTORY: struct.pack("<II", 2, 0)}, "2 is no kind of history"),
            ({Pid.DATA_REPRESENTATION: struct.pack("<I", 9) + bytes(20)}, "9 data representations"),
            ({Pid.DATA_REPRESENTATION: struct.pack("<I", 3) + bytes(4)}, "3 data representations"),
            ({Pid.PARTITION: struct.pack("<I", 2**32 - 1)}, "ends within a string"),
        ],
    )
    def test_endpoint(self, changed: dict[int, bytes], why: str) -> None:
        parameters = {
            int(Pid.ENDPOINT_GUID): A + b"\0\0\1\3",
            int(Pid.TOPIC_NAME): _text("t"),
            int(Pid.TYPE_NAME): _text("T"),
        } | changed
        with pytest.raises(InvalidDiscoveryData, match=why):
            EndpointData.parse_untrusted(_list(*parameters.items()))

    def test_key_and_assertion(self) -> None:
        for payload in (b"", b"\0\3\0\0\1\0\0\0", b"\0\3"):
            with pytest.raises(InvalidDiscoveryData):
                key_untrusted(payload, None)
        for payload in (b"", bytes(19), b"\0\3" + bytes(22)):
            with pytest.raises(InvalidDiscoveryData):
                Assertion.parse_untrusted(payload)
        assert Assertion.parse_untrusted(b"\0\1\0\0" + A + b"\0\0\0\0" + bytes(4)) is None

    def test_not_more_locators_than_we_would_send_to(self) -> None:
        many = [
            (Pid.DEFAULT_UNICAST_LOCATOR, struct.pack("<iI16s", *udp4("127.0.0.1", port)))
            for port in range(99)
        ]
        guid = (Pid.PARTICIPANT_GUID, A + b"\0\0\1\xc1")
        assert len(ParticipantData.parse_untrusted(_list(guid, *many)).default_unicast) == MAX_LOCATORS

    @given(
        st.data(),
        st.lists(st.tuples(st.integers(0, 600), st.integers(0, 255)), max_size=8),
        st.integers(0, 600),
    )
    def test_foreign_bytes(self, draw: st.DataObject, edits: list[tuple[int, int]], end: int) -> None:
        name = draw.draw(st.sampled_from(PEERS))
        writers = (
            ENTITYID_SPDP_WRITER,
            ENTITYID_SEDP_PUBLICATIONS_WRITER,
            ENTITYID_SEDP_SUBSCRIPTIONS_WRITER,
        )
        sample = draw.draw(st.sampled_from(samples(name, draw.draw(st.sampled_from(writers)))))
        payload = bytearray(sample.payload)
        for position, value in edits:
            if position < len(payload):
                payload[position] = value
        for parse in (ParticipantData.parse_untrusted, EndpointData.parse_untrusted):
            for data in (bytes(payload), bytes(payload[:end])):
                try:
                    parsed = parse(data)
                except InvalidDiscoveryData:
                    continue
                assert isinstance(parsed, ParticipantData | EndpointData)


class TestUserValues:
    """The pairs that ROS 2 puts into user data."""

    @pytest.mark.parametrize(
        ("data", "values"),
        [
            (b"enclave=/;", {"enclave": "/"}),
            (b"enclave=/robot;\0", {"enclave": "/robot"}),
            (b"typehash=RIHS01_00;x=;", {"typehash": "RIHS01_00", "x": ""}),
            (b"", {}),
            (b"nothing;=;=x;;", {}),
            (b"a=b=c;\xff=1", {"a": "b=c", "\\xff": "1"}),
        ],
    )
    def test_values(self, data: bytes, values: dict[str, str]) -> None:
        assert user_values(data) == values


# --- Other implementations ---


def participants_of(name: str) -> dict[bytes, ParticipantData]:
    """The participants that the datagrams of one file announce."""
    found = [
        ParticipantData.parse_untrusted(sample.payload)
        for sample in samples(name, ENTITYID_SPDP_WRITER)
        if not status_info(sample.inline_qos)
    ]
    return {data.prefix: data for data in found}


def endpoints_of(name: str, writer: int) -> dict[str, EndpointData]:
    """The writers or readers that they announce, by topic; of the parameter services none."""
    found = [
        EndpointData.parse_untrusted(sample.payload)
        for sample in samples(name, writer)
        if not status_info(sample.inline_qos)
    ]
    return {data.topic: data for data in found}


@pytest.mark.parametrize("name", [*PEERS, *LOSSES])
def test_every_datagram_is_understood(name: str) -> None:
    for message in messages(name):
        assert message.trouble == ""
        assert message.submessages
        assert message.vendor == (VENDOR_CYCLONE if "cyclone" in name else VENDOR_EPROSIMA)
        assert message.version == ((2, 5) if "cyclone" in name else (2, 2))


@pytest.mark.parametrize("name", PEERS)
def test_participants(name: str) -> None:
    found = participants_of(name)
    assert len(found) == 2
    for prefix, data in found.items():
        assert prefix == data.prefix
        assert user_values(data.user_data) == {"enclave": "/"}
        assert data.builtin_endpoints & BUILTIN_ENDPOINTS == BUILTIN_ENDPOINTS
        assert data.vendor == (VENDOR_CYCLONE if "cyclone" in name else VENDOR_EPROSIMA)
        assert data.lease == (10 if "cyclone" in name else 20) * SECOND
        assert data.domain == (None if name == "fastdds_2_14" else 77)
        assert [locator.host for locator in data.metatraffic_unicast + data.default_unicast] == [
            "127.0.0.1"
        ] * 2
        assert data.metatraffic_multicast == ((udp4("239.255.0.1", 26650),) if "cyclone" in name else ())
    if "cyclone" in name:
        assert {data.name for data in found.values()} == {"peer a", "peer b"}
        assert {dict(data.properties)["__ProcessName"] for data in found.values()} == {"python"}
    else:
        assert {data.name for data in found.values()} == {"/"}
        assert {port.port for data in found.values() for port in data.default_unicast} == {26661, 26663}


@pytest.mark.parametrize("name", PEERS)
@pytest.mark.parametrize("writer", [ENTITYID_SEDP_PUBLICATIONS_WRITER, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER])
def test_theirs_written_by_us_says_the_same(name: str, writer: int) -> None:
    for data in participants_of(name).values():
        assert ParticipantData.parse_untrusted(data.payload()) == data
    for endpoint in endpoints_of(name, writer).values():
        assert EndpointData.parse_untrusted(endpoint.payload()) == endpoint
        assert endpoint.guid[:12] == endpoint.participant[:12]
        assert endpoint.participant[:12] in participants_of(name)
        assert endpoint.is_writer == (writer == ENTITYID_SEDP_PUBLICATIONS_WRITER)


_RELIABLE: dict[str, Any] = {"representations": (q.XCDR1,)}
_FASTDDS = {
    "rt/chatter": EndpointQos(**_RELIABLE),
    "rt/robot/left/scan": EndpointQos(reliability=q.Reliability.BEST_EFFORT, **_RELIABLE),
    "rt/map": EndpointQos(durability=q.Durability.TRANSIENT_LOCAL, **_RELIABLE),
}


@pytest.mark.parametrize("name", ["fastdds_2_14", "fastdds_3_2"])
def test_endpoints_of_ros_2(name: str) -> None:
    writers = endpoints_of(name, ENTITYID_SEDP_PUBLICATIONS_WRITER)
    readers = endpoints_of(name, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER)

    def said(endpoint: EndpointData) -> EndpointQos:
        # Readers of Fast DDS 3 leave the durability service out, the others send its default.
        assert endpoint.qos.durability_service in (None, q.DurabilityService())
        return replace(endpoint.qos, durability_service=None)

    for topic, qos in _FASTDDS.items():
        for endpoint in (writers[topic], readers[topic]):
            assert said(endpoint) == qos
            assert endpoint.type_name == "std_msgs::msg::dds_::String_"
            assert user_values(endpoint.user_data)["typehash"].startswith("RIHS01_df668c740482bbd4")
    assert said(writers["rt/full"]) == EndpointQos(
        deadline=5 * SECOND // 2,
        lifespan=10 * SECOND,
        liveliness=q.Liveliness.MANUAL_BY_TOPIC,
        lease=3 * SECOND,
        **_RELIABLE,
    )
    assert said(readers["rt/full"]) == EndpointQos(deadline=4 * SECOND, lease=5 * SECOND, **_RELIABLE)
    assert writers["rr/resetReply"].type_name == "std_srvs::srv::dds_::Trigger_Response_"
    assert readers["rq/resetRequest"].type_name == "std_srvs::srv::dds_::Trigger_Request_"


def test_endpoints_of_cyclone() -> None:
    writers = endpoints_of("cyclone_11", ENTITYID_SEDP_PUBLICATIONS_WRITER)
    readers = endpoints_of("cyclone_11", ENTITYID_SEDP_SUBSCRIPTIONS_WRITER)
    assert list(writers) == list(readers) == ["rt/chatter", "keyed", "rt/scan"]
    assert writers["rt/chatter"].qos == EndpointQos(history=q.History.KEEP_LAST, depth=10)
    assert user_values(writers["rt/chatter"].user_data)["typehash"].startswith("RIHS01_df668c740482bbd4")
    assert readers["rt/scan"].qos == replace(q.READER_QOS, max_blocking=0, representations=(q.XCDR1, q.XCDR2))
    both: dict[str, Any] = {
        "durability": q.Durability.TRANSIENT_LOCAL,
        "history": q.History.KEEP_ALL,
        "depth": 0,
        "limits": q.ResourceLimits(100, 10, 10),
        "deadline": 5 * SECOND // 2,
        "latency_budget": SECOND // 50,
        "liveliness": q.Liveliness.MANUAL_BY_TOPIC,
        "lease": 3 * SECOND,
        "ownership": q.Ownership.EXCLUSIVE,
        "partitions": ("left", "r*"),
        "destination_order": q.DestinationOrder.BY_SOURCE,
        "access_scope": q.AccessScope.TOPIC,
        "coherent": True,
        "ordered": True,
    }
    assert writers["keyed"].qos == EndpointQos(
        strength=7,
        lifespan=10 * SECOND,
        transport_priority=3,
        durability_service=q.DurabilityService(
            5 * SECOND, q.History.KEEP_LAST, 10, q.ResourceLimits(100, 10, 10)
        ),
        **both,
    )
    assert readers["keyed"].qos == EndpointQos(
        time_based_filter=SECOND // 10, representations=(q.XCDR1, q.XCDR2), **both
    )
    assert writers["keyed"].group_data == readers["keyed"].group_data == b"group data"


@pytest.mark.parametrize("name", PEERS)
def test_who_leaves(name: str) -> None:
    """Fast DDS says it by a key hash, Cyclone by a key; both are understood."""
    left = [
        key_untrusted(sample.payload, sample.inline_qos)
        for writer in (ENTITYID_SPDP_WRITER, ENTITYID_SEDP_PUBLICATIONS_WRITER)
        for sample in samples(name, writer)
        if status_info(sample.inline_qos) & StatusInfo.DISPOSED
    ]
    known = [data.guid for data in participants_of(name).values()]
    known += [data.guid for data in endpoints_of(name, ENTITYID_SEDP_PUBLICATIONS_WRITER).values()]
    assert set(left) & set(known)


def test_assertions_of_cyclone() -> None:
    found = [
        Assertion.parse_untrusted(sample.payload)
        for sample in samples("cyclone_11", ENTITYID_PARTICIPANT_MESSAGE_WRITER)
        if not status_info(sample.inline_qos)
    ]
    assert dict.fromkeys(participants_of("cyclone_11"), False).items() <= {*map(tuple, filter(None, found))}


@pytest.mark.parametrize("name", ["fastdds_2_14", "fastdds_3_2"])
def test_replies_of_ros_2_say_what_they_answer(name: str) -> None:
    (client,) = [
        data.guid
        for data in endpoints_of(name, ENTITYID_SEDP_SUBSCRIPTIONS_WRITER).values()
        if data.topic == "rr/resetReply"
    ]
    related = [
        related_identity(event.inline_qos)
        for message in messages(name)
        for event in message.submessages
        if isinstance(event, Data)
    ]
    # The request names the reader that waits, with a sequence number that means "unknown"; the reply the request.
    assert [identity for identity in related if identity] == [
        client + struct.pack("<iI", -1, 0),
        client + struct.pack("<iI", 0, 1),
    ]


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text) + 1) + text.encode() + b"\0"


def _list(*parameters: tuple[int, bytes]) -> bytes:
    """A payload with these parameters."""
    builder = ParameterBuilder()
    for pid, value in parameters:
        builder.add(pid, value)
    return b"\0\3\0\0" + builder.build()
