"""What the class of a message may cost on a board: 1.2 kB of a 32-bit heap, and 0.4 kB for each nested type.

It is what ``from package.msg import Type`` leaves on the heap once ``muros.cdr`` and its companions are loaded. A
service costs what its two messages may, an action what its three may.

The interpreter keeps names in chunks that are filled before another is made, so that what one class adds differs by a
hundred bytes from start to start. So a class is imported twice: the first time tells the bytes of its new names, the
second, when it was forgotten again, what all the rest takes. Tables that grow by doubling, of all names and of all
modules, are not counted.
"""

import re
from functools import cache

from muros.interfaces import Registry, board
from muros.interfaces._model import Message, Service
from tests.micropython.budgets import Budget
from tests.micropython.gauge import run_gauges
from tests.micropython.tree import board_tree, compiled

CLASS, NESTED = 1200, 400  # bytes

_ROOMS = ("compat.py", "cdr.py", "cdr_texts.py", "cdr_lists.py", "cdr_rows.py")
_SETUP = """
import sys, micropython
import muros.cdr_rows
import {module}
micropython.qstr_info()
"""
_FIRST = "from {module} import {name}\nmicropython.qstr_info()\n"
_FORGET = "del {name}, {module}._{name}, sys.modules['{module}._{name}']"
_TIMEOUT = 60.0  # seconds for some hundred interpreters


def limit(name: str) -> int:
    """The budget of a type, in bytes."""
    registry = Registry()
    found = registry.definition(name)
    if isinstance(found, Message):
        parts = [found]
    elif isinstance(found, Service):
        parts = [found.request, found.response]
    else:
        parts = [found.goal, found.result, found.feedback]
    return sum(CLASS + NESTED * len(registry.closure(part)) for part in parts)


@cache
def costs() -> dict[str, int]:
    """Bytes on a 32-bit heap of each standard type that boards can have."""
    names = [name for name in Registry().names() if name != "example_interfaces/msg/WString"]
    jobs = []
    for name in names:
        package, kind, short = name.split("/")
        steps = (_SETUP, _FIRST, _FORGET, "from {module} import {name}")
        jobs.append([step.format(module=f"{package}.{kind}", name=short) for step in steps])
    tree = compiled(board_tree(_ROOMS) | {path: text.encode() for path, text in board.sources(names).items()})
    return {
        name: last.live - forgotten.live + _names(first.output) - _names(before.output)
        for name, (before, first, forgotten, last) in zip(
            names, run_gauges(tree, jobs, _TIMEOUT), strict=True
        )
    }


def shares() -> list[tuple[float, str]]:
    """How much of its budget each type takes, in percent; the dearest first."""
    return sorted(((100 * cost / limit(name), name) for name, cost in costs().items()), reverse=True)


def _names(report: str) -> int:
    """The bytes of all names, from the interpreter's report."""
    found = re.search(r"n_str_data_bytes=(\d+)", report)
    assert found, report
    return int(found[1])


MESSAGE_BUDGETS: tuple[Budget, ...] = (
    Budget(
        "message class that takes most of its 1.2 kB and 0.4 a nested type",
        100,
        "%",
        ("mpy-cross", "gauge"),
        lambda: shares()[0][0],
    ),
)
