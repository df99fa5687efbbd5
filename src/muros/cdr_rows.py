"""CDR for boards: many sequences in a row, with one call; see :mod:`muros.cdr_lists`. Few types have that.

``codes`` has one for each sequence: ``s`` for strings, ``B`` for bytes, ``?`` for bools, else that of numbers.
"""

from array import array
from struct import calcsize

from muros.cdr_lists import list_size, put_sequence, sequence, texts_size
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Sequence
    from typing import Any


def new_sequences(codes: str, *values: "Any") -> "list[Any]":
    """What a constructor was given for sequences; in place of None new ones."""
    made = list(values)
    for i in range(len(codes)):
        if made[i] is None:
            code = codes[i]
            made[i] = b"" if code == "B" else [] if code in "?s" else array(code)
    return made


def sequences(at: "list[Any]", codes: str) -> "list[Any]":
    """The next sequences."""
    return [sequence(at, code) for code in codes]


def put_sequences(buf: "bytearray", p: int, off: int, codes: str, *values: "Sequence[Any]") -> int:
    """Writes sequences; returns the offset behind the last. Allocates."""
    for i in range(len(codes)):
        code = codes[i]
        p = put_sequence(buf, p, off, values[i], "B" if code == "?" else code)
    return p


def sequences_size(p: int, codes: str, *values: "Sequence[Any]") -> int:
    """The size of a message up to and with sequences, ``p`` without them."""
    for i in range(len(codes)):
        code = codes[i]
        if code == "s":
            p = texts_size(p, values[i])
        else:
            size = calcsize("B" if code == "?" else code)
            p = list_size(p, values[i], size, size)
    return p
