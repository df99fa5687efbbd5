"""What a board's program does without, taken out of a module: see the package."""

from __future__ import annotations

import ast
from collections.abc import Collection

_TRUTHS = {"MPY": True, "TYPE_CHECKING": False}
_Body = list[ast.stmt]


def strip(tree: ast.Module, modules: Collection[str]) -> ast.Module:
    """A module of the floor without docstrings, annotations, what is for hosts or type checkers, and constants.

    What tries to import a module that is not among ``modules``, named with dots, does what is meant for that case.
    """
    tree = _Strip(modules).visit(tree)
    tree = _Constants().visit(tree)
    _forget(tree)
    return tree


class _Strip(ast.NodeTransformer):
    def __init__(self, modules: Collection[str]) -> None:
        self._modules = modules

    def generic_visit(self, node: ast.AST) -> ast.AST:
        super().generic_visit(node)
        if getattr(node, "body", None) == []:
            node.body = [ast.Pass()]  # type: ignore[attr-defined]
        return node

    def visit_Module(self, node: ast.Module) -> ast.AST:
        super().generic_visit(node)
        return node

    def visit_Expr(self, node: ast.Expr) -> ast.AST | None:
        return None if isinstance(node.value, ast.Constant) else self.generic_visit(node)

    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        node.returns = None
        return self.generic_visit(node)

    def visit_arg(self, node: ast.arg) -> ast.AST:
        node.annotation = None
        return node

    def visit_AnnAssign(self, node: ast.AnnAssign) -> ast.AST | None:
        if node.value is None:
            return None
        return self.generic_visit(ast.copy_location(ast.Assign([node.target], node.value), node))

    def visit_If(self, node: ast.If) -> ast.AST | _Body:
        truth = _truth(node.test)
        if truth is None:
            return self.generic_visit(node)
        return self._all(node.body if truth else node.orelse)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST:
        truth = _truth(node.test)
        if truth is None:
            return self.generic_visit(node)
        chosen: ast.AST = self.visit(node.body if truth else node.orelse)
        return chosen

    def visit_Try(self, node: ast.Try) -> ast.AST | _Body:
        first = node.body[0]
        if (
            isinstance(first, ast.ImportFrom)
            and str(first.module).startswith("muros.")
            and first.module not in self._modules
        ):
            return self._all(node.handlers[0].body)
        return self.generic_visit(node)

    def _all(self, body: _Body) -> _Body:
        out: _Body = []
        for statement in body:
            made = self.visit(statement)
            out += made if isinstance(made, list) else [made] if made is not None else []
        return out


class _Constants(ast.NodeTransformer):
    """Puts ``const`` values where they are used; public names keep theirs, too."""

    def __init__(self) -> None:
        self._known: dict[str, object] = {}

    def visit_Assign(self, node: ast.Assign) -> ast.AST | None:
        self.generic_visit(node)
        target, value = node.targets[0], node.value
        if not (
            isinstance(target, ast.Name)
            and isinstance(value, ast.Call)
            and isinstance(value.func, ast.Name)
            and value.func.id == "const"
        ):
            return node
        number = eval(compile(ast.Expression(value.args[0]), "", "eval"), {"__builtins__": {}})
        self._known[target.id] = number
        node.value = _literal(number)
        return None if target.id[0] == "_" or target.id in _TRUTHS else node

    def visit_Name(self, node: ast.Name) -> ast.AST:
        if isinstance(node.ctx, ast.Load) and node.id in self._known:
            return _literal(self._known[node.id])
        return node


def _literal(value: object) -> ast.expr:
    return ast.parse(repr(value), mode="eval").body


def _truth(test: ast.expr) -> bool | None:
    """Whether a test holds on boards; None if that is not known."""
    if isinstance(test, ast.UnaryOp) and isinstance(test.op, ast.Not):
        truth = _truth(test.operand)
        return None if truth is None else not truth
    return _TRUTHS.get(test.id) if isinstance(test, ast.Name) else None


def _forget(tree: ast.Module) -> None:
    """Takes out imports from muros that nothing uses, unless they are there to be imported again."""
    used = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    for statement in list(tree.body):
        if isinstance(statement, ast.ImportFrom) and str(statement.module).startswith("muros"):
            statement.names = [
                one for one in statement.names if (one.asname or one.name) in used or one.asname == one.name
            ]
            if not statement.names:
                tree.body.remove(statement)
