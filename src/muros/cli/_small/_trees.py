"""Syntax trees of modules, and what is asked of them in several places."""

from __future__ import annotations

import ast
import copy
import re
from collections.abc import Iterator

WORD = re.compile(r"[^\W\d]\w*")

Modules = dict[str, ast.Module]
"""Syntax trees by module, named with dots."""

Function = ast.FunctionDef | ast.Lambda

_PURE = frozenset(
    "bytearray bytes array min max len int list dict set bool ticks_add ticks_diff hasattr".split()
)


def assigned(scope: ast.Module | ast.ClassDef) -> set[str]:
    """The names that a module or a class assigns."""
    return {
        target.id
        for node in scope.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }


def defined(tree: ast.Module) -> set[str]:
    """What a module defines at its top, without what it imports."""
    made = {node.name for node in tree.body if isinstance(node, ast.FunctionDef | ast.ClassDef)}
    return made | assigned(tree)


def functions(tree: ast.Module) -> Iterator[tuple[ast.ClassDef | None, ast.FunctionDef]]:
    """The functions of a module and, with their class, the methods."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef):
            yield None, node
        elif isinstance(node, ast.ClassDef):
            yield from ((node, one) for one in node.body if isinstance(one, ast.FunctionDef))


def stored(node: ast.AST) -> Iterator[str]:
    """The variables that code gives values."""
    for one in ast.walk(node):
        match one:
            case ast.Name(id=name, ctx=ast.Store() | ast.Del()):
                yield name
            case ast.ExceptHandler(name=str(name)):
                yield name
            case ast.alias(name=name, asname=other):
                yield other or name.split(".")[0]


def variables(function: Function) -> set[str]:
    """The names that are a function's own, those of functions in it too."""
    arguments = {one.arg for one in ast.walk(function) if isinstance(one, ast.arg)}
    shared = {name for one in ast.walk(function) if isinstance(one, ast.Global) for name in one.names}
    return (arguments | set(stored(function))) - shared


def names_of(node: ast.AST) -> Iterator[str]:
    """Whatever is a name in one node."""
    match node:
        case ast.Name(id=name) | ast.Attribute(attr=name) | ast.arg(arg=name):
            yield name
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            yield name
        case ast.keyword(arg=str(name)) | ast.ExceptHandler(name=str(name)):
            yield name
        case ast.alias(name=name, asname=other):
            yield from name.split(".")
            if other:
                yield other


def identifiers(*trees: ast.Module) -> set[str]:
    """Whatever is a name in these modules."""
    return {name for tree in trees for node in ast.walk(tree) for name in names_of(node)}


def is_plain(node: ast.expr) -> bool:
    """Whether it is a name, or attributes of one."""
    while isinstance(node, ast.Attribute):
        node = node.value
    return isinstance(node, ast.Name)


def is_pure(node: ast.expr) -> bool:
    """Whether working it out does nothing else."""
    for one in ast.walk(node):
        if isinstance(one, ast.Call):
            if not (isinstance(one.func, ast.Name) and one.func.id in _PURE):
                return False
        elif isinstance(one, ast.Subscript | ast.Yield | ast.YieldFrom | ast.Await | ast.Starred):
            return False
    return True


def literal(value: object) -> ast.expr:
    """An expression with a constant's value."""
    return ast.parse(repr(value), mode="eval").body


def asks(function: ast.FunctionDef) -> bool:
    """Whether a function asks for attributes by names that are strings."""
    return any(
        isinstance(node, ast.Name)
        and node.id in ("getattr", "hasattr", "setattr", "delattr", "lend", "__import__")
        for node in ast.walk(function)
    )


def wholes(tree: ast.AST) -> set[str]:
    """The strings in code but those by which it takes one thing of a module: they may lend its functions.

    The others are ``borrow("module").name`` and ``__import__("module", ...).name``.
    """
    direct = set()
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(value=ast.Call(func=ast.Name(id="borrow" | "__import__"), args=[text, *_])):
                direct.add(id(text))
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in direct
    }


class Substitute(ast.NodeTransformer):
    """Puts expressions where variables are read, and other names where they are given values."""

    def __init__(self, names: dict[str, ast.expr]) -> None:
        self._names = names

    def visit_Name(self, node: ast.Name) -> ast.AST:
        value = self._names.get(node.id)
        if value is None:
            return node
        if isinstance(node.ctx, ast.Load):
            return copy.deepcopy(value)
        assert isinstance(value, ast.Name)
        return ast.Name(value.id, node.ctx)

    def visit_ExceptHandler(self, node: ast.ExceptHandler) -> ast.AST:
        value = self._names.get(node.name or "")
        if isinstance(value, ast.Name):
            node.name = value.id
        return self.generic_visit(node)

    def visit_alias(self, node: ast.alias) -> ast.AST:
        shown = node.asname or node.name.split(".")[0]
        value = self._names.get(shown)
        if isinstance(value, ast.Name) and value.id != shown:
            node.asname = value.id
        return node


class Transformer(ast.NodeTransformer):
    """One that leaves nothing without a body."""

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if getattr(node, "body", None) == [] and not isinstance(node, ast.Module):
            node.body = [ast.Pass()]  # type: ignore[attr-defined]
        return node
