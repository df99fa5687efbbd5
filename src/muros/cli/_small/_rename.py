"""Names of the floor that become names which firmware has: those cost a board nothing."""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Collection, Iterable

from muros.cli._small._bundles import BORROWED, HOME
from muros.cli._small._names import COMMON, STATIC
from muros.cli._small._trees import Modules, asks, assigned, identifiers, names_of

_BETWEEN = re.compile(r"[\s*.]+")  # what stands between names in a string of names


def shortened(modules: Modules, kept: Collection[str], used: Collection[str]) -> dict[str, str]:
    """A free name of the firmware for each name but ``kept`` ones: first for what is always in memory.

    What many modules mention gets the names that take the least room in a compiled file.
    """
    count = Counter(name for tree in modules.values() for name in identifiers(tree))
    always = identifiers(modules[HOME])
    often = identifiers(*(modules[name] for name in BORROWED if name in modules))
    stored = set[str]().union(*map(_stored, modules.values()))
    wanted = sorted(
        (name for name in stored.difference(STATIC, COMMON, kept) if not name.startswith("__")),
        key=lambda name: (name not in always, name not in often, -count[name], name),
    )
    free = [name for name in (*STATIC, *COMMON) if name not in used]
    chosen = sorted(wanted[: len(free)], key=lambda name: (-count[name], name))
    return dict(zip(chosen, free, strict=False))


def _stored(tree: ast.Module) -> set[str]:
    """The names that a board keeps of a module: all but those of variables within functions."""
    names = _assigned(tree)
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name, ctx=ast.Store()) | ast.arg(arg=name):
                names.add(name)
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                names.add(name)
    return names


def _assigned(tree: ast.Module) -> set[str]:
    """The names that a module and its classes assign."""
    scopes = (node for node in ast.walk(tree) if isinstance(node, ast.Module | ast.ClassDef))
    return set[str]().union(*map(assigned, scopes))


def import_near(tree: ast.Module, package: str) -> None:
    """Imports things of muros by dots and not by its name, in a module of ``package``: they take less of a file."""
    own, *below = package.split(".")
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and own == HOME and not node.level:
            home, *path = str(node.module).split(".")
            if home == HOME:
                node.module, node.level = ".".join(path) or None, 1 + len(below)


def own(messages: Modules) -> set[str]:
    """The names of message classes; what they import from the floor is the floor's."""
    names: set[str] = set()
    for tree in messages.values():
        lent = {
            one.name
            for node in tree.body
            if isinstance(node, ast.ImportFrom) and str(node.module).split(".")[0] == HOME
            for one in node.names
        }
        for node in ast.walk(tree):
            if not (isinstance(node, ast.alias | ast.Name) and set(names_of(node)) <= lent):
                names.update(names_of(node))
    return names


def strings(trees: Iterable[ast.Module], places: Collection[str]) -> set[str]:
    """Names in strings by which attributes may be asked for: those in functions that ask so, but paths of modules."""
    names: set[str] = set()
    for tree in trees:
        for function in ast.walk(tree):
            if isinstance(function, ast.FunctionDef) and asks(function):
                for node in ast.walk(function):
                    if isinstance(node, ast.Constant) and isinstance(node.value, str):
                        words = [word for word in _BETWEEN.split(node.value) if word]
                        if node.value not in places and all(map(str.isidentifier, words)):
                            names.update(words)
    return names


class Renamer(ast.NodeTransformer):
    def __init__(self, names: dict[str, str], modules: Collection[str]) -> None:
        self._names = names
        self._modules = modules

    def visit(self, node: ast.AST) -> ast.AST:
        new = self._names
        match node:
            case ast.Name():
                node.id = new.get(node.id, node.id)
            case ast.Attribute():
                node.attr = new.get(node.attr, node.attr)
            case ast.arg():
                node.arg = new.get(node.arg, node.arg)
            case ast.keyword(arg=str(name)):
                node.arg = new.get(name, name)
            case ast.FunctionDef() | ast.ClassDef():
                node.name = new.get(node.name, node.name)
            case ast.ExceptHandler(name=str(name)):
                node.name = new.get(name, name)
            case ast.Global() | ast.Nonlocal():
                node.names = [new.get(name, name) for name in node.names]
            case ast.ImportFrom() | ast.Import():
                self._imported(node)
        return self.generic_visit(node)

    def _imported(self, node: ast.ImportFrom | ast.Import) -> None:
        """What is imported from the floor is renamed there; what is not gets its name here."""
        place = node.module if isinstance(node, ast.ImportFrom) else None
        for one in node.names:
            shown = one.asname or one.name
            if place in self._modules and f"{place}.{one.name}" not in self._modules:
                one.name = self._names.get(one.name, one.name)
            shown = self._names.get(shown, shown)
            one.asname = shown if shown != one.name else None
