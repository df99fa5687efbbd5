"""Straight-line code for host classes that encodes messages or computes their size.

An encoder walks the leaves once. Numbers that follow each other go into one ``struct`` call; strings and sequences
are byte objects of their own; at the end ``b"".join`` copies everything into place once, which for large messages is
faster than filling a buffer. The position is only computed (``terms``) where padding depends on it, and then only its
remainder by 8 counts.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from muros.interfaces._layout import (
    MAX_ALIGN,
    START,
    Block,
    Dummy,
    Leaf,
    Many,
    Numbers,
    Path,
    Scalar,
    Text,
    after,
    loop,
)


class Code:
    """Lines of a function body in the making, with its own names for temporary variables."""

    def __init__(self, root: str) -> None:
        self.lines: list[str] = []
        self.indent = 0
        self._root = root
        self._count = 0
        self._parents: dict[Path, str] = {}

    def line(self, text: str) -> None:
        self.lines.append("    " * self.indent + text)

    def temp(self, letter: str) -> str:
        """A fresh variable; none is assigned twice, so that expressions can be kept for later."""
        self._count += 1
        return f"{letter}{self._count}"

    def place(self, path: Path) -> str:
        """The expression of a leaf; nested messages on the way get variables of their own."""
        if not path:
            return self._root
        if len(path) == 1:
            return f"{self._root}.{path[0]}"
        parent = path[:-1]
        if parent not in self._parents:
            value = self.place(parent)
            self._parents[parent] = self.temp("v")
            self.line(f"{self._parents[parent]} = {value}")
        return f"{self._parents[parent]}.{path[-1]}"

    def enter(self, root: str) -> tuple[str, dict[Path, str]]:
        """Goes into a loop whose elements are ``root``; returns what :meth:`leave` needs."""
        saved = self._root, self._parents
        self._root, self._parents = root, {}
        self.indent += 1
        return saved

    def leave(self, saved: tuple[str, dict[Path, str]]) -> None:
        self._root, self._parents = saved
        self.indent -= 1


def format_text(order: str, chunks: Sequence[str]) -> str:
    """A ``struct`` format of chunks; equal codes in a row are counted together."""
    merged: list[tuple[int, str]] = []
    for chunk in chunks:
        if merged and merged[-1][1] == chunk and len(chunk) == 1:
            merged[-1] = (merged[-1][0] + 1, chunk)
        else:
            merged.append((1, chunk))
    return order + "".join(code if count == 1 else f"{count}{code}" for count, code in merged)


class Structs:
    """The ``struct.Struct`` constants of a generated module, one for each format."""

    def __init__(self) -> None:
        self._names: dict[str, str] = {}

    def name(self, order: str, chunks: Sequence[str]) -> str:
        """The constant for a format."""
        return self._names.setdefault(format_text(order, chunks), f"_S{len(self._names) + 1}")

    def lines(self) -> list[str]:
        return [f'{name} = _Struct("{text}")' for text, name in self._names.items()]


def size_code(found: Sequence[Leaf]) -> list[str]:
    """The lines of a function of ``m`` that returns the size of the body in bytes."""
    return _Sizer(found).code.lines


class _Sizer:
    def __init__(self, found: Sequence[Leaf]) -> None:
        self.code = Code("m")
        self._at = START
        self._terms: list[str] = []
        self._const = 0
        for leaf in found:
            self._leaf(leaf)
        self.code.line(f"return {self._position()}")

    def _leaf(self, leaf: Leaf) -> None:
        start = self._at
        match leaf:
            case Scalar():
                self._skip(leaf.size, leaf.size)
            case Block():
                self._skip(leaf.size, leaf.size * leaf.count)
            case Dummy():
                self._const += 1
            case Text():
                value = self.code.place(leaf.path)
                self._skip(4, 4 if leaf.wide else 5)
                self._terms.append(f"len(wide({value}))" if leaf.wide else f"text_size({value})")
            case Numbers():
                self._numbers(leaf)
            case Many():
                self._many(leaf)
        self._at = after(leaf, start)

    def _numbers(self, leaf: Numbers) -> None:
        value = self.code.place(leaf.path)
        self._skip(4, 4)
        if self._at.aligned(4).moved(4).pad(leaf.size) == 0:
            self._terms.append(f"len({value})" if leaf.size == 1 else f"{leaf.size} * len({value})")
            return
        position, count = self._variable(), self.code.temp("n")
        self.code.line(f"{count} = len({value})")
        self.code.line(f"if {count}:")
        self.code.line(
            f"    {position} = ({position} + {leaf.size - 1} & -{leaf.size}) + {leaf.size} * {count}"
        )

    def _many(self, leaf: Many) -> None:
        value = self.code.place(leaf.path)
        at = self._at
        if not leaf.count:
            self._skip(4, 4)
            at = at.aligned(4).moved(4)
        position, element = self._variable(), self.code.temp("e")
        self.code.line(f"for {element} in {value}:")
        saved = self.code.enter(element)
        self._at = loop(leaf.body, at)
        for inner in leaf.body:
            self._leaf(inner)
        self.code.line(f"{position} = {self._position()}")
        self.code.leave(saved)
        self._terms, self._const = [position], 0

    def _skip(self, align: int, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            position = self._variable()
            self._terms = [f"({position} + {align - 1} & -{align})"]
            pad = 0
        self._const += pad + size

    def _variable(self) -> str:
        name = self.code.temp("p")
        self.code.line(f"{name} = {self._position()}")
        self._terms, self._const = [name], 0
        return name

    def _position(self) -> str:
        return " + ".join(self._terms + ([str(self._const)] if self._const or not self._terms else []))


class Encoder:
    """Encoding code of one message: :meth:`body` are the lines of a function of ``m`` that returns bytes."""

    def __init__(self, found: Sequence[Leaf], structs: Structs, big_endian: bool = False) -> None:
        self._code = Code("m")
        self._structs = structs
        self._order = ">" if big_endian else "<"
        self._big = big_endian
        self._swap = big_endian == (sys.byteorder == "little")
        self._at = START
        self._run: list[str] = []  # format of the numbers gathered so far
        self._values: list[str] = []  # their expressions
        self._parts: list[str] = []  # byte expressions gathered so far
        self._terms: list[str] = []  # the position is the sum of these
        self._const = 0
        self._listed = any(isinstance(leaf, Many) for leaf in found)
        self.values: list[str] | None = None  # the expressions, if the whole message is one struct call
        self.struct = ""
        if self._listed:
            self._code.line("o = []")
        for leaf in found:
            self._leaf(leaf)
        self._finish()

    def body(self) -> list[str]:
        return self._code.lines

    def prelude(self) -> list[str]:
        """The lines before the final ``return``."""
        return self._code.lines[:-1]

    def _finish(self) -> None:
        whole = not self._parts and not self._listed and bool(self._values)
        if whole:
            self.values = self._values[:]
        self._flush()
        if whole:
            self.struct = self._parts[0].partition(".")[0]
            self._code.line(f"return {self._parts[0]}")
        elif self._listed:
            self._out()
            self._code.line('return b"".join(o)')
        elif len(self._parts) == 1:
            self._code.line(f"return {self._parts[0]}")
        else:
            self._code.line(f'return b"".join(({", ".join(self._parts)}))')

    def _leaf(self, leaf: Leaf) -> None:
        start = self._at
        match leaf:
            case Scalar():
                self._number(leaf.size, leaf.code, self._code.place(leaf.path), leaf.size)
            case Block():
                self._block(leaf)
            case Dummy():
                self._run.append("x")
                self._const += 1
            case Text():
                self._text(leaf)
            case Numbers():
                self._numbers(leaf)
            case Many():
                self._many(leaf)
        self._at = after(leaf, start)

    def _block(self, leaf: Block) -> None:
        value = self._code.place(leaf.path)
        name = self._code.temp("c")
        if self._swap and leaf.size > 1:
            self._code.line(f'{name} = blocks_swapped("{leaf.code}", {leaf.count}, {value})')
        elif leaf.code in "B?":
            self._code.line(f"{name} = {value}")
            good = f"type({name}) is bytes and len({name}) == {leaf.count}" if leaf.code == "B" else "False"
            self._code.line(f'{name} = {name} if {good} else block("{leaf.code}", {leaf.count}, {name})')
        else:
            self._code.line(f"{name} = {value}")
            good = (
                f'type({name}) is array and {name}.typecode == "{leaf.code}" and len({name}) == {leaf.count}'
            )
            self._code.line(
                f'{name} = {name}.tobytes() if {good} else block("{leaf.code}", {leaf.count}, {name})'
            )
        self._number(leaf.size, f"{leaf.size * leaf.count}s", name, leaf.size * leaf.count)

    def _text(self, leaf: Text) -> None:
        name, count = self._code.temp("s"), self._code.temp("n")
        value = self._code.place(leaf.path)
        if leaf.wide:
            self._code.line(f"{name} = wide({value}, {leaf.bound}, {self._big})")
            self._number(4, "I", f"len({name}) // 4", 4)
            self._flush()
            self._parts.append(name)
            self._terms.append(f"len({name})")
            return
        self._code.line(f"{name} = {value}")
        if leaf.bound:
            self._code.line(f"{name} = text({name}, {leaf.bound})")
        else:
            self._code.line(f"{name} = {name}.encode() if type({name}) is str else text({name})")
        self._code.line(f"{count} = len({name}) + 1")
        self._number(4, "I", count, 4)
        self._flush()
        self._parts.append(name)
        self._terms.append(count)
        self._run.append("x")  # the NUL, already counted

    def _numbers(self, leaf: Numbers) -> None:
        name, count = self._code.temp("a"), self._code.temp("n")
        value = self._code.place(leaf.path)
        if leaf.code == "?":
            self._code.line(f"{name} = bools({value})")
        elif leaf.code == "B":
            self._code.line(f"{name} = {value}")
            self._code.line(f"{name} = {name} if type({name}) is bytes else octets({name})")
        elif self._swap and leaf.size > 1:
            self._code.line(f'{name} = swapped("{leaf.code}", {value})')
        else:
            self._code.line(f"{name} = {value}")
            self._code.line(f'if type({name}) is not array or {name}.typecode != "{leaf.code}":')
            self._code.line(f'    {name} = numbers("{leaf.code}", {name})')
        self._code.line(f"{count} = len({name})")
        self._bound(count, leaf.bound)
        self._number(4, "I", count, 4)
        counted = self._at.aligned(4).moved(4)
        self._flush()
        if counted.pad(leaf.size) == 0:
            self._parts.append(name)
            self._terms.append(count if leaf.size == 1 else f"{leaf.size} * {count}")
            return
        at, pad = self._variable(), self._code.temp("z")
        self._code.line(f'{pad} = _A[{leaf.size}][{at} & {leaf.size - 1}] if {count} else b""')
        self._parts += [pad, name]
        self._terms.append(f"len({pad})")  # the elements are multiples of 8

    def _many(self, leaf: Many) -> None:
        items = self._code.temp("l")
        self._code.line(f"{items} = {self._code.place(leaf.path)}")
        at = self._at
        if leaf.count:
            self._code.line(f"if len({items}) != {leaf.count}:")
            self._code.line(f"    wrong_count(len({items}), {leaf.count})")
        else:
            count = self._code.temp("n")
            self._code.line(f"{count} = len({items})")
            self._bound(count, leaf.bound)
            self._number(4, "I", count, 4)
            at = at.aligned(4).moved(4)
        self._flush()
        self._out()
        position = self._variable()
        element = self._code.temp("e")
        self._code.line(f"for {element} in {items}:")
        saved = self._code.enter(element)
        self._at = loop(leaf.body, at)
        for inner in leaf.body:
            self._leaf(inner)
        self._flush()
        self._out()
        self._code.line(f"{position} = {self._position()}")
        self._code.leave(saved)
        self._terms, self._const = [position], 0

    def _bound(self, count: str, bound: int) -> None:
        if bound:
            self._code.line(f"if {count} > {bound}:")
            self._code.line(f"    too_many({count}, {bound})")

    def _number(self, align: int, chunk: str, value: str, size: int) -> None:
        """One value of the run, the first of its leaf."""
        pad = self._at.pad(align)
        if pad is None:
            self._align(align)
        elif pad:
            self._run.append("x" if pad == 1 else f"{pad}x")
            self._const += pad
        self._run.append(chunk)
        self._values.append(value)
        self._const += size

    def _align(self, align: int) -> None:
        """Padding that depends on the position, together with the NUL of a string just before."""
        table = "_A"
        if self._run == ["x"] and not self._values:
            table = "_N"
            self._run.clear()
        else:
            self._flush()
        position = self._position()
        if align == MAX_ALIGN:
            self._parts.append(f"{table}[8][{position} & 7]")
            self._terms, self._const = [], 0
            return
        at = self._variable()
        self._parts.append(f"{table}[{align}][{at} & {align - 1}]")
        following = self._code.temp("p")
        self._code.line(f"{following} = {at} + {align - 1} & -{align}")
        self._terms, self._const = [following], 0

    def _position(self) -> str:
        terms = self._terms + ([str(self._const)] if self._const or not self._terms else [])
        return " + ".join(terms)

    def _variable(self) -> str:
        """The position as a variable of its own."""
        name = self._code.temp("p")
        self._code.line(f"{name} = {self._position()}")
        self._terms, self._const = [name], 0
        return name

    def _flush(self) -> None:
        """Makes the run a part."""
        if self._values:
            self._parts.append(
                f"{self._structs.name(self._order, self._run)}.pack({', '.join(self._values)})"
            )
        elif self._run:
            zeros = sum(int(chunk[:-1] or 1) for chunk in self._run)
            self._parts.append(repr(bytes(zeros)))
        self._run, self._values = [], []

    def _out(self) -> None:
        """Puts the parts on the list; within loops and before them."""
        if len(self._parts) == 1:
            self._code.line(f"o.append({self._parts[0]})")
        elif self._parts:
            self._code.line(f"o += ({', '.join(self._parts)})")
        self._parts = []
