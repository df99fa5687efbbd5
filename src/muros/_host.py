"""What MicroPython has and CPython lacks, for ``compat``; and what hosts have more, for ``exports``."""

import time
from importlib import import_module

TYPE_CHECKING = False
if TYPE_CHECKING:  # typing would be the slowest part of `import muros`
    from types import ModuleType
    from typing import Any

__all__ = [
    "HOSTS",
    "borrow",
    "const",
    "copy",
    "lend",
    "lending",
    "loans",
    "names",
    "release",
    "sleep_ms",
    "ticks_add",
    "ticks_diff",
    "ticks_ms",
    "ticks_us",
]

loans: list[str] = []
"""Hosts forget no module."""


def const(value: int) -> int:
    """Marks a module constant; MicroPython folds ``_NAME = const(n)`` away at compile time."""
    return value


def borrow(name: str) -> "ModuleType":
    """A module; boards drop it when nobody refers to it any more, hosts keep it."""
    return import_module(name)


def release() -> None:
    """Boards forget what was borrowed."""


def lend(owner: object, module: str, name: str) -> "Any":
    """``owner``'s method ``name``: a function of a module, which takes ``owner`` first."""
    method = None if name.startswith("_") else getattr(import_module(module), name, None)
    if method is None:
        raise AttributeError(f"{type(owner).__name__!r} object has no attribute {name!r}")
    return lambda *given, **named: method(owner, *given, **named)


def lending(owner: "Any", name: str) -> "Any":
    """``__getattr__`` of a class that has the functions of the module ``lends`` as methods."""
    return lend(owner, owner.lends, name)


def ticks_ms() -> int:
    """Monotonic milliseconds; boards wrap them, hosts do not."""
    return time.monotonic_ns() // 1_000_000


def ticks_us() -> int:
    """Monotonic microseconds; boards wrap them, hosts do not."""
    return time.monotonic_ns() // 1_000


def sleep_ms(ms: int) -> None:
    """Sleeps so many milliseconds."""
    time.sleep(ms / 1000)


def ticks_add(ticks: int, delta: int) -> int:
    """The tick ``delta`` milliseconds after ``ticks``."""
    return ticks + delta


def ticks_diff(later: int, earlier: int) -> int:
    """Milliseconds from ``earlier`` to ``later``, negative when ``later`` lies before."""
    return later - earlier


def copy(target: bytearray, at: int, source: bytes | bytearray | memoryview, start: int, n: int) -> None:
    """Copies ``n`` bytes of ``source`` from ``start`` into ``target`` at ``at``."""
    target[at : at + n] = source[start : start + n]


def names(places: dict[str, str], package: str) -> list[str]:
    """All public names of a package, by what ``exports`` says."""
    found = {"Qos"}
    for line in places[package].split("\n"):
        found.update(line.split()[1:])
    return sorted(found - {"Uart"})


HOSTS = {
    "client": """
hosts Session
""",
    "rclc": """
host.actions ActionClient ActionServer
host.entities Client Publisher Service
host.events Event
host.executor Executor
host.handles GuardCondition Subscription Timer
host.context Context Node
host.groups BEST_EFFORT CallbackGroup REAL_TIME_CRITICAL RealTimeClass SOFT_REAL_TIME ThreadError Threads
host.sense_plan_act FAWKES_STAGES SensePlanAct
host.workers Workers
host.clock Clock
host.graph Endpoint Graph
host.parameters Parameters
host.parameter_files ParameterClient
host.remapping ArgumentsError RosArguments remove_ros_arguments
""",
}
"""Where public names are that only hosts have, or hosts have of their own; see ``exports``."""
