"""Trees of files for a board, as ``muros board copy`` makes them, with a cache of what is compiled.

A tree is a mapping from a path as the board sees it (``muros/xrce/serial.py``) to the file's bytes.
"""

import hashlib
import os
from collections.abc import Iterable, Mapping

from muros.cli import _floor
from muros.cli._floor import HOST_ONLY as HOST_ONLY
from muros.cli._floor import SOURCES as SOURCES
from muros.cli._floor import CompileError
from muros.cli._floor import Tree as Tree
from muros.cli._floor import board_files as board_files
from muros.cli._floor import board_path as board_path
from muros.cli._floor import board_tree as board_tree
from muros.cli._floor import write as write
from muros.cli._small import small
from tests.micropython.runtimes import ROOT, BoardError

_CACHE = ROOT / "build" / "mpy"
_COMPILER = (ROOT / "src/muros/cli/_floor.py").read_bytes()
"""What compiles: when it changes, nothing that it made before is used."""


def compiled(tree: Mapping[str, bytes], march: str | None = None) -> Tree:
    """The same tree with every ``.py`` as ``.mpy``; native code for ``march``, left out when it is None."""
    return _floor.compiled(tree, march, _compile)


def small_compiled(tree: Mapping[str, bytes], march: str | None = None) -> Tree:
    """A tree that was made small, compiled as ``muros board copy --small`` does it."""
    return _floor.compiled(tree, march, _compile_small)


def small_tree(
    extra: Mapping[str, bytes], programs: Iterable[str], native: bool = False, most: int | None = None
) -> Tree:
    """The board floor and more, made small for programs, as sources; with native code or without.

    ``most`` bounds the text of joined modules.
    """
    tree = {**board_tree(), **extra}
    if not native:
        tree = {path: content for path, content in tree.items() if not _floor.is_native(content)}
    return small(tree, programs, most)[0]


def _compile(path: str, content: bytes, march: str | None) -> bytes:
    return _cached(path, content, march, _floor.mpy)


def _compile_small(path: str, content: bytes, march: str | None) -> bytes:
    return _cached(path, content, march, _floor.small_mpy)


def _cached(path: str, content: bytes, march: str | None, compile_: _floor.Compile) -> bytes:
    parts = [compile_.__name__.encode(), path.encode(), (march or "").encode(), _COMPILER, content]
    key = hashlib.sha256(b"\0".join(parts)).hexdigest()[:24]
    cached = _CACHE / f"{key}.mpy"
    if not cached.exists():
        _CACHE.mkdir(parents=True, exist_ok=True)
        fresh = _CACHE / f"{key}.{os.getpid()}.new"  # several processes may compile it at once
        try:
            fresh.write_bytes(compile_(path, content, march))
        except CompileError as error:
            raise BoardError(str(error)) from None
        fresh.replace(cached)
    return cached.read_bytes()
