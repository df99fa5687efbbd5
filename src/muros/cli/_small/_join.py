"""Modules joined into few: a module takes 300 bytes of a heap beside its code, and names are kept once for each.

What a program keeps in memory all the time goes into the package ``muros`` itself; what is borrowed together into one
module. Things of the same name in modules that are joined get different ones, where everybody that refers to them can
be seen: in a module whose functions are taken by their names alone (``lend``) they cannot, so it joins only if nothing
in it clashes. Within a joined module things refer to each other directly.
"""

from __future__ import annotations

import ast
import re
from collections import Counter
from collections.abc import Collection, Iterator

from muros.cli._small._bundles import BORROWED, HOME, MOVED, OF_MESSAGES, PLAIN, RESIDENT, TO
from muros.cli._small._exports import PACKAGES, import_exports, imported
from muros.cli._small._program import Programs
from muros.cli._small._trees import Modules, defined, stored, variables, wholes


def join(
    modules: Modules, messages: Modules, native: Collection[str], programs: Programs, most: int | None = None
) -> Modules:
    """The modules, fewer; ``messages`` find them where they are then, and so do modules find ``native`` ones.

    Modules that a program names by their path stay where they are, or hand on what they had. ``most`` bounds the text
    of a joined module, in characters.
    """
    places: dict[str, str] = {}
    named, words = programs.named, programs.words
    residents = [*_residents(modules, messages, "\n".join(programs.texts), PLAIN if native else "", most)]
    _gather(modules, messages, HOME, residents, words, places)
    kept = {*named, *imported(modules[package] for package in PACKAGES if package in modules)}
    for target, members in BORROWED.items():
        free = [name for name in members if name in modules and name not in places and name not in kept]
        _gather(modules, messages, target, _fitting(modules, free, most), words, places)
    for name in (*modules, *native):
        if name.startswith(MOVED) and name not in places and (name not in named or name in native):
            places[name] = moved(name)
    had = {name: defined(modules[name]) | _imported(modules[name]) for name in residents if name in named}
    out: Modules = {}
    order = {name: i for i, name in enumerate(places)}
    trees = modules | messages
    for name in sorted(trees, key=lambda name: (order.get(name, -1), name)):
        tree = trees[name]
        place = places.get(name, name)
        _Refer(modules, places, place).rewrite(tree)
        if name not in messages:
            out.setdefault(place, ast.Module([], [])).body += tree.body
    for place, tree in out.items():
        if place != HOME:
            _lift_imports(tree)
        tree.body = _imports_first(tree.body)
    for package in PACKAGES:
        if package in out:
            import_exports(out[package], defined(out[HOME]), HOME)
    if not any(name.startswith(MOVED) for name in out):
        out.pop(MOVED[:-1], None)
    for name, names in had.items():
        handed = sorted(names & set(words))
        out[name] = ast.Module(
            [ast.ImportFrom(HOME, [ast.alias(one) for one in handed], 0)] if handed else [], []
        )
    return out


def moved(name: str) -> str:
    """Where a module is, unless it stayed or was joined."""
    return TO + name.removeprefix(MOVED) if name.startswith(MOVED) else name


def _residents(
    modules: Modules, messages: Modules, program: str, without: str, most: int | None
) -> Iterator[str]:
    """What stays in memory: all that one of these imports at its top does so, too."""
    asked = set[str]().union(*map(_needed, messages.values()))
    asked.update(*(_needed(modules[name]) for name in OF_MESSAGES if name in asked and name in modules))
    candidates = [name for name, sign in RESIDENT if re.search(sign, program)]
    candidates[1:1] = [name for name in OF_MESSAGES if name in asked]
    known: set[str] = set()
    for name in candidates:
        if name not in modules or name == without or not _needed(modules[name]) <= known:
            continue
        if len(_fitting(modules, [HOME, *known, name], most)) == len(known) + 2:
            known.add(name)
            yield name


def _fitting(modules: Modules, names: Collection[str], most: int | None) -> list[str]:
    """The first of these modules, as long as their text is not more than ``most``."""
    found: list[str] = []
    size = 0
    for name in names:
        size += len(ast.unparse(modules[name])) if most is not None else 0
        if most is None or size <= most:
            found.append(name)
    return found


def _needed(tree: ast.Module) -> set[str]:
    """The modules of muros that a module imports at its top."""
    places = (str(node.module) for node in tree.body if isinstance(node, ast.ImportFrom))
    return {place for place in places if place.startswith("muros")}


def _imported(tree: ast.Module) -> set[str]:
    return {
        one.asname or one.name for node in tree.body if isinstance(node, ast.ImportFrom) for one in node.names
    }


def _gather(
    modules: Modules,
    messages: Modules,
    target: str,
    members: Collection[str],
    words: Collection[str],
    places: dict[str, str],
) -> None:
    """Notes in ``places`` which members go into ``target``, after their names are made different."""
    taken: dict[str, str] = dict.fromkeys(defined(modules[target]), target) if target in modules else {}
    for member in members:
        tree = modules[member]
        if _is_value(member, modules.values()):
            continue
        closed = not _is_open(member, [*modules.values(), *messages.values()])
        clashes = sorted(
            name for name, source in _held(tree, member).items() if taken.get(name, source) != source
        )
        own = defined(tree)
        if any(
            name in own and not name.startswith("_") and (name in words or not closed) for name in clashes
        ):
            continue
        for name in clashes:
            new = f"{name}_{len(places)}"
            if name in own:
                _rename(modules | messages, member, name, new)
            else:
                _rename_import(tree, name, new)
        taken.update(_held(tree, member))
        places[member] = target


def _held(tree: ast.Module, name: str) -> dict[str, str]:
    """What each name at the top of a module stands for."""
    found = dict.fromkeys(defined(tree), name)
    for node in tree.body:
        if isinstance(node, ast.ImportFrom | ast.Import):
            source = f"{node.module}." if isinstance(node, ast.ImportFrom) else ""
            found.update((one.asname or one.name, source + one.name) for one in node.names)
    for shown, source in list(found.items()):
        above, _, last = source.rpartition(".")
        if last == shown:
            found[shown] = above or source  # the same thing, here and where it comes from
    return found


def _is_open(module: str, trees: Collection[ast.Module]) -> bool:
    """Whether something refers to a module as a whole, and so to its names unseen."""
    return any(module in wholes(tree) for tree in trees)


def _is_value(module: str, trees: Collection[ast.Module]) -> bool:
    """Whether something imports a module and hands it on, so that it has to be one."""
    for tree in trees:
        aliases = set(_aliases(tree, module))
        bases = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Attribute)}
        if any(
            isinstance(node, ast.Name) and node.id in aliases and id(node) not in bases
            for node in ast.walk(tree)
        ):
            return True
    return False


def _aliases(tree: ast.Module, module: str) -> Iterator[str]:
    """The names by which a module has another one."""
    above, _, last = module.rpartition(".")
    for node in ast.walk(tree):
        if isinstance(node, ast.ImportFrom) and node.module == above:
            yield from (one.asname or one.name for one in node.names if one.name == last)


def _rename(modules: Modules, module: str, old: str, new: str) -> None:
    """Gives something at the top of a module another name, there and wherever it is taken from there."""
    _Rename(old, new).visit(modules[module])
    for tree in modules.values():
        aliases = set(_aliases(tree, module))
        for node in ast.walk(tree):
            match node:
                case ast.ImportFrom(module=source, names=names) if source == module:
                    for one in names:
                        if one.name == old:
                            one.name, one.asname = new, one.asname or old
                case ast.Attribute(
                    value=ast.Call(func=ast.Name(id="borrow"), args=[ast.Constant(value=text)]), attr=name
                ) if text == module and name == old:
                    node.attr = new
                case ast.Attribute(value=ast.Name(id=alias), attr=name) if alias in aliases and name == old:
                    node.attr = new


def _rename_import(tree: ast.Module, old: str, new: str) -> None:
    for node in tree.body:
        if isinstance(node, ast.ImportFrom | ast.Import):
            for one in node.names:
                if (one.asname or one.name) == old:
                    one.asname = new
    _Rename(old, new).visit(tree)


class _Rename(ast.NodeTransformer):
    """Another name for something at the top of a module; variables of the same name stay."""

    def __init__(self, old: str, new: str) -> None:
        self._old = old
        self._new = new
        self._depth = 0

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        if self._depth == 0 and node.name == self._old:
            node.name = self._new
        if self._old in variables(node):
            return node
        return self._within(node)

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        return node if self._old in variables(node) else self.generic_visit(node)

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        if node.name == self._old:
            node.name = self._new
        return self._within(node)

    def _within(self, node: ast.AST) -> ast.AST:
        self._depth += 1
        self.generic_visit(node)
        self._depth -= 1
        return node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if node.id == self._old:
            node.id = self._new
        return node


class _Refer(ast.NodeTransformer):
    """Refers to things where they are now; to those in the same joined module directly."""

    def __init__(self, modules: Modules, places: dict[str, str], here: str) -> None:
        self._modules = modules
        self._places = places
        self._here = here
        self._new: dict[
            str, str
        ] = {}  # the name of what was imported by another one, and is in the same module now
        self._whole: dict[str, str] = {}  # modules by the name that they had
        self._variables: set[str] = set()

    def rewrite(self, tree: ast.Module) -> None:
        """Does so all through a module."""
        for node in ast.walk(tree):
            if isinstance(node, ast.ImportFrom):
                for one in node.names:
                    shown = one.asname or one.name
                    if self._is_here(str(node.module)) and shown != one.name:
                        self._new[shown] = one.name
                    whole = f"{node.module}.{one.name}"
                    if whole in self._modules and self._is_here(whole):
                        self._whole[shown] = whole
        self.visit(tree)

    def _is_here(self, module: str) -> bool:
        return module in self._places and self._places[module] == self._here

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST | list[ast.stmt]:
        place = str(node.module)
        out: list[ast.stmt] = []
        for one in node.names:
            whole = f"{place}.{one.name}"
            if whole in self._modules:
                if self._is_here(whole):
                    continue
                above, _, name = self._places.get(whole, whole).rpartition(".")
                shown = one.asname or one.name
                if above:
                    out.append(ast.ImportFrom(above, [ast.alias(name, shown if shown != name else None)], 0))
                else:
                    out.append(ast.Import([ast.alias(name, shown)]))
            elif place not in self._places:
                out.append(ast.ImportFrom(place, [one], 0))
            elif not self._is_here(place):
                out.append(ast.ImportFrom(self._places[place], [one], 0))
        return _together(out) or ast.Pass()

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        outer, self._variables = self._variables, self._variables | variables(node)
        self.generic_visit(node)
        self._variables = outer
        return node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        match node.value:
            case ast.Call(func=ast.Name(id="borrow"), args=[ast.Constant(value=str(text))]):
                if self._is_here(text) and node.attr not in self._variables:
                    return ast.Name(node.attr, ast.Load())
            case ast.Name(id=alias) if alias in self._whole:
                return ast.Name(node.attr, ast.Load())
        return self.generic_visit(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        node.id = self._new.get(node.id, node.id)
        return node

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str) and node.value in self._places:
            return ast.Constant(self._places[node.value])
        return node


def _lift_imports(tree: ast.Module) -> None:
    """What functions import from the package, which is there anyway, their module imports at its top, once."""
    taken = _held(tree, "")
    for function in ast.walk(tree):
        if not isinstance(function, ast.FunctionDef):
            continue
        for node in list(function.body):
            if isinstance(node, ast.ImportFrom) and node.module == HOME:
                shown = {one.asname or one.name: f"{HOME}.{one.name}" for one in node.names}
                others = Counter(name for each in function.body if each is not node for name in stored(each))
                if not any(
                    others[name] or taken.get(name, source) != source for name, source in shown.items()
                ):
                    function.body.remove(node)
                    tree.body.insert(0, node)
                    taken.update(_held(ast.Module([node], []), ""))


def _together(imports: list[ast.stmt]) -> list[ast.stmt]:
    out: list[ast.stmt] = []
    for one in imports:
        last = out[-1] if out else None
        if isinstance(one, ast.ImportFrom) and isinstance(last, ast.ImportFrom) and last.module == one.module:
            last.names += one.names
        else:
            out.append(one)
    return out


def _imports_first(body: list[ast.stmt]) -> list[ast.stmt]:
    """A module's statements, imports first and each name of theirs once."""
    imports: list[ast.stmt] = []
    others: list[ast.stmt] = []
    seen: set[str] = set()
    for node in body:
        if isinstance(node, ast.ImportFrom | ast.Import):
            source = str(node.module) if isinstance(node, ast.ImportFrom) else ""
            for one in node.names:
                made: ast.stmt = ast.ImportFrom(source, [one], 0) if source else ast.Import([one])
                if ast.unparse(made) not in seen:
                    seen.add(ast.unparse(made))
                    imports.append(made)
        elif not isinstance(node, ast.Pass):
            others.append(node)
    imports.sort(key=lambda one: str(one.module) if isinstance(one, ast.ImportFrom) else "")
    return [*_together(imports), *others]
