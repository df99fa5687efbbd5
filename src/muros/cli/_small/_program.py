"""What a board's programs say of muros, read from their text."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterable

from muros.cli._small._bundles import HOME
from muros.cli._small._trees import WORD, names_of, stored


class Programs:
    """The programs that a floor is made small for, given as texts."""

    def __init__(self, texts: Iterable[str]) -> None:
        self.texts = list(texts)
        self.trees: list[ast.Module] = []
        self.words: set[str] = set()
        """All names, in strings too."""
        self.shown: set[str] = set()
        """Those of them that may be somebody else's: all but variables."""
        self.hidden: set[str] = set()
        """The words of what is written for another Python: any of them may mean anything."""
        for text in self.texts:
            tree = _parsed(text)
            if tree is None:
                self.hidden.update(WORD.findall(text))
            else:
                self.trees.append(tree)
                self.words |= _words(tree)
                self.shown |= _words(tree, variables=False)
        self.words |= self.hidden
        self.shown |= self.hidden
        self.named = named_in("\n".join(self.texts))

    def defines(self) -> set[str]:
        """What programs define themselves: functions, classes, and whatever they assign."""
        found = set(self.hidden)
        for tree in self.trees:
            for node in ast.walk(tree):
                match node:
                    case ast.FunctionDef(name=name) | ast.ClassDef(name=name):
                        found.add(name)
                    case ast.Name(id=name, ctx=ast.Store()) | ast.Attribute(attr=name, ctx=ast.Store()):
                        found.add(name)
        return found

    def asked(self, package: str) -> set[str]:
        """The names that they take from a package; all they say when they have the package as a whole."""
        names = set(self.hidden)
        for tree in self.trees:
            for node in ast.walk(tree):
                match node:
                    case ast.ImportFrom(module=source, names=parts) if source == package:
                        names.update(one.name for one in parts)
                    case ast.ImportFrom(module=source, names=parts):
                        if package in (f"{source}.{one.name}" for one in parts):
                            return self.words
                    case ast.Import(names=parts) if any(one.name.split(".")[0] == HOME for one in parts):
                        return self.words
                    case ast.Call(func=ast.Name(id="__import__")):
                        return self.words
        return names


def named_in(text: str) -> set[str]:
    """What a program may name by its path: whatever stands behind ``muros``, with dots or with ``import``."""
    found = set(re.findall(r"\bmuros(?:\.\w+)+", text))
    for package, names in re.findall(r"\bfrom\s+(muros[.\w]*)\s+import\s+(\([^)]*\)|[^\n]*)", text):
        found.update(f"{package}.{name}" for name in re.findall(r"\w+", names))
    return found


def _parsed(text: str) -> ast.Module | None:
    """A program's tree without its docstrings; None for what is written for another Python."""
    try:
        tree = ast.parse(text)
    except SyntaxError:
        return None
    for node in ast.walk(tree):
        if isinstance(node, ast.Module | ast.FunctionDef | ast.ClassDef) and ast.get_docstring(node, False):
            node.body[:1] = [ast.Pass()]
    return tree


def _words(tree: ast.Module, variables: bool = True) -> set[str]:
    words: set[str] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            words.update(WORD.findall(node.value))
        elif isinstance(node, ast.ClassDef):
            words.update(stored(node))
        if variables or not isinstance(node, ast.Name):
            words.update(names_of(node))
    return words
