"""What the generated encoders and decoders call: texts, sequences of numbers, checks."""

from __future__ import annotations

import struct
from array import array
from typing import Any, Final

__all__ = [
    "HELPERS", "Numbers", "chars_of", "counted", "index_of", "listed", "octets_of", "read_text", "read_wide",
    "read_wide_char", "take", "text_of", "wide_char_of", "wide_chars_of", "wide_of",
]  # fmt: skip


class Numbers:
    """Sequences of numbers in one endianness."""

    def __init__(self, order: str) -> None:
        self._order = order
        self._swaps = (order == ">") != (struct.pack("=H", 1) == struct.pack(">H", 1))

    def __call__(self, values: Any, code: str, limit: int, exact: bool) -> bytes:
        kind = getattr(values, "dtype", None)
        if kind is not None:
            if kind.kind + str(kind.itemsize) != _NUMPY[code]:
                values = values.tolist()
            elif values.ndim != 1:
                raise TypeError(f"an array of {values.ndim} dimensions where a sequence is wanted")
            else:
                _check_count(len(values), limit, exact)
                octets: bytes = values.astype(self._order + _NUMPY[code]).tobytes()
                return octets
        _check_count(len(values), limit, exact)
        if code == "?":
            return bytes(map(bool, values))
        if isinstance(values, str):
            raise TypeError("a text where numbers are wanted")
        if isinstance(values, array) and values.typecode == code and _IS_WIDTH[code]:
            return self._in_order(values).tobytes()
        return struct.pack(f"{self._order}{len(values)}{code}", *values)

    def read(self, octets: bytes, pos: int, count: int, code: str) -> list[Any]:
        """The same way back; `octets` may end too soon."""
        if not _IS_WIDTH.get(code):
            return list(struct.unpack_from(f"{self._order}{count}{code}", octets, pos))
        return self._in_order(array(code, take(octets, pos, count * int(_NUMPY[code][1])))).tolist()

    def _in_order(self, data: array[Any]) -> array[Any]:
        if self._swaps:
            data = data[:]
            data.byteswap()
        return data


_NUMPY: Final = {
    "h": "i2", "H": "u2", "i": "i4", "I": "u4", "q": "i8", "Q": "u8", "f": "f4", "d": "f8", "?": "b1",
}  # fmt: skip
_IS_WIDTH: Final = {
    code: array(code).itemsize == int(name[1]) for code, name in _NUMPY.items() if code != "?"
}


def _check_count(count: int, limit: int, exact: bool) -> None:
    if exact and count != limit:
        raise ValueError(f"{count} elements where {limit} are wanted")
    if limit and count > limit:
        raise ValueError(f"{count} elements where {limit} are allowed")


def octets_of(values: Any, limit: int, exact: bool) -> bytes:
    if type(values) is not bytes:
        if isinstance(values, (int, str)):
            raise TypeError(f"{type(values).__name__} where octets are wanted")
        if not isinstance(values, (list, tuple)) and memoryview(values).itemsize != 1:
            raise TypeError("a buffer of something wider than octets")
        values = bytes(values)
    octets: bytes = values
    _check_count(len(octets), limit, exact)
    return octets


def chars_of(values: Any, limit: int, exact: bool) -> bytes:
    text = (values if isinstance(values, str) else "".join(values)).encode("latin-1")
    _check_count(len(text), limit, exact)
    return text


def listed(values: Any, limit: int, exact: bool) -> Any:
    _check_count(len(values), limit, exact)
    if isinstance(values, str):
        raise TypeError("a text where a sequence is wanted")
    return values


def wide_chars_of(values: Any, limit: int, exact: bool) -> Any:
    _check_count(len(values), limit, exact)
    return values


def text_of(text: Any, limit: int) -> bytes:
    octets: bytes = text.encode()
    if b"\0" in octets:
        raise ValueError("a text with a zero in it")
    if limit and len(text) > limit:
        raise ValueError(f"a text of {len(text)} characters where {limit} are allowed")
    return octets + b"\0"


def wide_of(text: Any, limit: int) -> bytes:
    if limit and len(text) > limit:
        raise ValueError(f"a text of {len(text)} characters where {limit} are allowed")
    octets: bytes = text.encode("utf-16")
    return octets if text else b""


def wide_char_of(text: Any) -> bytes:
    if not isinstance(text, str) or len(text) != 1:
        raise TypeError("a text that is not one character")
    octets = text.encode("utf-16")
    return bytes((len(octets),)) + octets


def index_of(item: Any, items: tuple[Any, ...]) -> int:
    index: int = item._v
    if not 0 <= index < len(items) or items[index]._parent_id != item._parent_id:
        raise ValueError(f"{item} is none of {', '.join(map(str, items))}")
    return index


def counted(count: int, limit: int, least: int, left: int) -> None:
    if limit and count > limit:
        raise ValueError(f"{count} elements where {limit} are allowed")
    if count * least > left:
        raise ValueError(f"{count} elements in {left} octets")


def take(octets: bytes, pos: int, size: int) -> bytes:
    if pos + size > len(octets):
        raise ValueError("they end too soon")
    return octets[pos : pos + size]


def read_text(octets: bytes, pos: int, size: int, limit: int) -> str:
    if pos + size > len(octets):
        raise ValueError("a text that ends too soon")
    if not size or octets[pos + size - 1]:
        raise ValueError("a text that does not end with a zero")
    data = bytes(octets[pos : pos + size - 1])
    try:
        text = data.decode()
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    if limit and len(text) > limit:
        raise ValueError(f"a text of {len(text)} characters where {limit} are allowed")
    return text


def read_wide(octets: bytes, pos: int, size: int, limit: int) -> str:
    if pos + size > len(octets):
        raise ValueError("a text that ends too soon")
    text = _wide(bytes(octets[pos : pos + size]))
    if limit and len(text) > limit:
        raise ValueError(f"a text of {len(text)} characters where {limit} are allowed")
    return text


def read_wide_char(octets: bytes, pos: int) -> tuple[str, int]:
    end = pos + 1 + octets[pos]
    if end > len(octets):
        raise ValueError("a character that ends too soon")
    text = _wide(bytes(octets[pos + 1 : end]))
    if len(text) != 1:
        raise ValueError("not one character")
    return text, end


def _wide(data: bytes) -> str:
    """UTF-16 with its byte order mark; big endian without one, as CORBA has it (3.1, part 2, 9.3.1.6)."""
    return data.decode("utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-16-be")


HELPERS: Final = {
    helper.__name__: helper
    for helper in (
        *(octets_of, chars_of, text_of, wide_of, wide_char_of, wide_chars_of, index_of, listed),
        *(read_text, read_wide, read_wide_char, take, counted),
    )
}
"""By the names that generated code has for them."""
