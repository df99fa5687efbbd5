"""Functions that are called in one place become part of it: each takes some 20 bytes of flash and 120 of a 64-bit heap.

A function or method is put in its caller's place when it is the only thing of its name, nothing but that one call, in
the same module, mentions it, and the call is a statement: ``f(x)``, ``y = f(x)`` or ``return f(x)``. One that is no
more than ``return ...`` may be called within an expression. Its variables get names that the caller does not have.
"""

from __future__ import annotations

import ast
import copy
from collections import Counter
from collections.abc import Callable, Collection, Iterator

from muros.cli._small._bundles import HOME
from muros.cli._small._frames import MOST
from muros.cli._small._frames import words as frame
from muros.cli._small._names import COMMON, STATIC
from muros.cli._small._trees import WORD, Modules, Substitute, functions, names_of, stored, variables, wholes

_FIRMWARE = frozenset([*STATIC, *COMMON])  # a method's name may be that of a list's
_Body = list[ast.stmt]
_Make = Callable[[ast.expr | None], _Body]


class _ImpossibleError(Exception):
    """This call can't be replaced."""


def inline(modules: Modules, messages: Modules, kept: Collection[str], named: Collection[str]) -> None:
    """Puts functions where they are called.

    ``kept`` are names that others than these modules may use, ``named`` the modules that a program names.
    """
    trees = [*modules.values(), *messages.values()]
    mentions = Counter(name for tree in trees for name in _mentioned(tree))
    uses = Counter(use for place, tree in (modules | messages).items() for use in _used(place, tree))
    unseen = set(named).union(*map(wholes, trees))
    for place, tree in modules.items():
        tried: set[int] = set()
        while fresh := [found for found in functions(tree) if id(found[1]) not in tried]:
            for owner, function in fresh:
                tried.add(id(function))
                name = function.name
                if name.startswith("__") or not _is_simple(function):
                    continue
                alone = name not in kept and mentions[name] == 2 and not (owner and name in _FIRMWARE)
                if alone or (not owner and place not in unseen and uses[place, name] == 1):
                    _put_in_place(function, owner, tree, place == HOME)


def _put_in_place(
    function: ast.FunctionDef, owner: ast.ClassDef | None, tree: ast.Module, is_hot: bool
) -> None:
    call = _Place(function, owner is not None, is_hot)
    call.look(tree)
    if call.done:
        (owner or tree).body.remove(function)
        if owner and not owner.body:
            owner.body.append(ast.Pass())


def _mentioned(tree: ast.Module) -> Iterator[str]:
    """Whatever is a name, or a word in a string."""
    for node in ast.walk(tree):
        yield from names_of(node)
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            yield from WORD.findall(node.value)


def _used(place: str, tree: ast.Module) -> Iterator[tuple[str, str]]:
    """What is referred to at the top of which module, as far as can be seen."""
    own = {
        id(node)
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef | ast.Lambda)
        for names in [variables(function)]
        for node in ast.walk(function)
        if isinstance(node, ast.Name) and node.id in names
    }
    for node in ast.walk(tree):
        match node:
            case ast.Name(id=name) if id(node) not in own:
                yield place, name
            case ast.ImportFrom(module=str(source), names=names):
                for one in names:
                    yield source, one.name
            case ast.Attribute(value=ast.Call(args=[ast.Constant(value=str(source)), *_]), attr=name):
                yield source, name


def _is_simple(function: ast.FunctionDef) -> bool:
    """Whether nothing in it needs a function of its own."""
    arguments = function.args
    if function.decorator_list or arguments.vararg or arguments.kwarg or arguments.kwonlyargs:
        return False
    inner = (
        ast.FunctionDef, ast.Lambda, ast.ListComp, ast.GeneratorExp, ast.SetComp, ast.DictComp,
        ast.Yield, ast.YieldFrom, ast.Global, ast.Nonlocal, ast.AsyncFunctionDef,
    )  # fmt: skip
    return not any(isinstance(node, inner) for one in function.body for node in ast.walk(one)) and not any(
        isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "super"
        for node in ast.walk(function)
    )


class _Place:
    """The one place in which a function is called."""

    def __init__(self, function: ast.FunctionDef, is_method: bool, is_hot: bool) -> None:
        self._function = function
        self._is_hot = is_hot
        self._is_method = is_method
        self.done = False

    def look(self, tree: ast.Module) -> None:
        """Replaces the call, if it is in this module and can be replaced.

        What stays in memory runs for each message: there no frame may become too large for the stack.
        """
        for _, caller in functions(tree):
            if caller is not self._function and any(self._is_call(node) for node in ast.walk(caller)):
                if variables(caller) & _free(self._function):
                    return  # what the function means by a name is another thing there
                before, words = copy.deepcopy(caller.body), frame(caller)
                try:
                    caller.body = self._in_body(caller.body, caller, True)
                except _ImpossibleError:
                    self.done = False
                if not self.done or (self._is_hot and words <= MOST < frame(caller)):
                    caller.body = before
                    self.done = False
                return

    def _is_call(self, node: ast.AST) -> bool:
        match node:
            case ast.Call(func=ast.Name(id=name)):
                return not self._is_method and name == self._function.name
            case ast.Call(func=ast.Attribute(attr=name)):
                return self._is_method and name == self._function.name
        return False

    def _in_body(self, body: _Body, caller: ast.FunctionDef, is_last: bool) -> _Body:
        out: _Body = []
        for i, node in enumerate(body):
            last = is_last and i == len(body) - 1
            if self.done or not any(self._is_call(one) for one in ast.walk(node)):
                out.append(node)
                continue
            made = self._in_statement(node, caller, last)
            out += made
        return out

    def _in_statement(self, node: ast.stmt, caller: ast.FunctionDef, last: bool) -> _Body:
        match node:
            case ast.Expr(value=ast.Call() as call) if self._is_call(call):
                if last and not _gives(self._function) and not _gives(caller):
                    return self._expand(call, caller, None, last)
                return self._expand(call, caller, lambda value: _kept(value), False)
            case ast.Return(value=ast.Call() as call) if self._is_call(call):
                return self._expand(call, caller, None, last)
            case ast.Assign(targets=[target], value=ast.Call() as call) if self._is_call(call):
                if not isinstance(target, ast.Name):
                    raise _ImpossibleError
                return self._expand(
                    call,
                    caller,
                    lambda value: [ast.Assign([copy.deepcopy(target)], value or ast.Constant(None))],
                    False,
                )
        nested = False
        for field in ("body", "orelse", "finalbody"):
            inner = getattr(node, field, None)
            if isinstance(inner, list) and any(
                self._is_call(one) for each in inner for one in ast.walk(each)
            ):
                loop = isinstance(node, ast.For | ast.While | ast.Try | ast.With)
                setattr(node, field, self._in_body(inner, caller, last and not loop))
                nested = True
        for handler in getattr(node, "handlers", []):
            if any(self._is_call(one) for each in handler.body for one in ast.walk(each)):
                handler.body = self._in_body(handler.body, caller, False)
                nested = True
        if not nested:
            return [self._in_expression(node, caller)]
        return [node]

    def _in_expression(self, node: ast.stmt, caller: ast.FunctionDef) -> ast.stmt:
        body = self._function.body
        if len(body) != 1 or not isinstance(body[0], ast.Return) or body[0].value is None:
            raise _ImpossibleError
        found = next(one for one in ast.walk(node) if self._is_call(one))
        assert isinstance(found, ast.Call)
        given = self._arguments(found)
        uses = Counter(one.id for one in ast.walk(body[0].value) if isinstance(one, ast.Name))
        acts = any(isinstance(one, ast.Call) for one in ast.walk(body[0].value))
        for name, value in given.items():
            if isinstance(value, ast.Name | ast.Constant):
                continue
            read = any(isinstance(one, ast.Attribute) for one in ast.walk(value))
            if (
                uses[name] > 1 or not _is_still(value) or (acts and read)
            ):  # it is worked out later than it was
                raise _ImpossibleError
        made = Substitute(given).visit(copy.deepcopy(body[0].value))
        _Replace(found, made).visit(node)
        self.done = True
        return node

    def _arguments(self, call: ast.Call) -> dict[str, ast.expr]:
        parameters = [one.arg for one in self._function.args.args]
        values = list(call.args)
        if any(isinstance(one, ast.Starred) for one in values) or any(
            one.arg is None for one in call.keywords
        ):
            raise _ImpossibleError
        if self._is_method:
            assert isinstance(call.func, ast.Attribute)
            values.insert(0, call.func.value)
        if len(values) > len(parameters):
            raise _ImpossibleError
        given = dict(zip(parameters, values, strict=False))
        given.update((str(one.arg), one.value) for one in call.keywords)
        defaults = self._function.args.defaults
        for name, value in zip(parameters[len(parameters) - len(defaults) :], defaults, strict=True):
            given.setdefault(name, value)
        if set(given) != set(parameters):
            raise _ImpossibleError
        return given

    def _expand(self, call: ast.Call, caller: ast.FunctionDef, make: _Make | None, last: bool) -> _Body:
        """The function's body for a call; ``make`` says what becomes of a returned value, None that it returns it."""
        given = self._arguments(call)
        body = copy.deepcopy(self._function.body)
        taken = set(_local_names(caller))
        changed = {name for node in body for name in stored(node)}
        names: dict[str, ast.expr] = {}
        before: _Body = []
        for name in dict.fromkeys([*given, *sorted(changed)]):
            value = given.get(name)
            if value is not None and name not in changed and isinstance(value, ast.Name | ast.Constant):
                names[name] = value
                continue
            new = name
            while new in taken:
                new += "_"
            taken.add(new)
            names[name] = ast.Name(new, ast.Load())
            if value is not None:
                before.append(ast.Assign([ast.Name(new, ast.Store())], value))
        if len(before) > 1:
            # what one argument is worked out from must not be changed by another's name
            fresh = {one.targets[0].id for one in before}  # type: ignore[attr-defined]
            for one in before:
                if fresh & {n.id for n in ast.walk(one.value) if isinstance(n, ast.Name)}:  # type: ignore[attr-defined]
                    raise _ImpossibleError
        body = [Substitute(names).visit(node) for node in body]
        if make is None:
            if not last and not _ends(body):
                body.append(ast.Return(None))
        else:
            body = _without_returns(body, make)
        self.done = True
        return before + (body or [ast.Pass()])


def _free(function: ast.FunctionDef) -> set[str]:
    """The names in a function that are not its own."""
    return {node.id for node in ast.walk(function) if isinstance(node, ast.Name)} - variables(function)


def _gives(function: ast.FunctionDef) -> bool:
    """Whether a function returns anything but None."""
    return any(isinstance(one, ast.Return) and one.value is not None for one in ast.walk(function))


def _kept(value: ast.expr | None) -> _Body:
    """What remains of a value that nobody wants."""
    return [] if value is None or _is_still(value) else [ast.Expr(value)]


def _without_returns(body: _Body, make: _Make) -> _Body:
    """Statements that lead to their end in place of returning."""
    out: _Body = []
    for i, node in enumerate(body):
        if isinstance(node, ast.Return):
            return out + make(node.value)
        if not any(isinstance(one, ast.Return) for one in ast.walk(node)):
            out.append(node)
            if isinstance(node, ast.Raise):
                return out
            continue
        if not isinstance(node, ast.If):
            raise _ImpossibleError
        rest = body[i + 1 :]
        if _ends(node.body):
            then, other = node.body, node.orelse + rest
        elif _ends(node.orelse):
            then, other = node.body + rest, node.orelse
        elif not rest:
            then, other = node.body, node.orelse
        else:
            raise _ImpossibleError
        then, other = _without_returns(then, make), _without_returns(other, make)
        if not then and other:
            out.append(ast.If(_negated(node.test), other, []))
        elif then or other or not _is_still(node.test):
            out.append(ast.If(node.test, then or [ast.Pass()], other))
        return out
    return out + make(None)


def _negated(test: ast.expr) -> ast.expr:
    return (
        test.operand
        if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not)
        else ast.UnaryOp(ast.Not(), test)
    )


def _ends(body: _Body) -> bool:
    """Whether no path leads behind these statements."""
    if not body:
        return False
    last = body[-1]
    if isinstance(last, ast.If):
        return _ends(last.body) and _ends(last.orelse)
    return isinstance(last, ast.Return | ast.Raise)


def _is_still(node: ast.expr) -> bool:
    """Whether working it out does nothing, at any time."""
    return all(
        isinstance(one, ast.Name | ast.Constant | ast.Attribute | ast.BinOp | ast.operator | ast.expr_context)
        for one in ast.walk(node)
    )


def _local_names(function: ast.FunctionDef) -> Iterator[str]:
    yield from stored(function)
    for one in ast.walk(function):
        if isinstance(one, ast.arg):
            yield one.arg
        elif isinstance(one, ast.Name):
            yield one.id


class _Replace(ast.NodeTransformer):
    def __init__(self, old: ast.AST, new: ast.AST) -> None:
        self._old = old
        self._new = new

    def visit(self, node: ast.AST) -> ast.AST:
        if node is self._old:
            return self._new
        visited: ast.AST = super().visit(node)
        return visited
