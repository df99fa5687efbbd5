"""The source of encoders and decoders: from the ORB's type descriptors to Python text, and that to functions.

A type is walked member by member. Members of fixed size are gathered in *runs* that one `struct.Struct` packs and
unpacks at once, with the padding between them written into its format. What is known of the position at every point
is a `Place`: position = `offset` modulo `modulus`. Where that is not enough to align the next member (after a text,
say), code is written that aligns by the real position, `pos`, which is only kept in encoders that need it.

Sequences of structures whose elements all have the same layout are packed and unpacked without a loop of their own
(`Struct.iter_unpack`); others become loops whose body is written for a position that holds in every round.

Foreign octets: every count is checked against the octets that are left before anything is made of it, so a value is
never larger than its octets allow; nothing recurses, as types that hold themselves are not written.
"""

from __future__ import annotations

import struct
from collections.abc import Callable, Iterator
from typing import Any

from muros.rtc.corba._codec_layout import (
    MAX_DEPTH,
    NUMBERS,
    START,
    UNKNOWN,
    Place,
    Row,
    Unwritable,
    advanced,
    alignment_of,
    code_of,
    kind_of,
    kinds,
    least_size,
    loosened,
    members_of,
    name_of,
    resolved,
    round_place,
    row_of,
)
from muros.rtc.corba._codec_runtime import HELPERS, Numbers

__all__ = ["make_codec"]


def make_codec(descriptor: Any, order: str) -> tuple[Callable[[Any], bytes], Callable[[bytes], Any]]:
    """An encoder and a decoder; `order` is "<" or ">". They raise what Python raises for bad values and octets.

    Unwritable if the type has parts that are left to the ORB.
    """
    source = _Source()
    encoder = _Encoder(source, keep_position=False)
    encoder.value(descriptor, "value")
    encoder.flush()
    if encoder.needs_position:
        encoder = _Encoder(source, keep_position=True)
        encoder.value(descriptor, "value")
        encoder.flush()
    decoder = _Decoder(source)
    result = decoder.value(descriptor)
    decoder.flush()
    text = "\n".join(
        [
            "def encode(value):",
            *encoder.head(),
            *(f"    {line}" for line in encoder.lines),
            "    return b''.join(parts)" if len(encoder.parts) != 1 else f"    return {encoder.parts[0]}",
            "def decode(octets):",
            "    pos = 0",
            "    end = len(octets)",
            *(f"    {line}" for line in decoder.lines),
            "    if pos != end:",
            "        raise ValueError(f'{end - pos} octets too many')",
            f"    return {result}",
        ]
    )
    space = source.namespace(order)
    exec(compile(text, f"<codec of {name_of(descriptor)}>", "exec"), space)
    return space["encode"], space["decode"]


# ---- what generated code stands on


class _Source:
    """Names of the generated code: structs by format, classes, helpers."""

    def __init__(self) -> None:
        self._structs: dict[str, str] = {}
        self._objects: dict[int, tuple[str, Any]] = {}
        self._count = 0

    def fresh(self, stem: str) -> str:
        """A new name."""
        self._count += 1
        return f"{stem}{self._count}"

    def struct(self, codes: str) -> str:
        """The name of the Struct of this format."""
        return self._structs.setdefault(codes, f"s{len(self._structs)}")

    def known(self, thing: Any) -> str:
        """The name of an object."""
        return self._objects.setdefault(id(thing), (f"k{len(self._objects)}", thing))[0]

    def namespace(self, order: str) -> dict[str, Any]:
        """What the code is run in."""
        space: dict[str, Any] = {"numbers": Numbers(order), **HELPERS}
        for codes, name in self._structs.items():
            made = struct.Struct(order + codes)
            space[name] = made
            space[f"{name}_pack"] = made.pack
            space[f"{name}_unpack"] = made.unpack_from
        space.update(self._objects.values())
        return space


# ---- encoders


class _Encoder:
    """Writes the lines that turn `value` into octets."""

    def __init__(self, source: _Source, *, keep_position: bool) -> None:
        self.lines: list[str] = []
        self.parts: list[str] = []
        """The one expression of encoders that need no more than that."""
        self.needs_position = False
        self._source = source
        self._keep = keep_position
        self._place = START
        self._codes = ""
        self._size = 0
        self._arguments: list[str] = []
        self._indent = ""
        self._depth = 0
        self._single = True

    def head(self) -> list[str]:
        """The lines before `lines`."""
        if len(self.parts) == 1:
            return []
        return ["    parts = []", "    add = parts.append", *(["    pos = 0"] if self._keep else [])]

    def value(self, descriptor: Any, expression: str) -> None:
        """Encode what `expression` gives."""
        descriptor = resolved(descriptor)
        kind = kind_of(descriptor)
        if self._depth > MAX_DEPTH:
            raise Unwritable("too many structures in structures")
        self._depth += 1
        if alignment_of(kind):
            self._scalar(kind, descriptor, expression)
        elif kind == kinds.tv_struct:
            members = list(members_of(descriptor))
            if len(members) > 1 and "." in expression:
                expression = self._let("v", expression)
            for name, member in members:
                self.value(member, f"{expression}.{name}")
        elif kind == kinds.tv_string:
            text = self._let("t", f"text_of({expression}, {descriptor[1]})")
            self._scalar(kinds.tv_ulong, kinds.tv_ulong, f"len({text})")
            self._part(text, UNKNOWN)
        elif kind == kinds.tv_wstring:
            text = self._let("t", f"wide_of({expression}, {descriptor[1]})")
            self._scalar(kinds.tv_ulong, kinds.tv_ulong, f"len({text})")
            self._part(text, UNKNOWN)
        elif kind == kinds.tv_wchar:
            self._part(self._let("t", f"wide_char_of({expression})"), UNKNOWN)
        elif kind in (kinds.tv_sequence, kinds.tv_array):
            self._many(descriptor, kind, expression)
        else:
            raise Unwritable(f"kind {kind}")
        self._depth -= 1

    def flush(self) -> None:
        """Write down the run so far."""
        if not self._codes:
            return
        packed = f"{self._source.struct(self._codes)}_pack({', '.join(self._arguments)})"
        size, self._codes, self._size, self._arguments = self._size, "", 0, []
        if self._single and not self._indent and not self.parts and not self._keep:
            self.parts.append(packed)
            self.lines.append(f"#first add({packed})")
        else:
            self._line(f"add({packed})")
        if self._keep:
            self._line(f"pos += {size}")

    def _line(self, text: str) -> None:
        if self._single and self.parts:
            # More than one part: the first one is added as all others are.
            self._single = False
            self.lines = [line.removeprefix("#first ") for line in self.lines]
            self.parts = []
        elif self._single and not text.startswith(("v", "t")):
            self._single = False
        self.lines.append(self._indent + text)

    def _let(self, stem: str, expression: str) -> str:
        name = self._source.fresh(stem)
        self.lines.append(f"{self._indent}{name} = {expression}")
        return name

    def _align(self, alignment: int) -> None:
        padding = self._place.padding(alignment)
        if padding is None:
            self.flush()
            self.needs_position = True
            self._line(f"pad = -pos % {alignment}")
            self._line("add(bytes(pad))")
            self._line("pos += pad")
            self._place = Place(alignment, 0)
        elif padding:
            self._codes += "x" * padding
            self._size += padding
            self._place = self._place.after(padding)

    def _scalar(self, kind: int, descriptor: Any, expression: str) -> None:
        size = alignment_of(kind)
        self._align(size)
        if kind == kinds.tv_enum:
            expression = f"index_of({expression}, {self._source.known(descriptor[3])})"
        elif kind == kinds.tv_char:
            expression = f"{expression}.encode('latin-1')"
        self._codes += code_of(kind)
        self._size += size
        self._arguments.append(expression)
        self._place = self._place.after(size)

    def _part(self, expression: str, place: Place) -> None:
        """Add octets that stand for themselves."""
        self.flush()
        self._line(f"add({expression})")
        if self._keep:
            self._line(f"pos += len({expression})")
        self._place = place

    def _many(self, descriptor: Any, kind: int, expression: str) -> None:
        element = resolved(descriptor[1])
        inner = kind_of(element)
        limit, exact = int(descriptor[2]), kind == kinds.tv_array
        bounds = f"{limit}, {exact}"
        if inner in (kinds.tv_octet, kinds.tv_char) or inner in NUMBERS:
            helper = {kinds.tv_octet: "octets_of", kinds.tv_char: "chars_of"}.get(inner)
            if helper is not None:
                data = self._let("t", f"{helper}({expression}, {bounds})")
            else:
                data = self._let("t", f"numbers({expression}, {code_of(inner)!r}, {bounds})")
            size = alignment_of(inner)
            if not exact:
                length = f"len({data})" if size == 1 else f"len({data}) // {size}"
                self._scalar(kinds.tv_ulong, kinds.tv_ulong, length)
            entry = self._place
            self._align_if(size, data)
            self._part(data, self._place.after(limit * size) if exact else loosened(entry, size))
            return
        helper = "wide_chars_of" if inner == kinds.tv_wchar else "listed"
        items = self._let("t", f"{helper}({expression}, {bounds})")
        if not exact:
            self._scalar(kinds.tv_ulong, kinds.tv_ulong, f"len({items})")
        row = row_of(element)
        if row is not None:
            entry = self._place
            self._align_if(row.alignment, items)
            one = self._source.fresh("e")
            arguments = ", ".join(self._leaf(one, *leaf) for leaf in row.leaves)
            pack = f"{self._source.struct(row.codes)}_pack"
            data = self._let("t", f"b''.join([{pack}({arguments}) for {one} in {items}])")
            place = self._place.after(limit * row.size) if exact else loosened(entry, row.alignment)
            self._part(data, place)
            return
        self._loop(element, items)

    def _align_if(self, alignment: int, items: str) -> None:
        """Align for elements, if there are any: an empty sequence is not followed by padding."""
        padding = self._place.padding(alignment)
        if padding == 0:
            return
        self.flush()
        if padding is None:
            self.needs_position = True
            self._line(f"pad = -pos % {alignment} if {items} else 0")
        else:
            self._line(f"pad = {padding} if {items} else 0")
        self._line("add(bytes(pad))")
        if self._keep:
            self._line("pos += pad")
        self._place = Place(alignment, 0)

    def _leaf(self, one: str, path: str, kind: int, descriptor: Any) -> str:
        if kind == kinds.tv_enum:
            return f"index_of({one}{path}, {self._source.known(descriptor[3])})"
        return f"{one}{path}.encode('latin-1')" if kind == kinds.tv_char else f"{one}{path}"

    def _loop(self, element: Any, items: str) -> None:
        self.flush()
        start = round_place(lambda place: advanced(element, place), self._place)
        one = self._source.fresh("e")
        self._line(f"for {one} in {items}:")
        outer, self._indent = self._indent, self._indent + "    "
        self._place = start
        self.value(element, one)
        self.flush()
        self._indent = outer
        self._place = start


# ---- decoders


class _Decoder:
    """Writes the lines that read a value from `octets` at `pos`, and gives the expression of what was read."""

    def __init__(self, source: _Source) -> None:
        self.lines: list[str] = []
        self._source = source
        self._place = START
        self._codes = ""
        self._size = 0
        self._names: list[str] = []
        self._indent = ""
        self._depth = 0

    def value(self, descriptor: Any) -> str:
        """Read a value; the expression may be used after `flush`."""
        descriptor = resolved(descriptor)
        kind = kind_of(descriptor)
        if self._depth > MAX_DEPTH:
            raise Unwritable("too many structures in structures")
        self._depth += 1
        try:
            if alignment_of(kind):
                return self._scalar(kind, descriptor)
            if kind == kinds.tv_struct:
                fields = [self.value(member) for _, member in members_of(descriptor)]
                return f"{self._source.known(descriptor[1])}({', '.join(fields)})"
            if kind in (kinds.tv_string, kinds.tv_wstring):
                count = self._count()
                helper = "read_text" if kind == kinds.tv_string else "read_wide"
                return self._read(f"{helper}(octets, pos, {count}, {descriptor[1]})", f"pos += {count}")
            if kind == kinds.tv_wchar:
                self.flush()
                name = self._source.fresh("w")
                self._line(f"{name}, pos = read_wide_char(octets, pos)")
                self._place = UNKNOWN
                return name
            if kind in (kinds.tv_sequence, kinds.tv_array):
                return self._many(descriptor, kind)
            raise Unwritable(f"kind {kind}")
        finally:
            self._depth -= 1

    def flush(self) -> None:
        """Write down the run so far."""
        if not self._codes:
            return
        names = ", ".join(self._names) + ","
        self._line(f"{names} = {self._source.struct(self._codes)}_unpack(octets, pos)")
        self._line(f"pos += {self._size}")
        self._codes, self._size, self._names = "", 0, []

    def _line(self, text: str) -> None:
        self.lines.append(self._indent + text)

    def _align(self, alignment: int) -> None:
        padding = self._place.padding(alignment)
        if padding is None:
            self.flush()
            self._line(f"pos += -pos % {alignment}")
            self._place = Place(alignment, 0)
        elif padding and self._codes:
            self._codes += "x" * padding
            self._size += padding
            self._place = self._place.after(padding)
        elif padding:
            self._line(f"pos += {padding}")
            self._place = self._place.after(padding)

    def _scalar(self, kind: int, descriptor: Any) -> str:
        size = alignment_of(kind)
        self._align(size)
        name = self._source.fresh("n")
        self._codes += code_of(kind)
        self._size += size
        self._names.append(name)
        self._place = self._place.after(size)
        return self._converted(name, kind, descriptor)

    def _converted(self, name: str, kind: int, descriptor: Any) -> str:
        if kind == kinds.tv_enum:
            return f"{self._source.known(descriptor[3])}[{name}]"
        return f"{name}.decode('latin-1')" if kind == kinds.tv_char else name

    def _count(self) -> str:
        name = self._scalar(kinds.tv_ulong, kinds.tv_ulong)
        self.flush()
        return name

    def _read(self, expression: str, then: str) -> str:
        """Read something of a size of its own."""
        self.flush()
        name = self._source.fresh("r")
        self._line(f"{name} = {expression}")
        self._line(then)
        self._place = UNKNOWN
        return name

    def _many(self, descriptor: Any, kind: int) -> str:
        element = resolved(descriptor[1])
        inner = kind_of(element)
        limit, exact = int(descriptor[2]), kind == kinds.tv_array
        self.flush()
        if exact:
            count = str(limit)
        else:
            count = self._count()
            least = least_size(element)
            self._line(f"counted({count}, {limit}, {least}, end - pos)")
        entry = self._place
        if inner in NUMBERS or inner == kinds.tv_char:
            size = alignment_of(inner)
            self._align_if(size, count, exact)
            if inner == kinds.tv_octet:
                source = f"take(octets, pos, {count})"
            elif inner == kinds.tv_char:
                source = f"take(octets, pos, {count}).decode('latin-1')"
            else:
                code = code_of(inner)
                source = (
                    f"list({self._source.struct(f'{limit}{code}')}_unpack(octets, pos))"
                    if exact
                    else f"numbers.read(octets, pos, {count}, {code!r})"
                )
            aligned = self._place
            name = self._read(source, f"pos += {count} * {size}" if size > 1 else f"pos += {count}")
            self._place = aligned.after(limit * size) if exact else loosened(entry, size)
            return name
        row = row_of(element)
        if row is not None:
            self._align_if(row.alignment, count, exact)
            return self._rows(row, element, count, exact, limit, entry)
        name = self._loop(element, count)
        return f"''.join({name})" if inner == kinds.tv_wchar else name

    def _align_if(self, alignment: int, count: str, exact: bool) -> None:
        padding = self._place.padding(alignment)
        if padding == 0:
            return
        step = f"-pos % {alignment}" if padding is None else str(padding)
        self._line(f"pos += {step}" if exact else f"pos += {step} if {count} else 0")
        self._place = Place(alignment, 0)

    def _rows(self, row: Row, element: Any, count: str, exact: bool, limit: int, entry: Place) -> str:
        names = [self._source.fresh("n") for _ in row.leaves]
        leaves = iter(zip(names, row.leaves, strict=True))
        built = self._built(element, leaves)
        unpack = f"{self._source.struct(row.codes)}.iter_unpack(take(octets, pos, {count} * {row.size}))"
        aligned = self._place
        name = self._read(f"[{built} for {', '.join(names)}, in {unpack}]", f"pos += {count} * {row.size}")
        self._place = aligned.after(limit * row.size) if exact else loosened(entry, row.alignment)
        return name

    def _built(self, element: Any, leaves: Iterator[tuple[str, tuple[str, int, Any]]]) -> str:
        element = resolved(element)
        if kind_of(element) == kinds.tv_struct:
            fields = ", ".join(self._built(member, leaves) for _, member in members_of(element))
            return f"{self._source.known(element[1])}({fields})"
        name, (_, kind, descriptor) = next(leaves)
        return self._converted(name, kind, descriptor)

    def _loop(self, element: Any, count: str) -> str:
        start = round_place(lambda place: advanced(element, place), self._place)
        name = self._source.fresh("r")
        self._line(f"{name} = []")
        self._line(f"for _ in range({count}):")
        outer, self._indent = self._indent, self._indent + "    "
        self._place = start
        one = self.value(element)
        self.flush()
        self._line(f"{name}.append({one})")
        self._indent = outer
        self._place = start
        return name
