"""What values things of the board floor have, as far as the code that is reached tells: see ``_reach``.

Known are the few constants that an attribute is given anywhere, judged by its name alone, and those that a parameter is
given by any call that may be of its function. Nothing yet means that no code which gives it a value is reached; whoever
asks is not reached then either.
"""

from __future__ import annotations

import ast
import operator
from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import product
from typing import Any, Final

from muros.cli._small._trees import Function, Modules, assigned, is_plain, is_pure, stored, variables

Values = tuple[Any, ...] | None
"""The constants that something may be, none while nothing is known; None for anything at all."""

Environment = dict[str, Values]
"""What is known of the names within a function."""

_MOST: Final = 6  # values of one thing
_COMPARE: Final[dict[type[ast.cmpop], Any]] = {
    ast.Is: operator.is_, ast.IsNot: operator.is_not, ast.Eq: operator.eq, ast.NotEq: operator.ne,
    ast.Lt: operator.lt, ast.LtE: operator.le, ast.Gt: operator.gt, ast.GtE: operator.ge,
}  # fmt: skip
_TYPES: Final = {"str": str, "int": int, "bytes": bytes, "bool": bool, "float": float}


@dataclass(frozen=True, slots=True, eq=False)
class Known:
    """A function of the floor."""

    place: str
    owner: str
    """Its class, if it is a method."""
    node: ast.FunctionDef


class Knowledge:
    """Values by name. ``open_names`` may stand for anything."""

    def __init__(self, modules: Modules, open_names: Collection[str]) -> None:
        self.functions: dict[str, list[Known]] = {}
        self.classes: dict[str, list[tuple[str, ast.ClassDef]]] = {}
        self._open = open_names
        self._ever: set[str] = set()
        self._constants: dict[str, dict[str, object]] = {}
        for place, tree in modules.items():
            self._ever.update(_ever_stored(tree))
            self._constants[place] = dict(_constants(tree))
            for node in tree.body:
                self._register(place, node)
        self._by_node = {id(one.node): one for found in self.functions.values() for one in found}
        self._attributes: dict[str, list[object]] = {}
        self._given: dict[tuple[int, str], list[object]] = {}
        self._explicit: set[tuple[int, str]] = set()
        self._left_out: set[tuple[int, str]] = set()
        self._varied: set[int] = set()
        self._gave_up: set[str] = set()
        self._asked: set[str] = set()
        self.place = ""

    def _register(self, place: str, node: ast.stmt) -> None:
        if isinstance(node, ast.FunctionDef):
            self.functions.setdefault(node.name, []).append(Known(place, "", node))
        elif isinstance(node, ast.ClassDef):
            self.classes.setdefault(node.name, []).append((place, node))
            for one in node.body:
                if isinstance(one, ast.FunctionDef):
                    self.functions.setdefault(one.name, []).append(Known(place, node.name, one))

    # What is noted

    def size(self) -> int:
        """Grows with everything that is learnt."""
        found = sum(map(len, self._attributes.values())) + sum(map(len, self._given.values()))
        return found + len(self._explicit) + len(self._left_out) + len(self._varied) + len(self._gave_up)

    def store(self, name: str, values: Values) -> None:
        """An attribute may have one of these values."""
        _add(self._attributes.setdefault(name, []), values)

    def give(self, function: ast.FunctionDef, parameter: str, values: Values, explicit: bool = True) -> None:
        """A parameter may have one of these values, which a call names or leaves to the default."""
        _add(self._given.setdefault((id(function), parameter), []), values)
        (self._explicit if explicit else self._left_out).add((id(function), parameter))

    def vary(self, function: ast.FunctionDef) -> None:
        """It may be called with anything."""
        self._varied.add(id(function))

    def give_up(self) -> bool:
        """What is asked for although nothing gives it a value may be anything; whether there was such a thing."""
        asked = {name for name in self._asked - self._gave_up if not self._attributes.get(name)}
        self._asked = set()
        self._gave_up |= asked
        return bool(asked)

    # What is known

    def may_have(self, name: str) -> bool:
        """Whether anything may have such an attribute."""
        return name in self._open or name in self._attributes

    def is_explicit(self, function: ast.FunctionDef, parameter: str) -> bool:
        """Whether a call gives a value for a parameter."""
        return id(function) in self._varied or (id(function), parameter) in self._explicit

    def is_left_out(self, function: ast.FunctionDef, parameter: str) -> bool:
        """Whether a call leaves a parameter to its default, or may do so unseen."""
        if id(function) in self._varied or (id(function), parameter) not in self._explicit:
            return True
        return (id(function), parameter) in self._left_out

    def attribute(self, name: str) -> Values:
        """What an attribute of this name may be."""
        if name in self._open or name not in self._ever or name in self._gave_up:
            return None
        found = self._attributes.get(name, [])
        if not found:
            self._asked.add(name)
        return _values(found)

    def environment(self, node: Function, outer: Environment) -> Environment:
        """What is known of the names within a function; its variables may be anything."""
        env = outer | dict.fromkeys(variables(node))
        known = self._by_node.get(id(node))
        if known is None or id(node) in self._varied or node.args.vararg or known.node.name in self._open:
            return env
        again = set(stored(node)) | {
            one.arg for each in known.node.body for one in ast.walk(each) if isinstance(one, ast.arg)
        }
        for one in (*node.args.args, *node.args.kwonlyargs, *filter(None, [node.args.kwarg])):
            values = _values(self._given.get((id(node), one.arg), []))
            if values and one.arg not in again:
                env[one.arg] = values
        return env

    def values(self, node: ast.expr, env: Environment) -> Values:
        """What an expression may be."""
        match node:
            case ast.Constant(value=value):
                return (value,)
            case ast.Name(id=name):
                return env[name] if name in env else self._constant(name)
            case ast.Attribute(value=owner, attr=name) if is_plain(owner):
                return self.attribute(name)
            case ast.UnaryOp(op=ast.Not(), operand=operand):
                found = self.values(operand, env)
                return None if found is None else _values([not one for one in found])
            case ast.UnaryOp(op=ast.USub(), operand=ast.Constant(value=int(value))):
                return (-value,)
            case ast.Compare(left=left, ops=[op], comparators=[right]):
                return _both(_compare(op), self.values(left, env), self.values(right, env))
            case ast.BoolOp():
                return self._either(node, env)
            case ast.Call(func=ast.Name(id="hasattr"), args=[owner, ast.Constant(value=str(name))]):
                return (False,) if self._lacks(owner, name, env) else None
            case ast.Call(func=ast.Name(id="getattr"), args=[owner, ast.Constant(value=str(name)), default]):
                return self.values(default, env) if self._lacks(owner, name, env) else None
            case ast.Call(func=ast.Name(id="isinstance"), args=[one, ast.Name(id=kind)]) if kind in _TYPES:
                found = self.values(one, env)
                return (
                    None if found is None else _values([isinstance(value, _TYPES[kind]) for value in found])
                )
        return None

    def truth(self, node: ast.expr, env: Environment) -> bool | None:
        """Whether an expression is true; None where that is open, or where the code is not reached."""
        found = self.values(node, env)
        truths = {bool(one) for one in found or ()}
        if len(truths) == 1:
            return truths.pop()
        if found is None and isinstance(node, ast.BoolOp):
            stops = isinstance(node.op, ast.Or)
            for one in node.values:
                if self.truth(one, env) is stops:
                    return stops
                if not is_pure(one):
                    break
        return None

    def is_reached(self, test: ast.expr, env: Environment) -> bool:
        """Whether there is a value to decide by."""
        return self.values(test, env) != ()

    def _lacks(self, owner: ast.expr, name: str, env: Environment) -> bool:
        """Whether something has no attribute of that name."""
        found = self.values(owner, env)
        if found and all(isinstance(one, str | int) for one in found):
            return not any(hasattr(one, name) for one in found)
        return not self.may_have(name)

    def _constant(self, name: str) -> Values:
        found = self._constants.get(self.place, {})
        return (found[name],) if name in found else None

    def _either(self, node: ast.BoolOp, env: Environment) -> Values:
        """The value of ``and`` or ``or``, where it is decided before anything unknown."""
        stops = isinstance(node.op, ast.Or)
        found: Values = ()
        for one in node.values:
            found = self.values(one, env)
            if not found or len({bool(value) for value in found}) > 1:
                return found if found == () else None
            if bool(found[0]) is stops:
                return found
        return found


def is_short(value: object) -> bool:
    """Whether a constant may stand wherever it is used."""
    return (
        value is None or isinstance(value, bool | int | float) or (isinstance(value, str) and len(value) < 9)
    )


def _add(found: list[object], values: Values) -> None:
    """``found`` ends with ``...`` when it is too much to be kept."""
    if ... in found:
        return
    for value in (...,) if values is None else values:
        if not any(_is_same(value, one) for one in found):
            found.append(value)
    if len(found) > _MOST:
        found.append(...)


def _values(found: list[Any]) -> Values:
    if any(one is ... for one in found):
        return None
    out: list[Any] = []
    for one in found:
        if not any(_is_same(one, other) for other in out):
            out.append(one)
    return tuple(out)


def _is_same(a: object, b: object) -> bool:
    return a is b or (type(a) is type(b) and a == b)


def _compare(op: ast.cmpop) -> Any:
    if isinstance(op, ast.In):
        return lambda a, b: a in b
    if isinstance(op, ast.NotIn):
        return lambda a, b: a not in b
    return _COMPARE.get(type(op))


def _both(compare: Any, left: Values, right: Values) -> Values:
    if () in (left, right):
        return ()
    if left is None or right is None or compare is None:
        return None
    try:
        return _values([compare(a, b) for a, b in product(left, right)])
    except TypeError:
        return None


def _ever_stored(tree: ast.Module) -> Iterator[str]:
    """Attributes that some code of a module stores, as far as a name tells."""
    for node in ast.walk(tree):
        match node:
            case ast.Attribute(attr=name, ctx=ast.Store() | ast.Del()):
                yield name
            case ast.ClassDef():
                yield from assigned(node)


def _constants(tree: ast.Module) -> Iterator[tuple[str, object]]:
    """Names at the top of a module that are given a literal once and nothing else."""
    given: dict[str, int] = {}
    for node in ast.walk(tree):
        for name in stored(node) if isinstance(node, ast.Name | ast.alias | ast.ExceptHandler) else ():
            given[name] = given.get(name, 0) + 1
    for node in tree.body:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=value) if given[name] == 1:
                try:
                    literal = ast.literal_eval(value)
                except ValueError:
                    continue
                if isinstance(literal, str | bytes | int | tuple):
                    yield name, literal
