"""The board floor made small for one program: the same modules, with shorter names and fewer files.

A board keeps every name of its code in memory, about 20 bytes each, and no collector frees them; a module takes some
300 bytes beside its code. ``small`` rewrites the syntax trees of the floor for a program that it can read:

- What the program does not reach goes, with the options that it does not say, docstrings and annotations.
- Modules that are needed at the same time are joined, functions that are called once become part of their caller.
- A name of the floor's own that the program does not say becomes one that every firmware has anyway, ``pow`` or
  ``KeyError``. One map holds for all modules, and two attributes never become one, nor do two variables that meet.

Kept are: words of the program; names in strings of the floor, as for ``getattr``; names of messages; what firmware
offers. So a program that says what it uses runs unchanged. What it does not say it cannot find.
"""

from __future__ import annotations

import ast
from collections.abc import Iterable

from muros.cli._floor import Tree, is_native
from muros.cli._small._bundles import HOME
from muros.cli._small._exports import find_exports
from muros.cli._small._inline import inline
from muros.cli._small._join import join, moved
from muros.cli._small._names import COMMON, OFFERED, STATIC
from muros.cli._small._order import order
from muros.cli._small._program import Programs
from muros.cli._small._prune import prune, unlend
from muros.cli._small._reach import Reach
from muros.cli._small._rename import Renamer, import_near, own, shortened, strings
from muros.cli._small._share import share
from muros.cli._small._strip import strip
from muros.cli._small._tidy import tidy
from muros.cli._small._trees import Modules, defined, identifiers

_PACKAGE = "/__init__.py"
_PASSES = 3  # what nobody reads any more is known after the first
_ROUNDS = 2  # what is shorter then may be put in its place
_FIRMWARE = OFFERED.union(STATIC, COMMON)


def small(tree: Tree, programs: Iterable[str], most: int | None = None) -> tuple[Tree, dict[str, str]]:
    """The tree for these programs, given as texts, and the new name of each that is renamed.

    ``tree`` holds sources: the board floor, and message classes, whose own names stay. Native modules stay as they are.
    ``most`` bounds the text of joined modules, in characters, for boards that compile them, which takes 10 to 20 bytes
    of heap for each. Raises SyntaxError for a source that is not Python.
    """
    said = Programs(programs)
    floor: Modules = {}
    messages: Modules = {}
    rest: Tree = {}
    packages = set()
    for path, content in tree.items():
        if not path.endswith(".py") or is_native(content):
            rest[path] = content
            continue
        name = path.removesuffix(_PACKAGE).removesuffix(".py").replace("/", ".")
        packages.update([name] if path.endswith(_PACKAGE) else [])
        (floor if name.split(".")[0] == HOME else messages)[name] = ast.parse(content)
    native = {path.removesuffix(".py").replace("/", "."): path for path in rest if path.endswith(".py")}
    of_native = set[str]().union(*(defined(ast.parse(rest[path])) for path in native.values()))
    for name, path in native.items():
        rest[moved(name).replace(".", "/") + ".py"] = rest.pop(path)
    floor = {name: strip(node, {*native, *floor}) for name, node in floor.items()}
    floor = _reached(floor, messages, of_native, said)
    asked = strings([*floor.values(), *messages.values()], {*floor, *native})
    kept = said.shown | OFFERED | of_native | asked | own(messages)
    modules = join(floor, messages, native, said, most)
    for _ in range(_ROUNDS):
        inline(modules, messages, kept, said.named)
        tidy(modules)
    pairs = share(modules, messages, kept, asked, compiled=most is None)
    used = identifiers(*modules.values(), *messages.values()) | kept
    names = shortened(modules, kept | set(pairs), used)
    names |= {name: names.get(other, other) for name, other in pairs.items()}
    out = dict(rest)
    for name, node in (modules | messages).items():
        Renamer(names, {*modules, *native}).visit(node)
        import_near(node, name if name in packages else name.rpartition(".")[0])
        if most is None and name in modules:
            order(node)
        ast.fix_missing_locations(node)
        path = name.replace(".", "/") + (_PACKAGE if name in packages else ".py")
        out[path] = ast.unparse(node).encode()
    return out, dict(sorted(names.items()))


def _reached(floor: Modules, messages: Modules, of_native: set[str], said: Programs) -> Modules:
    """What the programs reach; each pass knows what the one before has left."""
    find_exports(floor, said.asked)
    readers = [*messages.values(), *said.trees]
    foreign = said.defines() | of_native | (_FIRMWARE - {"close", "send"}) | identifiers(*messages.values())
    for _ in range(_PASSES):
        reach = Reach(floor, said.hidden | of_native | _FIRMWARE, said.hidden | of_native)
        reach.find({HOME, *said.named}, readers)
        floor = prune(floor, reach, foreign)
        unlend(floor)
    return floor
