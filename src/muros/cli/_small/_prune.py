"""Takes out of the board floor what a program cannot reach: see ``_reach``."""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Collection

from muros.cli._small._bundles import HOME
from muros.cli._small._reach import Reach
from muros.cli._small._trees import (
    Function,
    Modules,
    Substitute,
    Transformer,
    is_plain,
    is_pure,
    literal,
    stored,
    variables,
    wholes,
)
from muros.cli._small._values import Environment, is_short

_Body = list[ast.stmt]


def prune(modules: Modules, reach: Reach, foreign: Collection[str]) -> Modules:
    """The modules that are reached, with what is reached in them; ``foreign`` names may be somebody else's."""
    idle = {
        name
        for name, found in reach.functions.items()
        if name not in foreign and all(_is_empty(known.node) for known in found)
    }
    return {
        place: _pruned(tree, place, reach, idle) for place, tree in modules.items() if place in reach.places
    }


def unlend(modules: Modules) -> None:
    """Classes and modules no longer look for their functions in modules that have none left."""
    for tree in modules.values():
        scopes: list[ast.Module | ast.ClassDef] = [tree]
        scopes += [node for node in tree.body if isinstance(node, ast.ClassDef)]
        for scope in scopes:
            looked = {place for node in scope.body for place in _lenders(node)}
            if looked and not any(_gives(modules, place) for place in looked):
                scope.body = [one for one in scope.body if not _looks(one)] or [ast.Pass()]


def _lenders(node: ast.stmt) -> set[str]:
    """The modules in which a statement has functions looked for."""
    match node:
        case ast.Assign(targets=[ast.Name(id="lends")]) | ast.FunctionDef(name="__getattr__"):
            return {place for place in wholes(node) if place.startswith(f"{HOME}.")}
    return set()


def _looks(node: ast.stmt) -> bool:
    """Whether a statement has to do with looking elsewhere."""
    match node:
        case ast.Assign(targets=[ast.Name(id="__getattr__")]):
            return True
    return bool(_lenders(node))


def _gives(modules: Modules, place: str) -> bool:
    """Whether a module has anything for whoever looks in it, or looks where there is something."""
    for node in modules[place].body if place in modules else []:
        looked = _lenders(node)
        if looked and any(_gives(modules, other) for other in looked):
            return True
        if not looked and not isinstance(node, ast.Import | ast.ImportFrom | ast.Pass):
            return True
    return False


def _pruned(tree: ast.Module, place: str, reach: Reach, idle: Collection[str]) -> ast.Module:
    body: _Body = []
    for node in tree.body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            above = str(node.module) if isinstance(node, ast.ImportFrom) else ""
            node.names = [one for one in node.names if reach.is_used(one, above, place)]
            if node.names:
                body.append(node)
        elif reach.is_live(node, place):
            if isinstance(node, ast.ClassDef):
                node.body = [one for one in node.body if reach.is_live(one)] or [ast.Pass()]
            body.append(node)
    tree.body = body
    reach.place = place
    out: ast.Module = _Pruner(reach, idle).visit(tree)
    return out


class _Pruner(Transformer, ast.NodeTransformer):
    """Decides what is decided, and takes out what is not reached or has no effect."""

    def __init__(self, reach: Reach, idle: Collection[str]) -> None:
        self._reach = reach
        self._idle = idle
        self._env: Environment = {}

    # Functions and classes

    def _in(self, node: Function) -> None:
        outer, self._env = self._env, self._reach.environment(node, self._env)
        self.generic_visit(node)
        if isinstance(node, ast.FunctionDef):
            self._shorten(node)
        self._env = outer

    def _shorten(self, node: ast.FunctionDef) -> None:
        """Takes out parameters that no call gives and whose value stands in the body, and defaults not needed."""

        used = {one.id for each in node.body for one in ast.walk(each) if isinstance(one, ast.Name)}

        def is_decided(one: ast.arg) -> bool:
            found = self._env.get(one.arg)
            if found is None or len(found) != 1 or (one.arg in used and not is_short(found[0])):
                return False
            return not self._reach.is_explicit(node, one.arg)

        arguments = node.args
        if (
            arguments.kwarg
            and arguments.kwarg.arg not in used
            and self._env.get(arguments.kwarg.arg) == ({},)
        ):
            arguments.kwarg = None
        for i in reversed(range(len(arguments.kwonlyargs))):
            if is_decided(arguments.kwonlyargs[i]):
                del arguments.kwonlyargs[i], arguments.kw_defaults[i]
        while arguments.defaults and is_decided(arguments.args[-1]):
            del arguments.args[-1], arguments.defaults[-1]
        while arguments.defaults and not self._reach.is_left_out(
            node, arguments.args[-len(arguments.defaults)].arg
        ):
            del arguments.defaults[0]

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self._in(node)
        node.body = _until_end(_without_copies(node)) or [ast.Pass()]
        for one in ast.walk(node):
            for field in ("body", "orelse"):
                if isinstance(body := getattr(one, field, None), list):
                    setattr(one, field, _returned_at_once(body))
        return node

    def visit_Lambda(self, node: ast.Lambda) -> ast.AST:
        self._in(node)
        return node

    def visit_ClassDef(self, node: ast.ClassDef) -> ast.AST:
        node.body = [one for one in node.body if self._is_asked_for(one)]
        return self.generic_visit(node)

    def _is_asked_for(self, node: ast.stmt) -> bool:
        match node:
            case ast.Assign(targets=[ast.Name(id=name)], value=ast.Constant()):
                return self._reach.is_read(name)
        return True

    # Branches

    def visit_If(self, node: ast.If) -> ast.AST | _Body | None:
        truth = self._reach.truth(node.test, self._env)
        if truth is not None:
            return self._all(node.body if truth else node.orelse)
        node.test = self.visit(node.test)
        node.body, node.orelse = _until_end(self._all(node.body)), _until_end(self._all(node.orelse))
        if all(isinstance(one, ast.Pass) for one in node.body):
            if not node.orelse:
                return None if is_pure(node.test) else ast.Expr(node.test)
            node.test = ast.UnaryOp(ast.Not(), node.test)
            node.body, node.orelse = node.orelse, []
        return node

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        truth = self._reach.truth(node.test, self._env)
        if truth is None:
            return self.generic_visit(node)
        chosen: ast.AST = self.visit(node.body if truth else node.orelse)
        return chosen

    def visit_While(self, node: ast.While) -> ast.AST | _Body:
        truth = self._reach.truth(node.test, self._env)
        return self._all(node.orelse) if truth is False else self.generic_visit(node)

    def visit_Try(self, node: ast.Try) -> ast.AST | _Body:
        node.body = self._all(node.body)
        if not node.body:
            return self._all(node.orelse + node.finalbody)
        return self.generic_visit(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        left: list[ast.expr] = []
        for i, one in enumerate(node.values):
            truth = self._reach.truth(one, self._env)
            is_last = i == len(node.values) - 1
            if truth is None:
                left.append(self.visit(one))
            elif truth is isinstance(node.op, ast.Or) or is_last:
                left.append(self.visit(one))
                break
        if len(left) == 1:
            return left[0]
        node.values = left
        return node

    def _all(self, body: _Body) -> _Body:
        out: _Body = []
        for one in body:
            made = self.visit(one)
            out += made if isinstance(made, list) else [made] if made is not None else []
        return out

    # Values

    def _expression(self, node: ast.expr) -> ast.AST:
        found = self._reach.values(node, self._env)
        if found is not None and len(found) == 1 and is_short(found[0]):
            return literal(found[0])
        return self.generic_visit(node)

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        return self._expression(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        return self._expression(node)

    def visit_Name(self, node: ast.Name) -> ast.AST:
        return self._expression(node) if isinstance(node.ctx, ast.Load) else node

    def visit_Attribute(self, node: ast.Attribute) -> ast.AST:
        return self._expression(node) if isinstance(node.ctx, ast.Load) else self.generic_visit(node)

    def visit_Call(self, node: ast.Call) -> ast.AST:
        found = self._reach.values(node, self._env)
        if found is not None and len(found) == 1:
            return literal(found[0])
        if isinstance(node.func, ast.Attribute):
            node.func.value = self.visit(node.func.value)  # what is called stays what it is
        elif not isinstance(node.func, ast.Name):
            node.func = self.visit(node.func)
        node.args = [self.visit(one) for one in node.args]
        for keyword in node.keywords:
            keyword.value = self.visit(keyword.value)
        return node

    # Effects

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        match node.value:
            case ast.Call(func=ast.Attribute(value=owner, attr=name), args=args, keywords=keywords):
                given = (*args, *(one.value for one in keywords))
                if name in self._idle and is_plain(owner) and all(map(is_pure, given)):
                    return None
        self.generic_visit(node)
        return None if is_pure(node.value) else node

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        self.generic_visit(node)
        left = [one for one in node.targets if not self._is_unread(one)]
        if left:
            node.targets = left
            return node
        return None if is_pure(node.value) else ast.Expr(node.value)

    def visit_AugAssign(self, node: ast.AugAssign) -> ast.AST | None:
        self.generic_visit(node)
        if self._is_unread(node.target):
            return None if is_pure(node.value) else ast.Expr(node.value)
        return node

    def _is_unread(self, target: ast.expr) -> bool:
        match target:
            case ast.Attribute(value=owner, attr=name):
                return is_plain(owner) and not self._reach.is_read(name)
        return False


def _is_empty(function: ast.FunctionDef) -> bool:
    return all(isinstance(node, ast.Pass) for node in function.body)


def _until_end(body: _Body) -> _Body:
    """Statements up to the first behind which nothing runs."""
    for i, node in enumerate(body):
        if isinstance(node, ast.Return | ast.Raise | ast.Continue | ast.Break):
            return body[: i + 1]
    return body


def _returned_at_once(body: _Body) -> _Body:
    """Statements in which a value is returned without a name."""
    for i in range(len(body) - 1):
        match body[i : i + 2]:
            case [ast.Assign(targets=[ast.Name(id=new)], value=value), ast.Return(value=ast.Name(id=old))]:
                if new == old:
                    return [*body[:i], ast.Return(value)]
    return body


def _without_copies(function: ast.FunctionDef) -> _Body:
    """A function's body without variables that are only another name for something of the module, or a constant's."""
    own = variables(function)
    names = Counter(stored(function))
    arguments = {one.arg for one in ast.walk(function) if isinstance(one, ast.arg)}
    copies: dict[str, ast.expr] = {}
    body: _Body = []
    for node in function.body:
        match node:
            case ast.Assign(targets=[ast.Name(id=new)], value=value) if (
                names[new] == 1 and new not in arguments
            ):
                if isinstance(value, ast.Name) and value.id not in own:
                    copies[new] = value
                    continue
                if isinstance(value, ast.Constant) and is_short(value.value):
                    copies[new] = value
                    continue
        body.append(node)
    return [Substitute(copies).visit(node) for node in body]
