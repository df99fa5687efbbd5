"""Messages: what is built is parsed again, in either byte order; foreign bytes do no harm."""

import struct
from collections.abc import Iterable
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from muros.rtps import _wire as wire
from muros.rtps._constants import StatusInfo
from muros.rtps._parameters import inline_qos, status_info
from muros.rtps._values import INFINITE, Locator, duration_from_wire, duration_to_wire, udp4

A = bytes(range(12))
B = bytes(range(100, 112))
TIME = 1_700_000_000_123_456_789

entities = st.integers(0, 2**32 - 1)
sequences = st.integers(1, 2**63 - 1)
counts = st.integers(0, 2**32 - 1)


def parse(*submessages: bytes) -> list[wire.Event]:
    """The events of a message of A that has nothing wrong."""
    message = wire.parse_untrusted(wire.message(A, *submessages))
    assert message.trouble == ""
    assert (message.prefix, message.vendor, message.version) == (A, b"\0\0", (2, 3))
    return message.submessages


def trouble(*submessages: bytes) -> tuple[int, str]:
    """How many events come before the trouble, and what it is."""
    message = wire.parse_untrusted(wire.message(A, *submessages))
    return len(message.submessages), message.trouble


def sub(kind: int, flags: int, body: bytes) -> bytes:
    """A submessage by hand, in the byte order that the flags say."""
    return struct.pack(("<" if flags & 1 else ">") + "BBH", kind, flags, len(body)) + body


class TestBuilt:
    """What the builders make is what the parser reads."""

    @given(entities, entities, sequences, st.binary(max_size=300), st.booleans(), st.booleans())
    def test_data(
        self, reader: int, writer: int, sequence: int, payload: bytes, key: bool, disposed: bool
    ) -> None:
        qos = inline_qos(status=StatusInfo.DISPOSED) if disposed else b""
        (event,) = parse(wire.data(reader, writer, sequence, payload, inline_qos=qos, key=key))
        assert isinstance(event, wire.Data)
        assert event[:6] == (A, None, None, reader, writer, sequence)
        assert event.payload == payload + bytes(-len(payload) % 4)
        assert event.key == (key and payload != b"")
        assert status_info(event.inline_qos) == (StatusInfo.DISPOSED if disposed else 0)

    @given(st.data(), sequences, st.integers(1, 0xFFFF), st.integers(1, 2**31), st.booleans())
    def test_data_frag(
        self, draw: st.DataObject, sequence: int, fragment_size: int, sample_size: int, key: bool
    ) -> None:
        total = -(-sample_size // fragment_size)
        first = draw.draw(st.integers(1, total))
        count = draw.draw(st.integers(1, max(1, min(60000 // fragment_size, total - first + 1))))
        size = min((first - 1 + count) * fragment_size, sample_size) - (first - 1) * fragment_size
        if size > 65000:
            return
        built = wire.data_frag(1, 2, sequence, first, count, fragment_size, sample_size, b"x" * size, key=key)
        assert parse(built) == [
            wire.DataFrag(
                A,
                None,
                None,
                1,
                2,
                sequence,
                first,
                count,
                fragment_size,
                sample_size,
                b"x" * size,
                None,
                key,
            )
        ]

    def test_data_frag_with_inline_qos(self) -> None:
        built = wire.data_frag(1, 2, 3, 1, 1, 8, 8, b"fragment", inline_qos=inline_qos(key_hash=bytes(16)))
        (event,) = parse(built)
        assert isinstance(event, wire.DataFrag)
        assert event.inline_qos == {0x70: [bytes(16)]}
        assert event.payload == b"fragment"

    @given(entities, entities, sequences, st.integers(-1, 1000), counts, st.booleans(), st.booleans())
    def test_heartbeat(
        self, reader: int, writer: int, first: int, more: int, count: int, final: bool, alive: bool
    ) -> None:
        last = min(first + more, 2**63 - 1)
        built = wire.heartbeat(reader, writer, first, last, count, final=final, liveliness=alive)
        assert parse(built) == [wire.Heartbeat(A, None, reader, writer, first, last, count, final, alive)]

    @given(sequences, st.integers(0, 2**62), st.sets(st.integers(0, 255)))
    def test_gap(self, start: int, base: int, offsets: set[int]) -> None:
        base += 1
        numbers = tuple(base + offset for offset in sorted(offsets))
        assert parse(wire.gap(3, 4, start, base, numbers)) == [wire.Gap(A, None, 3, 4, start, base, numbers)]

    @given(st.integers(0, 2**62), st.sets(st.integers(0, 255)), counts, st.booleans())
    def test_acknack(self, base: int, offsets: set[int], count: int, final: bool) -> None:
        missing = tuple(base + offset for offset in sorted(offsets))
        built = wire.acknack(3, 4, base, missing, count, final=final)
        assert parse(built) == [wire.AckNack(A, None, 3, 4, base, missing, count, final)]

    @given(sequences, st.integers(1, 2**32 - 256), st.sets(st.integers(0, 255)), counts)
    def test_nack_frag(self, sequence: int, base: int, offsets: set[int], count: int) -> None:
        missing = tuple(base + offset for offset in sorted(offsets))
        built = wire.nack_frag(3, 4, sequence, base, missing, count)
        assert parse(built) == [wire.NackFrag(A, None, 3, 4, sequence, base, missing, count)]

    @given(sequences, st.integers(1, 2**32 - 1), counts)
    def test_heartbeat_frag(self, sequence: int, last: int, count: int) -> None:
        built = wire.heartbeat_frag(3, 4, sequence, last, count)
        assert parse(built) == [wire.HeartbeatFrag(A, None, 3, 4, sequence, last, count)]

    def test_sets_are_as_short_as_can_be(self) -> None:
        for missing, words in (([], 0), ([9], 1), ([9, 40], 1), ([9, 41], 2), ([264], 8)):
            assert len(wire.acknack(3, 4, 9, missing, 1)) == 28 + 4 * words

    def test_counts_wrap(self) -> None:
        (event,) = parse(wire.heartbeat(0, 1, 1, 1, 2**32 + 5))
        assert isinstance(event, wire.Heartbeat)
        assert event.count == 5

    def test_info_reply(self) -> None:
        one, two = udp4("127.0.0.1", 7410), Locator(2, 7411, bytes(range(16)))
        assert parse(wire.info_reply([one, two])) == [wire.InfoReply(A, None, (one, two), ())]
        assert parse(wire.info_reply([one], [two])) == [wire.InfoReply(A, None, (one,), (two,))]

    def test_info_reply_ip4(self) -> None:
        body = struct.pack(">4I", 0x7F000001, 7410, 0xEFFF0001, 7400)
        assert parse(sub(0x0D, 0x02, body)) == [
            wire.InfoReply(A, None, (udp4("127.0.0.1", 7410),), (udp4("239.255.0.1", 7400),))
        ]
        assert parse(sub(0x0D, 0x00, body)) == [wire.InfoReply(A, None, (udp4("127.0.0.1", 7410),), ())]


class TestReceiver:
    """What the INFO submessages say holds for those that follow, until another says otherwise."""

    def test_in_order(self) -> None:
        beat = wire.heartbeat(1, 2, 1, 1, 1)
        sample = wire.data(1, 2, 1, b"\0\1\0\0")
        events = parse(
            sample,
            wire.info_dst(B),
            wire.info_ts(TIME),
            sample,
            beat,
            wire.info_src(B),
            sample,
            wire.info_ts(TIME),
            wire.info_dst(bytes(12)),
            sample,
            wire.info_ts(None),
            sample,
        )
        assert [event[:2] for event in events] == [(A, None), (A, B), (A, B), (B, B), (B, None), (B, None)]
        assert [event.time for event in events if isinstance(event, wire.Data)] == [
            None,
            TIME,
            None,
            TIME,
            None,
        ]

    @given(st.integers(0, (2**32 - 2) * 10**9))
    def test_times_survive_to_the_nanosecond(self, time: int) -> None:
        (event,) = parse(wire.info_ts(time), wire.data(1, 2, 1, b""))
        assert isinstance(event, wire.Data)
        assert event.time == time

    @pytest.mark.parametrize("time", [-1, 2**32 * 10**9])
    def test_times_that_do_not_fit(self, time: int) -> None:
        with pytest.raises(ValueError, match="does not fit an RTPS time"):
            wire.info_ts(time)

    def test_the_invalid_time_is_none(self) -> None:
        (event,) = parse(sub(0x09, 1, b"\xff" * 8), wire.data(1, 2, 1, b""))
        assert isinstance(event, wire.Data)
        assert event.time is None


class TestForeign:
    """Other versions, vendors and byte orders."""

    def test_big_endian(self) -> None:
        ids = struct.pack(">II", 0x100, 0x103)
        number = struct.pack(">iI", 1, 2)
        sequence = (1 << 32) + 2
        info = sub(0x09, 0, struct.pack(">II", 5, 0x80000000))
        data = sub(0x15, 0x06, b"\0\0\0\x10" + ids + number + b"\0\x70\0\4abcd\0\1\0\0" + b"\0\0\0\0body")
        frag = sub(0x16, 0x00, b"\0\0\0\x1c" + ids + number + struct.pack(">IHHI", 2, 1, 4, 9) + b"defg")
        beat = sub(0x07, 0x02, ids + number + struct.pack(">iII", 1, 9, 7))
        gap = sub(0x08, 0x00, ids + number + struct.pack(">iIII", 1, 4, 33, 0x40000000) + b"\x80\0\0\0")
        ack = sub(0x06, 0x00, ids + struct.pack(">iIII", 1, 2, 3, 0xFF000000) + b"\0\0\0\x05")
        nack = sub(0x12, 0x00, ids + number + struct.pack(">III", 7, 1, 0x80000000) + b"\0\0\0\x06")
        events = parse(info, data, frag, beat, gap, ack, nack)
        assert [tuple(event[2:]) for event in events] == [
            (5_500_000_000, 0x100, 0x103, sequence, b"\0\0\0\0body", {0x70: [b"abcd"]}, False),
            (5_500_000_000, 0x100, 0x103, sequence, 2, 1, 4, 9, b"defg", None, False),
            (0x100, 0x103, sequence, (1 << 32) + 9, 7, True, False),
            (0x100, 0x103, sequence, (1 << 32) + 4, ((1 << 32) + 5, (1 << 32) + 36)),
            # Three bits count, the five that follow do not.
            (0x100, 0x103, sequence, (sequence, sequence + 1, sequence + 2), 5, False),
            (0x100, 0x103, sequence, 7, (7,), 6),
        ]

    def test_inline_qos_begin_where_the_offset_says(self) -> None:
        """Later versions may put fields before them (9.4.5.3)."""
        body = struct.pack("<HH", 0, 24) + struct.pack(">II", 1, 2) + struct.pack("<iI", 0, 1)
        (event,) = parse(sub(0x15, 0x05, body + b"later on" + b"pay!"))
        assert isinstance(event, wire.Data)
        assert event.payload == b"pay!"

    def test_fields_behind_the_known_ones_are_skipped(self) -> None:
        beat = wire.heartbeat(1, 2, 1, 1, 1)
        longer = beat[:2] + struct.pack("<H", 28 + 12) + beat[4:] + bytes(12)
        assert len(parse(longer, beat)) == 2

    def test_unknown_and_padding_are_skipped(self) -> None:
        beat = wire.heartbeat(1, 2, 1, 1, 1)
        unknown = [sub(kind, 1, b"whatever") for kind in (0x02, 0x30, 0x80, 0xFF)]
        assert len(parse(*unknown, sub(0x01, 1, b""), beat, sub(0x01, 0, b"pad pads"), beat)) == 2
        assert parse(sub(0x01, 1, b"")) == parse(wire.info_ts(None)) == []

    def test_the_last_may_leave_its_length_open(self) -> None:
        sample = wire.data(1, 2, 1, b"\0\1\0\0 all the rest")
        events = parse(wire.info_ts(None), sample[:2] + b"\0\0" + sample[4:])
        assert isinstance(events[0], wire.Data)
        assert events[0].payload == b"\0\1\0\0 all the rest\0\0\0"

    def test_any_minor_version(self) -> None:
        data = wire.message(A, wire.heartbeat(1, 2, 1, 1, 1))
        message = wire.parse_untrusted(data[:4] + b"\x02\x09\x01\x2a" + data[8:])
        assert (message.version, message.vendor, len(message.submessages)) == ((2, 9), b"\x01\x2a", 1)

    @pytest.mark.parametrize("header", [b"", b"RTPS", b"RTPX\2\3" + bytes(14), b"RTPS\1\3" + bytes(14)])
    def test_not_a_message(self, header: bytes) -> None:
        with pytest.raises(wire.InvalidMessage):
            wire.parse_untrusted(header)


BEAT = wire.heartbeat(1, 2, 1, 1, 1)
IDS = struct.pack(">II", 1, 2)
FRAGMENT = IDS + struct.pack("<iIIHHI", 0, 1, 1, 1, 4, 4) + b"frag"


class TestBroken:
    """A broken submessage ends the reading; what stood before it counts, what follows does not."""

    @pytest.mark.parametrize(
        ("broken", "why"),
        [
            (b"\x07\1", "ends within a submessage's header"),
            (BEAT[:-1], "longer than its datagram"),
            (wire.data(1, 2, 0, b""), "sequence number 0"),
            (wire.data(1, 2, -1, b""), "sequence number -1"),
            (wire.heartbeat(1, 2, 0, 5, 1), "announces samples 0 to 5"),
            (wire.heartbeat(1, 2, 5, 3, 1), "announces samples 5 to 3"),
            (wire.heartbeat(1, 2, 1, -1, 1), "announces samples 1 to -1"),
            (wire.gap(1, 2, 0, 5, ()), "sequence number 0"),
            (wire.gap(1, 2, 5, 0, ()), "sequence number 0"),
            (wire.acknack(1, 2, -1, (), 1), "begins with number -1"),
            (wire.heartbeat_frag(1, 2, 1, 0, 1), "announces no fragment"),
            (wire.nack_frag(1, 2, 1, 0, (), 1), "begins with fragment 0"),
            (wire.data_frag(1, 2, 1, 0, 1, 8, 80, bytes(8)), "fragments 0 to 0 of 8 bytes"),
            (wire.data_frag(1, 2, 1, 1, 0, 8, 80, bytes(8)), "fragments 1 to 0 of 8 bytes"),
            (wire.data_frag(1, 2, 1, 1, 1, 0, 80, bytes(8)), "fragments 1 to 1 of 0 bytes"),
            (wire.data_frag(1, 2, 1, 11, 1, 8, 80, bytes(8)), "fragments 11 to 11 of 8 bytes"),
            (wire.data_frag(1, 2, 1, 10, 2, 8, 80, bytes(16)), "fragments 10 to 11 of 8 bytes"),
            (wire.data_frag(1, 2, 1, 1, 2, 8, 80, bytes(8)), "holds 8 of its 16 bytes"),
            (sub(0x15, 0x0D, b"\0\0\x10\0" + IDS + struct.pack("<iI", 0, 1)), "both a sample and a key"),
            (sub(0x15, 0x05, b"\0\0\x0f\0" + IDS + struct.pack("<iI", 0, 1)), "outside of itself"),
            (sub(0x15, 0x05, b"\0\0\x11\0" + IDS + struct.pack("<iI", 0, 1)), "outside of itself"),
            (sub(0x16, 1, b"\0\0\x1b\0" + FRAGMENT), "outside of itself"),
            (sub(0x16, 1, b"\0\0\x21\0" + FRAGMENT), "outside of itself"),
            (sub(0x12, 1, IDS + struct.pack("<iIIII", 0, 1, 1, 32, 0)), "NACK_FRAG is too short"),
            (wire.data(1, 2, 1, b"", inline_qos=b"\x70\0\4\0"), "impossible length"),
            (wire.data(1, 2, 1, b"", inline_qos=b"\x70\0\4\0abcd"), "has no end"),
            (sub(0x06, 1, IDS + struct.pack("<iIII", 0, 1, 257, 0) + bytes(40)), "set of 257 numbers"),
            (sub(0x06, 1, IDS + struct.pack("<iII", 0, 1, 64) + bytes(4)), "set of 64 numbers"),
            (sub(0x06, 1, IDS + struct.pack("<iII", 0, 1, 32) + bytes(4)), "ACKNACK is too short"),
            (sub(0x0F, 1, struct.pack("<I", 65) + bytes(65 * 24)), "65 locators"),
            (sub(0x0F, 1, struct.pack("<I", 2) + bytes(24)), "2 locators"),
        ],
    )
    def test_what_is_wrong(self, broken: bytes, why: str) -> None:
        events, what = trouble(BEAT, broken, BEAT if len(broken) % 4 == 0 else b"")
        assert events == 1
        assert why in what

    @pytest.mark.parametrize("kind", [0x06, 0x07, 0x08, 0x09, 0x0C, 0x0D, 0x0E, 0x0F, 0x12, 0x13, 0x15, 0x16])
    def test_too_short(self, kind: int) -> None:
        assert trouble(BEAT, sub(kind, 1, b"\1\2"), BEAT)[0] == 1
        assert trouble(BEAT, sub(kind, 1, b"\1\2"), BEAT)[1].endswith("is too short")

    def test_the_smallest_and_largest_numbers(self) -> None:
        """Fast DDS asks for everything by an ACKNACK from 0, and a writer without samples ends before it begins."""
        events = parse(
            wire.acknack(1, 2, 0, (), 1), wire.heartbeat(1, 2, 1, 0, 1), wire.gap(1, 2, 1, 2**63 - 1)
        )
        assert len(events) == 3


class TestRefused:
    """What a builder is not able to say."""

    def test_too_large(self) -> None:
        with pytest.raises(ValueError, match="send the sample in fragments"):
            wire.data(1, 2, 3, bytes(65517))
        with pytest.raises(ValueError, match="larger than 65532"):
            wire.data_frag(1, 2, 3, 1, 1, 65504, 70000, bytes(65504))
        assert len(wire.data(1, 2, 3, bytes(65512))) == 65536

    @pytest.mark.parametrize("number", [4, 261])
    def test_outside_of_the_set(self, number: int) -> None:
        with pytest.raises(ValueError, match="does not fit a set from 5, which ends at 260"):
            wire.acknack(1, 2, 5, [6, number], 1)

    @given(st.sets(st.integers(1, 2000)))
    def test_split_numbers(self, numbers: set[int]) -> None:
        portions = list(wire.split_numbers(sorted(numbers)))
        assert [number for _, portion in portions for number in portion] == sorted(numbers)
        for base, portion in portions:
            assert base == portion[0]
            assert portion[-1] - base < wire.MAX_SET
        for (_, one), (base, _) in pairwise(portions):
            assert base - one[0] >= wire.MAX_SET


class TestValues:
    """GUIDs, locators and durations."""

    def test_guids(self) -> None:
        guid = wire.guid_of(A, 0x000100C2)
        assert guid == A + b"\0\1\0\xc2"
        assert wire.split_guid(guid) == (A, 0x000100C2)

    def test_locators(self) -> None:
        assert str(udp4("10.0.0.7", 7400)) == "10.0.0.7:7400"
        assert str(Locator(2, 7400, bytes(15) + b"\1")) == "[0:0:0:0:0:0:0:1]:7400"
        assert str(Locator(16, 7, bytes(16))) == f"kind 16 {'0' * 32}:7"
        for host in ("localhost", "1.2.3", "1.2.3.256", "1.2.3.-4", "::1", "1.2.3.4.5"):
            with pytest.raises(ValueError, match="not a dotted"):
                udp4(host, 1)

    @given(st.integers(0, 2**31 * 10**9 - 10**9 - 1))
    def test_durations(self, ns: int) -> None:
        assert duration_from_wire(*duration_to_wire(ns)) == ns

    def test_infinite(self) -> None:
        assert duration_to_wire(INFINITE) == duration_to_wire(2**31 * 10**9) == (0x7FFFFFFF, 0xFFFFFFFF)
        for wire_form in ((0x7FFFFFFF, 0xFFFFFFFF), (0x7FFFFFFF, 0), (0xFFFFFFFF, 0xFFFFFFFF), (-1, 0)):
            assert duration_from_wire(*wire_form) == INFINITE
        with pytest.raises(ValueError, match="negative"):
            duration_to_wire(-1)


def _mutated() -> st.SearchStrategy[bytes]:
    """Real messages, somewhere changed, shortened or continued."""
    whole = wire.message(
        A,
        wire.info_dst(B),
        wire.info_ts(TIME),
        wire.data(1, 2, 3, b"\0\1\0\0 body", inline_qos=inline_qos(related=bytes(24), key_hash=bytes(16))),
        wire.data_frag(1, 2, 3, 2, 1, 8, 80, bytes(8)),
        wire.heartbeat(1, 2, 3, 4, 5),
        wire.gap(1, 2, 3, 5, [7, 40]),
        wire.acknack(1, 2, 3, [7, 40], 5),
        wire.heartbeat_frag(1, 2, 3, 4, 5),
        wire.nack_frag(1, 2, 3, 4, [5, 9], 5),
        wire.info_src(B),
        wire.info_reply([udp4("127.0.0.1", 1)]),
    )

    def change(edits: Iterable[tuple[int, int]], end: int, tail: bytes) -> bytes:
        data = bytearray(whole)
        for position, value in edits:
            data[position % len(data)] = value
        return bytes(data[:end]) + tail

    edits = st.lists(st.tuples(st.integers(0, len(whole)), st.integers(0, 255)), max_size=6)
    return st.builds(change, edits, st.integers(20, len(whole)), st.binary(max_size=40))


@given(
    st.one_of(st.binary(max_size=200), st.binary(max_size=200).map(lambda b: wire.message(A) + b), _mutated())
)
def test_foreign_bytes(data: bytes) -> None:
    """Any bytes: a message, or the one exception; and never more than the bytes can tell."""
    try:
        message = wire.parse_untrusted(data)
    except wire.InvalidMessage:
        return
    assert len(message.submessages) <= len(data) // 4
    for event in message.submessages:
        if isinstance(event, wire.Data | wire.DataFrag):
            assert len(event.payload) <= len(data)
        if isinstance(event, wire.AckNack | wire.NackFrag):
            assert len(event.missing) <= wire.MAX_SET
