"""What a program can reach of the board floor.

All is judged by names, from what the program says on: a function is reached when code that is reached mentions its
name, a module when it is imported, borrowed, or named in a string. Code that depends on values which nothing that is
reached gives is not reached: the branch that cannot be, the option that no program says. At first nothing is taken for
reached and nothing for given; what is found takes that back until nothing changes, as in sparse conditional constant
propagation.

The program and the message classes are followed, too, and taken as they are.
"""

from __future__ import annotations

import ast
from collections.abc import Collection, Iterable
from typing import Final

from muros.cli._small._exports import PACKAGES
from muros.cli._small._trees import Function, Modules, asks, is_pure, wholes
from muros.cli._small._values import Environment, Knowledge, Known, Values, is_short

_OF_CONTAINERS: Final = {"add", "remove"}
"""Methods of lists and sets that objects have as well; the floor means those of lists and sets."""


class Reach(Knowledge):
    """What is reached in ``modules``; ``roots`` are names that are reached anyhow."""

    def __init__(self, modules: Modules, open_names: Collection[str], roots: Iterable[str]) -> None:
        super().__init__(modules, open_names)
        self._modules = modules
        self._roots = frozenset(roots)
        self.places: set[str] = set()
        self._names = set(self._roots)  # mentioned as attributes or in strings, in any module
        self._perhaps: set[str] = set()  # mentioned as methods of containers
        self._own: dict[str, set[str]] = {
            place: set() for place in ("", *modules)
        }  # mentioned within the module
        self._imported: set[tuple[str, str]] = set()
        self._sources: dict[tuple[str, str], set[str]] = {}  # where names of a module are imported from
        self._aliases: dict[tuple[str, str], str] = {}  # modules by the names that others have for them
        self._loaded: set[str] = set()
        self._handed: set[int] = set()  # functions that are given more than can be seen
        self._lent = set[str]().union(*map(_lent, modules.values()))
        self._function: ast.FunctionDef | None = None
        self._asks = False  # whether the function that is walked through asks for attributes by name
        self._class: ast.ClassDef | None = None
        self._surplus: dict[int, list[tuple[list[Values], dict[str, Values]]]] = {}

    def find(self, places: Iterable[str], readers: Collection[ast.Module]) -> None:
        """Follows everything from these modules on, and from the code that uses them."""
        self.places.update(place for place in places if place in self._modules)
        before = -1
        while before != self.size():
            before = self.size()
            self.place = ""
            for tree in readers:
                self._walk_all(tree.body, {})
            for place in sorted(self.places):
                self._module(place)
            if before == self.size():
                self.give_up()

    def size(self) -> int:
        """Grows with everything that is found."""
        words = sum(map(len, (self.places, self._names, self._perhaps, self._loaded, *self._own.values())))
        return (
            super().size()
            + len(self._handed)
            + words
            + len(self._imported)
            + sum(map(len, self._surplus.values()))
        )

    # What is left

    def is_live(self, node: ast.stmt, place: str = "") -> bool:
        """Whether a statement at the top of a module that is reached is needed; of a class without ``place``."""
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                return self._is_wanted(name, place)
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if is_pure(value):
                return self._is_wanted(name, place)
        return True

    def is_used(self, one: ast.alias, source: str, place: str) -> bool:
        """Whether what a module imports at its top from ``source`` is used there, or handed on."""
        shown = one.asname or one.name.split(".")[0]
        if shown in self._own[place] or (place, shown) in self._imported:
            return True
        return shown in self._names and (one.asname == one.name or source not in self._modules)

    def is_read(self, name: str) -> bool:
        """Whether an attribute is read anywhere."""
        return name in self._loaded or name in self._roots

    def _is_wanted(self, name: str, place: str) -> bool:
        if name in self._names or (name.startswith("__") and name != "__version__"):
            return True
        if name in self._perhaps and place not in self._lent:
            return True
        return bool(place) and (name in self._own[place] or (place, name) in self._imported)

    # Following code

    def _module(self, place: str) -> None:
        self.place = place
        for node in self._modules[place].body:
            if isinstance(node, ast.Import | ast.ImportFrom):
                self._imports(node, place)
            elif self.is_live(node, place):
                if isinstance(node, ast.Assign) and isinstance(node.targets[0], ast.Name):
                    self._walk(node.value, {})
                else:
                    self._walk(node, {})

    def _imports(self, node: ast.Import | ast.ImportFrom, top: str = "") -> None:
        """Follows an import, at the top of the module ``top`` as far as what it gives is used there or handed on."""
        place = node.module or "" if isinstance(node, ast.ImportFrom) else ""
        for one in node.names:
            whole = f"{place}.{one.name}" if place else one.name
            if top and whole in self._modules:
                self._aliases[top, one.asname or one.name] = whole
            if top and not self.is_used(one, place, top):
                continue
            parts = whole.split(".")
            for i in range(len(parts)):
                if ".".join(parts[: i + 1]) in self._modules:
                    self.places.add(".".join(parts[: i + 1]))
            self._imported.add((place, one.name))
            self._sources.setdefault((self.place, one.asname or one.name), set()).add(place)
            if not self.place:
                self._names.add(one.name)
            if one.asname and one.asname != one.name:
                self._refer(one.name)

    def _refer(self, name: str, place: str | None = None) -> None:
        """Something is taken as a value: whoever has it may call it with anything.

        In ``place`` a name stands for what is defined there, or imported. Packages only hand on what programs take.
        """
        if self.place in PACKAGES:
            return
        imported = place is None or any(one == name for _, one in self._imported)
        for known in self.functions.get(name, ()):
            if place is None or (not known.owner and (imported or known.place == place)):
                self.vary(known.node)
                if not self.place:
                    self._handed.add(id(known.node))
        for source, node in self.classes.get(name, ()):
            if imported or source == place:
                for known in self._makers(node):
                    self.vary(known.node)

    def _makers(self, node: ast.ClassDef) -> list[Known]:
        """What makes an object of a class: its own method, or one that it inherits."""
        for known in self.functions.get("__init__", ()):
            if known.node in node.body:
                return [known]
        return self._makers_above(node)

    def _makers_above(self, node: ast.ClassDef) -> list[Known]:
        return [
            known
            for base in node.bases
            if isinstance(base, ast.Name)
            for _, above in self.classes.get(base.id, ())
            for known in self._makers(above)
        ]

    def _called(self, func: ast.expr, env: Environment) -> list[tuple[Known, int]]:
        """What a call may be of, and how many parameters it does not show."""
        match func:
            case ast.Name(id=name) if name not in env or (self.place, name) in self._sources:
                made = [
                    (known, 1)
                    for place, node in self.classes.get(name, ())
                    if self._is_meant(name, place)
                    for known in self._makers(node)
                ]
                return made + [
                    (known, 0)
                    for known in self.functions.get(name, ())
                    if not known.owner and self._is_meant(name, known.place)
                ]
            case ast.Attribute(value=ast.Call(func=ast.Name(id="super")), attr="__init__") if self._class:
                return [(known, 1) for known in self._makers_above(self._class)]
            case ast.Attribute(value=owner, attr=name) if module := self._module_of(owner, env):
                made = [
                    (known, 0)
                    for known in self.functions.get(name, ())
                    if known.place == module and not known.owner
                ]
                return made + [
                    (known, 1)
                    for place, node in self.classes.get(name, ())
                    if place == module
                    for known in self._makers(node)
                ]
            case ast.Attribute(value=owner, attr=name):
                made = [(known, 1) for _, node in self.classes.get(name, ()) for known in self._makers(node)]
                for known in self.functions.get(name, ()):
                    hidden = bool(known.owner) or known.place in self._lent
                    made.append((known, int(hidden)))
                return made
        return []

    def _is_meant(self, name: str, place: str) -> bool:
        """Whether a name may stand for what a module defines: this one, or one that it imports from."""
        if place == self.place:
            return True
        sources = self._sources.get((self.place, name), set())
        return place in sources or any(f"{source}." in f"{place}." for source in sources)

    def _module_of(self, owner: ast.expr, env: Environment) -> str:
        """The module that an expression stands for; empty if it may be something else."""
        match owner:
            case ast.Call(func=ast.Name(id="borrow"), args=[ast.Constant(value=str(name))]):
                return name
            case ast.Name(id=name) if name not in env:
                return self._aliases.get((self.place, name), "")
        return ""

    def _call(self, node: ast.Call, env: Environment) -> None:
        """Notes what a call gives to whatever it may be of."""
        positional = [self.values(one, env) for one in node.args if not isinstance(one, ast.Starred)]
        named = {one.arg: self.values(one.value, env) for one in node.keywords if one.arg}
        calls = [(positional, named)]
        if len(positional) < len(node.args) or len(named) < len(node.keywords):
            calls = self._passed_on(node, positional, named)
        for known, hidden in self._called(node.func, env):
            if not calls:
                self.vary(known.node)
                self._handed.add(id(known.node))
            for values, by_name in calls:
                self._give_all(known, hidden, values, by_name)

    def _passed_on(
        self, node: ast.Call, positional: list[Values], named: dict[str, Values]
    ) -> list[tuple[list[Values], dict[str, Values]]]:
        """What a function gives that hands on what it was given itself; nothing where that is not all."""
        function = self._function
        stars = [one.value for one in node.args if isinstance(one, ast.Starred)]
        stars += [one.value for one in node.keywords if not one.arg]
        if (
            function is None
            or id(function) in self._handed
            or not node.args
            or len(node.args) > len(positional) + 1
        ):
            return []
        own = {one.arg for one in (function.args.vararg, function.args.kwarg) if one}
        if not all(isinstance(one, ast.Name) and one.id in own for one in stars):
            return []
        return [(positional + more, named | others) for more, others in self._surplus.get(id(function), [])]

    def _give_all(
        self, known: Known, hidden: int, positional: list[Values], named: dict[str, Values]
    ) -> None:
        function, here = known.node, self.place
        arguments = function.args
        parameters = [one.arg for one in arguments.args]
        defaults: dict[str, ast.expr | None] = dict.fromkeys(parameters)
        defaults.update(
            zip(parameters[len(parameters) - len(arguments.defaults) :], arguments.defaults, strict=True)
        )
        defaults.update(
            (one.arg, default)
            for one, default in zip(arguments.kwonlyargs, arguments.kw_defaults, strict=True)
        )
        given = dict(zip(parameters[hidden:], positional, strict=False))
        more = positional[len(parameters) - hidden :]
        others = {name: values for name, values in named.items() if name not in defaults}
        given.update((name, values) for name, values in named.items() if name in defaults)
        for name in [*parameters[hidden:], *(one.arg for one in arguments.kwonlyargs)]:
            if name in given:
                self.give(function, name, given[name])
            else:
                default = defaults[name]
                self.place = known.place
                self.give(function, name, self.values(default, {}) if default else None, explicit=False)
                self.place = here
        for name in parameters[:hidden]:
            self.give(function, name, None)
        if arguments.kwarg:
            self.give(function, arguments.kwarg.arg, None if others else ({},), explicit=bool(others))
        if arguments.vararg or arguments.kwarg:
            surplus = self._surplus.setdefault(id(function), [])
            if (more, others) not in surplus:
                surplus.append((more, others))

    def _walk(self, node: ast.AST, env: Environment) -> None:
        match node:
            case ast.If(test=test) | ast.IfExp(test=test) | ast.While(test=test):
                if self.place and not self.is_reached(test, env):
                    return
                truth = self.truth(test, env) if self.place else None
                if truth is None:
                    self._walk(test, env)
                if truth is not False:
                    self._walk_all(_as_list(node.body), env)
                if truth is not True:
                    self._walk_all(_as_list(node.orelse), env)
            case ast.BoolOp(op=op, values=values):
                for one in values:
                    if self.place and not self.is_reached(one, env):
                        return
                    truth = self.truth(one, env) if self.place else None
                    decides = truth is isinstance(op, ast.Or)
                    if truth is None or decides or one is values[-1]:  # the others are left out
                        self._walk(one, env)
                    if decides:
                        return
            case ast.Call():
                self._walk_call(node, env)
            case ast.Attribute(value=owner, attr=name, ctx=ast.Load()):
                found = self.values(node, env) if self.place else None
                if found is None or len(found) > 1 or (found and not is_short(found[0])):
                    self._names.add(name)
                    self._loaded.add(name)
                    self._refer(name)
                    self._walk(owner, env)
            case ast.Assign(targets=targets, value=value):
                for target in targets:
                    self._target(target, self.values(value, env), env)
                self._walk(value, env)
            case ast.AugAssign(target=target, value=value):
                self._target(target, None, env)
                if isinstance(target, ast.Attribute) and not self.place:
                    self._text(target.attr)  # nobody takes it out of a program
                self._walk(value, env)
            case ast.Attribute(value=owner, attr=name, ctx=ast.Store() | ast.Del()):
                self.store(name, None)
                self._walk(owner, env)
            case ast.For(target=target):
                self._target(target, None, env)
                self._walk(node.iter, env)
                self._walk_all([*node.body, *node.orelse], env)
            case ast.Name(id=name, ctx=ast.Load()):
                if name not in env:
                    self._own[self.place].add(name)
                    self._refer(name, self.place)
            case ast.Constant(value=str(text)):
                self._text(text)
            case ast.FunctionDef() | ast.Lambda():
                self._walk_function(node, env)
            case ast.ClassDef():
                self._walk_class(node)
            case ast.Import() | ast.ImportFrom():
                self._imports(node)
            case _:
                self._walk_all(ast.iter_child_nodes(node), env)

    def _walk_all(self, nodes: Iterable[ast.AST], env: Environment) -> None:
        for node in nodes:
            self._walk(node, env)

    def _walk_call(self, node: ast.Call, env: Environment) -> None:
        func = node.func
        found = self.values(node, env) if self.place else None
        if found is not None and len(found) < 2:
            return
        self._call(node, env)
        if isinstance(func, ast.Attribute):
            (self._perhaps if self.place and func.attr in _OF_CONTAINERS else self._names).add(func.attr)
            self._loaded.add(func.attr)
            self._walk(func.value, env)
        elif not isinstance(func, ast.Name):
            self._walk(func, env)
        elif func.id not in env:
            self._own[self.place].add(func.id)
        self._walk_all([one.value for one in node.keywords], env)
        self._walk_all(node.args, env)

    def _target(self, target: ast.expr, values: Values, env: Environment) -> None:
        match target:
            case ast.Attribute(value=owner, attr=name):
                self.store(name, values if self.place else None)
                self._walk(owner, env)
            case ast.Tuple(elts=elements) | ast.List(elts=elements):
                for one in elements:
                    self._target(one, None, env)
            case ast.Name():
                pass
            case _:
                self._walk(target, env)

    def _text(self, text: str) -> None:
        if text in self._modules:
            self.places.add(text)
            return
        if self.place and not self._asks:
            return
        words = text.replace(".", " ").replace("*", " ").split()
        if words and all(word.isidentifier() for word in words):
            self._names.update(words)
            self._loaded.update(words)
            for word in words:
                self._refer(word)
                if not self.place:
                    self.store(word, None)  # as by setattr

    def _walk_function(self, node: Function, outer: Environment) -> None:
        self._walk_all([one for one in (*node.args.defaults, *node.args.kw_defaults) if one], outer)
        before = self._function, self._asks
        if isinstance(node, ast.FunctionDef):
            self._walk_all(node.decorator_list, outer)
            self._function = node
            self._asks = asks(node)
        self._walk_all(_as_list(node.body), self.environment(node, outer))
        self._function, self._asks = before

    def _walk_class(self, node: ast.ClassDef) -> None:
        self._walk_all(node.bases, {})
        before, self._class = self._class, node
        for one in node.body:
            if isinstance(one, ast.FunctionDef):
                self.store(one.name, None)
                if not self.place or self.is_live(one):
                    self._walk(one, {})
            elif isinstance(one, ast.AnnAssign):
                if isinstance(one.target, ast.Name):
                    self.store(one.target.id, None)
                self._walk(one, {})
            elif isinstance(one, ast.Assign):
                for target in one.targets:
                    if isinstance(target, ast.Name):
                        self.store(target.id, self.values(one.value, {}) if self.place else None)
                if isinstance(one.value, ast.Name):  # another name of a method
                    self._names.add(one.value.id)
                    self._refer(one.value.id)
                self._walk(one.value, {})
            else:
                self._walk(one, {})
        self._class = before


def _lent(tree: ast.Module) -> set[str]:
    """The modules whose functions are methods of objects."""
    found: set[str] = set()
    for node in ast.walk(tree):
        match node:
            case ast.FunctionDef(name="__getattr__"):
                found |= wholes(node)
            case ast.Assign(targets=[ast.Name(id="lends")], value=ast.Constant(value=str(module))):
                found.add(module)
    return found


def _as_list(body: list[ast.stmt] | ast.expr) -> list[ast.AST]:
    return list(body) if isinstance(body, list) else [body]
