"""Quality of service: values, words, presets, and the table of what fits."""

import json
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.space import (
    PRESETS,
    Durability,
    History,
    Liveliness,
    Ownership,
    Qos,
    Reliability,
    Sample,
    identity_of,
    mismatches,
    split_identity,
)

PROFILES = json.loads((Path(__file__).parents[1] / "vectors/rmw/qos_profiles.json").read_text())["profiles"]

periods = st.integers(0, 2**63 - 1)
qoses = st.builds(
    Qos,
    reliability=st.sampled_from(Reliability),
    durability=st.sampled_from(Durability),
    history=st.sampled_from(History),
    depth=st.integers(0, 2**31 - 1),
    deadline=periods,
    lifespan=periods,
    liveliness=st.sampled_from(Liveliness),
    lease=periods,
    ownership=st.sampled_from(Ownership),
    strength=st.integers(0, 2**31 - 1),
)


@pytest.mark.parametrize("name", [name for name in PROFILES if name != "system_default"])
def test_presets_are_those_of_ros(name: str) -> None:
    profile, qos = PROFILES[name], Qos.preset(name)
    assert qos.reliability.name.lower() == profile["reliability"]
    assert qos.durability.name.lower() == profile["durability"]
    assert qos.history.name.lower() == profile["history"]
    assert qos.depth == profile["depth"]
    assert qos.lifespan == profile.get("lifespan_s", 0) * 10**9
    assert qos.deadline == 0


def test_every_profile_is_there() -> None:
    assert set(PROFILES) | {"dds_writer", "dds_reader"} == set(PRESETS)
    with pytest.raises(ValueError, match=r"unknown QoS profile 'fast' \(known: default, sensor_data"):
        Qos.preset("fast")


def test_numbers_are_those_of_the_wire() -> None:
    assert (Reliability.BEST_EFFORT, Reliability.RELIABLE) == (1, 2)
    assert [d.name for d in sorted(Durability)] == ["VOLATILE", "TRANSIENT_LOCAL", "TRANSIENT", "PERSISTENT"]
    assert (History.KEEP_LAST, History.KEEP_ALL) == (0, 1)


def test_depth_not_said_is_one() -> None:
    assert Qos(depth=0) == Qos(depth=1) == Qos()


@pytest.mark.parametrize(
    ("field", "value", "words"),
    [("depth", -1, "depth is -1"), ("depth", 2**31, "depth is"), ("deadline", -5, "deadline is -5 ns"),
     ("lifespan", -1, "lifespan is"), ("lease", -1, "lease is")],
)  # fmt: skip
def test_nonsense_is_refused(field: str, value: int, words: str) -> None:
    with pytest.raises(ValueError, match=words):
        Qos().replace(**{field: value})


@pytest.mark.parametrize(
    ("qos", "words"),
    [
        (Qos(), "reliable, volatile, keep last 1"),
        (
            Qos(Reliability.BEST_EFFORT, Durability.TRANSIENT_LOCAL, History.KEEP_ALL, deadline=100_000_000),
            "best effort, transient local, keep all, deadline 100 ms",
        ),
        (Qos(lifespan=1_500_000_000), "reliable, volatile, keep last 1, lifespan 1.5 s"),
        (Qos(lifespan=999), "reliable, volatile, keep last 1, lifespan 999 ns"),
        (
            Qos(liveliness=Liveliness.MANUAL_BY_TOPIC, ownership=Ownership.EXCLUSIVE, strength=3),
            "reliable, volatile, keep last 1, liveliness manual by topic infinite, exclusive, strength 3",
        ),
    ],
)
def test_in_words(qos: Qos, words: str) -> None:
    assert str(qos) == words


@pytest.mark.parametrize(
    ("offered", "wanted", "policies"),
    [
        (Qos(), Qos(), []),
        (Qos(Reliability.BEST_EFFORT), Qos(), ["reliability"]),
        (Qos(durability=Durability.TRANSIENT_LOCAL), Qos(durability=Durability.TRANSIENT), ["durability"]),
        (Qos(deadline=11), Qos(deadline=10), ["deadline"]),
        (Qos(deadline=10), Qos(deadline=10), []),
        (Qos(), Qos(deadline=10), ["deadline"]),
        (Qos(deadline=10), Qos(), []),
        (Qos(), Qos(liveliness=Liveliness.MANUAL_BY_PARTICIPANT), ["liveliness"]),
        (Qos(liveliness=Liveliness.MANUAL_BY_TOPIC), Qos(liveliness=Liveliness.AUTOMATIC), []),
        (Qos(lease=11), Qos(lease=10), ["lease"]),
        (Qos(ownership=Ownership.EXCLUSIVE), Qos(), ["ownership"]),
        (Qos(partitions=("a",)), Qos(partitions=("b",)), ["partition"]),
        (Qos(ownership=Ownership.EXCLUSIVE, strength=1), Qos(ownership=Ownership.EXCLUSIVE), []),
        (Qos(lifespan=1), Qos(lifespan=2), []),
        (Qos(Reliability.BEST_EFFORT), Qos(deadline=1), ["reliability", "deadline"]),
    ],
)
def test_requested_and_offered(offered: Qos, wanted: Qos, policies: list[str]) -> None:
    found = mismatches(offered, wanted)
    assert [m.policy for m in found] == policies
    for mismatch in found:
        assert mismatch.offered != mismatch.wanted
        assert mismatch.remedy


@given(qoses)
def test_everybody_fits_their_own_kind(qos: Qos) -> None:
    assert mismatches(qos, qos.replace()) == ()


@given(qoses, qoses, qoses)
def test_offering_more_never_hurts(a: Qos, b: Qos, wanted: Qos) -> None:
    """What satisfies everything `b` promises satisfies whoever is content with `b`."""
    if not mismatches(a, b) and not mismatches(b, wanted):
        assert mismatches(a, wanted) == ()


@given(st.binary(min_size=16, max_size=16), st.integers(0, 2**63 - 1))
def test_identities(gid: bytes, sequence: int) -> None:
    identity = identity_of(gid, sequence)
    assert len(identity) == 24
    assert split_identity(identity) == (gid, sequence)
    assert Sample(b"", 0, gid, sequence).identity == identity


def test_identity_on_the_wire() -> None:
    assert identity_of(bytes(16), 5 << 32 | 7)[16:] == b"\x05\0\0\0\x07\0\0\0"
    for size in (0, 23, 25):
        with pytest.raises(ValueError, match=f"24 bytes, this one has {size}"):
            split_identity(bytes(size))
