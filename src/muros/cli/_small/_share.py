"""Names that stand for more than one thing: in a compiled file a name takes two bytes more than its length, once.

Variables of a module and attributes of objects are looked up apart. So a function of a module may be named as some
attribute that the module mentions anyway, and so may arguments. Variables of functions have no names in a compiled
file; where a board compiles, few names serve for those of all functions.
"""

from __future__ import annotations

import ast
from collections import Counter, defaultdict
from collections.abc import Collection, Iterator, Sequence

from muros.cli._small._names import COMMON
from muros.cli._small._trees import Modules, defined, functions, identifiers, names_of, stored

_ARGUMENTS = 12  # names that arguments share


def share(
    modules: Modules, messages: Modules, kept: Collection[str], asked: Collection[str], compiled: bool
) -> dict[str, str]:
    """Gives arguments and variables of functions shared names, and tells which names things of modules may share.

    That is, for each of these the name of an attribute; whoever renames the attribute gives both the new name. ``kept``
    names stay, and nothing gets one of those by which attributes are ``asked`` for. ``compiled``: the result will be,
    so that names of variables may be long.
    """
    used = {*kept, *identifiers(*modules.values(), *messages.values())}
    spare = [name for name in COMMON if name not in used]  # short ones first
    variables = spare[: _ARGUMENTS - 1 : -1] if compiled else spare[_ARGUMENTS:]
    arguments = _share_variables(modules, kept, spare[:_ARGUMENTS], variables)
    found = _Mentions(modules | messages)
    free = {
        name: places
        for name, places in found.attributes.items()
        if name not in found.variables and name not in asked and not name.startswith("__")
    }
    for place in modules:
        for part in place.split("."):
            free.pop(part, None)  # a package has its modules as attributes
    wide = sorted(free, key=lambda name: (-len(free[name]), name))
    shared = dict(zip(arguments, wide, strict=False))
    for tree in modules.values():
        _Variables(shared).visit(tree)
    for name in shared.values():
        del free[name]
    return dict(_pairs(modules, found, kept, free))


class _Mentions:
    """Where names stand for attributes, and where for variables or for what calls name."""

    def __init__(self, trees: Modules) -> None:
        self.attributes: dict[str, set[str]] = defaultdict(set)
        self.variables: dict[str, set[str]] = defaultdict(set)
        self.of_classes: set[str] = set()
        self.in_classes: set[str] = set()
        """Variables that the bodies of classes read: they look first for what the class has."""
        for place, tree in trees.items():
            own: set[int] = set()
            for node in ast.walk(tree):
                if isinstance(node, ast.ClassDef):
                    own.update(self._of_class(node))
            for node in ast.walk(tree):
                kind = (
                    self.attributes if isinstance(node, ast.Attribute) or id(node) in own else self.variables
                )
                for name in names_of(node):
                    kind[name].add(place)

    def _of_class(self, node: ast.ClassDef) -> Iterator[int]:
        """Notes what a class has and what its body reads; the nodes that give something its name."""
        for one in node.body:
            read: list[ast.AST] = [one]
            if isinstance(one, ast.FunctionDef):
                self.of_classes.add(one.name)
                yield id(one)
                arguments = one.args
                read = [*one.decorator_list, *arguments.defaults, *filter(None, arguments.kw_defaults)]
            elif isinstance(one, ast.Assign):
                read = [one.value]
                for target in one.targets:
                    if isinstance(target, ast.Name):
                        self.of_classes.add(target.id)
                        yield id(target)
            self.in_classes.update(
                name for each in read for part in ast.walk(each) for name in names_of(part)
            )


def _pairs(
    modules: Modules, found: _Mentions, kept: Collection[str], free: dict[str, set[str]]
) -> Iterator[tuple[str, str]]:
    """For things at the top of modules that are nothing else the names of attributes; widely known things first.

    Names that are said often are given first: those that a module defines have the lowest numbers in its compiled file,
    and a number below 128 takes one byte.
    """
    often = Counter(name for tree in modules.values() for node in ast.walk(tree) for name in names_of(node))
    single = {
        name
        for tree in modules.values()
        for name in _top(tree)
        if name not in found.attributes and name not in kept and not name.startswith("__")
    }
    taken: dict[str, set[str]] = defaultdict(set)
    for name in sorted(single, key=lambda name: (-len(found.variables[name]), name)):
        places = found.variables[name]

        def cost(other: str, places: set[str] = places) -> tuple[int, int, str]:
            return len(places - free[other]), -often[other], other

        hidden = found.of_classes if name in found.in_classes else ()
        fitting = [
            other
            for other in free
            if not places & taken[other] and places & free[other] and other not in hidden
        ]
        if fitting:
            other = min(fitting, key=cost)
            taken[other] |= places
            yield name, other


def _top(tree: ast.Module) -> Iterator[str]:
    yield from defined(tree)
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            yield from stored(node)


def _share_variables(
    modules: Modules, kept: Collection[str], arguments: Sequence[str], variables: Sequence[str]
) -> list[str]:
    """The same few names for arguments, and for other variables, of all functions; those that arguments have now."""
    named = {name for tree in modules.values() for name in _keywords(tree)}.union(kept)
    for tree in modules.values():
        top = set(_top(tree))
        for _, function in functions(tree):
            given = dict.fromkeys(node.arg for node in ast.walk(function) if isinstance(node, ast.arg))
            own = [name for name in given if name not in top | named]
            others = [
                name for name in dict.fromkeys(stored(function)) if name not in top and name not in given
            ]
            new = zip(own, arguments, strict=False), zip(others, variables, strict=False)
            _Variables({old: one for pairs in new for old, one in pairs}).visit(function)
    said = identifiers(*modules.values())
    return [name for name in arguments if name in said]


class _Variables(ast.NodeTransformer):
    """Other names for variables and arguments; attributes stay."""

    def __init__(self, names: dict[str, str]) -> None:
        self._names = names

    def visit(self, node: ast.AST) -> ast.AST:
        new = self._names
        match node:
            case ast.Name(id=name):
                node.id = new.get(name, name)
            case ast.arg(arg=name):
                node.arg = new.get(name, name)
            case ast.ExceptHandler(name=str(name)):
                node.name = new.get(name, name)
            case ast.alias():
                shown = node.asname or node.name
                if new.get(shown, shown) != shown:
                    node.asname = new[shown]
        return self.generic_visit(node)


def _keywords(tree: ast.Module) -> Iterator[str]:
    """The names by which calls give arguments."""
    for node in ast.walk(tree):
        if isinstance(node, ast.keyword) and node.arg:
            yield node.arg
