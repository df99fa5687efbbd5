"""The generator of board classes: packages of small modules that MicroPython and CPython import alike.

``generate(["std_msgs/msg/Int32"], "lib")`` writes ``lib/std_msgs/msg/_Int32.py`` and what it needs, so that a board
program says ``from std_msgs.msg import Int32`` like any other. Packages load a module when its type is asked for.

What is named gets a full class. Messages that are only nested in others get a class with fields and nothing else, as
the code of the outer message reads and writes them: that is what makes a type cheap on a heap of some kilobytes.

Of constants a board keeps the names, so long lists of them cost more than all the code of a class: unless a program
says which it uses, types with more than ``MOST_CONSTANTS`` bytes of them go without. ``constants_in`` finds those.
"""

from __future__ import annotations

import os
import re
from collections.abc import Container, Iterable, Sequence
from pathlib import Path

from muros.interfaces import _model as model
from muros.interfaces._api import registry as default_registry
from muros.interfaces._board_code import RUN, Memo, Shared, read_lines, size_lines, write_lines
from muros.interfaces._layout import Leaf, Many, Text, leaves
from muros.interfaces._model import (
    PRIMITIVES,
    Constant,
    Field,
    InterfaceError,
    Kind,
    Message,
    Value,
    attribute,
)
from muros.interfaces._names import split_type
from muros.interfaces._registry import Registry
from muros.interfaces._shape import shape

ACTION_TYPES = ("action_msgs/srv/CancelGoal", "action_msgs/msg/GoalStatusArray")
"""What all actions have in common."""

_HELPERS = {
    "muros.cdr": ("Fields", "block", "integer", "need", "numbers"),
    "muros.cdr_texts": ("count", "finish", "pad", "part", "put_text", "text", "text_size", "unpack"),
    "muros.cdr_lists": ("list_size", "put_count", "put_sequence", "sequence", "texts_size"),
    "muros.cdr_rows": ("new_sequences", "put_sequences", "sequences", "sequences_size"),
}

MOST_CONSTANTS = 500  # bytes of a 32-bit heap: names, each with what its entry takes
_ENTRY = 12

_PACKAGE = """\
def __getattr__(name):
    if name[0] == "_":
        raise AttributeError(name)
    try:
        return getattr(__import__(__name__ + "._" + name, None, None, (name,)), name)
    except ImportError:
        raise AttributeError(name)
"""


def generate(
    names: Iterable[str],
    folder: str | os.PathLike[str],
    action_services: bool = False,
    registry: Registry | None = None,
    constants: Container[str] | None = None,
    shapes: bool = False,
) -> list[Path]:
    """Writes the modules of the named types and of all they need below a folder; returns the files, sorted.

    Types that the folder already has in full stay full. ``action_services`` adds the services and the messages
    that carry an action. ``constants`` names those to keep; None keeps all but long lists. With ``shapes`` classes
    have what bounds of memory need, see :mod:`muros.rclc.memory`. Raises :class:`InterfaceError` for unknown types and
    for ``wstring``, which boards do not do.
    """
    root = Path(folder)
    written: set[Path] = set()
    for path, text in sources(names, action_services, registry, root, constants, shapes).items():
        target = root / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_text(text, encoding="utf-8")
        written.add(target)
    return sorted(written)


def sources(
    names: Iterable[str],
    action_services: bool = False,
    registry: Registry | None = None,
    present: Path | None = None,
    constants: Container[str] | None = None,
    shapes: bool = False,
) -> dict[str, str]:
    """The modules that :func:`generate` writes: path -> text. ``present``: a folder whose full types stay full."""
    work = _Work(registry or default_registry(), present, constants, shapes)
    for name in names:
        work.add(work.registry.full_name(name), action_services)
    return work.files()


def without_constants(names: Iterable[str], registry: Registry | None = None) -> dict[str, int]:
    """The types, of those named and all they need, whose constants are too many to be kept unasked: name -> number."""
    work = _Work(registry or default_registry(), None, None)
    for name in names:
        work.add(work.registry.full_name(name), action_services=False)
    return {m.name: len(m.constants) for m in work.messages() if m.constants and not work.constants(m)}


def constants_in(program: str) -> frozenset[str]:
    """The names in a program's text that may be those of constants: what ``constants`` takes."""
    return frozenset(re.findall(r"\b[A-Za-z]\w*", program))


class _Work:
    """The types to write: which in full, which only as what others hold."""

    def __init__(
        self, registry: Registry, present: Path | None, constants: Container[str] | None, shapes: bool = False
    ) -> None:
        self.registry = registry
        self._shapes = shapes
        self._wanted = constants
        self._present = present
        self._modules: dict[str, list[Message]] = {}  # module path -> messages in it
        self._full: set[str] = set()
        self._tails: dict[str, list[str]] = {}  # module path -> classes of services and actions

    def add(self, name: str, action_services: bool) -> None:
        found = self.registry.definition(name)
        if isinstance(found, Message):
            self._message(found)
        elif isinstance(found, model.Service):
            self._service(found, name)
        else:
            for message in (found.goal, found.result, found.feedback):
                self._message(message, name)
            parts = {"Goal": found.goal, "Result": found.result, "Feedback": found.feedback}
            if action_services:
                for common in ACTION_TYPES:
                    self.add(common, action_services)
                self._message(found.feedback_message, name)
                self._service(found.send_goal, name)
                self._service(found.get_result, name)
                parts |= {"FeedbackMessage": found.feedback_message}
            lines = _holder(name, {key: message.name.split("/")[2] for key, message in parts.items()})
            if action_services:
                lines += f"    SendGoal = {_short(name)}_SendGoal\n    GetResult = {_short(name)}_GetResult\n"
            self._tails.setdefault(_module(name), []).append(lines)

    def messages(self) -> list[Message]:
        """All that will be written, nested ones too."""
        return [message for found in self._modules.values() for message in found]

    def constants(self, message: Message) -> list[Constant]:
        """The constants that the class of a message gets."""
        if self._wanted is not None:
            return [constant for constant in message.constants if constant.name in self._wanted]
        long = sum(len(constant.name) + _ENTRY for constant in message.constants) > MOST_CONSTANTS
        return [] if long else list(message.constants)

    def files(self) -> dict[str, str]:
        files: dict[str, str] = {}
        for path, messages in self._modules.items():
            files[path] = self._source(path, messages)
            package, kind, _ = path.split("/")
            files[f"{package}/__init__.py"] = ""
            files[f"{package}/{kind}/__init__.py"] = _PACKAGE
        return files

    def _service(self, found: model.Service, home: str) -> None:
        self._message(found.request, home)
        self._message(found.response, home)
        halves = {"Request": f"{_short(found.name)}_Request", "Response": f"{_short(found.name)}_Response"}
        self._tails.setdefault(_module(home), []).append(_holder(found.name, halves))

    def _message(self, message: Message, home: str = "", full: bool = True) -> None:
        path = _module(home or message.name)
        messages = self._modules.setdefault(path, [])
        if message not in messages:
            messages.append(message)
        if (full or self._was_full(path)) and message.name not in self._full:
            self._full.add(message.name)
            self._refuse_wide(message)
        for nested in self.registry.closure(message).values():
            other = self._home(nested)
            if nested not in self._modules.setdefault(_module(other), []):
                self._message(nested, other, full=False)

    def _home(self, message: Message) -> str:
        """The definition whose module holds a message: its own, its service's or its action's."""
        name = message.name
        while split_type(name).kind != "msg" and "_" in name and not self._is_whole(name):
            name = name.rpartition("_")[0]
        return name

    def _is_whole(self, name: str) -> bool:
        return self.registry.known(name) and not isinstance(self.registry.definition(name), Message)

    def _was_full(self, path: str) -> bool:
        if self._present is None:
            return False
        try:
            return "def write(" in (self._present / path).read_text("utf-8")
        except OSError:
            return False

    def _refuse_wide(self, message: Message) -> None:
        if _any_wide(leaves(message, self.registry.message)):
            raise InterfaceError(f"{message.name}: wstring is not supported on boards; use string")

    def _source(self, path: str, messages: list[Message]) -> str:
        functions: dict[str, list[str]] = {}  # name -> lines
        classes = [self._class(message, functions) for message in messages]
        body = "\n\n".join([*_used(functions, classes), *classes, *self._tails.get(path, [])])
        head = _imports(body)
        hidden = {name for message in messages for name in _hidden(message)}
        head += [f"_{name} = {name}" for name in sorted(hidden) if f"_{name}(" in body]
        return "\n".join([*head, "", "", body] if head else [body])

    def _class(self, message: Message, functions: dict[str, list[str]]) -> str:
        shared = Shared(message, self.registry.message)
        found = shared.leaves(message)
        memo = Memo(found)
        values = _Values(self.registry, shared)
        methods: list[str] = []
        full = message.name in self._full
        if full:
            methods += ["    def size(self):", *_indented(size_lines(found, memo, shared))]
            methods += ["    def write(self, buf, off):", *_indented(write_lines(found, memo, shared))]
            methods += [
                "    def read(self, buf, off, n):",
                *_indented(read_lines(found, values.blank, shared)),
            ]
        for name in shared:
            functions |= values.maker(name) | shared.functions(name, values.blank)
        lines = [f"class {_short(message.name)}:", f'    TYPE = "{message.name}"']
        if full and self._shapes:
            lines.append(f'    SHAPE = "{shape(message, self.registry.message)}"')
        lines += [f"    {attribute(c.name)} = {_literal(c.value)}" for c in self.constants(message)]
        if message.fields:
            lines += self._init(message, values, len(memo.paths) if full else 0)
        return "\n".join(lines + methods) + "\n"

    def _init(self, message: Message, values: _Values, texts: int) -> list[str]:
        arguments, lines = ["self"], []
        hidden = _hidden(message)
        runs = _runs(message.fields)
        for field in message.fields:
            name = attribute(field.name)
            if (run := runs.get(field.name)) is not None:
                arguments.append(f"{name}=None")
                lines += run
                continue
            if zeros := _zeros(field):
                arguments.append(f"{name}=None")
                lines.append(_unshadowed(f"self.{name} = numbers({name}, {zeros})", hidden))
                continue
            if field.type.nested or _made(field):
                arguments.append(f"{name}=None")
                filled = [f"if {name} is None:", *(f"    {line}" for line in values.filled(name, field))]
                lines += [_unshadowed(line, hidden) for line in filled]
            else:
                arguments.append(f"{name}={_literal(_plain(field))}")
            lines.append(f"self.{name} = {name}")
        if texts:
            lines.append(f"self._memo = [None] * {2 * texts}")
        return [f"    def __init__({', '.join(arguments)}):", *_indented(lines)]


class _Values:
    """Code that makes nested messages: with their defaults for constructors, or blank for what is about to be read."""

    def __init__(self, registry: Registry, shared: Shared) -> None:
        self._find = registry.message
        self._shared = shared

    def filled(self, target: str, field: Field, depth: int = 0) -> list[str]:
        """Lines that put the default of a field into ``target``."""
        if not field.type.nested:
            return [f"{target} = {_made(field) or _literal(_plain(field))}"]
        name = field.type.base
        if field.type.kind is Kind.ONE:
            if name in self._shared:
                return [f"{target} = {self._shared.function('new', name)}()"]
            variable = target if target.isidentifier() else f"v{depth}"
            lines = self._message(variable, self._find(name), depth)
            return lines if variable == target else [*lines, f"{target} = {variable}"]
        if field.type.kind is not Kind.ARRAY:
            return [f"{target} = []"]
        items, element = f"l{depth}", f"e{depth}"
        if name in self._shared:
            inner = [f"{items}.append({self._shared.function('new', name)}())"]
        else:
            inner = [*self._message(element, self._find(name), depth + 1), f"{items}.append({element})"]
        loop = [f"for _ in range({field.type.count}):", *(f"    {line}" for line in inner)]
        return [f"{items} = []", *loop, f"{target} = {items}"]

    def blank(self, name: str, variable: str, depth: int = 0) -> list[str]:
        """Lines that make a nested message with the messages in it; only shared types get values, too."""
        if name in self._shared:
            return [f"{variable} = {self._shared.function('new', name)}()"]
        lines = [f"{variable} = Fields()"]
        for field in self._find(name).fields:
            if field.type.nested and field.type.kind is Kind.ONE:
                target = f"{variable}.{attribute(field.name)}"
                if field.type.base in self._shared:
                    lines += self.blank(field.type.base, target)
                    continue
                inner = f"f{depth}"
                lines += [*self.blank(field.type.base, inner, depth + 1), f"{target} = {inner}"]
        return lines

    def maker(self, name: str) -> dict[str, list[str]]:
        """The function that makes a shared type: name -> lines."""
        function = self._shared.function("new", name)
        lines = self._message("m", self._find(name), 0)
        return {function: [f"def {function}():", *(f"    {line}" for line in lines), "    return m"]}

    def _message(self, variable: str, message: Message, depth: int) -> list[str]:
        """Lines that make a message with its values; equal defaults in a row share a line."""
        lines = [f"{variable} = Fields()"]
        previous = ""
        for field in message.fields:
            target = f"{variable}.{attribute(field.name)}"
            if field.type.nested or _made(field):
                lines += self.filled(target, field, depth + 1)
                previous = ""
            elif (value := _literal(_plain(field))) == previous:
                lines[-1] = f"{target} = {lines[-1]}"
            else:
                lines.append(f"{target} = {value}")
                previous = value
        return lines


def _used(functions: dict[str, list[str]], classes: list[str]) -> list[str]:
    """The text of the functions that classes call, or that such functions call."""
    text = "".join(classes)
    used: dict[str, str] = {}
    while more := {
        name: lines for name, lines in functions.items() if name not in used and f"{name}(" in text
    }:
        used |= {name: "\n".join(lines) + "\n" for name, lines in more.items()}
        text = "".join(used.values())
    return ["\n".join(line.rstrip("\n") for line in used.values()) + "\n"] if used else []


def _imports(body: str) -> list[str]:
    lines = []
    if re.search(r"\b_?array\(", body):
        lines.append("from array import array")
    packers = [name for name in ("pack_into", "unpack_from") if f"{name}(" in body]
    if packers:
        lines.append(f"from struct import {', '.join(packers)}")
    for module, names in _HELPERS.items():
        used = [name for name in names if re.search(rf"(?<!\w|\.)_?{name}\(", body)]
        if used:
            lines.append(f"from {module} import {', '.join(used)}")
    return lines


def _runs(fields: Sequence[Field]) -> dict[str, list[str]]:
    """The sequences that a constructor makes together: field -> lines, none but for the first in a row."""
    made: dict[str, list[str]] = {}
    row: list[Field] = []
    for field in [*fields, None]:
        if field is not None and _starts_empty(field):
            row.append(field)
            continue
        if len(row) >= RUN:
            names = [attribute(f.name) for f in row]
            codes = "".join(PRIMITIVES[f.type.base].code or "s" for f in row)
            targets = ", ".join(f"self.{name}" for name in names)
            made |= {f.name: [] for f in row}
            made[row[0].name] = [f'{targets} = new_sequences("{codes}", {", ".join(names)})']
        row = []
    return made


def _starts_empty(field: Field) -> bool:
    """Whether it is a sequence of primitives without a default."""
    kinds = (Kind.SEQUENCE, Kind.BOUNDED)
    return not field.type.nested and field.type.kind in kinds and field.default is None


_GLOBALS = frozenset({"Fields", "array", "bytes", "float", "numbers", "range"})  # what constructors use


def _hidden(message: Message) -> set[str]:
    """The global names that arguments of the constructor hide; they are used with an underscore before them."""
    return {attribute(field.name) for field in message.fields} & _GLOBALS


def _unshadowed(line: str, hidden: set[str]) -> str:
    for name in hidden:
        line = re.sub(rf"\b{name}\(", f"_{name}(", line)
    return line


def _plain(field: Field) -> Value | bytes:
    """The default of a field that is no object of its own."""
    primitive = PRIMITIVES[field.type.base]
    if field.type.kind is not Kind.ONE:  # bytes
        return bytes(field.default if isinstance(field.default, list) else _elements(field))  # type: ignore[arg-type]
    if field.default is not None:
        return field.default
    return "" if not primitive.size else False if field.type.base == "bool" else 0 if primitive.high else 0.0


def _made(field: Field) -> str:
    """The expression that makes the default of a list or array of primitives; "" for other fields."""
    primitive = PRIMITIVES[field.type.base]
    if field.type.kind is Kind.ONE or primitive.code == "B":
        return ""
    if not primitive.size or primitive.code == "?":
        zero = "" if not primitive.size else False
        if field.default is not None:
            return _literal(field.default)
        return f"[{zero!r}] * {field.type.count}" if _elements(field) else "[]"
    if field.default is not None:
        return f'array("{primitive.code}", {_literal(field.default)})'
    return f"numbers(None, {_zeros(field)})"


def _zeros(field: Field) -> str:
    """Code and bytes of an array that is zero or empty unless told otherwise; "" for other fields."""
    if field.type.nested or field.type.kind is Kind.ONE or field.default is not None:
        return ""
    primitive = PRIMITIVES[field.type.base]
    if primitive.code in ("B", "?") or not primitive.size:
        return ""
    size = _elements(field) * primitive.size
    return f'"{primitive.code}", {size}' if size else f'"{primitive.code}"'


def _elements(field: Field) -> int:
    return field.type.count if field.type.kind is Kind.ARRAY else 0


def _module(name: str) -> str:
    package, kind, type_name = name.split("/")
    return f"{package}/{kind}/_{type_name}.py"


def _short(name: str) -> str:
    return name.rpartition("/")[2]


def _holder(name: str, members: dict[str, str]) -> str:
    lines = [f"class {_short(name)}:", f'    TYPE = "{name}"']
    return "\n".join(lines + [f"    {key} = {value}" for key, value in members.items()]) + "\n"


def _indented(lines: list[str]) -> list[str]:
    return ["        " + line for line in lines]


def _any_wide(found: Iterable[Leaf]) -> bool:
    return any(
        (isinstance(leaf, Text) and leaf.wide) or (isinstance(leaf, Many) and _any_wide(leaf.body))
        for leaf in found
    )


def _literal(value: Value | bytes) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    text = repr(value)
    return f'float("{text}")' if text in ("nan", "inf", "-inf") else text
