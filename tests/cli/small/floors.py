"""Tiny board floors for the tests of this folder: made small for a program, and run with it before and after.

A floor is written as ``{"client.session": source, ...}``, without ``muros.`` in front; packages are made where they are
needed, and ``muros.compat`` has ``borrow`` and ``const``.
"""

import builtins
import textwrap
from collections.abc import Mapping
from types import ModuleType
from typing import Any

from muros.cli._floor import Tree
from muros.cli._small import small

COMPAT = """
MPY = True
def const(value):
    return value
def borrow(name):
    return __import__(name, None, None, ("*",))
"""


def floor(modules: Mapping[str, str]) -> Tree:
    """The files of a floor with these modules."""
    texts = {"compat": COMPAT} | {name: textwrap.dedent(text) for name, text in modules.items()}
    packages = {"", *(name.rpartition(".")[0] for name in texts)}
    tree: Tree = {}
    for package in packages:
        folder = "/".join(["muros", *package.split(".")]).rstrip("/")
        tree[f"{folder}/__init__.py"] = texts.pop(package, "").encode()
    for name, text in texts.items():
        tree[f"muros/{name.replace('.', '/')}.py"] = text.encode()
    return tree


def run(tree: Tree, program: str) -> str:
    """What a program prints that imports from a tree: there are no other modules. Errors are printed by their type."""
    out: list[str] = []
    modules: dict[str, ModuleType] = {}

    def load(name: str) -> ModuleType:
        if name in modules:
            return modules[name]
        above, _, last = name.rpartition(".")
        if above:
            load(above)
        path = name.replace(".", "/")
        source = tree.get(f"{path}.py", tree.get(f"{path}/__init__.py"))
        if source is None:
            if not any(file.startswith(f"{path}/") for file in tree):
                raise ImportError(name)
            source = b""  # MicroPython takes any folder for a package
        modules[name] = module = made(name)
        exec(compile(source, path, "exec"), module.__dict__)
        if above:
            setattr(modules[above], last, module)
        return module

    def find(name: str, given: Any = None, local: Any = None, parts: Any = (), level: int = 0) -> ModuleType:
        if level:  # from a module's package, or from those above
            above = given["__name__"].split(".")
            is_module = f"{'/'.join(above)}.py" in tree
            name = ".".join([*above[: len(above) - level + (not is_module)], *filter(None, [name])])
        module = load(name)
        for part in parts or ():
            if not hasattr(module, part) and part != "*":
                load(f"{name}.{part}")
        return module if parts else modules[name.split(".")[0]]

    def made(name: str) -> ModuleType:
        module = ModuleType(name)
        own = vars(builtins) | {
            "__import__": find,
            "print": lambda *words: out.append(" ".join(map(str, words))),
        }
        module.__dict__["__builtins__"] = own
        return module

    try:
        exec(compile(textwrap.dedent(program), "main", "exec"), made("__main__").__dict__)
    except Exception as error:
        out.append(f"{type(error).__name__}: {error}")
    return "\n".join(out)


def small_text(modules: Mapping[str, str], program: str) -> str:
    """All sources of a floor that was made small for a program which runs as it did before."""
    tree, program = floor(modules), textwrap.dedent(program)
    made, _ = small(tree, [program])
    before, after = run(tree, program), run(made, program)
    assert "Error" not in before, before
    assert after == before, "\n".join(f"# {path}\n{text.decode()}" for path, text in made.items())
    return "\n".join(text.decode() for text in made.values())
