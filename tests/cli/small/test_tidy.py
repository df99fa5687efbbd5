"""Functions are tidied, and do what they did, in the order in which they did it."""

import ast

import pytest

from muros.cli._small._tidy import tidy
from muros.cli._small._trees import Modules
from tests.cli.small.floors import run


def tidied(text: str) -> str:
    """A module after the pass; ``f`` is checked to give what it gave, with all that it says on the way."""
    modules: Modules = {"muros.m": ast.parse(text)}
    tidy(modules)
    made = ast.unparse(ast.fix_missing_locations(modules["muros.m"]))
    for value in (0, 1, 2):
        program = f"from muros.m import f\nprint(f({value}))"
        before = run({"muros/m.py": text.encode()}, program)
        assert run({"muros/m.py": made.encode()}, program) == before, made
    return made


@pytest.mark.parametrize(
    ("text", "left"),
    [
        ("if 129 < 128:\n  x = 5\n return x", "return x"),
        ("if x and 0:\n  return 5\n return x", "return x"),
        ("if x or not 0:\n  return 5\n return x", "return 5\n    return x"),
        ("if 1 and x:\n  return 5", "if x:\n        return 5"),
        ("return 5 if 'a' == 'b' else x", "return x"),
        ("for one in [x]:\n  pass\n return x", "return x"),
        ("not print(x)", "print(x)"),
        ("y = x\n return y + y", "return x + x"),
        ("y = x + 1\n return [y]", "return [x + 1]"),
        ("y = str(x)\n if y == '1':\n  return 3", "if str(x) == '1':\n        return 3"),
    ],
)
def test_what_is_left(text: str, left: str) -> None:
    assert tidied(f"def f(x):\n {text}") == f"def f(x):\n    {left}"


@pytest.mark.parametrize(
    "text",
    [
        "if print(x) and 0:\n  return 5\n return x",
        "y = print(x)\n return [print(2), y]",
        "y = [x]\n z = y\n y = 3\n return z, y",
        "y = x\n x = 3\n return y",
        "for i in range(3):\n  y = x\n  x = i\n  print(y)",
        "y = print(x)\n while y is None:\n  return 3",
        "y = str(x)\n return [lambda: y][0]()",
        "y = x\n return (lambda x: [x, y])(7)",
        "y = [x].pop()\n return print(1) or y",
        "y = str(x)\n for i in range(2):\n  print(y)",
        "if x:\n  y = 5\n  return y + y\n y = 2\n return y",
    ],
    ids="effect order changed argument loop while captured hidden before-a-call in-a-loop twice".split(),
)
def test_what_matters_stays(text: str) -> None:
    assert tidied(f"def f(x):\n {text}") == ast.unparse(ast.parse(f"def f(x):\n {text}"))
