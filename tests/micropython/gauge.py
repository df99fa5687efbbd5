"""The 32-bit gauge: heap figures that hold for boards within about ten percent.

A run mounts a tree of files into a fresh 32-bit MicroPython, runs snippets one after the other in one global
namespace and reports what each left live on the heap. Garbage never counts: the gauge collects first. The
build has no socket, no native code and doubles for floats, and its heap grows as needed.
"""

import base64
import json
import subprocess
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.micropython.runtimes import NPM_BUILD, BoardError

_SCRIPT = Path(__file__).with_suffix(".mjs")
_TIMEOUT = 60.0  # seconds for a run


@dataclass(frozen=True, slots=True)
class Step:
    """What one snippet did."""

    output: str
    """What it printed."""
    live: int
    """Bytes live on the heap afterwards."""


def run_gauge(tree: Mapping[str, bytes], *snippets: str) -> list[Step]:
    """Runs the snippets in a fresh interpreter that finds ``tree`` below its library folder.

    Raises BoardError, with the traceback, at the first snippet that raises.
    """
    return run_gauges(tree, [snippets])[0]


def run_gauges(
    tree: Mapping[str, bytes], jobs: Sequence[Sequence[str]], timeout: float = _TIMEOUT
) -> list[list[Step]]:
    """The same for several lists of snippets, each in an interpreter of its own: quicker than one after the other."""
    job = {
        "build": NPM_BUILD.as_uri(),
        "files": {path: base64.b64encode(content).decode() for path, content in tree.items()},
        "jobs": jobs,
    }
    try:
        done = subprocess.run(
            ["node", str(_SCRIPT)],
            input=json.dumps(job),
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
        )
    except subprocess.TimeoutExpired:
        raise BoardError(f"the 32-bit build did not end within {timeout:g} s") from None
    if done.returncode:
        raise BoardError(f"node ended with status {done.returncode}\n{done.stderr}")
    reports = json.loads(done.stdout)
    for snippets, steps in zip(jobs, reports, strict=True):
        for snippet, step in zip(snippets, steps, strict=True):
            if step["error"] is not None:
                raise BoardError(f"on the 32-bit build:\n{step['output']}{step['error']}\nin:\n{snippet}")
    return [[Step(step["output"], step["live"]) for step in steps] for steps in reports]


def heap_cost(tree: Mapping[str, bytes], snippet: str, before: str = "pass") -> int:
    """Bytes that ``snippet`` leaves live on a 32-bit heap, run after ``before``."""
    first, second = run_gauge(tree, before, snippet)
    return second.live - first.live
