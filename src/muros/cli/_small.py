"""The board floor made small for one program: the same modules, with shorter names and fewer files.

A board keeps every name of its code in memory, about 20 bytes each, and no collector frees them; a module takes some
300 bytes beside its code. ``small`` rewrites the syntax trees of the floor for a program that it can read:

- A name of the floor's own that the program does not say becomes one that every firmware has anyway, ``pow`` or
  ``KeyError``. Such a name costs nothing. One map holds for all modules and for all kinds of names, and two names never
  become one, so whatever referred to the same thing still does, and nothing needs to be known about scopes and types.
- Modules that the program keeps in memory all the time are joined into the package ``muros`` itself.
- Constants are put where they are used; docstrings, annotations and functions that nothing mentions go.

Kept are: words of the program; names in strings of the floor, as for ``getattr``; names of messages; what firmware
offers. So a program that says what it uses runs unchanged. What it does not say it cannot find.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Collection, Iterable, Iterator

from muros.cli._floor import Tree, is_native
from muros.cli._small_join import BORROWED, HOME, OF_MESSAGES, Modules, join, moved
from muros.cli._small_names import COMMON, OFFERED, STATIC
from muros.cli._small_strip import strip

_WORD = re.compile(r"[^\W\d]\w*")
_BETWEEN = re.compile(r"[\s*.]+")  # what stands between names in a string of names
_PACKAGE = "/__init__.py"
_SHARED = 12  # names that arguments share


def small(tree: Tree, programs: Iterable[str]) -> tuple[Tree, dict[str, str]]:
    """The tree for these programs, given as texts, and the name that each renamed name had.

    ``tree`` holds sources: the board floor, and message classes, whose own names stay. Native modules stay as they are.
    Raises SyntaxError for a source that is not Python.
    """
    text = "\n".join(programs)
    words = set(_WORD.findall(text))
    floor: Modules = {}
    messages: Modules = {}
    rest: Tree = {}
    packages = set()
    for path, content in tree.items():
        if not path.endswith(".py") or is_native(content):
            rest[path] = content
            continue
        name = path.removesuffix(_PACKAGE).removesuffix(".py").replace("/", ".")
        packages.update([name] if path.endswith(_PACKAGE) else [])
        (floor if name.split(".")[0] == HOME else messages)[name] = ast.parse(content)
    native = {path.removesuffix(".py").replace("/", "."): path for path in rest if path.endswith(".py")}
    floor = {name: strip(node, {*native, *floor}) for name, node in floor.items()}
    _drop(floor, messages, words)
    modules = join(floor, messages, native, text, words)
    kept = words | OFFERED | _strings([*floor.values(), *messages.values()]) | _own(messages)
    for name, path in native.items():
        kept |= _identifiers(ast.parse(rest[path]))
        rest[moved(name).replace(".", "/") + ".py"] = rest.pop(path)
    used = _identifiers(*modules.values(), *messages.values()) | kept
    _share_arguments(modules.values(), kept, [name for name in STATIC if name not in used][:_SHARED])
    used |= _identifiers(*modules.values())
    names = _shortened(modules, kept, used)
    out = dict(rest)
    for name, node in (modules | messages).items():
        ast.fix_missing_locations(_Renamer(names, {*modules, *native}).visit(node))
        path = name.replace(".", "/") + (_PACKAGE if name in packages else ".py")
        out[path] = ast.unparse(node).encode()
    return out, {new: old for old, new in sorted(names.items())}


def _drop(modules: Modules, messages: Modules, words: Collection[str]) -> None:
    """Takes out what reads and writes messages and what is defined, where nothing that is left mentions it."""
    for name in reversed(OF_MESSAGES):
        others = [tree for other, tree in (modules | messages).items() if other != name]
        imported = {
            node.module for tree in others for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
        }
        if name in modules and name not in imported:
            del modules[name]
    mentioned = Counter(words) + Counter(_strings([*modules.values(), *messages.values()]))
    for tree in (*modules.values(), *messages.values()):
        mentioned.update(name for node in ast.walk(tree) for name in _names_of(node))
    for tree in modules.values():
        tree.body = [node for node in tree.body if mentioned[_defines(node)] != 1]
        for node in tree.body:
            if isinstance(node, ast.ImportFrom):
                node.names = [one for one in node.names if one.asname or mentioned[one.name] != 1]
        tree.body = [node for node in tree.body if not isinstance(node, ast.ImportFrom) or node.names]


def _defines(node: ast.stmt) -> str:
    """The one name that a statement defines and that is all it does; nothing if it does more."""
    match node:
        case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
            return "" if name.startswith("__") else name
        case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant() | ast.Compare()):
            return "" if name.startswith("__") else name
    return ""


def _share_arguments(trees: Collection[ast.Module], kept: Collection[str], shared: list[str]) -> None:
    """Gives arguments that only their own function knows the same few names in all functions."""
    public = set(kept)
    for tree in trees:
        public |= _assigned(tree)
        for node in ast.walk(tree):
            if not isinstance(node, ast.arg | ast.Name):
                public.update(_names_of(node))
    for tree in trees:
        classes = [node for node in ast.walk(tree) if isinstance(node, ast.ClassDef)]
        bodies = [tree.body, *(node.body for node in classes)]
        for function in (node for body in bodies for node in body):
            if isinstance(function, ast.FunctionDef):
                given = [node.arg for node in ast.walk(function) if isinstance(node, ast.arg)]
                own = [name for name in dict.fromkeys(given) if name not in public]
                _Renamer(dict(zip(own, shared, strict=False)), ()).visit(function)


def _shortened(modules: Modules, kept: Collection[str], used: Collection[str]) -> dict[str, str]:
    """A free name of the firmware for each name that may have one: first for what is always in memory."""
    count = Counter(name for tree in modules.values() for name in _identifiers(tree))
    always = _identifiers(modules[HOME])
    often = _identifiers(*(modules[moved(name)] for name in BORROWED if moved(name) in modules))
    stored = set[str]().union(*map(_stored, modules.values()))
    wanted = sorted(
        (name for name in stored.difference(STATIC, COMMON, kept) if not name.startswith("__")),
        key=lambda name: (name not in always, name not in often, -count[name], name),
    )
    free = [name for name in (*STATIC, *COMMON) if name not in used]
    return dict(zip(wanted, free, strict=False))


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
    return {
        target.id
        for scope in ast.walk(tree)
        if isinstance(scope, ast.Module | ast.ClassDef)
        for node in scope.body
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Name)
    }


def _identifiers(*trees: ast.Module) -> set[str]:
    """Whatever is a name in these modules."""
    names: set[str] = set()
    for tree in trees:
        for node in ast.walk(tree):
            names.update(_names_of(node))
    return names


def _names_of(node: ast.AST) -> Iterator[str]:
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


def _own(messages: Modules) -> set[str]:
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
            if not (isinstance(node, ast.alias | ast.Name) and set(_names_of(node)) <= lent):
                names.update(_names_of(node))
    return names


def _strings(trees: Iterable[ast.Module]) -> set[str]:
    """Names in strings that are nothing but names."""
    names: set[str] = set()
    for tree in trees:
        for node in ast.walk(tree):
            if isinstance(node, ast.Constant) and isinstance(node.value, str):
                words = [word for word in _BETWEEN.split(node.value) if word]
                if all(word.isidentifier() for word in words):
                    names.update(words)
    return names


class _Renamer(ast.NodeTransformer):
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
