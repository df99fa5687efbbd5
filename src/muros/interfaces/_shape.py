"""The shape of a message as a line of text: what a board needs to know of a type to bound or to size its messages.

Its words stand for the fields in order, names before a colon:

=============== ======================================================================
``4``           a number of 4 bytes
``8*36``        an array of 36 numbers of 8 bytes
``label:s``     a string; ``label:s64`` of at most 64 characters; ``label:w`` of 16 bits
``data:1``      a sequence of numbers of 1 byte; ``data:1<16`` of at most 16
``dim:[``       a sequence, up to the matching ``)``; ``dim:[<3`` of at most 3 elements
``poses:4(``    an array of 4, up to ``)``
``header:{``    a nested message, up to ``)``
=============== ======================================================================

Elements that are strings have the name ``data``. A message without fields is its one byte, ``1``.
"""

from __future__ import annotations

from collections.abc import Callable

from muros.interfaces._model import PRIMITIVES, Field, FieldType, Kind, Message, attribute


def shape(message: Message, find: Callable[[str], Message]) -> str:
    """The shape of a message; ``find`` gives nested ones by name."""
    words = [word for field in message.fields for word in _words(field, find)]
    return " ".join(words) or "1"


def _words(field: Field, find: Callable[[str], Message]) -> list[str]:
    kind, name = field.type, attribute(field.name)
    bound = f"<{kind.count}" if kind.kind is Kind.BOUNDED else ""
    primitive = None if kind.nested else PRIMITIVES[kind.base]
    if primitive is not None and primitive.size:
        if kind.kind is Kind.ONE:
            return [str(primitive.size)]
        if kind.kind is Kind.ARRAY:
            return [f"{primitive.size}*{kind.count}"]
        return [f"{name}:{primitive.size}{bound}"]
    if kind.kind is Kind.ONE:
        return [f"{name}:{_text(kind)}"] if primitive else [f"{name}:{{", shape(find(kind.base), find), ")"]
    opened = f"{kind.count}(" if kind.kind is Kind.ARRAY else f"[{bound}"
    return [f"{name}:{opened}", f"data:{_text(kind)}" if primitive else shape(find(kind.base), find), ")"]


def _text(kind: FieldType) -> str:
    return ("w" if kind.base == "wstring" else "s") + (str(kind.string_bound) if kind.string_bound else "")
