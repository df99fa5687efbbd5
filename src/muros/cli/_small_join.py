"""Modules that a program keeps in memory all the time, joined into the package ``muros``: see ``_small``."""

from __future__ import annotations

import ast
import re
from collections.abc import Collection

Modules = dict[str, ast.Module]
"""Syntax trees by module, named with dots."""

HOME = "muros"
_MOVED, _TO = "muros.xrce.", "muros.xrce_"
_PACKAGES = ("client", "rclc")
_WAYS = r"\bmuros\.(client|rclc)\b"
_SERIAL = r"\b(Serial|Uart|framing)\b"
_CALLED = r"\.%s\("

RESIDENT: tuple[tuple[str, str], ...] = (
    ("muros.compat", ""),
    ("muros.xrce.streams", _WAYS),
    ("muros.xrce.session", _WAYS),
    ("muros.client.session", _WAYS),
    ("muros.xrce._codec", _SERIAL),
    ("muros.xrce.serial", _SERIAL),
    ("muros.client.custom", r"\bCustom\b"),
    ("muros.client.stream", r"\b(Udp|Tcp)\b"),
    ("muros.client.udp", r"\bUdp\b"),
    ("muros.rclc.context", r"\bmuros\.rclc\b"),
    ("muros.rclc.executor", r"\bExecutor\b"),
    ("muros.rclc.subscription", _CALLED % "subscription"),
    ("muros.rclc.timer", _CALLED % "timer"),
    ("muros.client.services", _CALLED % "(service|client)"),
    ("muros.rclc.service", _CALLED % "service"),
    ("muros.rclc.client", _CALLED % "client"),
    ("muros.client.timesync", r"\bTimeSync\b"),
)
"""Modules in the order of their need, and what a program says that keeps the module while it is connected."""

_PLAIN = "muros.xrce._codec"  # not needed where native code does the same

OF_MESSAGES = ("muros.cdr", "muros.cdr_texts", "muros.cdr_lists", "muros.cdr_rows")
"""Modules that are kept when a message class imports them."""

BORROWED = """
muros.client.start muros.xrce.beginning muros.xrce.inputs muros.xrce.outputs muros.xrce.requests muros.xrce.resetting
muros.client.chance muros.rclc.contexts muros.rclc.node muros.client.names muros.client.methods muros.client.making
muros.client.qos muros.client.link muros.client.hello muros.client.creating muros.client.entities muros.xrce.create
muros.client.requests muros.rclc.handles muros.exports
""".split()
"""What every program borrows while it makes and connects."""


def join(
    modules: Modules, messages: Modules, native: Collection[str], program: str, words: Collection[str]
) -> Modules:
    """The modules, fewer; ``messages`` find them where they are then, and so do modules find ``native`` ones.

    Modules that the program names by their path stay where they are, or hand on what they had. ``words`` are the
    program's.
    """
    named = named_in(program)
    members = _members(modules, messages, program, words, _PLAIN if native else "")
    places = dict.fromkeys(members, HOME)
    for name in (*modules, *native):
        if name.startswith(_MOVED) and name not in members and (name not in named or name in native):
            places[name] = moved(name)
    had = {member: _defined(modules[member]) | _imported(modules[member]) for member in members}
    out = {places.get(name, name): tree for name, tree in modules.items() if name not in members}
    if not any(name.startswith(_MOVED) for name in out):
        out.pop("muros.xrce", None)
    for member in members:
        out[HOME].body += modules[member].body
    for tree in (*out.values(), *messages.values()):
        _Imports(modules, places, tree is out[HOME]).visit(tree)
    out[HOME].body = _once(out[HOME].body)
    for package in _PACKAGES:
        shown = _public(modules, package, members)
        if shown:
            body = out[f"muros.{package}"].body
            out[f"muros.{package}"].body = _together([_import(shown), *body])
    for member in members:
        if member in named:
            handed = sorted(had[member] & set(words))
            out[member] = ast.Module([_import(handed)] if handed else [], [])
    return out


def moved(name: str) -> str:
    """Where a module is, unless it stayed or was joined."""
    return _TO + name.removeprefix(_MOVED) if name.startswith(_MOVED) else name


def named_in(text: str) -> set[str]:
    """What a program may name by its path: whatever stands behind ``muros``, with dots or with ``import``."""
    found = set(re.findall(r"\bmuros(?:\.\w+)+", text))
    for package, names in re.findall(r"\bfrom\s+(muros[.\w]*)\s+import\s+(\([^)]*\)|[^\n]*)", text):
        found.update(f"{package}.{name}" for name in re.findall(r"\w+", names))
    return found


def _members(
    modules: Modules, messages: Modules, program: str, words: Collection[str], without: str
) -> list[str]:
    """What joins: all that a member imports at its top has joined before, and no two have a name in common."""
    asked = set[str]().union(*map(_needed, messages.values()))
    asked.update(*(_needed(modules[name]) for name in OF_MESSAGES if name in asked and name in modules))
    candidates = [name for name, sign in RESIDENT if re.search(sign, program)]
    candidates[1:1] = [name for name in OF_MESSAGES if name in asked]
    members: list[str] = []
    taken: set[str] = set()
    for name in candidates:
        if name not in modules or name == without:
            continue
        tree = modules[name]
        if not _needed(tree) <= set(members):
            continue
        for clash in sorted(_defined(tree) & taken):
            if clash[0] == "_" and clash not in words:
                _rename(tree, clash, f"{clash}_{len(members)}")
        if _defined(tree) & taken:
            continue
        members.append(name)
        taken |= _defined(tree)
    return members


def _needed(tree: ast.Module) -> set[str]:
    """The modules of muros that a module imports at its top."""
    places = (str(node.module) for node in tree.body if isinstance(node, ast.ImportFrom))
    return {place for place in places if place.startswith("muros")}


def _defined(tree: ast.Module) -> set[str]:
    """What a module defines at its top, without what it imports."""
    names: set[str] = set()
    for node in tree.body:
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            names.add(node.name)
        elif isinstance(node, ast.Assign):
            names.update(target.id for target in node.targets if isinstance(target, ast.Name))
    return names


def _imported(tree: ast.Module) -> set[str]:
    return {
        one.asname or one.name for node in tree.body if isinstance(node, ast.ImportFrom) for one in node.names
    }


def _rename(tree: ast.Module, old: str, new: str) -> None:
    for node in ast.walk(tree):
        if isinstance(node, ast.Name) and node.id == old:
            node.id = new
        elif isinstance(node, ast.FunctionDef | ast.ClassDef) and node.name == old and node in tree.body:
            node.name = new


class _Imports(ast.NodeTransformer):
    """Imports from where modules are now."""

    def __init__(self, modules: Modules, places: dict[str, str], home: bool) -> None:
        self._modules = modules
        self._places = places
        self._home = home

    def visit_ImportFrom(self, node: ast.ImportFrom) -> ast.AST | list[ast.stmt] | None:
        place = str(node.module)
        out: list[ast.stmt] = []
        for one in node.names:
            whole = f"{place}.{one.name}"
            if whole in self._modules:
                above, _, name = self._places.get(whole, whole).rpartition(".")
                shown = one.asname or one.name
                if above:
                    out.append(ast.ImportFrom(above, [ast.alias(name, shown if shown != name else None)], 0))
                else:
                    out.append(ast.Import([ast.alias(name, shown)]))
            elif place not in self._places:
                out.append(ast.ImportFrom(place, [one], 0))
            elif not self._home or self._places[place] != HOME:
                out.append(ast.ImportFrom(self._places[place], [one], 0))
        return _together(out) or ast.Pass()

    def visit_Constant(self, node: ast.Constant) -> ast.AST:
        if isinstance(node.value, str) and node.value in self._places:
            return ast.Constant(self._places[node.value])
        return node


def _together(imports: list[ast.stmt]) -> list[ast.stmt]:
    out: list[ast.stmt] = []
    for one in imports:
        last = out[-1] if out else None
        if isinstance(one, ast.ImportFrom) and isinstance(last, ast.ImportFrom) and last.module == one.module:
            last.names += one.names
        else:
            out.append(one)
    return out


def _once(body: list[ast.stmt]) -> list[ast.stmt]:
    """A module's statements, imports first and each of them once."""
    imports: dict[str, ast.stmt] = {}
    others: list[ast.stmt] = []
    for node in body:
        if isinstance(node, ast.Import | ast.ImportFrom):
            imports.setdefault(ast.unparse(node), node)
        elif not isinstance(node, ast.Pass):
            others.append(node)
    return [*imports.values(), *others]


def _public(modules: Modules, package: str, members: Collection[str]) -> list[str]:
    """The public names of a package that are in members; the list is that of ``muros.exports``."""
    lists = [
        node.value
        for node in (modules["muros.exports"].body if "muros.exports" in modules else [])
        if isinstance(node, ast.Assign)
        and isinstance(node.targets[0], ast.Name)
        and node.targets[0].id == "PLACES"
    ]
    if not lists or f"muros.{package}" not in modules:
        return []
    found: list[str] = []
    for line in ast.literal_eval(lists[0])[package].splitlines():
        place, *names = line.split() or [""]
        if f"muros.{package}.{place}" in members:
            found += names
    return found


def _import(names: list[str]) -> ast.stmt:
    return ast.ImportFrom(HOME, [ast.alias(name) for name in names], 0)
