"""Names that stand for more than one thing, where nothing is mistaken for another."""

import ast
from collections.abc import Collection

import pytest

from muros.cli._small._share import share
from muros.cli._small._trees import Modules
from tests.cli.small.floors import run, small_text

COUNTER = """
from muros.compat import const
class Counter:
    def __init__(self, first):
        self.count = first
        self.step = 2
    def move(self, times):
        for _ in range(times):
            self.count = added(self.count, self.step)
        return self.count
def added(value, more):
    return value + more
"""


def shared(
    text: str, kept: Collection[str] = (), asked: Collection[str] = (), others: Modules | None = None
) -> tuple[Modules, dict[str, str]]:
    """Modules after the pass and the pairs of names; the first is ``muros.m``."""
    modules = {"muros.m": ast.parse(text)} | (others or {})
    return modules, share(modules, {}, kept, asked, compiled=True)


def test_a_function_shares_the_name_of_an_attribute_of_its_module() -> None:
    _, pairs = shared("def f():\n return g(1).x\ndef g(y):\n return h(y)\ndef h(z):\n return z")
    assert set(pairs) <= {"f", "g", "h"}
    assert "x" not in pairs
    assert set(pairs.values()) <= {"x"}


def test_each_name_stands_for_one_variable_and_one_attribute() -> None:
    names = "abcdefghijklmnopqrst"
    text = "\n".join(
        f"def {name}(o):\n return o.{name}{name}, {names[i - 1]}" for i, name in enumerate(names)
    )
    modules, pairs = shared(text)
    assert len(set(pairs.values())) == len(pairs)
    said = {node.id for node in ast.walk(modules["muros.m"]) if isinstance(node, ast.Name)}
    assert not set(pairs.values()) & said  # none is a variable's already


@pytest.mark.parametrize(
    ("text", "hidden"),
    [
        ("def f(o):\n return o.x\nx = 3\ndef g():\n return x", {"x"}),
        ("def f(o, **options):\n return o.a\ndef g(o):\n return f(o, a=1)\n", {"a"}),
        (
            "class A:\n lends = 'm'\n __getattr__ = other\ndef other(a, b):\n return 1",
            {"lends", "__getattr__"},
        ),
        ("class A:\n x = 1\n y = other\nother = 2", {"x", "y"}),
        ("class A:\n x = 1\n def f(self, y=other):\n  return y\nother = 2", {"x", "f"}),
        ("class A:\n x = 1\n @other\n def f(self):\n  return 1\ndef other(f):\n return f", {"x", "f"}),
    ],
    ids="variable keyword lent class-body default decorator".split(),
)
def test_names_that_would_hide_each_other_stay_apart(text: str, hidden: set[str]) -> None:
    modules, pairs = shared(text + "\ndef last(o):\n return o.free")
    assert not {pairs.get(name) for name in ("other", "x", "f", "g")} & hidden
    assert "free" in {
        *pairs.values(),
        *(one.arg for one in ast.walk(modules["muros.m"]) if isinstance(one, ast.arg)),
    }


def test_names_by_which_attributes_are_asked_for_and_modules_are_no_variables() -> None:
    text = "def f(o):\n return o.room, o.link\ndef g():\n return f"
    other: Modules = {"muros.link": ast.parse("def h():\n return 1")}
    _, pairs = shared(text, asked={"room"}, others=other)
    assert not {"room", "link"} & set(pairs.values())


def test_what_is_kept_keeps_its_name() -> None:
    modules, pairs = shared("def f(way):\n found = way.x\n return found", kept={"f", "way"})
    assert not pairs
    assert ast.unparse(modules["muros.m"]).startswith("def f(way):")


def test_a_variable_of_an_outer_function_is_the_same_in_inner_ones() -> None:
    text = "def f(o):\n made = [o.x]\n def inner(more):\n  made.append(more)\n  return made\n return inner"
    modules, _ = shared(text)
    for source in (text, ast.unparse(ast.fix_missing_locations(modules["muros.m"]))):
        name = ast.parse(source).body[0].name  # type: ignore[attr-defined]
        program = f"from muros.m import {name}\nclass O: x = 4\nprint({name}(O)(5))"
        assert run({"muros/m.py": source.encode()}, program) == "[4, 5]"


@pytest.mark.parametrize("times", [0, 3])
def test_a_program_does_as_before(times: int) -> None:
    made = small_text({"m": COUNTER}, f"from muros.m import Counter\nprint(Counter(5).move({times}))")
    assert "added" not in made
