"""Which writers and readers fit, and the reasons when they do not."""

from dataclasses import replace
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros._partitions import partitions_meet
from muros.rtps import (
    READER_QOS,
    WRITER_QOS,
    XCDR1,
    XCDR2,
    AccessScope,
    DestinationOrder,
    Durability,
    EndpointData,
    EndpointQos,
    Liveliness,
    Ownership,
    Policy,
    Reliability,
)
from muros.rtps._matching import mismatches

SECOND = 10**9


def writer(*, type_name: str = "T", keyed: bool = False, **changes: Any) -> EndpointData:
    guid = bytes(13) + (b"\0\1\2" if keyed else b"\0\1\3")
    return EndpointData(guid=guid, topic="t", type_name=type_name, qos=replace(WRITER_QOS, **changes))


def reader(*, type_name: str = "T", keyed: bool = False, **changes: Any) -> EndpointData:
    guid = bytes(13) + (b"\0\1\7" if keyed else b"\0\1\4")
    return EndpointData(guid=guid, topic="t", type_name=type_name, qos=replace(READER_QOS, **changes))


@pytest.mark.parametrize(
    ("offered", "wanted", "policy", "words"),
    [
        (
            {"reliability": Reliability.BEST_EFFORT},
            {"reliability": Reliability.RELIABLE},
            Policy.RELIABILITY,
            "the writer offers best effort, the reader wants reliable",
        ),
        (
            {"durability": Durability.VOLATILE},
            {"durability": Durability.TRANSIENT_LOCAL},
            Policy.DURABILITY,
            "the writer offers volatile, the reader wants transient local",
        ),
        (
            {"deadline": 2 * SECOND},
            {"deadline": SECOND},
            Policy.DEADLINE,
            "the writer offers a deadline of 2 s, the reader wants a deadline of 1 s",
        ),
        ({}, {"deadline": SECOND}, Policy.DEADLINE, "a deadline of no limit, the reader"),
        ({"latency_budget": 1}, {}, Policy.LATENCY_BUDGET, "latency budget"),
        ({}, {"liveliness": Liveliness.MANUAL_BY_TOPIC}, Policy.LIVELINESS, "automatic liveliness, the reader"),
        ({"lease": 3 * SECOND}, {"lease": SECOND}, Policy.LEASE, "lease of 3 s, the reader wants a"),
        ({"ownership": Ownership.EXCLUSIVE}, {}, Policy.OWNERSHIP, "exclusive ownership, the reader wants shared"),
        ({}, {"ownership": Ownership.EXCLUSIVE}, Policy.OWNERSHIP, "shared ownership, the reader wants exclusive"),
        ({}, {"destination_order": DestinationOrder.BY_SOURCE}, Policy.DESTINATION_ORDER, "by reception"),
        ({}, {"access_scope": AccessScope.TOPIC}, Policy.PRESENTATION, "instance access, the reader wants topic"),
        ({}, {"coherent": True}, Policy.PRESENTATION, "coherent"),
        ({}, {"ordered": True}, Policy.PRESENTATION, "ordered"),
        ({"partitions": ("a",)}, {}, Policy.PARTITION, "in partition 'a', the reader in the default partition"),
        ({"representations": (XCDR2, XCDR1)}, {}, Policy.REPRESENTATION, "sends XCDR2, the reader accepts XCDR1"),
        ({"type_name": "U"}, {}, Policy.TYPE, "the writer's type is U, the reader's type is T"),
        ({"keyed": True}, {}, Policy.KEY, "the writer has a topic with a key, the reader a topic without a key"),
    ],
)  # fmt: skip
def test_one_reason(offered: dict[str, Any], wanted: dict[str, Any], policy: Policy, words: str) -> None:
    (found,) = mismatches(writer(**offered), reader(**wanted))
    assert found.policy == policy
    assert words in found.text
    assert str(found) == found.text


@pytest.mark.parametrize(
    ("offered", "wanted"),
    [
        ({}, {}),
        ({}, {"reliability": Reliability.RELIABLE}),
        ({"durability": Durability.PERSISTENT}, {"durability": Durability.TRANSIENT_LOCAL}),
        ({"deadline": SECOND}, {"deadline": SECOND}),
        ({"deadline": SECOND}, {}),
        ({}, {"latency_budget": 5}),
        ({"liveliness": Liveliness.MANUAL_BY_TOPIC}, {"liveliness": Liveliness.MANUAL_BY_PARTICIPANT}),
        ({"lease": SECOND}, {"lease": 2 * SECOND}),
        ({"ownership": Ownership.EXCLUSIVE}, {"ownership": Ownership.EXCLUSIVE}),
        ({"access_scope": AccessScope.GROUP, "coherent": True, "ordered": True}, {"ordered": True}),
        ({"representations": (XCDR1,)}, {}),
        ({"representations": (XCDR2,)}, {"representations": (XCDR1, XCDR2)}),
        ({}, {"representations": (XCDR2, XCDR1)}),
        ({"keyed": True}, {"keyed": True}),
    ],
)
def test_good_enough(offered: dict[str, Any], wanted: dict[str, Any]) -> None:
    assert mismatches(writer(**offered), reader(**wanted)) == ()


def test_all_reasons_are_given() -> None:
    found = mismatches(
        writer(reliability=Reliability.BEST_EFFORT, type_name="U"),
        reader(reliability=Reliability.RELIABLE, durability=Durability.TRANSIENT_LOCAL),
    )
    assert [mismatch.policy for mismatch in found] == [Policy.TYPE, Policy.RELIABILITY, Policy.DURABILITY]


@pytest.mark.parametrize(
    ("one", "other", "meet"),
    [
        ((), (), True),
        ((), ("",), True),
        (("a", "b"), ("b", "c"), True),
        (("a",), ("b",), False),
        (("a*",), ("abc",), True),
        (("a?c",), ("abc",), True),
        (("[ab]c",), ("bc",), True),
        (("*",), (), True),
        (("a*",), ("a*",), False),
        (("a*", "x"), ("a*", "x"), True),
        (("A*",), ("abc",), False),
        (("*" * 300,), ("a",), False),
        (tuple(map(str, range(200))), tuple(map(str, range(199, 400))), False),  # too many to compare
    ],
)
def test_partitions(one: tuple[str, ...], other: tuple[str, ...], meet: bool) -> None:
    assert partitions_meet(one, other) is meet
    assert partitions_meet(other, one) is meet


QOS = st.builds(
    EndpointQos,
    reliability=st.sampled_from(Reliability),
    durability=st.sampled_from(Durability),
    deadline=st.integers(1, 3),
    latency_budget=st.integers(0, 2),
    liveliness=st.sampled_from(Liveliness),
    lease=st.integers(1, 3),
    ownership=st.sampled_from(Ownership),
    destination_order=st.sampled_from(DestinationOrder),
    access_scope=st.sampled_from(AccessScope),
    coherent=st.booleans(),
    ordered=st.booleans(),
)


@given(QOS)
def test_what_one_wants_is_what_it_offers(qos: EndpointQos) -> None:
    assert mismatches(replace(writer(), qos=qos), replace(reader(), qos=replace(qos))) == ()


@given(QOS, QOS, QOS)
def test_matching_is_transitive(offered: EndpointQos, between: EndpointQos, wanted: EndpointQos) -> None:
    """A relay whose wishes are met, and whose offers are its wishes, hides no mismatch."""
    first = mismatches(replace(writer(), qos=offered), replace(reader(), qos=between))
    second = mismatches(replace(writer(), qos=between), replace(reader(), qos=wanted))
    if not first and not second:
        assert mismatches(replace(writer(), qos=offered), replace(reader(), qos=wanted)) == ()
