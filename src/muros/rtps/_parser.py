"""Reading the messages of DDSI-RTPS 2.3, whoever sent them.

Theory of operation. `parse_untrusted` walks the submessages of a datagram. The INFO ones change what it remembers
about those that follow (8.3.4: the state of a receiver), the others become events that carry it. Unknown
submessages are skipped by their length, as are bytes that later versions put behind the known fields. A known but
broken one ends the reading (8.3.4.1, rule 6); what stood before it counts.

Nothing is read beyond the end that the submessage's length gives: `struct` would take what follows for its own,
and slices would be silently short. What one message makes is bounded by its size and `MAX_SET`, `MAX_LOCATORS` and
`MAX_PARAMETERS`.
"""

import struct
from collections.abc import Callable
from typing import Final

from muros.rtps import _parameters
from muros.rtps._constants import PROTOCOL_VERSION, Submessage
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
from muros.rtps._parameters import InvalidParameters, Parameters
from muros.rtps._values import UDP4, GuidPrefix, Locator, time_from_wire

__all__ = ["MAX_SET", "parse_untrusted"]

HEADER_SIZE: Final = 20
"""Bytes of a message's header."""

MAX_SET: Final = 256
"""Largest distance, plus one, of the numbers in a set (9.4.2.6, 9.4.2.8)."""

MAX_LOCATORS: Final = 64
"""Locators in a list of INFO_REPLY; more make it invalid."""


def parse_untrusted(data: bytes) -> Message:
    """The message in a datagram. `InvalidMessage` when it has no header of RTPS 2 (8.3.6.3)."""
    end = len(data)
    if end < HEADER_SIZE:
        raise InvalidMessage(f"{end} bytes are too short for an RTPS message")
    if data[:4] != b"RTPS":
        raise InvalidMessage("no RTPS message")
    if data[4] != PROTOCOL_VERSION[0]:
        raise InvalidMessage(f"RTPS {data[4]}.{data[5]} is not understood, only RTPS {PROTOCOL_VERSION[0]}")
    prefix = data[8:20]
    receiver = _Receiver(prefix)
    trouble = ""
    here = HEADER_SIZE
    try:
        while here < end:
            start = here + 4
            if start > end:
                raise _Broken("it ends within a submessage's header")
            kind = data[here]
            flags = data[here + 1]
            size = data[here + 2] | data[here + 3] << 8 if flags & 1 else data[here + 2] << 8 | data[here + 3]
            here = start + size
            if size == 0 and kind not in _MAY_BE_EMPTY:
                here = end  # the last submessage may leave its length open (8.3.3.2.3)
            elif here > end:
                raise _Broken(f"submessage 0x{kind:02x} is longer than its datagram")
            read = _READERS.get(kind)
            if read is not None:
                read(receiver, data, start, here, flags)
    except (_Broken, InvalidParameters) as error:
        trouble = str(error)
    return Message(prefix, data[6:8], (data[4], data[5]), receiver.events, trouble)


class _Broken(Exception):  # noqa: N818
    """A known submessage is not as it must be."""


class _Receiver:
    """What was said so far in one message, and the events made of it."""

    __slots__ = ("destination", "events", "source", "time")

    def __init__(self, source: GuidPrefix) -> None:
        self.source = source
        self.destination: GuidPrefix | None = None
        self.time: int | None = None
        self.events: list[Event] = []

    def data(self, data: bytes, start: int, end: int, flags: int) -> None:
        """DATA (8.3.7.2, 9.4.5.3)."""
        if end - start < 20:
            raise _short("DATA")
        order = flags & 1
        sequence = _positive(_NUMBER[order](data, start + 12), "DATA")
        inline: Parameters | None = None
        if order:
            begin = start + 4 + (data[start + 2] | data[start + 3] << 8)
        else:
            begin = start + 4 + (data[start + 2] << 8 | data[start + 3])
        if begin < start + 20 or begin > end:
            raise _Broken("DATA has its inline QoS outside of itself")
        if flags & 0x02:
            inline, begin = _parameters.parse_untrusted(data, begin, end, order=_ORDERS[order])
        content = flags & 0x0C
        if content == 0x0C:
            raise _Broken("DATA claims to hold both a sample and a key")
        reader, writer = _IDS(data, start + 4)
        self.events.append(
            Data(
                self.source,
                self.destination,
                self.time,
                reader,
                writer,
                sequence,
                data[begin:end] if content else b"",
                inline,
                content == 0x08,
            )
        )

    def data_frag(self, data: bytes, start: int, end: int, flags: int) -> None:
        """DATA_FRAG (8.3.7.3, 9.4.5.4)."""
        if end - start < 32:
            raise _short("DATA_FRAG")
        order = flags & 1
        sequence = _positive(_NUMBER[order](data, start + 12), "DATA_FRAG")
        (octets,) = _SHORT[order](data, start + 2)
        first, count, fragment_size, sample_size = _FRAGMENTS[order](data, start + 20)
        begin = start + 4 + octets
        if octets < 28 or begin > end:
            raise _Broken("DATA_FRAG has its inline QoS outside of itself")
        inline: Parameters | None = None
        if flags & 0x02:
            inline, begin = _parameters.parse_untrusted(data, begin, end, order=_ORDERS[order])
        # From the offset of the first byte to that behind the last; the sample's end is the last one's.
        offset = (first - 1) * fragment_size
        size = min(offset + count * fragment_size, sample_size) - offset
        if first < 1 or count < 1 or fragment_size == 0 or size <= (count - 1) * fragment_size:
            raise _Broken(
                f"DATA_FRAG has fragments {first} to {first + count - 1} of {fragment_size} bytes "
                f"in a sample of {sample_size}"
            )
        if end - begin < size:
            raise _Broken(f"DATA_FRAG holds {end - begin} of its {size} bytes")
        reader, writer = _IDS(data, start + 4)
        self.events.append(
            DataFrag(
                self.source,
                self.destination,
                self.time,
                reader,
                writer,
                sequence,
                first,
                count,
                fragment_size,
                sample_size,
                data[begin : begin + size],
                inline,
                bool(flags & 0x04),
            )
        )

    def heartbeat(self, data: bytes, start: int, end: int, flags: int) -> None:
        """HEARTBEAT (8.3.7.5, 9.4.5.6)."""
        if end - start < 28:
            raise _short("HEARTBEAT")
        first_high, first_low, last_high, last_low, count = _HEARTBEAT[flags & 1](data, start + 8)
        first = (first_high << 32) + first_low
        last = (last_high << 32) + last_low
        if first < 1 or last < first - 1:
            raise _Broken(f"HEARTBEAT announces samples {first} to {last}")
        reader, writer = _IDS(data, start)
        self.events.append(
            Heartbeat(
                self.source,
                self.destination,
                reader,
                writer,
                first,
                last,
                count,
                bool(flags & 0x02),
                bool(flags & 0x04),
            )
        )

    def gap(self, data: bytes, start: int, end: int, flags: int) -> None:
        """GAP (8.3.7.4, 9.4.5.5)."""
        if end - start < 28:
            raise _short("GAP")
        order = flags & 1
        first = _positive(_NUMBER[order](data, start + 8), "GAP")
        base = _positive(_NUMBER[order](data, start + 16), "GAP")
        numbers, _ = _set(data, start + 24, end, order, base)
        reader, writer = _IDS(data, start)
        self.events.append(Gap(self.source, self.destination, reader, writer, first, base, numbers))

    def acknack(self, data: bytes, start: int, end: int, flags: int) -> None:
        """ACKNACK (8.3.7.1, 9.4.5.2)."""
        if end - start < 24:
            raise _short("ACKNACK")
        order = flags & 1
        high, low = _NUMBER[order](data, start + 8)
        # The standard wants 1 at least, but the first ACKNACK of Fast DDS has 0.
        base = (high << 32) + low
        if base < 0:
            raise _Broken(f"ACKNACK begins with number {base}")
        missing, here = _set(data, start + 16, end, order, base)
        if here + 4 > end:
            raise _short("ACKNACK")
        reader, writer = _IDS(data, start)
        (count,) = _WORD[order](data, here)
        self.events.append(
            AckNack(self.source, self.destination, reader, writer, base, missing, count, bool(flags & 0x02))
        )

    def heartbeat_frag(self, data: bytes, start: int, end: int, flags: int) -> None:
        """HEARTBEAT_FRAG (8.3.7.6, 9.4.5.7)."""
        if end - start < 24:
            raise _short("HEARTBEAT_FRAG")
        order = flags & 1
        sequence = _positive(_NUMBER[order](data, start + 8), "HEARTBEAT_FRAG")
        last, count = _PAIR[order](data, start + 16)
        if last < 1:
            raise _Broken("HEARTBEAT_FRAG announces no fragment")
        reader, writer = _IDS(data, start)
        self.events.append(
            HeartbeatFrag(self.source, self.destination, reader, writer, sequence, last, count)
        )

    def nack_frag(self, data: bytes, start: int, end: int, flags: int) -> None:
        """NACK_FRAG (8.3.7.11, 9.4.5.13)."""
        if end - start < 28:
            raise _short("NACK_FRAG")
        order = flags & 1
        sequence = _positive(_NUMBER[order](data, start + 8), "NACK_FRAG")
        (base,) = _WORD[order](data, start + 16)
        if base < 1:
            raise _Broken("NACK_FRAG begins with fragment 0")
        missing, here = _set(data, start + 20, end, order, base)
        if here + 4 > end:
            raise _short("NACK_FRAG")
        reader, writer = _IDS(data, start)
        (count,) = _WORD[order](data, here)
        self.events.append(
            NackFrag(self.source, self.destination, reader, writer, sequence, base, missing, count)
        )

    def info_ts(self, data: bytes, start: int, end: int, flags: int) -> None:
        """INFO_TS (8.3.7.10, 9.4.5.11)."""
        if flags & 0x02:
            self.time = None
        elif end - start < 8:
            raise _short("INFO_TS")
        else:
            seconds, fraction = _PAIR[flags & 1](data, start)
            self.time = time_from_wire(seconds, fraction)

    def info_dst(self, data: bytes, start: int, end: int, flags: int) -> None:
        """INFO_DST (8.3.7.7, 9.4.5.8)."""
        if end - start < 12:
            raise _short("INFO_DST")
        prefix = data[start : start + 12]
        self.destination = None if prefix == _EVERYBODY else prefix

    def info_src(self, data: bytes, start: int, end: int, flags: int) -> None:
        """INFO_SRC (8.3.7.9, 9.4.5.10)."""
        if end - start < 20:
            raise _short("INFO_SRC")
        self.source = data[start + 8 : start + 20]
        self.time = None

    def info_reply(self, data: bytes, start: int, end: int, flags: int) -> None:
        """INFO_REPLY (8.3.7.8, 9.4.5.9)."""
        order = flags & 1
        unicast, start = _locators(data, start, end, order)
        multicast: tuple[Locator, ...] = ()
        if flags & 0x02:
            multicast, _ = _locators(data, start, end, order)
        self.events.append(InfoReply(self.source, self.destination, unicast, multicast))

    def info_reply_ip4(self, data: bytes, start: int, end: int, flags: int) -> None:
        """INFO_REPLY_IP4 (9.4.5.14): one address and port, and perhaps one of a group."""
        count = 2 if flags & 0x02 else 1
        if end - start < 8 * count:
            raise _short("INFO_REPLY_IP4")
        numbers = struct.unpack_from(f"{_ORDERS[flags & 1]}{2 * count}I", data, start)
        found = [
            Locator(UDP4, numbers[at + 1], numbers[at].to_bytes(16, "big")) for at in range(0, 2 * count, 2)
        ]
        self.events.append(InfoReply(self.source, self.destination, (found[0],), tuple(found[1:])))


_READERS: Final[dict[int, Callable[[_Receiver, bytes, int, int, int], None]]] = {
    Submessage.DATA: _Receiver.data,
    Submessage.DATA_FRAG: _Receiver.data_frag,
    Submessage.HEARTBEAT: _Receiver.heartbeat,
    Submessage.GAP: _Receiver.gap,
    Submessage.ACKNACK: _Receiver.acknack,
    Submessage.HEARTBEAT_FRAG: _Receiver.heartbeat_frag,
    Submessage.NACK_FRAG: _Receiver.nack_frag,
    Submessage.INFO_TS: _Receiver.info_ts,
    Submessage.INFO_DST: _Receiver.info_dst,
    Submessage.INFO_SRC: _Receiver.info_src,
    Submessage.INFO_REPLY: _Receiver.info_reply,
    Submessage.INFO_REPLY_IP4: _Receiver.info_reply_ip4,
}

# By the flag of every submessage: big endian, little endian.
_ORDERS: Final = (">", "<")
_SHORT: Final = (struct.Struct(">H").unpack_from, struct.Struct("<H").unpack_from)
_WORD: Final = (struct.Struct(">I").unpack_from, struct.Struct("<I").unpack_from)
_PAIR: Final = (struct.Struct(">II").unpack_from, struct.Struct("<II").unpack_from)
_NUMBER: Final = (struct.Struct(">iI").unpack_from, struct.Struct("<iI").unpack_from)
_FRAGMENTS: Final = (struct.Struct(">IHHI").unpack_from, struct.Struct("<IHHI").unpack_from)
_HEARTBEAT: Final = (struct.Struct(">iIiII").unpack_from, struct.Struct("<iIiII").unpack_from)
_LOCATOR: Final = (struct.Struct(">iI16s").unpack_from, struct.Struct("<iI16s").unpack_from)
# Entity ids are octets: big endian in either.
_IDS: Final = struct.Struct(">II").unpack_from

_MAY_BE_EMPTY: Final = (Submessage.PAD, Submessage.INFO_TS)
_EVERYBODY: Final = bytes(12)


def _positive(number: tuple[int, int], name: str) -> int:
    """A sequence number from its two words."""
    sequence = (number[0] << 32) + number[1]
    if sequence < 1:
        raise _Broken(f"{name} has sequence number {sequence}")
    return sequence


def _set(data: bytes, start: int, end: int, order: int, base: int) -> tuple[tuple[int, ...], int]:
    """The numbers of a set from `base` on, whose size stands at `start`, and the position behind it."""
    (size,) = _WORD[order](data, start)
    start += 4
    if size == 0:
        return (), start
    words = size + 31 >> 5
    behind = start + 4 * words
    if size > MAX_SET or behind > end:
        raise _Broken(f"a set of {size} numbers does not fit")
    # Bits count from the top of each word down; those beyond the size mean nothing.
    bits = 0
    for word in struct.unpack_from(f"{_ORDERS[order]}{words}I", data, start):
        bits = bits << 32 | word
    bits >>= 32 * words - size
    last = base + size - 1
    numbers = []
    while bits:
        top = bits.bit_length() - 1
        numbers.append(last - top)
        bits ^= 1 << top
    return tuple(numbers), behind


def _locators(data: bytes, start: int, end: int, order: int) -> tuple[tuple[Locator, ...], int]:
    """A LocatorList and the position behind it."""
    if start + 4 > end:
        raise _short("INFO_REPLY")
    (count,) = _WORD[order](data, start)
    start += 4
    if count > MAX_LOCATORS or start + 24 * count > end:
        raise _Broken(f"INFO_REPLY with {count} locators does not fit")
    unpack = _LOCATOR[order]
    return tuple(Locator(*unpack(data, start + 24 * at)) for at in range(count)), start + 24 * count


def _short(name: str) -> _Broken:
    return _Broken(f"{name} is too short")
