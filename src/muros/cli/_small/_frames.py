"""How many words the frame of a function takes on MicroPython, about.

A frame of more than 11 words is taken from the heap for each call, which costs thousands of instructions: what runs for
each message stays below.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable

from muros.cli._small._trees import variables

MOST = 11
"""Words of a frame on the stack."""

_HANDLER = 3  # words for each try within another
_ITERATOR = 4  # words of a loop over anything but a range


def words(function: ast.FunctionDef) -> int:
    """Variables, the deepest stack of values, and what handlers take."""
    return len(variables(function)) + _body(function.body)


def _body(nodes: Iterable[ast.stmt]) -> int:
    return max(map(_statement, nodes), default=0)


def _statement(node: ast.stmt) -> int:
    match node:
        case ast.Try(body=body, handlers=handlers, orelse=orelse, finalbody=final):
            inner = max([_body(body), _body(orelse), _body(final), *(_body(one.body) for one in handlers)])
            return inner + _HANDLER * (1 + bool(handlers and final)) + 1
        case ast.For(iter=values, body=body):
            return max(_depth(values), _body(body) + _ITERATOR)
        case ast.If(test=test, body=body, orelse=orelse) | ast.While(test=test, body=body, orelse=orelse):
            return max(_depth(test), _body(body), _body(orelse))
        case ast.Assign(targets=targets, value=value):
            return max(_depth(value), *(1 + _depth(one) for one in targets))
        case ast.AugAssign(target=target, value=value):
            return 1 + _depth(target) + _depth(value)
    return max((_depth(one) for one in ast.iter_child_nodes(node) if isinstance(one, ast.expr)), default=0)


def _depth(node: ast.expr) -> int:
    """The values that an expression has on the stack at most."""
    match node:
        case ast.Call(func=func, args=args, keywords=keywords):
            given = [*args, *(one.value for one in keywords)]
            first = 2 if isinstance(func, ast.Attribute) else 1
            return max([_depth(func) + 1, *(first + i + _depth(one) for i, one in enumerate(given))])
        case ast.BinOp(left=left, right=right) | ast.Subscript(value=left, slice=right):
            return max(_depth(left), 1 + _depth(right))
        case ast.Compare(left=left, comparators=others):
            return max(_depth(left), *(1 + _depth(one) for one in others))
        case ast.Tuple(elts=elements) | ast.List(elts=elements):
            return max((i + _depth(one) for i, one in enumerate(elements)), default=1)
        case ast.Slice():
            parts = [one for one in (node.lower, node.upper, node.step) if one]
            return max((i + 1 + _depth(one) for i, one in enumerate(parts)), default=2)
    return max((_depth(one) for one in ast.iter_child_nodes(node) if isinstance(one, ast.expr)), default=1)
