"""What tools of the RTC world need of Python that Python has no longer.

rtshell's rtinject, rtprint and rtlog ask `inspect.getargspec`, which went with Python 3.11, and the module `imp`, which
went with 3.12. Where rtshell is what imports this package, both are given back; other programs see Python as it is.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import inspect
import sys
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any, NamedTuple

__all__ = ["help_old_tools"]


class _ArgSpec(NamedTuple):
    args: list[str]
    varargs: str | None
    keywords: str | None
    defaults: tuple[Any, ...] | None


def help_old_tools(*, program: str = "rtshell") -> None:
    """Give Python back what `program` needs, if it has been imported."""
    if program not in sys.modules:
        return
    if not hasattr(inspect, "getargspec"):
        inspect.getargspec = _getargspec  # type: ignore[attr-defined]
    if sys.version_info >= (3, 12) and "imp" not in sys.modules:
        sys.modules["imp"] = _imp()


def _getargspec(function: Callable[..., Any]) -> _ArgSpec:
    return _ArgSpec(*inspect.getfullargspec(function)[:4])


def _imp() -> ModuleType:
    """The two functions of the module `imp` that are used."""
    module = ModuleType("imp")

    def find_module(name: str, path: Sequence[str] | None = None) -> tuple[None, str, ModuleType | Any]:
        spec = importlib.machinery.PathFinder.find_spec(name, path)
        if spec is None:
            spec = importlib.util.find_spec(name) if path is None else None
        if spec is None:
            raise ImportError(f"No module named {name!r}", name=name)
        return None, spec.origin or "", spec

    def load_module(name: str, file: object, pathname: str, spec: Any) -> ModuleType:
        loaded = sys.modules.get(spec.name)
        if loaded is None:
            loaded = importlib.util.module_from_spec(spec)
            sys.modules[spec.name] = loaded
            spec.loader.exec_module(loaded)
        return loaded

    module.find_module = find_module  # type: ignore[attr-defined]
    module.load_module = load_module  # type: ignore[attr-defined]
    return module
