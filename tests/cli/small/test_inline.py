"""Functions that are called once become part of their caller, where that changes nothing."""

import ast
from collections.abc import Collection

import pytest

from muros.cli._small._inline import inline
from muros.cli._small._trees import Modules
from tests.cli.small.floors import run, small_text


def inlined(
    text: str, place: str = "muros.m", kept: Collection[str] = "f", named: Collection[str] = ()
) -> str:
    """A module after the pass; it is checked that it does what it did."""
    modules: Modules = {place: ast.parse(text)}
    inline(modules, {}, kept, named)
    return ast.unparse(ast.fix_missing_locations(modules[place]))


@pytest.mark.parametrize(
    "text",
    [
        "def g(x):\n if x: return\n print('g', x)\ndef f(y):\n g(y)",
        "def g(x):\n if x > 1: return x\n return -x\ndef f(y):\n return g(y + 1)",
        "def g(x):\n if x > 1: return x\n return -x\ndef f(y):\n z = g(y)\n return [z]",
        "def g(x):\n return x * 2\ndef f(y):\n return [g(y), 3]",
        "def g(x, by=3):\n return x * by\ndef f(y):\n if g(y) > 3: return 1\n return 2",
        "def g(x, by=3):\n z = x * by\n return z\ndef f(y):\n if y:\n  z = g(by=y, x=2)\n  return z",
        "def g(x):\n raise ValueError(x)\ndef f(y):\n try: g(y)\n except ValueError as e: return str(e)",
        "def g(x):\n print(x)\n return x\ndef f(y):\n g(y)\n return y",
        "def g(x):\n for i in range(x): print(i)\ndef f(y):\n for i in range(2):\n  g(y)\n return i",
    ],
    ids="statement return assignment expression test keywords raise unwanted in-loop".split(),
)
def test_forms_of_calls(text: str) -> None:
    made = inlined(text)
    assert "def g" not in made
    for value in (0, 1, 2):
        program = f"from muros.m import f\nprint(f({value}))"
        assert run({"muros/m.py": made.encode()}, program) == run({"muros/m.py": text.encode()}, program)


def test_a_method_is_put_with_its_object() -> None:
    text = """
class A:
    def __init__(self):
        self.n = 2
    def grow(self, by):
        self.n += by
        return self.n
class B:
    def __init__(self):
        self.a = A()
    def f(self, by):
        got = self.a.grow(by)
        return got, self.a.n
"""
    made = inlined(text)
    assert "grow" not in made
    assert run({"muros/m.py": made.encode()}, "from muros.m import B\nprint(B().f(3))") == "(5, 5)"


@pytest.mark.parametrize(
    ("text", "printed"),
    [
        (
            "def g(x):\n n = x + 1\n x = 0\n return n\ndef f(x):\n n = 7\n m = g(n)\n return n, m, x",
            "(7, 8, 1)",
        ),
        ("N = [5]\ndef g():\n n = N[0]\n return n\ndef f(N):\n y = g()\n return y, N", "(5, 1)"),
        ("N = [5]\ndef g(x):\n return N[x]\ndef f(N):\n return g(0) + N", "6"),
        ("def g(x):\n return x + len('ab')\ndef f(len):\n y = g(len)\n return y", "3"),
    ],
    ids=["variables", "of-the-module", "in-an-expression", "of-python"],
)
def test_names_that_clash(text: str, printed: str) -> None:
    assert run({"muros/m.py": inlined(text).encode()}, "from muros.m import f\nprint(f(1))") == printed


@pytest.mark.parametrize(
    "text",
    [
        "def g(xs):\n for x in xs:\n  if x: return x\ndef f(xs):\n y = g(xs)\n return y",
        "def g(x):\n try: return int(x)\n finally: print(1)\ndef f(x):\n y = g(x)\n return y",
        "def g(x):\n yield x\ndef f(x):\n y = g(x)\n return y",
        "def g(x):\n y = lambda: x\n return y\ndef f(x):\n y = g(x)\n return y",
        "def g(*x):\n return x\ndef f(x):\n y = g(x)\n return y",
        "def g(x):\n return x + x\ndef f(x):\n return [g(print(x))]",
        "def g(x):\n return x\ndef f(x):\n return g(*x)",
        "def g(x):\n return g(x - 1) if x else 0\ndef f(x):\n return [f]",
        "def g(x):\n return x\ndef f(x):\n return g(x) + g(1)",
    ],
    ids="return-in-loop return-in-try yield lambda stars work-twice star-call recursion twice".split(),
)
def test_what_stays_a_function(text: str) -> None:
    assert "def g" in inlined(text)


def test_what_a_program_says_stays() -> None:
    text = "def g(x):\n return x\ndef f(x):\n return [g(x)]"
    assert "def g" not in inlined(text)
    assert "def g" in inlined(text, named={"muros.m"}, kept=frozenset({"f", "g"}))
    assert "def g" not in inlined(text, named={"muros.m"})


def test_a_method_named_as_one_of_lists_stays() -> None:
    """Nothing tells whose method is called."""
    floor = {
        "m": """
            class Way:
                def insert(self, at, what):
                    print(at, what)
            class Other(Way):
                pass
            def f(found):
                found.insert(0, 5)
                return found
        """
    }
    small_text(floor, "from muros.m import f, Other\nprint(f([1]), Other.__name__)")


def test_a_frame_stays_on_the_stack_of_what_runs_for_each_message() -> None:
    names = "abcdefghi"
    sums = "\n".join(f" {name} = x + {i}" for i, name in enumerate(names))
    text = f"def g(x):\n{sums}\n return {' + '.join(names)}\ndef f(y):\n z = g(y)\n return z + y"
    assert "def g" not in inlined(text, "muros.link")
    assert "def g" in inlined(text, "muros"), "11 words are too few for both"
    assert "def g" not in inlined(text.replace(sums, " a = x").replace(" + ".join(names), "a"), "muros")
