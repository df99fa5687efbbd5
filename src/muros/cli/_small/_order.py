"""The names that a large module says most have the lowest numbers in its compiled file: those take one byte, not two.

A compiler numbers names as it meets them, those of attributes before those of variables. So the module begins with a
loop that is left at once, and has them as attributes behind that: nothing is made of it but the numbers.
"""

from __future__ import annotations

import ast
from collections import Counter
from collections.abc import Iterator

from muros.cli._small._trees import names_of, variables

_SHORT = 128  # numbers that take one byte
_OTHERS = 2  # that a compiler numbers first: the file's name and that of its code
_SELF = "__name__"  # a name that is there anyway
_OF_CLASSES = ("__name__", "__module__", "__qualname__")  # what the code of each class says


def order(tree: ast.Module) -> None:
    """Has a module begin so, when it has more names than there are short numbers."""
    said = Counter(_said(tree))
    if len(said) + _OTHERS <= _SHORT:
        return
    unreached: ast.expr = ast.Name(_SELF, ast.Load())
    for name, _ in said.most_common(_SHORT - _OTHERS):
        unreached = ast.Attribute(unreached, name, ast.Load())
    tree.body.insert(0, ast.While(ast.Constant(True), [ast.Break(), ast.Expr(unreached)], []))


def _said(tree: ast.Module) -> Iterator[str]:
    """Each name as often as a compiled file says its number; variables of functions have none."""
    own = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.Lambda):
            names = variables(node)
            own |= {id(one) for one in ast.walk(node) if isinstance(one, ast.Name) and one.id in names}
    for node in ast.walk(tree):
        if id(node) in own or isinstance(node, ast.ExceptHandler):
            continue
        yield from names_of(node)
        match node:
            case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                yield name
                yield from _OF_CLASSES if isinstance(node, ast.ClassDef) else ()
            case ast.Constant(value=str(text)) if text.isidentifier():
                yield text
