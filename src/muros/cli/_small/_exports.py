"""The public names of ``muros.client`` and ``muros.rclc``, found for the program alone and not in ``muros.exports``."""

from __future__ import annotations

import ast
from collections.abc import Callable, Collection, Iterable, Iterator

from muros.cli._small._trees import Modules

PACKAGES = ("muros.client", "muros.rclc")


def find_exports(modules: Modules, asked: Callable[[str], Collection[str]]) -> None:
    """Has the packages look for the public names that a program asks them for, and for no others."""
    for package in PACKAGES:
        if package not in modules:
            continue
        wanted = asked(package)
        lines = ["from muros.compat import borrow", "def __getattr__(name):"]
        for place, names, is_kept in _listed(modules, package):
            for name in sorted(set(names).intersection(wanted)) if place in modules else ():
                made = f"__import__({place!r}, None, None, (name,))" if is_kept else f"borrow({place!r})"
                lines.append(f" if name == {name!r}: return {made}.{name}")
        modules[package] = ast.parse("\n".join([*lines, " raise AttributeError(name)"]))


def import_exports(package: ast.Module, names: Collection[str], source: str) -> None:
    """Has a package import some names from ``source``, and look for the others only."""
    found = []
    body: list[ast.stmt] = []
    for node in package.body:
        if isinstance(node, ast.FunctionDef):
            found = [name for one in node.body if (name := _looks_for(one)) in names]
            node.body = [one for one in node.body if _looks_for(one) not in found]
            if len(node.body) == 1:
                continue
        body.append(node)
    if not any(isinstance(node, ast.FunctionDef) for node in body):
        body = []
    if found:
        body.insert(0, ast.ImportFrom(source, [ast.alias(name) for name in found], 0))
    package.body = body


def imported(packages: Iterable[ast.Module]) -> Iterator[str]:
    """The modules that packages import for what a board keeps of them."""
    for tree in packages:
        for node in ast.walk(tree):
            match node:
                case ast.Call(func=ast.Name(id="__import__"), args=[ast.Constant(value=str(place)), *_]):
                    yield place


def _looks_for(node: ast.stmt) -> str:
    match node:
        case ast.If(test=ast.Compare(comparators=[ast.Constant(value=str(name))])):
            return name
    return ""


def _listed(modules: Modules, package: str) -> Iterator[tuple[str, list[str], bool]]:
    """The modules of a package, the public names that each has, and whether a board keeps it."""
    for node in modules["muros.exports"].body if "muros.exports" in modules else []:
        match node:
            case ast.Assign(targets=[ast.Name(id="PLACES")], value=value):
                for other, lines in ast.literal_eval(value).items():
                    for line in lines.splitlines():
                        place, *names = line.split() or [""]
                        if f"muros.{other}" != package:  # all find the QoS
                            names = [name for name in names if name == "Qos"]
                        yield f"muros.{other}.{place.lstrip('*')}", names, place[:1] != "*"
