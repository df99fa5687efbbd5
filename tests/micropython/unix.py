"""Programs on the 64-bit unix port of MicroPython."""

import os
import subprocess
from collections.abc import Callable, Sequence
from pathlib import Path

from tests.micropython.runtimes import ROOT, UNIX, BoardError

LIBRARY = (ROOT / "src", ROOT)
"""Where programs import from: the sources, and the repository for ``tests.board``."""


def run_mpy(
    program: str | Path,
    args: Sequence[str] = (),
    heapsize: str | None = None,
    library: Sequence[Path] = LIBRARY,
    timeout: float = 30.0,
) -> str:
    """Runs a program under MicroPython and returns what it wrote to both outputs.

    ``program`` is a script's path or source text; both see ``args`` as ``sys.argv[1:]``. It runs in the first
    folder of ``library``. ``heapsize`` caps the heap as MicroPython's ``-X heapsize`` does (``"40K"``).
    ``timeout`` is in seconds.

    Raises BoardError, with the output, when the program ends with an error or does not end in time.
    """
    options = ["-X", f"heapsize={heapsize}"] if heapsize else []
    script = [str(program)] if isinstance(program, Path) else ["-c", program]
    environment = {
        "PATH": os.environ.get("PATH", ""),
        "MICROPYPATH": ":".join([".frozen", *map(str, library)]),
    }
    try:
        done = subprocess.run(
            [str(UNIX), *options, *script, *args],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            stdin=subprocess.DEVNULL,
            text=True,
            env=environment,
            cwd=library[0],
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired as late:
        output = late.stdout.decode(errors="replace") if isinstance(late.stdout, bytes) else late.stdout
        raise BoardError(f"MicroPython did not end within {timeout:g} s\n{output or ''}") from None
    if done.returncode:
        raise BoardError(f"MicroPython ended with status {done.returncode}\n{done.stdout}")
    return done.stdout


def smallest_heap(runs: Callable[[str], None], low: int, high: int) -> int:
    """The smallest heap in kB, between ``low`` and ``high``, for which ``runs("<n>K")`` raises no BoardError.

    Raises BoardError when not even ``high`` is enough.
    """
    runs(f"{high}K")
    while low < high:
        middle = (low + high) // 2
        try:
            runs(f"{middle}K")
        except BoardError:
            low = middle + 1
        else:
            high = middle
    return high
