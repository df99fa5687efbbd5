"""Straight-line decoding code for host classes.

Numbers that follow each other are unpacked by one ``struct`` call straight into the attributes they belong to. Every
length is checked against the bytes that are there before anything is made of it; a ``struct`` call or a slice past the
end is caught by the one check at the end of the body or by ``struct`` itself.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence

from muros.interfaces._encoder import Code, Structs
from muros.interfaces._layout import (
    START,
    Block,
    Dummy,
    Leaf,
    Many,
    Numbers,
    Scalar,
    Text,
    after,
    least_size,
    loop,
)


class Decoder:
    """Decoding code of one message: :attr:`lines` are those of a function of ``m`` and the immutable bytes ``b``.

    ``blank`` maps a message's full name to the expression of a function that makes an instance to be filled.
    """

    def __init__(
        self, found: Sequence[Leaf], structs: Structs, blank: dict[str, str], big_endian: bool = False
    ) -> None:
        self._code = Code("m")
        self._structs = structs
        self._blank = blank
        self._order = ">" if big_endian else "<"
        self._big = big_endian
        self._swap = big_endian == (sys.byteorder == "little")
        self._at = START
        self._base = ""  # the position is this variable
        self._const = 0  # plus this
        self._run: list[str] = []
        self._run_size = 0
        self._targets: list[str] = []
        self._later: list[str] = []  # lines due after the run is unpacked
        if list(found) == [Dummy()]:
            self._code.line("e = len(b)")
            self._code.line("if e > 4:")
            self._code.line("    trailing(e - 1)")
            return
        if _holds(found, lambda leaf: not isinstance(leaf, Scalar | Block)):
            self._code.line("e = len(b)")
        if _holds(found, lambda leaf: isinstance(leaf, Numbers) and leaf.code == "B"):
            self._code.line("v = memoryview(b)")
        for leaf in found:
            self._leaf(leaf)
        self._flush()
        end = "e" if self._code.lines[0] == "e = len(b)" else "len(b)"
        self._code.line(f"if not 0 <= {end} - {self._bracketed()} < 4:")
        self._code.line(f"    trailing({end} - {self._bracketed()})")

    @property
    def lines(self) -> list[str]:
        return self._code.lines

    def _leaf(self, leaf: Leaf) -> None:
        start = self._at
        match leaf:
            case Scalar():
                self._number(leaf.size, leaf.code, self._code.place(leaf.path), leaf.size)
            case Block():
                self._block(leaf)
            case Dummy():
                self._run.append("x")
                self._run_size += 1
            case Text():
                self._text(leaf)
            case Numbers():
                self._numbers(leaf)
            case Many():
                self._many(leaf)
        self._at = after(leaf, start)

    def _block(self, leaf: Block) -> None:
        target = self._code.place(leaf.path)
        size = leaf.size * leaf.count
        if leaf.code == "B":
            self._number(1, f"{size}s", target, size)
            return
        name = self._code.temp("c")
        self._number(leaf.size, f"{size}s", name, size)
        if leaf.code == "?":
            self._later.append(f"{target} = [*map(bool, {name})]")
        elif self._swap and leaf.size > 1:
            self._later.append(f'{name} = array("{leaf.code}", {name})')
            self._later.append(f"{name}.byteswap()")
            self._later.append(f"{target} = {name}")
        else:
            self._later.append(f'{target} = array("{leaf.code}", {name})')

    def _text(self, leaf: Text) -> None:
        target = self._code.place(leaf.path)
        count = self._counted()
        if leaf.wide:
            self._bound(count, leaf.bound)
            start, end = self._position(), self._end(4, count)
            self._code.line(f"{target} = narrow(b[{start}:{end}], {self._big})")
            return
        if leaf.bound:
            self._bound(count, leaf.bound + 1)
        start, end = self._position(), self._code.temp("p")
        self._code.line(f"{end} = {start} + {count}")
        good = f"{count} and {end} <= e and not b[{end} - 1]"
        self._code.line(
            f'{target} = str(b[{start}:{end} - 1], "utf-8") if {good} else odd_text(b, {start}, {count})'
        )
        self._base, self._const = end, 0

    def _numbers(self, leaf: Numbers) -> None:
        target = self._code.place(leaf.path)
        count = self._counted()
        self._bound(count, leaf.bound)
        pad = self._at.aligned(4).moved(4).pad(leaf.size)
        if pad != 0:
            at = self._code.temp("p")
            position = self._position()
            self._code.line(f"{at} = {position} + {leaf.size - 1} & -{leaf.size} if {count} else {position}")
            self._base, self._const = at, 0
        start, end = self._position(), self._end(leaf.size, count)
        if leaf.code == "B":
            self._code.line(f"{target} = v[{start}:{end}]")
        elif leaf.code == "?":
            self._code.line(f"{target} = [*map(bool, b[{start}:{end}])]")
        else:
            name = self._code.temp("a")
            self._code.line(f'{name} = array("{leaf.code}")')
            self._code.line(f"{name}.frombytes(b[{start}:{end}])")
            if self._swap and leaf.size > 1:
                self._code.line(f"{name}.byteswap()")
            self._code.line(f"{target} = {name}")

    def _many(self, leaf: Many) -> None:
        target = self._code.place(leaf.path)
        at = self._at
        if leaf.count:
            self._flush()
            count = str(leaf.count)
        else:
            count = self._counted()
            at = at.aligned(4).moved(4)
            self._bound(count, leaf.bound)
            least = least_size(leaf.body)
            self._code.line(f"if {count} * {least} > e - {self._bracketed()}:")
            self._code.line(f"    short({self._position()} + {count} * {least}, e)")
        position, items = self._code.temp("p"), self._code.temp("l")
        self._code.line(f"{position} = {self._position()}")
        self._code.line(f"{items} = []")
        self._base, self._const = position, 0
        element = self._code.temp("e")
        self._code.line(f"for _ in range({count}):")
        saved = self._code.enter(element)
        if leaf.type_name:
            self._code.line(f"{element} = {self._blank[leaf.type_name]}()")
        self._at = loop(leaf.body, at)
        for inner in leaf.body:
            self._leaf(inner)
        self._flush()
        self._code.line(f"{items}.append({element})")
        if self._position() != position:
            self._code.line(f"{position} = {self._position()}")
        self._code.leave(saved)
        self._code.line(f"{target} = {items}")
        self._base, self._const = position, 0

    def _counted(self) -> str:
        """Reads a count into a variable and ends the run."""
        count = self._code.temp("n")
        self._number(4, "I", count, 4)
        self._flush()
        return count

    def _bound(self, count: str, bound: int) -> None:
        if bound:
            self._code.line(f"if {count} > {bound}:")
            self._code.line(f"    too_many({count}, {bound})")

    def _end(self, size: int, count: str) -> str:
        """The variable of the position behind ``count`` elements, checked; the position moves there."""
        end = self._code.temp("p")
        self._code.line(f"{end} = {self._position()} + {count if size == 1 else f'{size} * {count}'}")
        self._code.line(f"if {end} > e:")
        self._code.line(f"    short({end}, e)")
        self._base, self._const = end, 0
        return end

    def _number(self, align: int, chunk: str, target: str, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._flush()
            at = self._code.temp("p")
            self._code.line(f"{at} = {self._position()} + {align - 1} & -{align}")
            self._base, self._const = at, 0
        elif pad:
            self._run.append("x" if pad == 1 else f"{pad}x")
            self._run_size += pad
        self._run.append(chunk)
        self._targets.append(target)
        self._run_size += size

    def _flush(self) -> None:
        """Unpacks the run."""
        if self._targets:
            name = self._structs.name(self._order, self._run)
            targets = ", ".join(self._targets) + ("," if len(self._targets) == 1 else "")
            self._code.line(f"{targets} = {name}.unpack_from(b, {self._position()})")
        for line in self._later:
            self._code.line(line)
        self._const += self._run_size
        self._run, self._targets, self._later, self._run_size = [], [], [], 0

    def _position(self) -> str:
        if not self._base:
            return str(self._const)
        return f"{self._base} + {self._const}" if self._const else self._base

    def _bracketed(self) -> str:
        position = self._position()
        return f"({position})" if "+" in position else position


def _holds(found: Sequence[Leaf], wanted: object) -> bool:
    """Whether any leaf, at whatever depth, is as wanted."""
    assert callable(wanted)
    return any(wanted(leaf) or (isinstance(leaf, Many) and _holds(leaf.body, wanted)) for leaf in found)
