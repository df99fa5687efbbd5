"""Code of board classes: methods that MicroPython runs without touching the heap where that is possible.

Compared with host classes the code is small rather than fast: no constants per format, one position variable, helpers
of :mod:`muros.cdr` wherever a second use pays for them. Runs of integers are read one by one, since unpacking would
allocate a tuple; runs with a float are unpacked at once, since a float takes heap anyway.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from muros.interfaces._encoder import Code, format_text
from muros.interfaces._layout import (
    START,
    At,
    Block,
    Dummy,
    Leaf,
    Many,
    Numbers,
    Path,
    Scalar,
    Text,
    after,
    fixed_size,
    least_size,
    loop,
)

Blank = Callable[[str, str], list[str]]
"""(full name of a message, variable) -> lines that put an instance without values into the variable."""


class Memos:
    """The attributes in which a message keeps the encoded form of its strings: one for each string."""

    def __init__(self) -> None:
        self._names: dict[Path, str] = {}

    def name(self, path: Path) -> str:
        return self._names.setdefault(path, f"_{len(self._names) + 1}")

    def names(self) -> list[str]:
        return list(self._names.values())


class Shared:
    """The messages that occur in several sequences of one message: their code becomes functions of the module."""

    def __init__(self, found: Sequence[Leaf], blank: Blank) -> None:
        self._blank = blank
        self._bodies: dict[str, tuple[Leaf, ...]] = {}
        self._often: set[str] = set()
        self._count(found)

    def __contains__(self, type_name: str) -> bool:
        return type_name in self._often

    def function(self, verb: str, type_name: str) -> str:
        """The name of the function that sizes, writes or reads one element."""
        return f"_{verb}_{type_name.replace('/', '_')}"

    def lines(self) -> list[str]:
        """All functions, as lines of a module."""
        lines: list[str] = []
        for name in sorted(self._often):
            body = self._bodies[name]
            sizer, writer, reader = _Sizer(None, self), _Writer(None, self), _Reader(self._blank, self)
            for verb, arguments, code in (
                ("size", "m, p", sizer.element(body)),
                ("write", "m, buf, p, off", writer.element(body)),
                ("read", "m, buf, p, off, e", reader.element(body)),
            ):
                lines += [f"def {self.function(verb, name)}({arguments}):", *(f"    {line}" for line in code)]
        return lines

    def _count(self, found: Sequence[Leaf]) -> None:
        for leaf in found:
            if isinstance(leaf, Many) and leaf.type_name in self._bodies:
                self._often.add(leaf.type_name)
            elif isinstance(leaf, Many):
                if leaf.type_name:
                    self._bodies[leaf.type_name] = leaf.body
                self._count(leaf.body)


def size_lines(found: Sequence[Leaf], memos: Memos, shared: Shared) -> list[str]:
    """The body of ``size(self)``."""
    size = fixed_size(found)
    if size is not None:
        return [f"return {size}"]
    return _Sizer(memos, shared).run(found)


def write_lines(found: Sequence[Leaf], memos: Memos, shared: Shared) -> list[str]:
    """The body of ``write(self, buf, off)``."""
    return _Writer(memos, shared).run(found)


def read_lines(found: Sequence[Leaf], blank: Blank, shared: Shared) -> list[str]:
    """The body of ``read(self, buf, off, n)``; ``blank`` gives the lines that make an element to be filled."""
    return _Reader(blank, shared).run(found)


class _Walker:
    """What sizing, writing and reading share: the position as ``base + const`` and the walk over the leaves."""

    def __init__(self, base: str, shared: Shared) -> None:
        self.code = Code("self")
        self._shared = shared
        self._at = START
        self._base = base
        self._const = 0

    def element(self, found: Sequence[Leaf]) -> list[str]:
        """The body of a function for one element ``m`` at ``p``, of whose alignment nothing is known."""
        self.code = Code("m")
        self._at = At(1, 0)
        self._base = "p"
        self._walk(found)
        self._flush()
        self.code.line(f"return {self._position()}")
        return self.code.lines

    def _walk(self, found: Sequence[Leaf]) -> None:
        for leaf in found:
            start = self._at
            self._leaf(leaf)
            self._at = after(leaf, start)

    def _leaf(self, leaf: Leaf) -> None:
        raise NotImplementedError

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

    def _loop(
        self, leaf: Many, element: str, head: str, function: str, arguments: str, start: Sequence[str] = ()
    ) -> None:
        """A loop over the elements of an array or sequence, which begin at the present position."""
        self._moved(self._position())
        self.code.line(head)
        saved = self.code.enter(element)
        for line in start:
            self.code.line(line)
        self._at = loop(leaf.body, self._at)
        if leaf.type_name in self._shared:
            self._moved(f"{self._shared.function(function, leaf.type_name)}({element}, {arguments})")
        else:
            self._walk(leaf.body)
        self._flush()
        self._moved(self._position())
        self.code.leave(saved)

    def _flush(self) -> None:
        """Ends a run."""


class _Sizer(_Walker):
    def __init__(self, memos: Memos | None, shared: Shared) -> None:
        super().__init__("", shared)
        self._memos = memos

    def run(self, found: Sequence[Leaf]) -> list[str]:
        self._walk(found)
        self.code.line(f"return {self._position()}")
        return self.code.lines

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                self._skip(leaf.size, leaf.size)
            case Block():
                self._skip(leaf.size, leaf.size * leaf.count)
            case Dummy():
                self._const += 1
            case Text():
                self._skip(4, 5)
                value = _bytes_of(self.code, leaf, self._memos)
                self._moved(f"{self._position()} + len({value})")
            case Numbers():
                count = f"len({self.code.place(leaf.path)})"
                self._skip(4, 4)
                if self._at.aligned(4).moved(4).pad(leaf.size) == 0:
                    self._moved(f"{self._position()} + {_times(leaf.size, count)}")
                    return
                self._moved(self._position())
                name = self.code.temp("n")
                self.code.line(f"{name} = {count}")
                self.code.line(f"if {name}:")
                self.code.line(f"    p = (p + {leaf.size - 1} & -{leaf.size}) + {leaf.size} * {name}")
            case Many():
                items = self.code.place(leaf.path)
                if not leaf.count:
                    self._skip(4, 4)
                    self._at = self._at.aligned(4).moved(4)
                element = self.code.temp("e")
                self._loop(leaf, element, f"for {element} in {items}:", "size", "p")

    def _skip(self, align: int, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._moved(f"{self._position()} + {align - 1} & -{align}")
            pad = 0
        self._const += pad + size


class _Writer(_Walker):
    def __init__(self, memos: Memos | None, shared: Shared) -> None:
        super().__init__("off", shared)
        self._memos = memos
        self._run: list[str] = []
        self._values: list[str] = []
        self._run_size = 0

    def run(self, found: Sequence[Leaf]) -> list[str]:
        self._walk(found)
        self._flush()
        self.code.line(f"return {self._position()}")
        return self.code.lines

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                code = "B" if leaf.code == "?" else leaf.code
                self._value(leaf.size, code, self.code.place(leaf.path), leaf.size)
            case Block():
                code = "B" if leaf.code == "?" else leaf.code
                value = f'block({self.code.place(leaf.path)}, "{code}", {leaf.count})'
                self._value(leaf.size, f"{leaf.size * leaf.count}s", value, leaf.size * leaf.count)
            case Dummy():
                self._run.append("x")
                self._run_size += 1
            case Text():
                value = _bytes_of(self.code, leaf, self._memos)
                self._aligned(4)
                if leaf.bound:
                    name = self.code.temp("s")
                    self.code.line(f"{name} = {value}")
                    self.code.line(f"need({leaf.bound}, len({name}))")
                    value = name
                self._moved(f"put_text(buf, {self._position()}, {value})")
            case Numbers():
                self._numbers(leaf)
            case Many():
                self._many(leaf)

    def _numbers(self, leaf: Numbers) -> None:
        name, count = self.code.temp("v"), self.code.temp("n")
        self.code.line(f"{name} = {self.code.place(leaf.path)}")
        self.code.line(f"{count} = len({name})")
        if leaf.bound:
            self.code.line(f"need({leaf.bound}, {count})")
        self._value(4, "I", count, 4)
        padded = self._at.aligned(4).moved(4).pad(leaf.size) != 0
        self._flush()
        self._moved(self._position())
        code = "B" if leaf.code == "?" else leaf.code
        if leaf.size == 1 and code == "B":
            self.code.line(f'buf[p : p + {count}] = block({name}, "B", {count})')
            self._moved(f"p + {count}")
            return
        size = self.code.temp("n")
        self.code.line(f"if {count}:")
        if padded:
            self.code.line(f"    p = pad(buf, p, off, {leaf.size})")
        self.code.line(f"    {size} = {_times(leaf.size, count)}")
        self.code.line(f'    pack_into("%ds" % {size}, buf, p, block({name}, "{code}", {count}))')
        self.code.line(f"    p += {size}")

    def _many(self, leaf: Many) -> None:
        items, count = self.code.temp("l"), self.code.temp("n")
        self.code.line(f"{items} = {self.code.place(leaf.path)}")
        if leaf.count:
            self._flush()
            self.code.line(f"if len({items}) != {leaf.count}:")
            self.code.line(f"    need(len({items}), {leaf.count})")
            self.code.line(f"    need({leaf.count}, len({items}))")
        else:
            self.code.line(f"{count} = len({items})")
            if leaf.bound:
                self.code.line(f"need({leaf.bound}, {count})")
            self._value(4, "I", count, 4)
            self._flush()
            self._at = self._at.aligned(4).moved(4)
        element = self.code.temp("e")
        self._loop(leaf, element, f"for {element} in {items}:", "write", "buf, p, off")

    def _value(self, align: int, chunk: str, value: str, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._aligned(align)
        elif pad:
            self._run.append("x" if pad == 1 else f"{pad}x")
            self._run_size += pad
        self._run.append(chunk)
        self._values.append(value)
        self._run_size += size

    def _aligned(self, align: int) -> None:
        """Ends the run and zeroes what lies before the next aligned position."""
        pad = self._at.pad(align)
        if pad:
            self._run.append("x" if pad == 1 else f"{pad}x")
            self._run_size += pad
        self._flush()
        if pad is None:
            self._moved(f"pad(buf, {self._position()}, off, {align})")

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


class _Reader(_Walker):
    def __init__(self, blank: Blank, shared: Shared) -> None:
        super().__init__("off", shared)
        self._blank = blank
        self._run: list[tuple[str, str, int]] = []  # struct chunk ("" for padding), target, size
        self._later: list[str] = []
        self._checked = False  # all bytes are known to be there

    def run(self, found: Sequence[Leaf]) -> list[str]:
        size = fixed_size(found)
        if list(found) == [Dummy()]:
            return ["need(4, n)"]
        if size is not None:
            self._checked = True
            self.code.line(f"need(n, {size})")
            self._walk(found)
            self._flush()
            self.code.line(f"ended(n - {size})")
        else:
            self.code.line("e = off + n")
            self._walk(found)
            self._flush()
            self.code.line(f"ended(e - {_bracketed(self._position())})")
        return self.code.lines

    def _leaf(self, leaf: Leaf) -> None:
        match leaf:
            case Scalar():
                self._value(leaf.size, leaf.code, self.code.place(leaf.path), leaf.size)
            case Block():
                self._block(leaf)
            case Dummy():
                self._run.append(("", "", 1))
            case Text():
                target = self.code.place(leaf.path)
                count = self._count(1)
                if leaf.bound:
                    self.code.line(f"need({leaf.bound + 1}, {count})")
                self.code.line(f"{target} = text(buf, {self._position(4)}, {count})")
                self._moved(f"{self._position(4)} + {count}")
            case Numbers():
                self._numbers(leaf)
            case Many():
                self._many(leaf)

    def _block(self, leaf: Block) -> None:
        target, size = self.code.place(leaf.path), leaf.size * leaf.count
        self._value(leaf.size, f"{size}s", target, size)
        if leaf.code == "?":
            self._later.append(f"{target} = [c != 0 for c in {target}]")
        elif leaf.code != "B":
            self._later.append(f'{target} = array("{leaf.code}", {target})')

    def _numbers(self, leaf: Numbers) -> None:
        target = self.code.place(leaf.path)
        count = self._count(leaf.size)
        if leaf.bound:
            self.code.line(f"need({leaf.bound}, {count})")
        self._moved(self._position(4))
        size = self.code.temp("n")
        if leaf.size == 1:
            size = count
        else:
            self.code.line(f"{size} = {_times(leaf.size, count)}")
        if self._at.aligned(4).moved(4).pad(leaf.size) != 0:
            self.code.line(f"if {count}:")
            self.code.line(f"    p += off - p & {leaf.size - 1}")
            self.code.line(f"    need(e - p, {size})")
        part = f"bytes(memoryview(buf)[p : p + {size}])"
        if leaf.code == "?":
            part = f"[c != 0 for c in {part}]"
        elif leaf.code != "B":
            part = f'array("{leaf.code}", {part})'
        self.code.line(f"{target} = {part}")
        self._moved(f"p + {size}")

    def _many(self, leaf: Many) -> None:
        target = self.code.place(leaf.path)
        if leaf.count:
            self._flush()
            count = str(leaf.count)
        else:
            count = self._count(least_size(leaf.body))
            if leaf.bound:
                self.code.line(f"need({leaf.bound}, {count})")
            self._const += 4
            self._at = self._at.aligned(4).moved(4)
        items, element = self.code.temp("l"), self.code.temp("e")
        self.code.line(f"{items} = []")
        start = self._blank(leaf.type_name, element) if leaf.type_name else []
        self._loop(leaf, element, f"for _ in range({count}):", "read", "buf, p, off, e", start)
        self.code.indent += 1
        self.code.line(f"{items}.append({element})")
        self.code.indent -= 1
        self.code.line(f"{target} = {items}")

    def _count(self, least: int) -> str:
        """Reads and checks a count at the present position, which stays."""
        self._flush()
        pad = self._at.pad(4)
        if pad is None:
            self._moved(f"{self._position()} + ({self._offset()} & 3)")
        else:
            self._const += pad
        name = self.code.temp("n")
        self.code.line(f"{name} = count(buf, {self._position()}, e, {least})")
        return name

    def _offset(self) -> str:
        """What padding to the next aligned position takes, before it is masked."""
        return f"off - {_bracketed(self._position())}"

    def _value(self, align: int, chunk: str, target: str, size: int) -> None:
        pad = self._at.pad(align)
        if pad is None:
            self._flush()
            self._moved(f"{self._position()} + ({self._offset()} & {align - 1})")
        elif pad:
            self._run.append(("", "", pad))
        self._run.append((chunk, target, size))

    def _flush(self) -> None:
        size = sum(width for _, _, width in self._run)
        if size and not self._checked:
            self.code.line(f"need(e - {_bracketed(self._position())}, {size})")
        if any(chunk[-1:] in ("f", "d", "s") for chunk, _, _ in self._run):
            self._unpack()
        else:
            at = 0
            for chunk, target, width in self._run:
                if chunk:
                    self.code.line(f"{target} = {_integer(chunk, width, self._position(at))}")
                at += width
        for line in self._later:
            self.code.line(line)
        self._const += size
        self._run, self._later = [], []

    def _unpack(self) -> None:
        chunks = [chunk.replace("?", "B") or f"{width}x" for chunk, _, width in self._run]
        targets = [target for chunk, target, _ in self._run if chunk]
        bools = [f"{target} = {target} != 0" for chunk, target, _ in self._run if chunk == "?"]
        head = ", ".join(targets) + ("," if len(targets) == 1 else "")
        self.code.line(f'{head} = unpack_from("{format_text("<", chunks)}", buf, {self._position()})')
        self._later = bools + self._later


def _integer(code: str, size: int, at: str) -> str:
    if code == "B":
        return f"buf[{at}]"
    if code == "?":
        return f"buf[{at}] != 0"
    return f"integer(buf, {at}, {size}, {int(code.islower())})"


def _bytes_of(code: Code, leaf: Text, memos: Memos | None) -> str:
    """The expression of a string's bytes: kept with the message, or made anew for an element of a sequence."""
    value = code.place(leaf.path)
    if memos is not None and code.indent == 0:  # outside loops
        return f"encoded({value}, self.{memos.name(leaf.path)})"
    return f"({value}.encode() if isinstance({value}, str) else {value})"


def _times(size: int, count: str) -> str:
    return count if size == 1 else f"{size} * {count}"


def _bracketed(position: str) -> str:
    return f"({position})" if "+" in position else position
