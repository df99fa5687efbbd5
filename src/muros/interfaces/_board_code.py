"""Code of board classes: methods that MicroPython runs without touching the heap where that is possible.

Compared with host classes the code is small rather than fast: no constants per format, one position variable, and
helpers of ``muros.cdr``, ``cdr_texts``, ``cdr_lists`` and ``cdr_rows`` for whatever a second use pays for. What is
written leaves the heap alone, and so does what is read of a message of fixed size without floats: its integers are
read one by one, since unpacking would allocate a tuple. Other messages take heap when they are read anyway; runs are
unpacked there.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import TypeGuard, cast

from muros.interfaces._encoder import Code, format_text
from muros.interfaces._layout import (
    START,
    At,
    Block,
    Dummy,
    Group,
    Leaf,
    Many,
    Numbers,
    Path,
    Scalar,
    Text,
    after,
    fixed_size,
    least_size,
    leaves,
    loop,
)
from muros.interfaces._model import Message

Blank = Callable[[str, str], list[str]]
"""(full name of a message, variable) -> lines that put an instance without values into the variable."""

_WORTH = 12  # leaves that a type must save, by being written out only once, before its code becomes functions
RUN = 5
"""Sequences in a row from which on one call for all of them is worth ``muros.cdr_rows``."""
_PADDING = 3  # bytes that transports may put behind a body


class Memo:
    """Where a message keeps the encoded form of its strings: ``_memo``, a list with two places for each string."""

    def __init__(self, found: Sequence[Leaf]) -> None:
        self.paths: list[Path] = [leaf.path for leaf in found if isinstance(leaf, Text)]
        self._name = "memo" if len(self.paths) > 1 else "self._memo"

    def arguments(self, path: Path) -> str:
        """What helpers for the string at that path are told: the list, and the place if it is not the first."""
        place = 2 * self.paths.index(path)
        return f", {self._name}, {place}" if place else f", {self._name}"

    def start(self) -> list[str]:
        """The lines before any use."""
        return ["memo = self._memo"] if len(self.paths) > 1 else []


class Shared:
    """The nested types that occur so often in one message that their code becomes functions of the module."""

    def __init__(self, message: Message, find: Callable[[str], Message]) -> None:
        self._find = find
        self._names: dict[str, str] = {}
        if fixed_size(leaves(message, find)) is not None:
            return
        counts: Counter[str] = Counter()
        self._count(message, counts)
        for name, times in sorted(counts.items()):
            if (times - 1) * _number_of(leaves(find(name), find)) >= _WORTH:
                short = name.rpartition("/")[2]
                self._names[name] = name.replace("/", "_") if short in self._names.values() else short

    def __contains__(self, type_name: object) -> bool:
        return type_name in self._names

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def function(self, verb: str, type_name: str) -> str:
        """The name of the function that makes, sizes, writes or reads one message."""
        return f"_{verb}_{self._names[type_name]}"

    def leaves(self, message: Message) -> tuple[Leaf, ...]:
        """The leaves of a message, shared types kept together."""
        return leaves(message, self._find, kept=self._names)

    def functions(self, type_name: str, blank: Blank) -> dict[str, list[str]]:
        """The functions of a shared type but the one that makes it: name -> lines."""
        body = self.leaves(self._find(type_name))
        made: dict[str, list[str]] = {}
        for verb, arguments, code in (
            ("size", "m, p", _Sizer(None, self).element(body)),
            ("write", "m, buf, p, off", _Writer(None, self).element(body)),
            ("read", "m, at", _Reader(blank, self).element(body)),
        ):
            name = self.function(verb, type_name)
            made[name] = [f"def {name}({arguments}):", *(f"    {line}" for line in code)]
        return made

    def _count(self, message: Message, counts: Counter[str]) -> None:
        for field in message.fields:
            if field.type.nested:
                counts[field.type.base] += 1
                if counts[field.type.base] == 1:
                    self._count(self._find(field.type.base), counts)


def size_lines(found: Sequence[Leaf], memo: Memo, shared: Shared) -> list[str]:
    """The body of ``size(self)``."""
    size = fixed_size(found)
    if size is not None:
        return [f"return {size}"]
    return _Sizer(memo, shared).run(found)


def write_lines(found: Sequence[Leaf], memo: Memo, shared: Shared) -> list[str]:
    """The body of ``write(self, buf, off)``."""
    return _Writer(memo, shared).run(found)


def read_lines(found: Sequence[Leaf], blank: Blank, shared: Shared) -> list[str]:
    """The body of ``read(self, buf, off, n)``; ``blank`` gives the lines that make an element to be filled."""
    size = fixed_size(found)
    if list(found) == [Dummy()]:
        return ["need(4, n)"]
    if size is not None and not any(isinstance(leaf, Many) for leaf in found):
        return _FixedReader(shared).run(found, size)
    return _Reader(blank, shared).run(found)


def _number_of(found: Sequence[Leaf]) -> int:
    return sum(1 + _number_of(leaf.body) if isinstance(leaf, Many) else 1 for leaf in found)


class _Walker:
    """What sizing, writing and reading share: the walk over the leaves with what is known of their alignment."""

    def __init__(self, shared: Shared) -> None:
        self.code = Code("self")
        self._shared = shared
        self._at = START

    def _walk(self, found: Sequence[Leaf]) -> None:
        for run in _runs(found):
            start = self._at
            if len(run) > 1:
                self._sequences(cast("Sequence[Numbers | Many]", run))
            else:
                self._leaf(run[0])
            for leaf in run:
                start = after(leaf, start)
            self._at = start

    def _leaf(self, leaf: Leaf) -> None:
        raise NotImplementedError

    def _sequences(self, run: Sequence[Numbers | Many]) -> None:
        """Several sequences of numbers or strings that follow each other."""
        raise NotImplementedError

    def _flush(self) -> None:
        """Ends a run."""


class _Placed(_Walker):
    """A walk that knows the position: ``base + const``."""

    def __init__(self, base: str, shared: Shared) -> None:
        super().__init__(shared)
        self._base = base
        self._const = 0

    def element(self, found: Sequence[Leaf]) -> list[str]:
        """The body of a function for one message ``m`` at ``p``, of whose alignment nothing is known."""
        self.code = Code("m")
        self._at = At(1, 0)
        self._base = "p"
        self._walk(found)
        return self._returned()

    def _returned(self) -> list[str]:
        """The lines, with one that returns the position."""
        self._flush()
        value, lines = self._position(), self.code.lines
        if value == "p" and lines[-1].startswith("p = "):
            value = lines.pop().removeprefix("p = ")
        return [*lines, f"return {value}"]

    def _position(self, more: int = 0) -> str:
        const = self._const + more
        if not self._base:
            return str(const)
        return f"{self._base} + {const}" if const else self._base

    def _moved(self, expression: str) -> None:
        """The position becomes the variable ``p`` with that value."""
        if expression != "p":
            self.code.line(f"p = {expression}")
        self._base, self._const = "p", 0

    def _loop(self, leaf: Many, items: str, verb: str, arguments: str) -> None:
        """A loop over the elements of an array or sequence, which begin at the present position."""
        self._moved(self._position())
        element = self.code.temp("e")
        self.code.line(f"for {element} in {items}:")
        saved = self.code.enter(element)
        self._at = loop(leaf.body, self._at)
        if leaf.type_name in self._shared:
            self._moved(f"{self._shared.function(verb, leaf.type_name)}({element}, {arguments})")
        else:
            self._walk(leaf.body)
            self._flush()
        self._moved(self._position())
        self.code.leave(saved)


class _Sizer(_Placed):
    def __init__(self, memo: Memo | None, shared: Shared) -> None:
        super().__init__("", shared)
        self._memo = memo

    def run(self, found: Sequence[Leaf]) -> list[str]:
        self._walk(found)
        return (self._memo.start() if self._memo else []) + self._returned()

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                self._skip(leaf.size, leaf.size)
            case Block():
                self._skip(leaf.size, leaf.size * leaf.count)
            case Dummy():
                self._const += 1
            case Text():
                value = self.code.place(leaf.path)
                memo = _memo_arguments(self.code, leaf, self._memo)
                self._moved(f"text_size({self._position()}, {value}{memo})")
            case Numbers():
                self._elements(leaf, leaf.size, leaf.size)
            case Many() if _is_texts(leaf):
                self._moved(f"texts_size({self._position()}, {self.code.place(leaf.path)})")
            case Many():
                self._many(leaf)
            case Group():
                function = self._shared.function("size", leaf.type_name)
                self._moved(f"{function}({self.code.place(leaf.path)}, {self._position()})")

    def _sequences(self, run: Sequence[Numbers | Many]) -> None:
        self._moved(f'sequences_size({self._position()}, "{_codes(run)}", {_places(self.code, run)})')

    def _many(self, leaf: Many) -> None:
        stride = None if leaf.count else _stride(leaf.body)
        if stride:
            self._elements(leaf, *stride)
            return
        items = self.code.place(leaf.path)
        if not leaf.count:
            self._skip(4, 4)
            self._at = self._at.aligned(4).moved(4)
        self._loop(leaf, items, "size", "p")

    def _elements(self, leaf: Numbers | Many, align: int, size: int) -> None:
        """A sequence of elements that are ``size`` bytes each."""
        items = self.code.place(leaf.path)
        if self._at.aligned(4).moved(4).pad(align) == 0:
            self._skip(4, 4)
            self._base, self._const = f"{self._position()} + {_times(size, f'len({items})')}", 0
        else:
            self._moved(f"list_size({self._position()}, {items}, {align}, {size})")

    def _skip(self, align: int, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._base, self._const = f"({self._position(align - 1)} & -{align})", 0
            pad = 0
        self._const += pad + size


class _Writer(_Placed):
    def __init__(self, memo: Memo | None, shared: Shared) -> None:
        super().__init__("off", shared)
        self._memo = memo
        self._run: list[str] = []
        self._values: list[str] = []
        self._run_size = 0

    def run(self, found: Sequence[Leaf]) -> list[str]:
        self._walk(found)
        return (self._memo.start() if self._memo else []) + self._returned()

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                code = _bytewise(leaf.code)
                self._value(leaf.size, code, self.code.place(leaf.path), leaf.size)
            case Block():
                code = _bytewise(leaf.code)
                value = f'block({self.code.place(leaf.path)}, "{code}", {leaf.count})'
                self._value(leaf.size, f"{leaf.size * leaf.count}s", value, leaf.size * leaf.count)
            case Dummy():
                self._run.append("x")
                self._run_size += 1
            case Text():
                memo = _memo_arguments(self.code, leaf, self._memo)
                bound = f", bound={leaf.bound}" if leaf.bound else ""
                self._call("put_text", f"{self.code.place(leaf.path)}{memo}{bound}")
            case Numbers():
                bound = f", {leaf.bound}" if leaf.bound else ""
                self._call("put_sequence", f'{self.code.place(leaf.path)}, "{_bytewise(leaf.code)}"{bound}')
            case Many() if _is_texts(leaf):
                bound = f", {leaf.bound}" if leaf.bound else ""
                self._call("put_sequence", f'{self.code.place(leaf.path)}, "s"{bound}')
            case Many():
                self._many(leaf)
            case Group():
                value = self.code.place(leaf.path)
                self._flush()
                function = self._shared.function("write", leaf.type_name)
                self._moved(f"{function}({value}, buf, {self._position()}, off)")

    def _sequences(self, run: Sequence[Numbers | Many]) -> None:
        self._call("put_sequences", f'"{_codes(run)}", {_places(self.code, run)}')

    def _call(self, function: str, arguments: str) -> None:
        """Calls a helper, which aligns by itself and returns the position behind what it wrote."""
        self._flush()
        self._moved(f"{function}(buf, {self._position()}, off, {arguments})")

    def _many(self, leaf: Many) -> None:
        items = self.code.temp("l")
        self.code.line(f"{items} = {self.code.place(leaf.path)}")
        if leaf.count:
            self._flush()
            self.code.line(f"if len({items}) != {leaf.count}:")
            self.code.line(f"    need(len({items}), {leaf.count})")
            self.code.line(f"    need({leaf.count}, len({items}))")
        else:
            bound = f", {leaf.bound}" if leaf.bound else ""
            self._call("put_count", f"len({items}){bound}")
            self._at = self._at.aligned(4).moved(4)
        self._loop(leaf, items, "write", "buf, p, off")

    def _value(self, align: int, chunk: str, value: str, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._flush()
            self._moved(f"pad(buf, {self._position()}, off, {align})")
        elif pad:
            self._run.append("x" if pad == 1 else f"{pad}x")
            self._run_size += pad
        self._run.append(chunk)
        self._values.append(value)
        self._run_size += size

    def _flush(self) -> None:
        if self._run:
            if self._run[-1].endswith("x"):  # MicroPython writes padding only before a value
                zeros = bytes(int(self._run[-1][:-1] or 1))
                self._run[-1] = f"{len(zeros)}s"
                self._values.append(repr(zeros))
            values = "".join(f", {value}" for value in self._values)
            self.code.line(f'pack_into("{format_text("<", self._run)}", buf, {self._position()}{values})')
        self._const += self._run_size
        self._run, self._values, self._run_size = [], [], 0


class _Runs(_Walker):
    """Reading numbers that follow each other: their chunks are gathered, then read at once or one by one."""

    def __init__(self, shared: Shared) -> None:
        super().__init__(shared)
        self._run: list[tuple[str, str, int]] = []  # struct chunk ("" for padding), target, size
        self._later: list[str] = []

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                self._value(leaf.size, leaf.code, self.code.place(leaf.path), leaf.size)
            case Block():
                target, size = self.code.place(leaf.path), leaf.size * leaf.count
                self._value(leaf.size, f"{size}s", target, size)
                if leaf.code == "?":
                    self._later.append(f"{target} = list(map(bool, {target}))")
                elif leaf.code != "B":
                    self._later.append(f'{target} = array("{leaf.code}", {target})')
            case Dummy():
                self._run.append(("", "", 1))

    def _value(self, align: int, chunk: str, target: str, size: int) -> None:
        pad = self._at.pad(align)
        if pad:
            self._run.append(("", "", pad))
        self._run.append((chunk, target, size))

    def _unpack(self, call: str) -> None:
        """Reads the run at once; ``call`` has a place for the format."""
        chunks = [_bytewise(chunk) or f"{width}x" for chunk, _, width in self._run]
        targets = [target for chunk, target, _ in self._run if chunk]
        bools = [f"{target} = {target} != 0" for chunk, target, _ in self._run if chunk == "?"]
        head = ", ".join(targets) + ("," if len(targets) == 1 else "")
        self.code.line(f"{head} = {call.format(format_text('<', chunks))}")
        for line in bools + self._later:
            self.code.line(line)
        self._run, self._later = [], []


class _FixedReader(_Runs):
    """Reads a message of fixed size, whose bytes are counted once."""

    def run(self, found: Sequence[Leaf], size: int) -> list[str]:
        self.code.line(f"need(n, {size}, {_PADDING})")
        self._walk(found)
        if any(chunk[-1:] in ("f", "d", "s") for chunk, _, _ in self._run):
            self._unpack('unpack_from("{}", buf, off)')
        else:
            self._read()
        return self.code.lines

    def _read(self) -> None:
        """Reads integers one by one."""
        at = 0
        for chunk, target, width in self._run:
            if chunk:
                self.code.line(f"{target} = {_integer(chunk, width, f'off + {at}' if at else 'off')}")
            at += width


class _Reader(_Runs):
    """Reads any message through ``at``, which knows position and end."""

    def __init__(self, blank: Blank, shared: Shared) -> None:
        super().__init__(shared)
        self._blank = blank
        self._align = 1  # of the run

    def run(self, found: Sequence[Leaf]) -> list[str]:
        self.code.line("at = [buf, off, off + n, off]")
        self._walk(found)
        self._flush()
        self.code.line("return finish(at)")  # None; a return of its own would take two bytes more
        return self.code.lines

    def element(self, found: Sequence[Leaf]) -> list[str]:
        """The body of a function that reads one message ``m``, of whose alignment nothing is known."""
        self.code = Code("m")
        self._at = At(1, 0)
        self._walk(found)
        self._flush()
        return self.code.lines

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Text():
                self._assign(leaf.path, f"text(at, {leaf.bound})" if leaf.bound else "text(at)")
            case Numbers():
                bound = f", {leaf.bound}" if leaf.bound else ""
                self._assign(leaf.path, f'sequence(at, "{leaf.code}"{bound})')
            case Many() if _is_texts(leaf):
                bound = f", {leaf.bound}" if leaf.bound else ""
                self._assign(leaf.path, f'sequence(at, "s"{bound})')
            case Many():
                self._flush()
                self._many(leaf)
            case Group():
                self._flush()
                function = self._shared.function("read", leaf.type_name)
                self.code.line(f"{function}({self.code.place(leaf.path)}, at)")
            case _:
                super()._leaf(leaf)

    def _sequences(self, run: Sequence[Numbers | Many]) -> None:
        self._flush()
        self.code.line(f'{_places(self.code, run)} = sequences(at, "{_codes(run)}")')

    def _assign(self, path: Path, value: str) -> None:
        self._flush()
        self.code.line(f"{self.code.place(path)} = {value}")

    def _many(self, leaf: Many) -> None:
        target, items, element = self.code.place(leaf.path), self.code.temp("l"), self.code.temp("e")
        bound = f", {leaf.bound}" if leaf.bound else ""
        count = str(leaf.count) if leaf.count else f"count(at, {least_size(leaf.body)}{bound})"
        self.code.line(f"{items} = []")
        self.code.line(f"for _ in range({count}):")
        saved = self.code.enter(element)
        for line in self._blank(leaf.type_name, element) if leaf.type_name else ():
            self.code.line(line)
        self._at = loop(leaf.body, self._at if leaf.count else self._at.aligned(4).moved(4))
        if leaf.type_name in self._shared:
            self.code.line(f"{self._shared.function('read', leaf.type_name)}({element}, at)")
        else:
            self._walk(leaf.body)
            self._flush()
        self.code.line(f"{items}.append({element})")
        self.code.leave(saved)
        self.code.line(f"{target} = {items}")

    def _value(self, align: int, chunk: str, target: str, size: int) -> None:
        if self._at.pad(align) is None:
            self._flush()
        if self._run:
            super()._value(align, chunk, target, size)
        else:
            self._align = align
            self._run.append((chunk, target, size))

    def _flush(self) -> None:
        if not self._run:
            return
        align, self._align = self._align, 1
        if any(target for _, target, _ in self._run):
            self._unpack(f'unpack(at, "{{}}", {align})')
        else:
            self.code.line(f"part(at, 1, {len(self._run)})")
            self._run = []


def _runs(found: Sequence[Leaf]) -> Iterator[Sequence[Leaf]]:
    """The leaves one by one, but ``RUN`` sequences in a row and more together."""
    run: list[Leaf] = []
    for leaf in found:
        if _is_plain(leaf):
            run.append(leaf)
            continue
        yield from _gathered(run)
        run = []
        yield (leaf,)
    yield from _gathered(run)


def _gathered(run: Sequence[Leaf]) -> Iterator[Sequence[Leaf]]:
    if len(run) >= RUN:
        yield run
    else:
        yield from ((leaf,) for leaf in run)


def _is_plain(leaf: Leaf) -> TypeGuard[Numbers | Many]:
    """Whether it is a sequence of numbers or strings without a bound."""
    return (isinstance(leaf, Numbers) or (isinstance(leaf, Many) and _is_texts(leaf))) and not leaf.bound


def _codes(run: Sequence[Numbers | Many]) -> str:
    """The codes of several sequences; see ``muros.cdr_rows``."""
    return "".join(leaf.code if isinstance(leaf, Numbers) else "s" for leaf in run)


def _places(code: Code, run: Sequence[Numbers | Many]) -> str:
    return ", ".join(code.place(leaf.path) for leaf in run)


def _times(size: int, count: str) -> str:
    return count if size == 1 else f"{size} * {count}"


def _bytewise(code: str) -> str:
    """The code of numbers as they are packed: bools as bytes, since MicroPython packs no others."""
    return "B" if code == "?" else code


def _is_texts(leaf: Many) -> bool:
    """Whether it is a sequence of strings of any length."""
    return leaf.body == (Text((), False, 0),) and not leaf.count


def _stride(body: Sequence[Leaf]) -> tuple[int, int] | None:
    """Alignment and size of elements that follow each other without padding, None where they do not."""
    size = fixed_size(body)
    aligns = [leaf.size for leaf in body if isinstance(leaf, Scalar | Block)]
    if size is None or len(aligns) < len(body) or max(aligns) > aligns[0] or size % aligns[0]:
        return None
    return aligns[0], size


def _integer(code: str, size: int, at: str) -> str:
    if code == "B":
        return f"buf[{at}]"
    if code == "?":
        return f"buf[{at}] != 0"
    return f"integer(buf, {at}, {size}, {int(code.islower())})"


def _memo_arguments(code: Code, leaf: Text, memo: Memo | None) -> str:
    """A string outside loops is encoded once and kept with the message, an element's each time."""
    return memo.arguments(leaf.path) if memo is not None and code.indent == 0 else ""
