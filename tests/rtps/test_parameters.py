"""Parameter lists and inline QoS."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps._constants import Pid, StatusInfo
from muros.rtps._parameters import (
    MAX_PARAMETERS,
    InvalidParameters,
    ParameterBuilder,
    Parameters,
    inline_qos,
    key_hash,
    parse_untrusted,
    related_identity,
    status_info,
)
from muros.rtps._values import INFINITE, Locator

orders = st.sampled_from(["<", ">"])
texts = st.text(st.characters(codec="utf-8", exclude_characters="\0"), max_size=20)
durations = st.one_of(st.just(INFINITE), st.integers(0, 10**18))
locators = st.builds(
    Locator, st.integers(-(2**31), 2**31 - 1), st.integers(0, 2**32 - 1), st.binary(min_size=16, max_size=16)
)
END = b"\1\0\0\0"


def read(builder: ParameterBuilder) -> Parameters:
    """What was built, with something before and behind it."""
    data = builder.build()
    parameters, end = parse_untrusted(b"before" + data + b"behind", 6, order=builder.order)
    assert end == 6 + len(data)
    return parameters


@given(orders, st.integers(0, 2**32 - 1), st.booleans(), durations, st.binary(min_size=16, max_size=16))
def test_numbers(order: str, number: int, flag: bool, ns: int, guid: bytes) -> None:
    builder = ParameterBuilder(order)
    builder.uint32(10, number)
    builder.flag(11, flag)
    builder.duration(12, ns)
    builder.add(13, guid)
    builder.pack(14, "Hbb", 7, -1, 1)
    found = read(builder)
    assert (found.uint32(10), found.flag(11), found.duration(12), found.guid(13)) == (number, flag, ns, guid)
    assert found.unpack(14, "Hbb") == (7, -1, 1)
    assert (found.uint32(99), found.flag(99), found.duration(99), found.guid(99)) == (None, False, None, None)


@given(orders, texts, st.lists(texts, max_size=5), st.lists(st.tuples(texts, texts), max_size=4))
def test_texts(order: str, text: str, several: list[str], pairs: list[tuple[str, str]]) -> None:
    builder = ParameterBuilder(order)
    builder.text(10, text)
    builder.texts(11, several)
    builder.properties(pairs)
    found = read(builder)
    assert found.text(10) == text
    assert found.texts(11) == tuple(several)
    assert found.properties() == tuple(pairs)
    assert (found.text(99), found.texts(99), found.properties(99)) == (None, (), ())


@given(orders, st.binary(max_size=50), st.lists(locators, max_size=5))
def test_octets_and_locators(order: str, octets: bytes, where: list[Locator]) -> None:
    builder = ParameterBuilder(order)
    builder.octets(10, octets)
    builder.locators(11, where)
    found = read(builder)
    assert found.octets(10) == octets
    assert found.locators(11) == tuple(where)
    assert (found.octets(99), found.locators(99)) == (b"", ())


def test_padding_and_unknown_ones() -> None:
    found, end = parse_untrusted(b"\0\0\4\0pad \0\x80\0\0\x34\x12\4\0abcd\0\0\0\0\x34\x12\4\0efgh" + END)
    assert found == {0x8000: [b""], 0x1234: [b"abcd", b"efgh"]}
    assert end == 36


def test_text_of_other_encodings_and_with_an_early_end() -> None:
    builder = ParameterBuilder()
    builder.octets(10, b"caf\xe9\0more\0")
    builder.octets(11, b"")
    found = read(builder)
    assert found.text(10) == "caf\\xe9"
    assert found.text(11) == ""


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"", "has no end"),
        (b"\1\0\0", "has no end"),
        (b"\5\0\4\0abcd", "has no end"),
        (b"\5\0\4\0abc", "impossible length of 4"),
        (b"\5\0\3\0abc" + END, "impossible length of 3"),
        (b"\5\0\xff\xff" + END, "impossible length of 65535"),
        (b"\0\0\0\0" * MAX_PARAMETERS + END, "more than 1024"),
    ],
)
def test_no_list(data: bytes, why: str) -> None:
    with pytest.raises(InvalidParameters, match=why):
        parse_untrusted(data)


def test_the_end_is_not_passed() -> None:
    """The bytes behind `end` may look like a list that goes on."""
    with pytest.raises(InvalidParameters, match="has no end"):
        parse_untrusted(b"\5\0\4\0abcd" + END, 0, 8)
    with pytest.raises(InvalidParameters, match="impossible length"):
        parse_untrusted(b"\5\0\4\0abcd" + END, 0, 6)


def test_values_that_are_too_short() -> None:
    huge = struct.pack("<I", 2**32 - 1)
    found = Parameters()
    found[10] = [huge]
    found[11] = [b"\0\0"]
    for decode in (found.text, found.texts, found.octets, found.properties, found.guid, found.duration):
        for pid in (10, 11):
            with pytest.raises(InvalidParameters, match=r"ends within|needs"):
                decode(pid)
    with pytest.raises(InvalidParameters, match="it needs 4"):
        found.uint32(11)
    with pytest.raises(InvalidParameters, match="a locator has 4 bytes"):
        found.locators(10)


def test_a_value_beyond_its_room() -> None:
    with pytest.raises(ValueError, match="room for 65532"):
        ParameterBuilder().octets(10, bytes(65530))


@given(st.binary(max_size=100), orders)
def test_foreign_bytes(data: bytes, order: str) -> None:
    """A list, or the one exception; the same of every value in it."""
    try:
        found, end = parse_untrusted(data, order=order)
    except InvalidParameters:
        return
    assert end <= len(data)
    for pid in found:
        for decode in (
            found.text,
            found.texts,
            found.octets,
            found.properties,
            found.locators,
            found.duration,
        ):
            try:
                decode(pid)
            except InvalidParameters:
                continue


# --- Inline QoS ---

IDENTITY = bytes(range(16)) + struct.pack("<iI", 1, 2)


def test_inline_qos() -> None:
    assert inline_qos() == b""
    data = inline_qos(related=IDENTITY, key_hash=bytes(range(16)), status=StatusInfo.DISPOSED)
    found, _ = parse_untrusted(data)
    assert list(found) == [Pid.RELATED_SAMPLE_IDENTITY, 0x800F, Pid.KEY_HASH, Pid.STATUS_INFO]
    assert found[Pid.STATUS_INFO] == [b"\0\0\0\1"]
    assert related_identity(found) == IDENTITY
    assert key_hash(found) == bytes(range(16))
    assert status_info(found) == StatusInfo.DISPOSED


@pytest.mark.parametrize("pid", [0x0083, 0x800F])
@pytest.mark.parametrize("order", ["<", ">"])
def test_related_identity_of_either_kind_and_order(pid: int, order: str) -> None:
    builder = ParameterBuilder(order)
    builder.add(pid, IDENTITY[:16] + struct.pack(order + "iI", 1, 2))
    assert related_identity(read(builder)) == IDENTITY


def test_nothing_said() -> None:
    for found in (None, Parameters()):
        assert related_identity(found) is None
        assert key_hash(found) is None
        assert status_info(found) == 0


def test_too_short() -> None:
    found = Parameters()
    for pid, decode in ((0x0083, related_identity), (0x70, key_hash), (0x71, status_info)):
        found[pid] = [b"\0\0"]
        with pytest.raises(InvalidParameters, match="has 2 bytes"):
            decode(found)
    with pytest.raises(ValueError, match="24 bytes"):
        inline_qos(related=b"short")
