"""Parameter lists: (id, length, value) triples behind one another, the form of discovery data and inline QoS.

DDSI-RTPS 2.3, 9.4.2.11 and 9.6.2.2. `parse_untrusted` reads one of either byte order into `Parameters`, whose
methods decode values; `ParameterBuilder` writes one. At the end stand the inline QoS that this room uses.
"""

import struct
from collections.abc import Iterable
from typing import Final

from muros.rtps._constants import Pid, StatusInfo
from muros.rtps._values import Guid, Locator, duration_from_wire, duration_to_wire

__all__ = [
    "InvalidParameters",
    "ParameterBuilder",
    "Parameters",
    "inline_qos",
    "key_hash",
    "key_hash_of",
    "parse_untrusted",
    "related_identity",
    "status_info",
    "status_info_of",
]

MAX_PARAMETERS: Final = 1024
"""Parameters read from one list; more are refused."""

IDENTITY_SIZE: Final = 24
"""Bytes of a sample identity: a GUID, then the sequence number, high word first, both in the list's byte order."""

_GUID_SIZE: Final = 16
_LOCATOR_SIZE: Final = 24


class InvalidParameters(ValueError):  # noqa: N818
    """Foreign bytes that are no parameter list, or a parameter that is too short for what it should hold."""


class Parameters(dict[int, list[bytes]]):
    """A parameter list as read: values by id, in the order in which they came (`Pid.UNICAST_LOCATOR` may repeat).

    The methods decode the first (or all) values of an id. They raise `InvalidParameters` for a value that is too
    short, and return None or nothing when there is none.
    """

    __slots__ = ("order",)

    order: str
    """Byte order of the values, as `struct` writes it: "<" or ">"."""

    def __init__(self, order: str = "<") -> None:
        super().__init__()
        self.order = order

    def first(self, pid: int, size: int = 0) -> bytes | None:
        """The first value, of at least `size` bytes."""
        values = self.get(pid)
        if values is None:
            return None
        if len(values[0]) < size:
            raise InvalidParameters(f"parameter 0x{pid:04x} has {len(values[0])} bytes, it needs {size}")
        return values[0]

    def uint32(self, pid: int) -> int | None:
        """An unsigned long."""
        value = self.unpack(pid, "I")
        return None if value is None else value[0]

    def flag(self, pid: int) -> bool:
        """A boolean; False when there is none."""
        value = self.first(pid, 1)
        return value is not None and value[0] != 0

    def unpack(self, pid: int, layout: str) -> tuple[int, ...] | None:
        """Numbers, laid out as `struct` says."""
        form = struct.Struct(self.order + layout)
        value = self.first(pid, form.size)
        return None if value is None else form.unpack_from(value)

    def duration(self, pid: int) -> int | None:
        """A Duration_t in ns."""
        value = self.unpack(pid, "II")
        return None if value is None else duration_from_wire(*value)

    def guid(self, pid: int) -> Guid | None:
        """A GUID_t; its octets have no byte order."""
        value = self.first(pid, _GUID_SIZE)
        return None if value is None else value[:_GUID_SIZE]

    def octets(self, pid: int) -> bytes:
        """A sequence of octets."""
        value = self.first(pid, 4)
        return b"" if value is None else self._counted(value, 0, pid)[0]

    def text(self, pid: int) -> str | None:
        """A string. Bytes that are not UTF-8 are shown escaped."""
        value = self.first(pid, 4)
        return None if value is None else self._text(value, 0, pid)[0]

    def texts(self, pid: int) -> tuple[str, ...]:
        """A sequence of strings."""
        value = self.first(pid, 4)
        if value is None:
            return ()
        found: list[str] = []
        count: int = struct.unpack_from(self.order + "I", value)[0]
        position = 4
        # Each string takes at least its length field, so a count beyond the bytes ends here and not in memory.
        for _ in range(count):
            text, position = self._text(value, position, pid)
            found.append(text)
        return tuple(found)

    def locators(self, pid: int) -> tuple[Locator, ...]:
        """All locators of this id."""
        values = self.get(pid)
        if values is None:
            return ()
        found = []
        form = struct.Struct(self.order + "iI16s")
        for value in values:
            if len(value) < _LOCATOR_SIZE:
                raise InvalidParameters(f"a locator has {len(value)} bytes, it needs {_LOCATOR_SIZE}")
            found.append(Locator(*form.unpack_from(value)))
        return tuple(found)

    def properties(self, pid: int = Pid.PROPERTY_LIST) -> tuple[tuple[str, str], ...]:
        """A sequence of pairs of strings: names and values (9.6.2.2, Property_t without its local part)."""
        value = self.first(pid, 4)
        if value is None:
            return ()
        found: list[tuple[str, str]] = []
        count: int = struct.unpack_from(self.order + "I", value)[0]
        position = 4
        for _ in range(count):
            name, position = self._text(value, position, pid)
            text, position = self._text(value, position, pid)
            found.append((name, text))
        return tuple(found)

    def _text(self, value: bytes, position: int, pid: int) -> tuple[str, int]:
        """The string at `position` and where the next begins."""
        octets, position = self._counted(value, position, pid)
        # A string ends with a zero, which its length counts; some writers count none for an empty string.
        return octets.partition(b"\0")[0].decode("utf-8", "backslashreplace"), position

    def _counted(self, value: bytes, position: int, pid: int) -> tuple[bytes, int]:
        """As many bytes as the count at `position` says, and the aligned position behind them."""
        begin = position + 4
        if begin <= len(value):
            end = begin + struct.unpack_from(self.order + "I", value, position)[0]
            if end <= len(value):
                return value[begin:end], end + 3 & ~3
        raise InvalidParameters(f"parameter 0x{pid:04x} ends within a string or sequence")


def parse_untrusted(
    data: bytes, start: int = 0, end: int | None = None, *, order: str = "<", limit: int = MAX_PARAMETERS
) -> tuple[Parameters, int]:
    """The parameter list at `data[start:end]` and the position behind it.

    `order` is "<" or ">". `InvalidParameters` when it does not end within the bytes, or has more than `limit`.
    """
    parameters = Parameters(order)
    header = _HEADERS[order]
    if end is None:
        end = len(data)
    for _ in range(limit):
        value = start + 4
        if value > end:
            raise InvalidParameters("a parameter list has no end")
        pid, size = header(data, start)
        if pid == Pid.SENTINEL:
            return parameters, value
        start = value + size
        # A slice beyond the end would be silently short.
        if start > end or size & 3:
            raise InvalidParameters(f"parameter 0x{pid:04x} has an impossible length of {size} bytes")
        if pid in parameters:
            parameters[pid].append(data[value:start])
        elif pid != Pid.PAD:
            parameters[pid] = [data[value:start]]
    raise InvalidParameters(f"a parameter list has more than {limit} parameters")


class ParameterBuilder:
    """Writes a parameter list; every method adds one parameter. `order` as for `parse_untrusted`."""

    __slots__ = ("_parts", "order")

    def __init__(self, order: str = "<") -> None:
        self.order: Final = order
        self._parts: list[bytes] = []

    def build(self) -> bytes:
        """The list, its end included."""
        return b"".join(self._parts) + struct.pack(self.order + "HH", Pid.SENTINEL, 0)

    def add(self, pid: int, value: bytes) -> None:
        """A value as it is, filled up to a multiple of 4 bytes. ValueError beyond 65532 bytes."""
        size = len(value) + 3 & ~3
        if size > 0xFFFC:
            raise ValueError(f"{len(value)} bytes do not fit parameter 0x{pid:04x}, which has room for 65532")
        self._parts.append(struct.pack(self.order + "HH", pid, size) + value.ljust(size, b"\0"))

    def pack(self, pid: int, layout: str, *numbers: int) -> None:
        """Numbers, laid out as `struct` says."""
        self.add(pid, struct.pack(self.order + layout, *numbers))

    def uint32(self, pid: int, number: int) -> None:
        """An unsigned long."""
        self.pack(pid, "I", number)

    def flag(self, pid: int, value: bool) -> None:
        """A boolean."""
        self.add(pid, b"\1" if value else b"\0")

    def duration(self, pid: int, ns: int) -> None:
        """A Duration_t."""
        self.pack(pid, "II", *duration_to_wire(ns))

    def octets(self, pid: int, octets: bytes) -> None:
        """A sequence of octets."""
        self.add(pid, struct.pack(self.order + "I", len(octets)) + octets)

    def text(self, pid: int, text: str) -> None:
        """A string."""
        self.add(pid, self._text(text))

    def texts(self, pid: int, texts: Iterable[str]) -> None:
        """A sequence of strings."""
        parts = [self._text(text) for text in texts]
        self.add(pid, struct.pack(self.order + "I", len(parts)) + b"".join(parts))

    def properties(self, pairs: Iterable[tuple[str, str]], pid: int = Pid.PROPERTY_LIST) -> None:
        """A sequence of pairs of strings."""
        parts = [self._text(name) + self._text(value) for name, value in pairs]
        self.add(pid, struct.pack(self.order + "I", len(parts)) + b"".join(parts))

    def locators(self, pid: int, locators: Iterable[Locator]) -> None:
        """One parameter for each locator."""
        for locator in locators:
            self.pack_locator(pid, locator)

    def pack_locator(self, pid: int, locator: Locator) -> None:
        """A Locator_t."""
        self.add(pid, struct.pack(self.order + "iI16s", *locator))

    def _text(self, text: str) -> bytes:
        octets = text.encode() + b"\0"
        return struct.pack(self.order + "I", len(octets)) + octets.ljust(len(octets) + 3 & ~3, b"\0")


_END: Final = struct.pack("<HH", Pid.SENTINEL, 0)
_RELATED_HEAD: Final = struct.pack("<HH", Pid.RELATED_SAMPLE_IDENTITY, IDENTITY_SIZE)
_RELATED_MIDDLE: Final = struct.pack("<HH", Pid.VENDOR_RELATED_SAMPLE_IDENTITY, IDENTITY_SIZE)
_HEADERS: Final = {order: struct.Struct(order + "HH").unpack_from for order in "<>"}


# --- Inline QoS (8.7) ------------------------------------------------------------------------------------


def inline_qos(*, related: bytes = b"", key_hash: bytes = b"", status: int = 0) -> bytes:
    """Inline QoS for a DATA of ours, little endian; empty when there is nothing to say.

    `related`: sample identity of the request a reply answers (or, on a request, where its reply shall go): the
    GUID, then the sequence number as int32 high and uint32 low, little endian: 24 bytes. It is written twice:
    under the standard's id and under the older one that peers in the field still look for. `key_hash`: 16 bytes
    (9.6.3.8). `status`: whether the instance is disposed or unregistered.
    """
    if not (related or key_hash or status):
        return b""
    if related and len(related) != IDENTITY_SIZE:
        raise ValueError(f"a sample identity has {IDENTITY_SIZE} bytes, this one has {len(related)}")
    if not (key_hash or status):
        return _RELATED_HEAD + related + _RELATED_MIDDLE + related + _END
    builder = ParameterBuilder()
    if related:
        builder.add(Pid.RELATED_SAMPLE_IDENTITY, related)
        builder.add(Pid.VENDOR_RELATED_SAMPLE_IDENTITY, related)
    if key_hash:
        builder.add(Pid.KEY_HASH, key_hash)
    if status:
        builder.add(Pid.STATUS_INFO, struct.pack(">I", status))
    return builder.build()


def related_identity(parameters: Parameters | None) -> bytes | None:
    """Sample identity (24 bytes, sequence number little endian as in `inline_qos`) that a DATA is related to.

    `InvalidParameters` when it is too short.
    """
    if parameters is None:
        return None
    for pid in (Pid.RELATED_SAMPLE_IDENTITY, Pid.VENDOR_RELATED_SAMPLE_IDENTITY):
        value = parameters.first(pid, IDENTITY_SIZE)
        if value is not None:
            if parameters.order == "<":
                return value[:IDENTITY_SIZE]
            high, low = struct.unpack_from(parameters.order + "iI", value, _GUID_SIZE)
            return value[:_GUID_SIZE] + struct.pack("<iI", high, low)
    return None


def status_info(parameters: Parameters | None) -> StatusInfo:
    """What a DATA says about its instance; nothing when it does not say so. Always big endian (9.6.3.9)."""
    value = None if parameters is None else parameters.first(Pid.STATUS_INFO, 4)
    return StatusInfo(0 if value is None else value[3] & 7)


def status_info_of(parameters: Parameters | None) -> int:
    """`status_info`, nothing where it is malformed."""
    if parameters is None or Pid.STATUS_INFO not in parameters:
        return 0
    try:
        return int(status_info(parameters))
    except InvalidParameters:
        return 0


def key_hash(parameters: Parameters | None) -> bytes | None:
    """The key hash of the instance, 16 bytes."""
    value = None if parameters is None else parameters.first(Pid.KEY_HASH, 16)
    return None if value is None else value[:16]


def key_hash_of(parameters: Parameters | None) -> bytes:
    """`key_hash`, nothing where there is none or it is malformed."""
    try:
        return key_hash(parameters) or b""
    except InvalidParameters:
        return b""
