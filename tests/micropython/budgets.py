"""What the board floor may cost on a board: one row for each promise, with the way to measure it.

``test_budgets.py`` holds every row as a gate; ``make budgets`` prints the table with the figures of today.

Measures to build rows from:

- ``import_heap``, ``object_heap``, ``live_heap``: bytes on a 32-bit heap, bytecode in RAM, garbage not counted
- ``drift``: bytes that the 32-bit heap grows by over many calls
- ``allocation_32``, ``allocation_64``: bytes of heap that one call allocates, garbage included
- ``instructions``: exact count for one call (fuel); the limit is the agreed figure plus ten percent
- ``bytecode``: bytes of ``.mpy``, the flash that a board needs
- ``smallest``: kB of heap that a whole program needs on the 64-bit unix port, as ``.py`` or as ``.mpy``
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.micropython.fuel import fuel_per_call
from tests.micropython.gauge import heap_cost, run_gauge
from tests.micropython.runtimes import ROOT, BoardError
from tests.micropython.tree import Tree, board_tree, compiled, write
from tests.micropython.unix import run_mpy, smallest_heap

PROGRAMS = Path(__file__).parent / "programs"
"""Small board programs that whole-program budgets run; a program that did its work prints ``done`` last."""


@dataclass(frozen=True, slots=True)
class Budget:
    """One promise."""

    what: str
    limit: float
    unit: str
    runtimes: tuple[str, ...]
    """What the measure needs, see ``runtimes.require``."""
    measure: Callable[[], float]


def import_heap(source: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes that the imports in ``source`` leave on a 32-bit heap. ``extra`` holds more files, as ``.py``."""
    return heap_cost(_mpy(extra), source)


def object_heap(setup: str, expression: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes that the value of ``expression``, evaluated after ``setup``, takes on a 32-bit heap.

    The mean of ten, after a first one, so that neither the names of the program nor what is made once counts.
    """
    prepared = (
        f"{setup}\n_kept = [None] * 11\n"
        f"def _fill(start, end):\n    for i in range(start, end):\n        _kept[i] = {expression}\n"
    )
    _, first, last = run_gauge(_mpy(extra), prepared, "_fill(0, 1)", "_fill(1, 11)")
    return (last.live - first.live) / 10


def live_heap(setup: str, source: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes that ``source`` leaves on a 32-bit heap after ``setup``, which is not counted.

    New names in ``source`` count too, up to a few hundred bytes.
    """
    return heap_cost(_mpy(extra), source, before=setup)


def drift(setup: str, call: str, times: int, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes by which ``times`` calls of a statement after ``setup`` raise what lives on a 32-bit heap.

    A tenth as many calls run before, so that buffers which grow once to their size do not count.
    """
    loop = f"def _loop(n):\n    for _ in range(n):\n        {call}\n"
    *_, first, last = run_gauge(_mpy(extra), f"{setup}\n{loop}", f"_loop({times // 10})", f"_loop({times})")
    return last.live - first.live


def allocation_32(setup: str, call: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes that one ``call``, a statement after ``setup``, allocates on a 32-bit heap."""
    return float(run_gauge({**_mpy(extra), **_harness()}, _allocation(setup, call))[0].output)


def allocation_64(setup: str, call: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Bytes that one ``call``, a statement after ``setup``, allocates on a 64-bit heap."""
    with TemporaryDirectory() as name:
        folder = write({**board_tree(), **(extra or {}), **_harness()}, Path(name))
        return float(run_mpy(_allocation(setup, call), library=[folder]))


def instructions(setup: str, call: str, extra: Mapping[str, bytes] | None = None) -> float:
    """Instructions of one ``call``, a statement after ``setup``, as bytecode."""
    return fuel_per_call(_mpy(extra), setup, call)


def bytecode(rooms: Sequence[str]) -> float:
    """Bytes of the compiled modules of some rooms (``"compat.py"``, ``"xrce"``), native code left out."""
    tree = compiled(board_tree(rooms))
    return sum(map(len, tree.values())) - len(tree["muros/__init__.mpy"])


def smallest(
    program: str, form: str, limit: int, args: Sequence[str] = (), extra: Mapping[str, bytes] | None = None
) -> float:
    """kB of the smallest heap, up to twice ``limit``, in which a program of ``PROGRAMS`` runs on 64 bit.

    ``form`` is ``py`` or ``mpy``. A program that does not fit even twice the limit raises BoardError.
    """
    tree = {**board_tree(), **(extra or {}), f"{program}.py": (PROGRAMS / f"{program}.py").read_bytes()}
    return smallest_of(compiled(tree, march="x64") if form == "mpy" else tree, program, limit, args)


def smallest_of(tree: Tree, program: str, limit: int, args: Sequence[str] = ()) -> float:
    """The same for a module of a tree that is ready for a board."""
    with TemporaryDirectory() as name:
        folder = write(tree, Path(name))

        def run(heapsize: str) -> None:
            output = run_mpy(f"import {program}", args, heapsize=heapsize, library=[folder])
            if not output.endswith("done\n"):
                raise BoardError(f"{program} did not finish its work:\n{output}")

        return smallest_heap(run, 4, 2 * limit)


BUDGETS: tuple[Budget, ...] = (
    Budget(
        "import of compat", 2500, "B", ("mpy-cross", "gauge"), partial(import_heap, "import muros.compat")
    ),
    Budget("bytecode of compat", 1200, "B", ("mpy-cross",), partial(bytecode, ["compat.py"])),
    *(
        Budget(
            f"allocation of copying 16 B, {bits} bit",
            0,
            "B",
            runtimes,
            partial(
                measure, "from muros.compat import copy\nbuf = bytearray(32)", "copy(buf, 0, buf, 16, 16)"
            ),
        )
        for bits, runtimes, measure in (
            (32, ("mpy-cross", "gauge"), allocation_32),
            (64, ("unix",), allocation_64),
        )
    ),
)


def _mpy(extra: Mapping[str, bytes] | None) -> Tree:
    return compiled({**board_tree(), **(extra or {})})


def _harness() -> Tree:
    return {"tests/board/harness.py": (ROOT / "tests/board/harness.py").read_bytes()}


def _allocation(setup: str, call: str) -> str:
    return (
        f"from tests.board.harness import allocates\n{setup}\n"
        f"def _call():\n    {call}\nprint(allocates(_call))\n"
    )
