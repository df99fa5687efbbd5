"""Messages of DDSI-RTPS 2.3: building ours, and by `parse_untrusted`, reading everybody's.

A message is a header and submessages behind one another (8.3.3); some submessages say something about those that
follow (whose they are, when they were written, whom they are for). Builders return the bytes of one little-endian
submessage, its length filled in and a multiple of four, so that any may follow another; `message` joins them.

Sequence and fragment numbers count from 1, times are ns since 1970. Counts wrap at 2**32. Entity ids are the
numbers of the specification, such as 0x000100C2.
"""

import struct
from collections.abc import Iterable, Iterator
from typing import Final

from muros.rtps._constants import PROTOCOL_VERSION, VENDOR_OURS, Submessage
from muros.rtps._events import (
    AckNack,
    Data,
    DataFrag,
    Event,
    Gap,
    Heartbeat,
    HeartbeatFrag,
    InfoReply,
    InvalidMessage,
    Message,
    NackFrag,
)
from muros.rtps._parser import MAX_SET, parse_untrusted
from muros.rtps._values import EntityId, Guid, GuidPrefix, Locator, guid_of, split_guid, time_to_wire

__all__ = [
    "MAX_SET",
    "AckNack",
    "Data",
    "DataFrag",
    "EntityId",
    "Event",
    "Gap",
    "Guid",
    "GuidPrefix",
    "Heartbeat",
    "HeartbeatFrag",
    "InfoReply",
    "InvalidMessage",
    "Message",
    "NackFrag",
    "acknack",
    "data",
    "data_frag",
    "data_pieces",
    "gap",
    "guid_of",
    "heartbeat",
    "heartbeat_frag",
    "info_dst",
    "info_reply",
    "info_src",
    "info_ts",
    "message",
    "nack_frag",
    "parse_untrusted",
    "split_guid",
    "split_numbers",
]

MAX_SUBMESSAGE: Final = 0xFFFC
"""Bytes a submessage may hold behind its header; less where a datagram is smaller (65507 bytes over UDP)."""

_L: Final = 0x01
"""Flag of every submessage: little endian."""

_WORD: Final = 0xFFFFFFFF


def message(prefix: GuidPrefix, *submessages: bytes) -> bytes:
    """A message of the participant `prefix` (8.3.6)."""
    return b"".join((_HEADER, prefix, *submessages))


def data(
    reader: EntityId,
    writer: EntityId,
    sequence: int,
    payload: bytes,
    *,
    inline_qos: bytes = b"",
    key: bool = False,
) -> bytes:
    """DATA (9.4.5.3). `payload` begins with its encapsulation; `inline_qos` is a little-endian parameter list.

    `key`: the payload is only the instance's key. Without payload, the inline QoS say all. ValueError when it is
    too large for a submessage: send fragments.
    """
    return b"".join(data_pieces(reader, writer, sequence, (payload,), len(payload), inline_qos, key))


def data_pieces(
    reader: EntityId,
    writer: EntityId,
    sequence: int,
    payload: tuple[bytes, ...],
    payload_size: int,
    inline_qos: bytes,
    key: bool,
) -> tuple[bytes, ...]:
    """The same for a payload in pieces of `payload_size` bytes together; joined they are the submessage."""
    flags = _L | 0x02 if inline_qos else _L
    if payload_size:
        flags |= 0x08 if key else 0x04
    padding = -payload_size & 3
    size = 20 + len(inline_qos) + payload_size + padding
    if size > MAX_SUBMESSAGE:
        raise _too_large(size)
    head = _DATA.pack(
        Submessage.DATA,
        flags,
        size,
        0,
        16,
        reader.to_bytes(4, "big"),
        writer.to_bytes(4, "big"),
        sequence >> 32,
        sequence & _WORD,
    )
    return (head, inline_qos, *payload, _PADDING[padding])


def data_frag(
    reader: EntityId,
    writer: EntityId,
    sequence: int,
    first_fragment: int,
    fragments_in: int,
    fragment_size: int,
    sample_size: int,
    payload: bytes,
    *,
    inline_qos: bytes = b"",
    key: bool = False,
) -> bytes:
    """DATA_FRAG (9.4.5.4): `fragments_in` fragments from `first_fragment` of a sample of `sample_size` bytes.

    All fragments have `fragment_size` bytes, but the sample's last one. The sample's encapsulation stands at the
    begin of its first fragment. ValueError when it is too large for a submessage.
    """
    flags = _L | 0x02 if inline_qos else _L
    if key:
        flags |= 0x04
    padding = -len(payload) & 3
    size = 32 + len(inline_qos) + len(payload) + padding
    if size > MAX_SUBMESSAGE:
        raise _too_large(size)
    head = _DATA_FRAG.pack(
        Submessage.DATA_FRAG,
        flags,
        size,
        0,
        28,
        reader.to_bytes(4, "big"),
        writer.to_bytes(4, "big"),
        sequence >> 32,
        sequence & _WORD,
        first_fragment,
        fragments_in,
        fragment_size,
        sample_size,
    )
    return b"".join((head, inline_qos, payload, _PADDING[padding]))


def heartbeat(
    reader: EntityId,
    writer: EntityId,
    first: int,
    last: int,
    count: int,
    *,
    final: bool = False,
    liveliness: bool = False,
) -> bytes:
    """HEARTBEAT (9.4.5.6). A writer that has nothing says so by `last` = `first` - 1."""
    return _HEARTBEAT.pack(
        Submessage.HEARTBEAT,
        _L | (0x02 if final else 0) | (0x04 if liveliness else 0),
        28,
        reader.to_bytes(4, "big"),
        writer.to_bytes(4, "big"),
        first >> 32,
        first & _WORD,
        last >> 32,
        last & _WORD,
        count & _WORD,
    )


def gap(reader: EntityId, writer: EntityId, start: int, base: int, numbers: Iterable[int] = ()) -> bytes:
    """GAP (9.4.5.5): `start` to `base` - 1 and `numbers`, which are from `base` to `base` + 255."""
    return _submessage(
        Submessage.GAP,
        _L,
        _ids(reader, writer),
        _LONGS.pack(start >> 32, start & _WORD),
        _sequences(base, numbers),
    )


def acknack(
    reader: EntityId, writer: EntityId, base: int, missing: Iterable[int], count: int, *, final: bool = False
) -> bytes:
    """ACKNACK (9.4.5.2): all below `base` are there; `missing` are from `base` to `base` + 255."""
    return _submessage(
        Submessage.ACKNACK,
        _L | (0x02 if final else 0),
        _ids(reader, writer),
        _sequences(base, missing),
        _COUNT.pack(count & _WORD),
    )


def heartbeat_frag(
    reader: EntityId, writer: EntityId, sequence: int, last_fragment: int, count: int
) -> bytes:
    """HEARTBEAT_FRAG (9.4.5.7): the fragments up to `last_fragment` are there."""
    number = _LONGS.pack(sequence >> 32, sequence & _WORD)
    return _submessage(
        Submessage.HEARTBEAT_FRAG,
        _L,
        _ids(reader, writer),
        number,
        _COUNT.pack(last_fragment),
        _COUNT.pack(count & _WORD),
    )


def nack_frag(
    reader: EntityId, writer: EntityId, sequence: int, base: int, missing: Iterable[int], count: int
) -> bytes:
    """NACK_FRAG (9.4.5.13): `missing` are fragments of the sample `sequence`, from `base` to `base` + 255."""
    size, bits = _bitmap(base, missing)
    return _submessage(
        Submessage.NACK_FRAG,
        _L,
        _ids(reader, writer),
        _LONGS.pack(sequence >> 32, sequence & _WORD),
        _PAIR.pack(base, size),
        bits,
        _COUNT.pack(count & _WORD),
    )


def info_ts(time: int | None) -> bytes:
    """INFO_TS (9.4.5.11): what follows was written at `time`; None = it is not known when."""
    if time is None:
        return bytes((Submessage.INFO_TS, _L | 0x02, 0, 0))
    seconds, fraction = time_to_wire(time)
    return _INFO_TS.pack(Submessage.INFO_TS, _L, 8, seconds, fraction)


def info_dst(prefix: GuidPrefix) -> bytes:
    """INFO_DST (9.4.5.8): what follows is for the participant `prefix`; 12 zeros = for everybody."""
    return _INFO_DST + prefix


def info_src(prefix: GuidPrefix, *, vendor: bytes = VENDOR_OURS) -> bytes:
    """INFO_SRC (9.4.5.10): what follows comes from the participant `prefix`."""
    return _submessage(Submessage.INFO_SRC, _L, bytes(4), bytes(PROTOCOL_VERSION), vendor, prefix)


def info_reply(unicast: Iterable[Locator], multicast: Iterable[Locator] = ()) -> bytes:
    """INFO_REPLY (9.4.5.9): answers to what follows shall go there."""
    lists = [_locators(unicast)]
    if more := tuple(multicast):
        lists.append(_locators(more))
    return _submessage(Submessage.INFO_REPLY, _L | (0x02 if more else 0), *lists)


def split_numbers(numbers: Iterable[int]) -> Iterator[tuple[int, list[int]]]:
    """Rising `numbers` in portions that fit one set each: the first one of it as base, and all of it."""
    base, portion = 0, list[int]()
    for number in numbers:
        if portion and number - base >= MAX_SET:
            yield base, portion
            portion = []
        if not portion:
            base = number
        portion.append(number)
    if portion:
        yield base, portion


# --- Helpers ---------------------------------------------------------------------------------------------

_HEADER: Final = b"RTPS" + bytes(PROTOCOL_VERSION) + VENDOR_OURS
_PADDING: Final = (b"", b"\0", b"\0\0", b"\0\0\0")
_DATA: Final = struct.Struct("<BBHHH4s4siI")
_DATA_FRAG: Final = struct.Struct("<BBHHH4s4siIIHHI")
_HEARTBEAT: Final = struct.Struct("<BBH4s4siIiII")
_INFO_TS: Final = struct.Struct("<BBHII")
_INFO_DST: Final = bytes((Submessage.INFO_DST, _L, 12, 0))
_IDS: Final = struct.Struct(">II")
_LONGS: Final = struct.Struct("<iI")
_PAIR: Final = struct.Struct("<II")
_COUNT: Final = struct.Struct("<I")
_SET: Final = struct.Struct("<iII")
_LOCATOR: Final = struct.Struct("<iI16s")


def _submessage(kind: int, flags: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return struct.pack("<BBH", kind, flags, len(body)) + body


def _ids(reader: EntityId, writer: EntityId) -> bytes:
    # Octets on the wire, and so big endian in messages of either order (9.3.1.2).
    return _IDS.pack(reader, writer)


def _sequences(base: int, numbers: Iterable[int]) -> bytes:
    """A SequenceNumberSet (9.4.2.6)."""
    size, bits = _bitmap(base, numbers)
    return _SET.pack(base >> 32, base & _WORD, size) + bits


def _bitmap(base: int, numbers: Iterable[int]) -> tuple[int, bytes]:
    """How many numbers from `base` on the bits stand for, and the bits: from the top of each 32-bit word down."""
    bits = size = 0
    for number in numbers:
        index = number - base
        if not 0 <= index < MAX_SET:
            raise ValueError(
                f"number {number} does not fit a set from {base}, which ends at {base + MAX_SET - 1}"
            )
        bits |= 1 << (MAX_SET - 1 - index)
        size = max(size, index + 1)
    words = size + 31 >> 5
    return size, struct.pack(
        f"<{words}I", *struct.unpack_from(f">{words}I", bits.to_bytes(MAX_SET // 8, "big"))
    )


def _locators(locators: Iterable[Locator]) -> bytes:
    parts = [_LOCATOR.pack(*locator) for locator in locators]
    return _COUNT.pack(len(parts)) + b"".join(parts)


def _too_large(size: int) -> ValueError:
    return ValueError(
        f"a submessage of {size} bytes is larger than {MAX_SUBMESSAGE}: send the sample in fragments"
    )
