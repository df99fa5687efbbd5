"""What generated host classes share: the base class of messages and the helpers off the straight line.

Generated code handles the common case inline; whatever is unusual (a list where an array is due, a numpy array, bytes
for a string, a malformed length) comes here. Everything raises :class:`muros.cdr.CdrError` and nothing else.
"""

from __future__ import annotations

import struct
from array import array
from collections.abc import Callable, Sequence
from typing import Any, ClassVar, NoReturn, Self, cast

from muros.cdr import CdrError

NAMES = ("A", "BAD", "Message", "N")
"""What generated code knows with an underscore before it, so that no message type can be called the same."""
FUNCTIONS = (
    "block", "blocks_swapped", "bools", "explain", "malformed", "narrow", "numbers", "octets", "odd_text",
    "room", "short", "swapped", "text", "text_size", "too_many", "trailing", "wide", "wrong_count",
)  # fmt: skip
"""What generated code knows by its own name."""

BAD = (struct.error, TypeError, ValueError, AttributeError, OverflowError, IndexError)
"""What goes wrong in generated code when a value or a byte is not as it should be."""

A = {a: tuple(bytes(-k % a) for k in range(a)) for a in (2, 4, 8)}
"""Padding: ``A[align][position % align]`` leads to the next aligned position."""
N = {a: tuple(bytes(1 + -k % a) for k in range(a)) for a in (2, 4, 8)}
"""The same behind a string: its NUL, then the padding; the position counts the NUL."""

_ITEM_SIZES = {"?": 1, "b": 1, "B": 1, "h": 2, "H": 2, "i": 4, "I": 4, "q": 8, "Q": 8, "f": 4, "d": 8}
_SMALL = 4096  # bytes; bodies up to this size are copied rather than viewed, which reads faster
_SHOWN = 16  # elements of a long sequence that repr shows
_PADDING = 3  # bytes behind the body that transports add


class Message:
    """The base of all generated message classes.

    Plain attributes hold the fields; a message is written by :meth:`size` and :meth:`write` into a buffer or by
    :meth:`serialize` into bytes, and read by :meth:`read` or :meth:`deserialize`. Bodies are XCDR1, aligned from
    their first byte. All of them raise :class:`muros.cdr.CdrError` when a value or a byte does not fit the type.
    """

    __slots__: ClassVar[tuple[str, ...]] = ()
    TYPE: ClassVar[str]
    _FIELDS: ClassVar[dict[str, str]]
    _blank: ClassVar[Callable[[], Any]]
    _decode: ClassVar[Callable[[Any, Any], None]]
    __hash__ = None  # type: ignore[assignment]

    def size(self) -> int:
        """Bytes of the body as it is now."""
        raise NotImplementedError

    def write(self, buf: bytearray | memoryview, off: int = 0) -> int:
        """Writes the little-endian body into the buffer at ``off``; returns the offset behind it."""
        body = self.serialize()
        end = off + len(body)
        if end > len(buf):
            raise CdrError(f"{self.TYPE}: {len(body)} bytes do not fit the {len(buf) - off} of the buffer")
        buf[off:end] = body
        return end

    def read(self, buf: bytes | bytearray | memoryview, off: int = 0, n: int | None = None) -> None:
        """Reads the little-endian body in ``buf[off:off+n]`` into this message (its fields, nested ones in place).

        Up to three bytes of padding behind the body are ignored. After an error the fields are partly read.
        """
        type(self)._decode(self, _body(buf, off, n))

    def serialize(self, big_endian: bool = False, header: bool = False) -> bytes:
        """The body as bytes; ``header`` puts the 4-byte encapsulation header of DDS before it."""
        raise NotImplementedError

    @classmethod
    def deserialize(
        cls, data: bytes | bytearray | memoryview, big_endian: bool = False, header: bool = False
    ) -> Self:
        """A new message from its body; with ``header`` from its encapsulation, which then tells the byte order.

        Sequences of bytes (``uint8[]``) become read-only views of ``data`` when that is immutable, else of a copy.
        """
        message: Any = cls._blank()
        if header:
            big_endian = _encapsulation(data)
        body = data if type(data) is bytes and not header else _body(data, 4 if header else 0, None)
        decode: Callable[[Any, Any], None] = cls._swapped_codec()[1] if big_endian else cls._decode
        decode(message, body)
        return cast("Self", message)

    @classmethod
    def get_fields_and_field_types(cls) -> dict[str, str]:
        """Field names and their types in IDL notation, such as ``{'data': 'int32'}``."""
        return dict(cls._FIELDS)

    @classmethod
    def _swapped_codec(cls) -> tuple[Callable[[Any], bytes], Callable[[Any, Any], None]]:
        """The big-endian encoder and decoder, generated when first needed."""
        from muros.interfaces._host import swapped_codec

        return swapped_codec(cls)

    def _serialize_as(self, big_endian: bool, header: bool) -> bytes:
        """The less usual ways of :meth:`serialize`."""
        if big_endian:
            try:
                body = self._swapped_codec()[0](self)
            except BAD as error:
                raise explain(self, error) from None
        else:
            body = self.serialize()
        return (b"\0\0\0\0" if big_endian else b"\0\1\0\0") + body if header else body

    def __repr__(self) -> str:
        fields = ", ".join(f"{name}={_shown(getattr(self, name))}" for name in self.__slots__)
        return f"{type(self).__module__}.{type(self).__qualname__}({fields})"

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return all(_same(getattr(self, name), getattr(other, name)) for name in self.__slots__)

    def __reduce__(self) -> tuple[Callable[..., Any], tuple[Any, ...]]:
        return _rebuilt, (type(self), self.serialize())


def _rebuilt(cls: type[Message], body: bytes) -> Message:
    return cls.deserialize(body)


# ---- writing ----


def text(value: object, bound: int = 0) -> bytes:
    """The bytes of a string given as bytes (or as str, checked against its bound)."""
    data = value.encode() if isinstance(value, str) else value
    if not isinstance(data, bytes | bytearray | memoryview):
        raise CdrError(f"a str is due, not {type(value).__name__}")
    if bound and len(data) > bound:
        raise CdrError(f"{len(data)} bytes of text, at most {bound} allowed")
    return bytes(data)


def text_size(value: str | bytes) -> int:
    """The bytes that a string takes, without its NUL."""
    if type(value) is str:
        return len(value) if value.isascii() else len(value.encode())
    return len(text(value))


def wide(value: str, bound: int = 0, big_endian: bool = False) -> bytes:
    """A wstring as ROS 2 writes it: each UTF-16 unit in 4 bytes, no terminator."""
    if not isinstance(value, str):
        raise CdrError(f"a str is due, not {type(value).__name__}")
    units = value.encode("utf-16-be" if big_endian else "utf-16-le")
    if bound and len(units) > 2 * bound:
        raise CdrError(f"{len(units) // 2} UTF-16 units of text, at most {bound} allowed")
    data = bytearray(2 * len(units))
    first = 2 if big_endian else 0
    data[first::4], data[first + 1 :: 4] = units[::2], units[1::2]
    return bytes(data)


def octets(value: Any) -> Any:
    """A sequence of bytes as something that can be copied at once."""
    if isinstance(value, bytes | bytearray):
        return value
    if isinstance(value, str):
        raise CdrError("bytes are due, not str")
    try:
        view = memoryview(value)
    except TypeError:
        return bytes(value)
    if view.ndim == 1 and view.itemsize == 1 and view.contiguous:
        return view.cast("B")
    return bytes(view.tolist())


def bools(value: Any) -> bytes:
    """A sequence of bools."""
    return bytes(map(bool, value))


def numbers(code: str, value: Any) -> Any:
    """A sequence of numbers as an array or a view of that type code, which can be copied at once."""
    try:
        view = memoryview(value)
    except TypeError:
        return array(code, value)
    if view.ndim == 1 and view.contiguous and _same_format(view, code):
        return view
    if view.ndim != 1:
        raise CdrError(f"a flat sequence is due, not one of {view.ndim} dimensions")
    return array(code, view.tolist())


def swapped(code: str, value: Any) -> array[Any]:
    """A copy of a sequence of numbers in the other byte order."""
    values = numbers(code, value)
    copy = array(code)
    copy.frombytes(values.tobytes())
    copy.byteswap()
    return copy


def block(code: str, count: int, value: Any) -> bytes:
    """The bytes of a fixed array of numbers or bools."""
    if code == "?":
        data = bools(value)
    elif code == "B":
        data = bytes(octets(value))
    else:
        data = numbers(code, value).tobytes()
    size = _ITEM_SIZES[code]
    if len(data) != count * size:
        raise CdrError(f"{len(data) // size} elements, {count} needed")
    return data


def blocks_swapped(code: str, count: int, value: Any) -> bytes:
    """The bytes of a fixed array in the other byte order."""
    values = array(code)
    values.frombytes(block(code, count, value))
    values.byteswap()
    return values.tobytes()


def too_many(count: int, bound: int) -> NoReturn:
    """A bounded sequence is over its bound."""
    raise CdrError(f"{count} elements, at most {bound} allowed")


def wrong_count(count: int, needed: int) -> NoReturn:
    """An array has another number of elements than its type says."""
    raise CdrError(f"{count} elements, {needed} needed")


def room(value: memoryview | bytearray, off: int, size: int, name: str) -> NoReturn:
    """A buffer is too small for a message of fixed size."""
    raise CdrError(f"{name}: {size} bytes do not fit the {max(len(value) - off, 0)} of the buffer")


def explain(message: Message, error: Exception) -> CdrError:
    """The error to raise when writing failed: which field of the message, what is wrong with it."""
    where, problem = _culprit(message)
    return CdrError(f"{message.TYPE}{where}: {problem or error}")


# ---- reading ----


def odd_text(data: bytes | memoryview, start: int, count: int) -> str:
    """A string that is not as usual: empty without its NUL, or malformed."""
    if count == 0:
        return ""
    if start + count > len(data):
        short(start + count, len(data))
    raise CdrError(f"a string at byte {start} does not end with NUL")


def narrow(data: bytes | memoryview, big_endian: bool = False) -> str:
    """The text of a wstring, see :func:`wide`."""
    raw = bytes(data)
    first = 2 if big_endian else 0
    if any(raw[2 - first :: 4]) or any(raw[3 - first :: 4]):
        raise CdrError("a wstring has units beyond UTF-16")
    units = bytearray(len(raw) // 2)
    units[::2], units[1::2] = raw[first::4], raw[first + 1 :: 4]
    return units.decode("utf-16-be" if big_endian else "utf-16-le")


def short(needed: int, have: int) -> NoReturn:
    """The body ends before the value does."""
    raise CdrError(f"{have} bytes, at least {needed} needed")


def trailing(rest: int) -> NoReturn:
    """The body does not end where the type says."""
    if rest < 0:
        raise CdrError(f"{-rest} bytes missing at the end")
    raise CdrError(f"{rest} bytes left over: is it of another type?")


def malformed(type_name: str, body: bytes | memoryview, error: Exception) -> CdrError:
    """The error to raise when reading failed."""
    if isinstance(error, struct.error):
        return CdrError(f"{type_name}: malformed body: {len(body)} bytes are too few")
    return CdrError(f"{type_name}: malformed body: {error}")


def _body(data: Any, off: int, n: int | None) -> bytes | memoryview:
    """The immutable bytes of a body; large ones are not copied when the buffer itself is immutable."""
    view = memoryview(data)
    if view.format != "B" or view.ndim != 1:
        view = view.cast("B")
    end = len(view) if n is None else off + n
    if not 0 <= off <= end <= len(view):
        raise CdrError(f"bytes {off} to {end} lie outside a buffer of {len(view)}")
    part = view[off:end]
    if end - off <= _SMALL or type(part.obj) is not bytes:
        return bytes(part)
    return part


def _encapsulation(data: Any) -> bool:
    """Whether the encapsulation header (DDS-XTypes 1.3, 7.6.3.1.2) says big-endian."""
    head = bytes(memoryview(data)[:4])
    if len(head) < 4 or head[0] or head[1] > 1:
        raise CdrError(
            f"no plain CDR: the encapsulation header is {head.hex(' ') or 'missing'}, 00 00 or 00 01 is due"
        )
    return not head[1]


# ---- telling ----


def _shown(value: Any) -> str:
    if isinstance(value, array | memoryview | list) and len(value) > _SHOWN:
        return f"[{', '.join(_shown(item) for item in value[:_SHOWN])}, ... {len(value)} in all]"
    if isinstance(value, array):
        return repr(value.tolist())
    if isinstance(value, memoryview):
        return repr(value.tobytes())
    if isinstance(value, bytes | bytearray) and len(value) > 4 * _SHOWN:
        return f"{bytes(value[: 4 * _SHOWN])!r}... {len(value)} in all"
    return repr(value)


def _same(one: Any, other: Any) -> bool:
    if one is other:
        return True
    if isinstance(one, str | int | float | Message) and type(one) is type(other):
        return bool(one == other)
    if isinstance(other, array) and not isinstance(one, array):
        one, other = other, one
    try:
        if isinstance(one, array):
            return one == (other if isinstance(other, array) else array(one.typecode, other))
        if isinstance(one, bytes | bytearray | memoryview) or isinstance(
            other, bytes | bytearray | memoryview
        ):
            return bytes(octets(one)) == bytes(octets(other))
        if isinstance(one, Sequence) and isinstance(other, Sequence) and not isinstance(one, str):
            return len(one) == len(other) and all(map(_same, one, other))
        return bool(one == other)
    except (TypeError, ValueError, OverflowError):
        return False


def _same_format(view: memoryview, code: str) -> bool:
    """Whether a view's elements are those of the type code (numpy says ``l`` for int64)."""
    have = view.format.lstrip("=@<") if view.itemsize == 1 or struct.pack("=H", 1) == b"\1\0" else view.format
    if have in ("l", "L"):
        have = {("l", 8): "q", ("L", 8): "Q", ("l", 4): "i", ("L", 4): "I"}[have, view.itemsize]
    return have == code


_CODES = {
    "boolean": "?", "octet": "B", "uint8": "B", "int8": "b", "int16": "h", "uint16": "H", "int32": "i",
    "uint32": "I", "int64": "q", "uint64": "Q", "float": "f", "double": "d",
}  # fmt: skip


def _culprit(message: Message) -> tuple[str, str]:
    """The path of the first field that cannot be written and what is wrong with it; empty if none is found."""
    for name, kind in zip(message.__slots__, message._FIELDS.values(), strict=True):
        value = getattr(message, name, None)
        code = _CODES.get(kind)
        if code:
            try:
                struct.pack(code, value)
            except struct.error:
                return f".{name}", f"{_shown(value)} does not fit {kind}"
        elif isinstance(value, Message):
            where, problem = _culprit(value)
            if problem:
                return f".{name}{where}", problem
        elif kind.endswith("]") or kind.startswith("sequence<"):
            found = _bad_elements(value, kind)
            if found:
                return f".{name}{found[0]}", found[1]
        elif kind.startswith(("string", "wstring")):
            try:
                text(value)
            except ValueError as error:
                return f".{name}", str(error)
        else:
            return f".{name}", f"{_shown(value)} is no {kind}"
    return "", ""


def _bad_elements(values: Any, kind: str) -> tuple[str, str] | None:
    inner = (
        kind.removeprefix("sequence<").partition(",")[0].rstrip(">")
        if kind[-1] == ">"
        else kind.partition("[")[0]
    )
    code = _CODES.get(inner)
    count = kind.partition("[")[2].rstrip("]")
    try:
        if count and len(values) != int(count):
            return "", f"{len(values)} elements, {count} needed"
        for at, item in enumerate(values):
            if code:
                struct.pack(code, item)
            elif isinstance(item, Message):
                where, problem = _culprit(item)
                if problem:
                    return f"[{at}]{where}", problem
            elif "/" in inner:
                return f"[{at}]", f"{_shown(item)} is no {inner}"
            else:
                text(item)
    except struct.error:
        return f"[{at}]", f"{_shown(item)} does not fit {inner}"
    except TypeError:
        return "", f"{_shown(values)} is no sequence of {inner}"
    except ValueError as error:
        return f"[{at}]", str(error)
    return None
