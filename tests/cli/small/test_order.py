"""The names that a large module says most have the lowest numbers in its compiled file."""

import ast

from muros.cli._small._order import order
from tests.cli.small.floors import run
from tests.micropython.runtimes import require
from tests.micropython.tree import small_compiled

FEW = "def f(x):\n    return x.a"


def many() -> str:
    """A module of 300 names, the last of which are said most."""
    names = [f"name{i}" for i in range(300)]
    often = "\n".join(f"    x.{name} = x.{name} + x.{name}" for name in names[200:])
    return f"def f(x):\n    x.{'.'.join(names)}\n{often}\n    return 5"


def ordered(text: str) -> str:
    tree = ast.parse(text)
    order(tree)
    return ast.unparse(ast.fix_missing_locations(tree))


def test_a_module_of_few_names_stays() -> None:
    assert ordered(FEW) == FEW


def test_a_large_module_is_smaller_and_does_the_same() -> None:
    require("mpy-cross")
    before, after = (
        len(small_compiled({"m.py": text.encode()})["m.mpy"]) for text in (many(), ordered(many()))
    )
    assert before - after > 250  # 300 mentions take a byte less, 70 names a byte more
    program = "from muros.m import f\nprint(1)"
    assert run({"muros/m.py": ordered(many()).encode()}, program) == "1"
