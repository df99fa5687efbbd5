"""What component a Python file holds, without running it.

Two styles are known. A file `ConsoleOut.py` in the style of OpenRTM-aist has a list `consoleout_spec` of keys and
values. One in the style of muros has classes derived from `Component`, whose plain class attributes say the same.

Both are read from the syntax tree. A list that is computed is asked of another process, which imports the file and
has `ASK_TIME` for it: it can neither stop nor change the manager.
"""

from __future__ import annotations

import ast
import json
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Final

__all__ = ["read_specs_untrusted"]

FILE_SIZE: Final = 1 << 20
"""Octets of the largest file that is looked at."""

ASK_TIME: Final = 3.0
"""Seconds that importing a file in another process may take."""

CLASS_KEYS: Final = (
    "type_name",
    "description",
    "version",
    "vendor",
    "category",
    "activity_type",
    "max_instance",
)
"""Class attributes of a component that say what it is."""

CLASS_DEFAULTS: Final = {
    "version": "1.0.0",
    "vendor": "",
    "category": "Generic",
    "activity_type": "DataFlowComponent",
    "max_instance": "0",
    "language": "Python",
    "lang_type": "script",
}

TOOLS_WANT: Final = dict.fromkeys(
    ("implementation_id", "type_name", "description", "version", "vendor", "category"), ""
)
"""What tools look for in every specification (rtmgr ends with an error where one is missing)."""


def read_specs_untrusted(path: Path) -> list[dict[str, str]]:
    """The properties of every component in a file; none where it holds none or cannot be read. Raises nothing."""
    try:
        with path.open("rb") as file:
            source = file.read(FILE_SIZE + 1)
        if len(source) > FILE_SIZE:
            return []
        tree = ast.parse(source)
    except (OSError, SyntaxError, ValueError, RecursionError, MemoryError):
        return []
    specs = []
    name = f"{path.stem.lower()}_spec"
    values = _assigned(tree.body)
    if name in values:
        spec = _old_spec(values[name], values)
        specs += [{**TOOLS_WANT, **one} for one in ([spec] if spec is not None else _ask(path, name))]
    known = {"Component"}
    for node in tree.body:
        if isinstance(node, ast.ClassDef) and any(_is_component(base, known) for base in node.bases):
            known.add(node.name)
            if not node.name.startswith("_"):
                specs.append(_class_spec(node))
    return specs


def _assigned(body: list[ast.stmt]) -> dict[str, ast.expr]:
    values = {}
    for node in body:
        if isinstance(node, ast.Assign) and len(node.targets) == 1 and isinstance(node.targets[0], ast.Name):
            values[node.targets[0].id] = node.value
        elif isinstance(node, ast.AnnAssign) and isinstance(node.target, ast.Name) and node.value is not None:
            values[node.target.id] = node.value
    return values


def _old_spec(node: ast.expr, values: dict[str, ast.expr]) -> dict[str, str] | None:
    """Keys and values of a list of texts, names of other texts of the file among them. None if it is more than that."""
    if not isinstance(node, ast.List | ast.Tuple):
        return None
    texts = []
    for element in node.elts:
        if isinstance(element, ast.Name) and element.id in values:
            element = values[element.id]
        if not isinstance(element, ast.Constant):
            return None
        texts.append(str(element.value))
    return dict(_pairs(texts))


def _pairs(texts: list[str]) -> Iterator[tuple[str, str]]:
    """As many pairs as there are; the list ends with an empty text."""
    for key, value in zip(texts[::2], texts[1::2], strict=False):
        if key:
            yield key.strip(), value.strip()


def _is_component(base: ast.expr, known: set[str]) -> bool:
    """Whether a base is `Component`, or a class of the same file derived from it."""
    return (isinstance(base, ast.Name) and base.id in known) or (
        isinstance(base, ast.Attribute) and base.attr == "Component"
    )


def _class_spec(node: ast.ClassDef) -> dict[str, str]:
    values = _assigned(node.body)
    said = {}
    for key in CLASS_KEYS:
        value = values.get(key)
        if isinstance(value, ast.Constant):
            said[key] = str(value.value)
    name = said.get("type_name") or node.name
    description = said.get("description") or (ast.get_docstring(node) or "").strip().partition("\n")[0]
    return {
        "implementation_id": name,
        "type_name": name,
        **CLASS_DEFAULTS,
        **said,
        "description": description,
    }


def _ask(path: Path, name: str) -> list[dict[str, str]]:
    """Let another process import the file and print the list."""
    command = [sys.executable, "-c", _ASKED, str(path), name]
    try:
        done = subprocess.run(
            command,
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.DEVNULL,
            timeout=ASK_TIME,
        )
        texts = json.loads(done.stdout.rpartition(b"\n")[2] or b"null")
    except (OSError, subprocess.SubprocessError, ValueError):
        return []
    if not isinstance(texts, list):
        return []
    return [dict(_pairs([str(text) for text in texts]))]


_ASKED: Final = """
import json, runpy, sys
path, name = sys.argv[1:]
sys.path.append(path.rpartition("/")[0])
print()
print(json.dumps([str(text) for text in runpy.run_path(path)[name]]), end="", flush=True)
"""
