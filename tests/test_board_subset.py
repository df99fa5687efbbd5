"""The board floor keeps to the Python that MicroPython runs, and to the habits that keep a board's heap small.

Two kinds of check. The compiler check hands each module to MicroPython's own compiler, which settles what is
syntax. The rules below read the syntax tree for what compiles and yet fails or costs on a board: modules,
builtins and methods that are absent there, constants that take heap, signatures that allocate on each call.
What cannot be decided from the source is left to the tests in ``tests/board`` and to the memory budgets.
"""

import ast
import io
import tokenize
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from tests.micropython.runtimes import ROOT, require
from tests.micropython.tree import HOST_ONLY, SOURCES, board_files, board_path, board_tree, compiled

MAX_LINES = 250
"""Lines of code of a module: compiling a longer one on a board needs too much heap at once."""

MAX_PUBLIC_INTS = 8
"""Public integer constants of a module, each of which takes heap; an underscored one takes none."""

EVERYWHERE = frozenset({"array", "errno", "struct"})
"""Standard modules that any module of the board floor may import."""

ELSEWHERE = {
    "muros/compat.py": frozenset({"gc", "micropython", "sys", "time"}),
    "muros/xrce/_viper.py": frozenset({"micropython"}),
    "muros/client/chance.py": frozenset({"os"}),
    "muros/client/discovery.py": frozenset({"select", "socket"}),
    "muros/client/stream.py": frozenset({"select"}),
    "muros/client/udp.py": frozenset({"socket"}),
    "muros/client/tcp.py": frozenset({"socket"}),
    "muros/client/serial.py": frozenset({"os", "termios"}),
    "muros/client/uart.py": frozenset({"machine"}),
    "muros/rosserial/uart.py": frozenset({"machine"}),
}
"""What single modules may import besides: the platform in ``compat``, native code, and the transports."""

ABSENT_NAMES = frozenset(
    "BlockingIOError BrokenPipeError BufferError ChildProcessError ConnectionAbortedError "
    "ConnectionError ConnectionRefusedError ConnectionResetError EnvironmentError ExceptionGroup "
    "FileExistsError FileNotFoundError FloatingPointError IOError InterruptedError IsADirectoryError "
    "ModuleNotFoundError NotADirectoryError PermissionError ProcessLookupError RecursionError "
    "ReferenceError SystemError TimeoutError UnboundLocalError UnicodeDecodeError UnicodeEncodeError "
    "Warning UserWarning DeprecationWarning RuntimeWarning aiter anext ascii breakpoint format vars".split()
)
"""Builtins that MicroPython lacks."""

ABSENT_METHODS = frozenset(
    "bit_count bit_length capitalize casefold expandtabs format_map frombytes is_integer isalnum "
    "isascii isidentifier isnumeric isprintable iter_unpack ljust maketrans recv_into recvfrom_into "
    "removeprefix removesuffix rjust swapcase titlecase tobytes toreadonly zfill Struct".split()
)
"""Methods that MicroPython's strings, numbers, buffers and sockets lack."""

ABSENT_SYNTAX: dict[str, str] = {
    "AsyncFunctionDef": "async functions live outside the board floor's core",
    "Match": "no match statement",
    "Try_Star": "no except*",
    "TryStar": "no except*",
    "TypeAlias": "no type statement",
}


class Complaint(NamedTuple):
    """A place where a module breaks a rule."""

    line: int
    what: str


class Module:
    """One module as the rules see it."""

    def __init__(self, path: str, source: str) -> None:
        self.path = path
        self.source = source
        self.tree = ast.parse(source)
        skipped = _never_on_boards(self.tree)
        self.nodes = [node for node in ast.walk(self.tree) if id(node) not in skipped]


Rule = Callable[[Module], Iterator[Complaint]]


def imports_what_boards_have(module: Module) -> Iterator[Complaint]:
    """Rule 1: a few standard modules, muros itself; the platform only where it is adapted."""
    allowed = EVERYWHERE | ELSEWHERE.get(module.path, frozenset())
    for node in module.nodes:
        if isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        elif isinstance(node, ast.ImportFrom):
            names = [node.module or ""] if not node.level else ["muros"]
        else:
            continue
        for name in names:
            top = name.partition(".")[0]
            if top != "muros" and top not in allowed:
                yield Complaint(node.lineno, f"imports {name}")


def asks_for_no_platform(module: Module) -> Iterator[Complaint]:
    """Rule 2: only compat knows which interpreter runs."""
    if module.path == "muros/compat.py":
        return
    for node in module.nodes:
        if isinstance(node, ast.Attribute) and ast.unparse(node) in ("sys.implementation", "sys.platform"):
            yield Complaint(node.lineno, f"asks {ast.unparse(node)}; muros.compat answers that")


def uses_syntax_boards_have(module: Module) -> Iterator[Complaint]:
    """Section by section what CPython's grammar has and MicroPython's has not, or only costs there."""
    for node in module.nodes:
        if reason := ABSENT_SYNTAX.get(type(node).__name__):
            yield Complaint(getattr(node, "lineno", 1), reason)
        if isinstance(node, ast.FunctionDef | ast.Lambda) and node.args.posonlyargs:
            yield Complaint(node.lineno, "positional-only parameters")
        if isinstance(node, ast.Dict) and None in node.keys:
            yield Complaint(node.lineno, "{**mapping}")


def uses_builtins_boards_have(module: Module) -> Iterator[Complaint]:
    """Names and methods that raise only when a board reaches them."""
    for node in module.nodes:
        if isinstance(node, ast.Name) and node.id in ABSENT_NAMES and isinstance(node.ctx, ast.Load):
            yield Complaint(node.lineno, f"MicroPython has no {node.id}")
        if not isinstance(node, ast.Call) or not isinstance(node.func, ast.Attribute):
            continue
        name = node.func.attr
        if name in ABSENT_METHODS or (name == "cast" and module.path != "muros/compat.py"):
            yield Complaint(node.lineno, f"MicroPython has no .{name}()")
        if name in ("to_bytes", "from_bytes") and node.keywords:
            yield Complaint(node.lineno, f".{name}() takes positional arguments only")
        if name == "__init__" and isinstance(node.func.value, ast.Name):
            yield Complaint(node.lineno, "call super().__init__(): a base's own fails for exceptions")


def constants_cost_nothing(module: Module) -> Iterator[Complaint]:
    """Rule 4: an integer of a module is ``_NAME = const(n)``; a few public ones are bearable."""
    public = []
    for node in module.tree.body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or node.value is None:
            continue
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        names = [target.id for target in targets if isinstance(target, ast.Name)]
        if names == ["TYPE_CHECKING"] or not names:
            continue
        wrapped = isinstance(node.value, ast.Call) and ast.unparse(node.value.func) == "const"
        if not wrapped and not _is_integer(node.value):
            continue
        if not names[0].startswith("_"):
            public.append((node.lineno, names[0]))
        elif not wrapped:
            yield Complaint(node.lineno, f"{names[0]}: write const(...) around the number")
    if len(public) > MAX_PUBLIC_INTS:
        line, name = public[MAX_PUBLIC_INTS]
        yield Complaint(line, f"{name} is public constant number {MAX_PUBLIC_INTS + 1}; each takes heap")


def classes_are_plain(module: Module) -> Iterator[Complaint]:
    """Rule 5: single inheritance, no metaclass, no attribute hooks, no forwarding of arguments.

    But for one: what an object has not may be lent by a borrowed module, see ``muros.compat``; that may be what sets
    it up, once.
    """
    passing = {
        call
        for node in module.nodes
        if isinstance(node, ast.FunctionDef) and node.name == "__init__"
        for call in ast.walk(node)
        if isinstance(call, ast.Call) and ast.unparse(call.func).startswith("borrow(")
    }
    hooks = {
        "__getattr__",
        "__getattribute__",
        "__setattr__",
        "__init_subclass__",
        "__class_getitem__",
        "__new__",
    }
    for node in module.nodes:
        if isinstance(node, ast.ClassDef):
            if len(node.bases) > 1 or node.keywords:
                yield Complaint(node.lineno, f"class {node.name}: one base and no keywords")
            for item in node.body:
                if isinstance(item, ast.FunctionDef) and item.name in hooks and not _lends(item):
                    yield Complaint(item.lineno, f"class {node.name} defines {item.name}")
                text = ast.unparse(item)
                if text.split(" = ")[0] in hooks and text != "__getattr__ = lending":
                    yield Complaint(item.lineno, f"class {node.name} has {text}")
        if module.path == "muros/compat.py":
            continue  # where lending is done
        if (
            isinstance(node, ast.Call)
            and node not in passing
            and (
                any(isinstance(argument, ast.Starred) for argument in node.args)
                or any(keyword.arg is None for keyword in node.keywords)
            )
        ):
            yield Complaint(node.lineno, "passes * or ** on, which allocates on each call")


def nothing_recurses(module: Module) -> Iterator[Complaint]:
    """Rule 13: no function calls itself; a board's stack is a few kilobytes."""
    for owner, function in _functions(module.tree):
        itself = f"self.{function.name}" if owner else function.name
        for node in ast.walk(function):
            if isinstance(node, ast.Call) and ast.unparse(node.func) == itself:
                yield Complaint(node.lineno, f"{function.name} calls itself")


def modules_are_short(module: Module) -> Iterator[Complaint]:
    """Rule 14: what a board compiles at once stays small."""
    lines = _lines_of_code(module)
    if lines > MAX_LINES:
        yield Complaint(module.source.count("\n"), f"{lines} lines of code; at most {MAX_LINES}")


RULES: tuple[Rule, ...] = (
    imports_what_boards_have,
    asks_for_no_platform,
    uses_syntax_boards_have,
    uses_builtins_boards_have,
    constants_cost_nothing,
    classes_are_plain,
    nothing_recurses,
    modules_are_short,
)

_FILES = board_files()


@pytest.mark.parametrize("path", _FILES, ids=[board_path(path) for path in _FILES])
def test_module_keeps_to_the_subset(path: Path) -> None:
    module = Module(board_path(path), path.read_text())
    complaints = sorted(complaint for rule in RULES for complaint in rule(module))
    assert not complaints, "\n" + "\n".join(
        f"{path.relative_to(ROOT)}:{line}: {what}" for line, what in complaints
    )


def test_every_module_compiles_for_boards() -> None:
    require("mpy-cross")
    tree = board_tree()
    assert len(compiled(tree, march="armv6m")) == len(tree)


def test_host_only_modules_exist() -> None:
    gone = [path for path in HOST_ONLY if not (SOURCES / path).is_file()]
    assert not gone, f"HOST_ONLY in src/muros/cli/_floor.py names what is not there: {gone}"


def test_boards_load_no_host_only_module() -> None:
    hosts = {path.removesuffix(".py").replace("/", ".") for path in HOST_ONLY}
    for path in _FILES:
        for node in Module(board_path(path), path.read_text()).nodes:
            if isinstance(node, ast.ImportFrom) and node.module:
                names = {node.module} | {f"{node.module}.{alias.name}" for alias in node.names}
            elif isinstance(node, ast.Import):
                names = {alias.name for alias in node.names}
            else:
                continue
            assert not names & hosts, (
                f"{board_path(path)}:{node.lineno} imports the host-only {names & hosts}"
            )


BREACHES: dict[Rule, list[str]] = {
    imports_what_boards_have: [
        "import typing",
        "from dataclasses import dataclass",
        "from __future__ import annotations",
        "import time",
        "def f():\n    import enum",
        "import collections.abc",
    ],
    asks_for_no_platform: ["import sys\nx = sys.implementation.name"],
    uses_syntax_boards_have: [
        "match x:\n    case 1:\n        pass",
        "def f(a, /): pass",
        "async def f(): pass",
        "x = {**a}",
        "try:\n    pass\nexcept* OSError:\n    pass",
    ],
    uses_builtins_boards_have: [
        "try:\n    pass\nexcept TimeoutError:\n    pass",
        "x = n.bit_length()",
        "x = memoryview(b).cast('B')",
        "x = n.to_bytes(2, byteorder='little')",
        "class E(OSError):\n    def __init__(self):\n        OSError.__init__(self, 5)",
    ],
    constants_cost_nothing: [
        "_A = 5",
        "\n".join(f"A{i} = {i}" for i in range(MAX_PUBLIC_INTS + 1)),
        "_A = -1",
        "_A: int = 1 << 4",
        "\n".join(f"A{i} = const({i})" for i in range(MAX_PUBLIC_INTS + 1)),
    ],
    classes_are_plain: [
        "class A(B, C): pass",
        "class A(metaclass=M): pass",
        "class A:\n    def __getattr__(self, name): return 1",
        "class A:\n    __getattr__ = guess",
        "class A:\n    def __getattribute__(self, name): return lend(self, 'muros.x', name)",
        "def f(*args): g(*args)",
        "def f(**kw): g(**kw)",
    ],
    nothing_recurses: ["def f(n):\n    return f(n - 1)", "class A:\n    def f(self):\n        self.f()"],
    modules_are_short: ["x = y\n" * (MAX_LINES + 1)],
}
"""For each rule, sources that break it: a rule that no longer bites fails here."""


@pytest.mark.parametrize(("rule", "source"), [(rule, source) for rule in RULES for source in BREACHES[rule]])
def test_rules_bite(rule: Rule, source: str) -> None:
    assert list(rule(Module("muros/xrce/example.py", source)))


ACCEPTABLE = '''
"""A module as boards like it."""

import struct

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Protocol

_HEAD = const(4)
_TABLE = bytes([1, 2, 3])


class Writer:
    def __init__(self, buf: bytearray, sink: "Protocol") -> None:
        self.buf = buf
        self.sink = sink

    def write(self, off: int, value: int) -> int:
        struct.pack_into("<H", self.buf, off, value)
        self.sink.write(off)
        return off + _HEAD


class WriteError(Exception):
    def __init__(self, text: str) -> None:
        super().__init__(text)


def write(writer: Writer) -> None:
    writer.write(0, 1)
'''


@pytest.mark.parametrize("rule", RULES)
def test_rules_let_good_code_pass(rule: Rule) -> None:
    assert list(rule(Module("muros/xrce/example.py", ACCEPTABLE))) == []


def _never_on_boards(tree: ast.Module) -> set[int]:
    """The nodes that boards never evaluate: annotations, ``if TYPE_CHECKING:``, the host side of ``if MPY:``."""
    skipped: set[int] = set()
    for node in ast.walk(tree):
        parts: list[ast.AST | None] = []
        if isinstance(node, ast.If) and ast.unparse(node.test) in ("TYPE_CHECKING", "not MPY"):
            parts += node.body
        if isinstance(node, ast.If) and ast.unparse(node.test) == "MPY":
            parts += node.orelse
        if isinstance(node, ast.FunctionDef):
            parts.append(node.returns)
        if isinstance(node, ast.arg | ast.AnnAssign):
            parts.append(node.annotation)
        skipped.update(id(inner) for part in parts if part is not None for inner in ast.walk(part))
    return skipped


def _lends(function: ast.FunctionDef) -> bool:
    """Whether a ``__getattr__`` does nothing but to answer for a borrowed module."""
    return function.name == "__getattr__" and [ast.unparse(node).split("(")[0] for node in function.body] == [
        "return lend"
    ]


def _lines_of_code(module: Module) -> int:
    """Lines that hold code: neither blank nor of comments and docstrings, which boards compile to nothing."""
    layout = {
        tokenize.COMMENT,
        tokenize.NL,
        tokenize.NEWLINE,
        tokenize.INDENT,
        tokenize.DEDENT,
        tokenize.ENDMARKER,
    }
    lines: set[int] = set()
    for token in tokenize.generate_tokens(io.StringIO(module.source).readline):
        if token.type not in layout:
            lines.update(range(token.start[0], token.end[0] + 1))
    for node in ast.walk(module.tree):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            lines.difference_update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return len(lines)


def _is_integer(node: ast.expr) -> bool:
    """Whether an expression is made of integer literals and operators only."""
    if isinstance(node, ast.Constant):
        return type(node.value) is int
    if isinstance(node, ast.UnaryOp):
        return _is_integer(node.operand)
    if isinstance(node, ast.BinOp):
        return _is_integer(node.left) and _is_integer(node.right)
    return False


def _functions(tree: ast.Module) -> Iterator[tuple[str, ast.FunctionDef]]:
    """Each function of a module, with the name of the class it is a method of or an empty one."""
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef):
                yield (node.name if isinstance(node, ast.ClassDef) else ""), child
