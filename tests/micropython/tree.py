"""Trees of files for a board, as ``muros board copy`` makes them, with a cache of what is compiled.

A tree is a mapping from a path as the board sees it (``muros/xrce/serial.py``) to the file's bytes.
"""

import hashlib
from collections.abc import Mapping

from muros.cli import _floor
from muros.cli._floor import HOST_ONLY as HOST_ONLY
from muros.cli._floor import SOURCES as SOURCES
from muros.cli._floor import CompileError
from muros.cli._floor import Tree as Tree
from muros.cli._floor import board_files as board_files
from muros.cli._floor import board_path as board_path
from muros.cli._floor import board_tree as board_tree
from muros.cli._floor import write as write
from tests.micropython.runtimes import ROOT, BoardError

_CACHE = ROOT / "build" / "mpy"
_COMPILER = (ROOT / "src/muros/cli/_floor.py").read_bytes()
"""What compiles: when it changes, nothing that it made before is used."""


def compiled(tree: Mapping[str, bytes], march: str | None = None) -> Tree:
    """The same tree with every ``.py`` as ``.mpy``; native code for ``march``, left out when it is None."""
    return _floor.compiled(tree, march, _compile)


def _compile(path: str, content: bytes, march: str | None) -> bytes:
    key = hashlib.sha256(b"\0".join([path.encode(), (march or "").encode(), _COMPILER, content])).hexdigest()[
        :24
    ]
    cached = _CACHE / f"{key}.mpy"
    if not cached.exists():
        _CACHE.mkdir(parents=True, exist_ok=True)
        fresh = _CACHE / f"{key}.new"
        try:
            fresh.write_bytes(_floor.mpy(path, content, march))
        except CompileError as error:
            raise BoardError(str(error)) from None
        fresh.replace(cached)
    return cached.read_bytes()
