"""What is left to say shorter in functions when others were put in their place: see ``_inline``.

Constants came to where parameters stood, and decide something; what was an argument or a result is a variable now that
is read once, at once.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from muros.cli._small._trees import Modules, Substitute, Transformer, is_pure, literal, stored

_Body = list[ast.stmt]
_FOLDED = (
    ast.Constant, ast.Tuple, ast.Compare, ast.cmpop, ast.BoolOp, ast.boolop, ast.UnaryOp, ast.unaryop,
    ast.BinOp, ast.BitOr, ast.BitAnd, ast.BitXor, ast.Add, ast.Sub, ast.expr_context,
)  # fmt: skip
"""What a constant expression is made of whose value is not much longer than itself."""


def tidy(modules: Modules) -> None:
    """Says everything in these modules as shortly."""
    for tree in modules.values():
        _Tidy().visit(tree)


class _Tidy(Transformer, ast.NodeTransformer):
    def visit_FunctionDef(self, node: ast.FunctionDef) -> ast.AST:
        self.generic_visit(node)
        names = Counter(one.id for one in ast.walk(node) if isinstance(one, ast.Name))
        given = Counter(stored(node))
        arguments = Counter(one.arg for one in ast.walk(node) if isinstance(one, ast.arg))
        once = {name for name, count in given.items() if count == 1 and name not in arguments}
        own = {one.arg for one in ast.walk(node.args) if isinstance(one, ast.arg)}
        fixed = once | {name for name in own if arguments[name] == 1 and name not in given}
        node.body = _without_aliases(node.body, once, fixed)
        _at_once(node, {name for name in once if names[name] == 2})
        return node

    # Decided branches

    def visit_If(self, node: ast.If) -> ast.AST | _Body:
        return self._branch(node)

    def visit_IfExp(self, node: ast.IfExp) -> ast.AST | _Body:
        return self._branch(node)

    def _branch(self, node: ast.If | ast.IfExp) -> ast.AST | _Body:
        self.generic_visit(node)
        node.test = _tested(node.test)
        if isinstance(node.test, ast.Constant):
            return node.body if node.test.value else node.orelse
        return node

    def visit_For(self, node: ast.For) -> ast.AST | None:
        self.generic_visit(node)
        idle = all(isinstance(one, ast.Pass) for one in node.body) and not node.orelse
        return None if idle and isinstance(node.target, ast.Name) and is_pure(node.iter) else node

    def visit_Expr(self, node: ast.Expr) -> ast.AST:
        self.generic_visit(node)
        while isinstance(node.value, ast.UnaryOp):
            node.value = node.value.operand
        return node

    # Constants

    def visit_Compare(self, node: ast.Compare) -> ast.AST:
        self.generic_visit(node)
        return _folded(node)

    def visit_BoolOp(self, node: ast.BoolOp) -> ast.AST:
        self.generic_visit(node)
        return _folded(node)

    def visit_UnaryOp(self, node: ast.UnaryOp) -> ast.AST:
        self.generic_visit(node)
        if isinstance(node.op, ast.Not):
            node.operand = _tested(node.operand)
        return _folded(node)


def _folded(node: ast.expr) -> ast.expr:
    """A constant where all that it depends on is constant."""
    if not all(isinstance(one, _FOLDED) for one in ast.walk(node)):
        return node
    try:
        value = eval(compile(ast.Expression(ast.fix_missing_locations(node)), "", "eval"), {})  # constants
    except TypeError:
        return node
    return literal(value)


def _tested(node: ast.expr) -> ast.expr:
    """An expression that is as true as this one."""
    node = _folded(node)
    if not isinstance(node, ast.BoolOp):
        return node
    stops = isinstance(node.op, ast.Or)
    left: list[ast.expr] = []
    for one in map(_tested, node.values):
        if not isinstance(one, ast.Constant):
            left.append(one)
        elif bool(one.value) is stops:
            if all(map(is_pure, left)):
                return ast.Constant(stops)
            left.append(one)
            break
    node.values = left
    return (left[0] if len(left) == 1 else node) if left else ast.Constant(not stops)


def _without_aliases(body: _Body, once: set[str], fixed: set[str]) -> _Body:
    """Statements without variables that are another name for one which is never changed."""
    aliases: dict[str, ast.expr] = {}
    out: _Body = []
    for node in body:
        match node:
            case ast.Assign(targets=[ast.Name(id=new)], value=ast.Name(id=old)) if (
                new in once and old in fixed
            ):
                aliases[new] = aliases.get(old, ast.Name(old, ast.Load()))
                continue
        out.append(node)
    return [Substitute(aliases).visit(node) for node in out]


def _at_once(function: ast.FunctionDef, passing: set[str]) -> None:
    """Variables of ``passing`` that are read by the next statement, and before it does anything, are not needed."""
    for owner in ast.walk(function):
        for field in ("body", "orelse", "finalbody"):
            body = getattr(owner, field, None)
            if not isinstance(body, list):
                continue
            i = len(body) - 2
            while i >= 0:
                match body[i]:
                    case ast.Assign(targets=[ast.Name(id=name)], value=value) if name in passing:
                        if _reads_first(body[i + 1], name, value):
                            body[i : i + 2] = [Substitute({name: value}).visit(body[i + 1])]
                i -= 1


def _reads_first(node: ast.stmt, name: str, value: ast.expr) -> bool:
    """Whether a statement reads a variable before anything that working out ``value`` may have to do with."""
    still = is_pure(value)
    for one in _evaluated(node):
        match one:
            case ast.Name(id=other) if other == name:
                return True
            case ast.Name() | ast.Constant():
                pass
            case ast.Attribute(value=ast.Name()) if still:
                pass
            case _:
                return False
    return False


def _evaluated(node: ast.AST | None) -> Iterator[ast.AST]:
    """The parts of a statement in the order in which they are worked out, as far as that is plain, and then itself."""
    match node:
        case ast.Return(value=value) | ast.Expr(value=value) | ast.Assign(value=value):
            yield from _evaluated(value)
        case ast.If(test=value) | ast.UnaryOp(operand=value) | ast.IfExp(test=value):
            yield from _evaluated(value)
        case ast.BinOp(left=left, right=right) | ast.Compare(left=left, comparators=[right]):
            yield from _evaluated(left)
            yield from _evaluated(right)
        case ast.BoolOp(values=values):
            yield from _evaluated(values[0])
        case ast.Call(func=func, args=args):
            yield from _evaluated(func.value if isinstance(func, ast.Attribute) else func)
            for one in args:
                yield from _evaluated(one)
        case ast.Tuple(elts=elements, ctx=ast.Load()) | ast.List(elts=elements, ctx=ast.Load()):
            for one in elements:
                yield from _evaluated(one)
        case ast.Attribute(value=value):
            yield from _evaluated(value)
        case ast.Subscript(value=value, slice=index):
            yield from _evaluated(value)
            yield from _evaluated(index)
    if node is not None:
        yield node
