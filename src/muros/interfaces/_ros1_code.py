"""Straight-line code that turns the bytes of one serialisation into those of the other.

Most of a message is the same bytes on both sides, so most of the code is slices: whatever lies back to back on both
sides is copied at once, an Imu's 37 numbers in one slice. Nothing is unpacked but counts, nothing made but the lengths
of strings and the padding. ``b"".join`` puts the parts in place. Positions are constants wherever the alignment is
known when the code is generated (see :mod:`muros.interfaces._layout`).

The end of the source is checked once, at the end: a slice too far is short, and then the position does not match.
Only loops check before they run that as many elements can be there.
"""

from __future__ import annotations

import linecache
from collections.abc import Callable, Sequence
from struct import Struct, error, pack
from typing import Any

from muros.cdr import CdrError
from muros.interfaces._layout import START, At
from muros.interfaces._ros1_pairs import Care, Fixed, Leaf, Many, Run, Side, Text, least_size
from muros.interfaces._runtime import A, N

Convert = Callable[..., bytes]


def to_cdr_source(name: str, found: Sequence[Leaf]) -> str:
    """The source of ``to_cdr(b)``: a ROS 1 body to a little-endian CDR body."""
    return "\n".join(["def to_cdr(b):", *_Writer(name, found, Side.ROS1, Side.CDR).lines]) + "\n"


def to_ros1_source(name: str, found: Sequence[Leaf]) -> str:
    """The source of ``to_ros1(b, seq=0)``: a little-endian CDR body to a ROS 1 body."""
    return "\n".join(["def to_ros1(b, seq=0):", *_Writer(name, found, Side.CDR, Side.ROS1).lines]) + "\n"


def compiled(name: str, source: str) -> Convert:
    """The function of a source made here; it raises :class:`CdrError` for bytes that are no message of the type."""
    space: dict[str, Any] = dict(_HELPERS)
    filename = f"<muros {name} {source[4:].partition('(')[0]}>"
    linecache.cache[filename] = (len(source), None, source.splitlines(keepends=True), filename)
    exec(compile(source, filename, "exec", dont_inherit=True), space)
    made: Convert = next(value for key, value in space.items() if key in ("to_cdr", "to_ros1"))
    return made


class _Cursor:
    """A position in one of the two: a sum of variables and a constant, and what is known of its alignment."""

    def __init__(self, aligned: bool) -> None:
        self.aligned = aligned
        self.terms: list[str] = []
        self.const = 0
        self.at = START

    def pad(self, align: int) -> int | None:
        return self.at.pad(align) if self.aligned else 0

    def moved(self, size: int) -> None:
        self.const += size
        self.at = self.at.moved(size)

    def added(self, term: str, size: int) -> None:
        """Moves behind ``term`` bytes, a multiple of ``size``."""
        self.terms.append(term)
        self.at = self.at.strided(size)

    def set(self, variable: str) -> None:
        self.terms, self.const = [variable], 0

    def __str__(self) -> str:
        return " + ".join(self.terms + ([str(self.const)] if self.const or not self.terms else []))


class _Writer:
    """The body of a function of ``b`` that returns the other serialisation."""

    def __init__(self, name: str, found: Sequence[Leaf], source: Side, target: Side) -> None:
        self._source, self._target = source, target
        self._from = _Cursor(source is Side.CDR)
        self._to = _Cursor(target is Side.CDR)
        self._body: list[str] = []
        self._indent = 2
        self._count = 0
        self._parts: list[str] = []
        self._slice: tuple[str, str, int] | None = (
            None  # start, its text and constant, of bytes copied in a row
        )
        self._literal = b""
        self._listed = any(isinstance(leaf, Many) for leaf in found)
        if self._listed:
            self._line("o = []")
        for leaf in found:
            self._leaf(leaf)
        self._finish(name)

    @property
    def lines(self) -> list[str]:
        return self._body

    def _finish(self, name: str) -> None:
        self._settle()
        if self._source is Side.ROS1:
            self._line(f"if len(b) != {self._from}:")
            self._line(f"    wrong_end(len(b), {self._from})")
        else:
            self._line(f"if not 0 <= len(b) - ({self._from}) < 4:")
            self._line(f"    wrong_end(len(b), {self._from})")
        if self._listed:
            self._out()
            self._line('return b"".join(o)')
        elif len(self._parts) == 1:
            self._line(f"return {self._parts[0]}")
        else:
            self._line(f'return b"".join(({", ".join(self._parts)}))' if self._parts else 'return b""')
        head = ["    if type(b) is not bytes:", "        b = bytes(b)", "    try:"]
        tail = ["    except BAD as error:", f'        raise malformed("{name}", b, error) from None']
        self._body = head + self._body + tail

    def _line(self, text: str) -> None:
        self._body.append("    " * self._indent + text)

    def _temp(self, letter: str) -> str:
        self._count += 1
        return f"{letter}{self._count}"

    # ---- leaves ----

    def _leaf(self, leaf: Leaf) -> None:
        if leaf.side is Side.BOTH:
            self._copied(leaf)
        elif leaf.side is self._source:
            self._skipped(leaf)
        else:
            self._made_up(leaf)

    def _copied(self, leaf: Leaf) -> None:
        match leaf:
            case Fixed():
                self._align_from(leaf.align)
                self._align_to(leaf.align)
                if leaf.care is Care.NONE:
                    self._copy(leaf.size)
                else:
                    care = "truth({})" if leaf.care is Care.BOOL else self._duration()
                    start = str(self._from)
                    self._from.moved(leaf.size)
                    self._part(care.format(f"b[{start}:{self._from}]"))
                self._to.moved(leaf.size)
            case Text():
                self._text()
            case Run():
                self._run(leaf)
            case Many():
                self._many(leaf)

    def _duration(self) -> str:
        return "to_ros2_duration({})" if self._source is Side.ROS1 else "{}"

    def _text(self) -> None:
        count = self._counted()
        cdr = self._source is Side.CDR
        start = self._temp("p")
        self._line(f"{start} = {self._from}")
        self._from.set(start)
        self._from.added(count, 1)
        size = count
        if cdr:  # the NUL stays behind
            size = self._temp("n")
            self._line(f"{size} = {count} - 1 if {count} and not b[{start} + {count} - 1] else {count}")
        self._align_to(4)
        self._part(f"length({size})" if cdr else f"length({size} + 1)")
        self._to.moved(4)
        self._part(f"b[{start}:{start} + {size}]")
        self._to.added(size, 1)
        if not cdr:
            self._byte(b"\0")
            self._to.moved(1)

    def _run(self, leaf: Run) -> None:
        count = self._counted()
        self._align_to(4)
        self._part(f"length({count})")
        self._to.moved(4)
        self._align_from(leaf.align, count)
        self._align_to(leaf.align, count)
        start, size = str(self._from), self._temp("n")
        if self._from.const or len(self._from.terms) > 1:
            start = self._temp("p")
            self._line(f"{start} = {self._from}")
        self._line(f"{size} = {count}" + (f" * {leaf.size}" if leaf.size > 1 else ""))
        self._from.set(start)
        part = f"b[{start}:{start} + {size}]"
        self._part(f"truth({part})" if leaf.care is Care.BOOL else part)
        self._from.added(size, leaf.size)
        self._to.added(size, leaf.size)

    def _many(self, leaf: Many) -> None:
        count = str(leaf.count)
        if not leaf.count:
            count = self._counted()
            self._align_to(4)
            self._part(f"length({count})")
            self._to.moved(4)
            self._guard(count, leaf.body)
        self._settle()
        self._out()
        self._loop(count, leaf.body, self._leaf, True)

    def _skipped(self, leaf: Leaf) -> None:
        """A leaf that the target has no place for."""
        self._settle()
        match leaf:
            case Fixed():
                self._align_from(leaf.align)
                self._from.moved(leaf.size)
            case Text():
                self._from.added(self._counted(), 1)
                self._fix()
            case Run():
                count = self._counted()
                self._align_from(leaf.align, count)
                self._from.added(f"{count} * {leaf.size}", leaf.size)
                self._fix()
            case Many():
                count = str(leaf.count)
                if not leaf.count:
                    count = self._counted()
                    self._guard(count, leaf.body)
                self._loop(count, leaf.body, self._skipped, False)

    def _made_up(self, leaf: Leaf) -> None:
        """A leaf that the source has not."""
        match leaf:
            case Fixed():
                self._align_to(leaf.align)
                if leaf.care is Care.SEQ:
                    self._part("length(seq)")
                else:
                    self._byte(leaf.fill)
                self._to.moved(leaf.size)
            case Many(count=count) if count:
                for _ in range(count):
                    for inner in leaf.body:
                        self._made_up(inner)
            case Text() if self._target is Side.CDR:
                self._align_to(4)
                self._byte(pack("<I", 1) + b"\0")
                self._to.moved(5)
            case _:
                self._align_to(4)
                self._byte(bytes(4))
                self._to.moved(4)

    def _counted(self) -> str:
        """Reads a count into a variable."""
        self._align_from(4)
        count = self._temp("n")
        self._line(f"({count},) = count_at(b, {self._from})")
        self._from.moved(4)
        self._settle()
        return count

    def _guard(self, count: str, body: Sequence[Leaf]) -> None:
        """Elements of no bytes at all could be counted without end: one is taken for a byte."""
        least = max(least_size(body, self._source), 1)
        self._line(f"if {count} * {least} > len(b) - ({self._from}):")
        self._line(f"    wrong_end(len(b), {self._from} + {count} * {least})")

    def _loop(self, count: str, body: Sequence[Leaf], each: Callable[[Leaf], None], writes: bool) -> None:
        cursors = [self._from, self._to] if writes and self._to.aligned else [self._from]
        sides = [self._source, self._target]
        variables = []
        for cursor, side in zip(cursors, sides, strict=False):
            variables.append(self._temp("p"))
            self._line(f"{variables[-1]} = {cursor}")
            cursor.set(variables[-1])
            if cursor.aligned:
                cursor.at = _loop_at(body, cursor.at, side)
        known = [cursor.at for cursor in cursors]
        self._line(f"for _ in range({count}):")
        self._indent += 1
        empty = len(self._body)
        for leaf in body:
            each(leaf)
        self._settle()
        if writes:
            self._out()
        for cursor, variable, at in zip(cursors, variables, known, strict=True):
            if str(cursor) != variable:
                self._line(f"{variable} = {cursor}")
            cursor.set(variable)
            cursor.at = at
        if len(self._body) == empty:
            self._line("pass")
        self._indent -= 1

    # ---- positions ----

    def _align_from(self, align: int, count: str = "") -> None:
        """Goes over the source's padding; with a ``count`` there is none before no elements."""
        cursor = self._from
        pad = cursor.pad(align)
        if pad == 0:
            return
        self._settle()
        if pad and not count:
            cursor.moved(pad)
            return
        position = self._temp("p")
        following = f"{cursor} + {align - 1} & -{align}"
        self._line(f"{position} = " + (f"{following} if {count} else {cursor}" if count else following))
        before = cursor.at
        cursor.set(position)
        cursor.at = before.aligned(align).meet(before) if count else before.aligned(align)

    def _align_to(self, align: int, count: str = "") -> None:
        """Writes the target's padding."""
        cursor = self._to
        pad = cursor.pad(align)
        if pad == 0:
            return
        if pad and not count:
            self._byte(bytes(pad))
            cursor.moved(pad)
            return
        self._settle()
        if count:
            position, padding = self._temp("p"), self._temp("z")
            self._line(f"{position} = {cursor}")
            self._line(f'{padding} = PAD[{align}][{position} & {align - 1}] if {count} else b""')
            self._parts.append(padding)
            before = cursor.at
            cursor.set(position)
            cursor.terms.append(f"len({padding})")
            cursor.at = before.aligned(align).meet(before)
            return
        table = "PAD"
        if self._parts and self._parts[-1] == r"b'\x00'":  # the NUL of a string, already counted
            self._parts.pop()
            table = "NUL_PAD"
        if align == START.modulus:
            self._parts.append(f"{table}[8][{cursor} & 7]")
            cursor.terms, cursor.const = [], 0
        else:
            position = self._temp("p")
            self._line(f"{position} = {cursor}")
            self._parts.append(f"{table}[{align}][{position} & {align - 1}]")
            after = self._temp("p")
            self._line(f"{after} = {position} + {align - 1} & -{align}")
            cursor.set(after)
        cursor.at = cursor.at.aligned(align)

    def _fix(self) -> None:
        """The source's position as one variable, so that sums do not grow."""
        position = self._temp("p")
        self._line(f"{position} = {self._from}")
        self._from.set(position)

    # ---- parts ----

    def _copy(self, size: int) -> None:
        """Takes the next bytes of the source over; joins what was taken over just before."""
        if self._literal:
            self._settle()
        if self._slice is None:
            self._slice = (str(self._from), "+".join(self._from.terms), self._from.const)
        self._from.moved(size)
        start, terms, _ = self._slice
        self._slice = (start, terms, self._from.const)

    def _byte(self, literal: bytes) -> None:
        if self._slice is not None:
            self._settle()
        self._literal += literal

    def _part(self, expression: str) -> None:
        self._settle()
        self._parts.append(expression)

    def _settle(self) -> None:
        """Makes a part of bytes that are being taken over, or of bytes made up in a row."""
        if self._slice is not None:
            start, terms, const = self._slice
            end = " + ".join([*filter(None, terms.split("+")), *([str(const)] if const else [])])
            self._parts.append(f"b[{start}:{end}]")
            self._slice = None
        if self._literal:
            self._parts.append(repr(self._literal))
            self._literal = b""

    def _out(self) -> None:
        """Hands the parts over, before code that may run many times."""
        if self._parts:
            self._line(f"o += ({', '.join(self._parts)},)")
            self._parts = []


def _loop_at(body: Sequence[Leaf], at: At, side: Side) -> At:
    """What is known before each of any number of elements, and behind the last."""
    while True:
        met = at.meet(_after(body, at, side))
        if met == at:
            return at
        at = met


def _after(body: Sequence[Leaf], at: At, side: Side) -> At:
    for leaf in body:
        if leaf.side not in (Side.BOTH, side):
            continue
        match leaf:
            case Fixed():
                at = at.aligned(leaf.align).moved(leaf.size)
            case Text():
                at = at.aligned(4).moved(4).strided(1)
            case Run():
                counted = at.aligned(4).moved(4)
                at = counted.aligned(leaf.align).strided(leaf.size).meet(counted)
            case Many():
                at = _loop_at(leaf.body, at if leaf.count else at.aligned(4).moved(4), side)
    return at


# ---- what generated code calls ----

_TRUTH = bytes([0]) + bytes([1]) * 255
_DURATION, _STAMP, _COUNT = Struct("<ii"), Struct("<iI"), Struct("<I")
_SECOND = 1_000_000_000  # nanoseconds


def truth(raw: bytes) -> bytes:
    """Bools of ROS 1, any byte but 0, as CDR has them."""
    return raw.translate(_TRUTH)


def to_ros2_duration(raw: bytes) -> bytes:
    """A duration with nanoseconds of any sign as one with nanoseconds from 0 to 999 999 999; seconds wrap."""
    seconds, nanoseconds = _DURATION.unpack(raw)
    if 0 <= nanoseconds < _SECOND:
        return raw
    seconds += nanoseconds // _SECOND
    return _STAMP.pack((seconds + (1 << 31)) % (1 << 32) - (1 << 31), nanoseconds % _SECOND)


def wrong_end(have: int, needed: int) -> None:
    if have < needed:
        raise CdrError(f"{have} bytes, at least {needed} needed")
    raise CdrError(f"{have - needed} bytes left over: is it of another type?")


def malformed(name: str, body: bytes, failed: Exception) -> CdrError:
    if isinstance(failed, CdrError):
        return CdrError(f"{name}: malformed body: {failed}")
    return CdrError(f"{name}: malformed body: {len(body)} bytes are too few")


_HELPERS: dict[str, Any] = {
    "BAD": (error, IndexError, CdrError),
    "NUL_PAD": N,
    "PAD": A,
    "count_at": _COUNT.unpack_from,
    "length": _COUNT.pack,
    "malformed": malformed,
    "to_ros2_duration": to_ros2_duration,
    "truth": truth,
    "wrong_end": wrong_end,
}
