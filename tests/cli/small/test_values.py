"""Which constants attributes and parameters have."""

import ast

import pytest

from muros.cli._small._values import Knowledge, Values
from tests.cli.small.floors import small_text


def knowledge(text: str = "class A:\n x = y = 0\n") -> Knowledge:
    return Knowledge({"m": ast.parse(text)}, {"open"})


def value(known: Knowledge, text: str, **names: Values) -> Values:
    return known.values(ast.parse(text, mode="eval").body, names)


def test_an_attribute_is_what_it_was_given() -> None:
    known = knowledge()
    assert known.attribute("x") == ()
    known.store("x", (1,))
    known.store("x", (1, True))
    assert known.attribute("x") == (1, True), "equal, but of other types"
    known.store("x", None)
    assert known.attribute("x") is None
    assert known.attribute("open") is None
    assert known.attribute("of_others") is None


def test_too_many_constants_are_anything() -> None:
    known = knowledge()
    for i in range(6):
        known.store("x", (i,))
    assert known.attribute("x") == (0, 1, 2, 3, 4, 5)
    known.store("x", (6,))
    assert known.attribute("x") is None


def test_what_nothing_stores_may_be_anything_once_it_is_given_up() -> None:
    known = knowledge()
    assert not known.give_up()
    assert known.attribute("x") == ()
    assert known.give_up()
    assert known.attribute("x") is None
    assert not known.give_up()


@pytest.mark.parametrize(
    ("text", "found"),
    [
        ("5", (5,)),
        ("-5", (-5,)),
        ("p", (1, 2)),
        ("q", None),
        ("not p", (False,)),
        ("p == 1", (True, False)),
        ("p is None", (False,)),
        ("p < 3", (True,)),
        ("p < 'a'", None),
        ("q and None", None),
        ("None and q", (None,)),
        ("p or q", (1, 2)),
        ("p and q", None),
        ("never == 1", ()),
        ("isinstance(p, int)", (True,)),
        ("hasattr(q, 'x')", (False,)),
        ("hasattr(q, 'open')", None),
        ("getattr(q, 'x', 8)", (8,)),
        ("f(p)", None),
    ],
)
def test_expressions(text: str, found: Values) -> None:
    assert value(knowledge(), text, p=(1, 2), q=None, never=()) == found


def test_constants_of_a_module() -> None:
    known = knowledge("A = 5\nB = 6\nB = 7\nC = [1]\nD = ('a', 1)")
    known.place = "m"
    assert [value(known, name) for name in "ABCD"] == [(5,), None, None, (("a", 1),)]


def test_parameters_are_what_calls_give() -> None:
    text = "def f(a, b=2, *, c=3):\n c = 4\n return a"
    known = knowledge(text)
    function = known.functions["f"][0]
    assert function.place == "m"
    known.give(function.node, "a", (1,))
    known.give(function.node, "b", (2,), explicit=False)
    known.give(function.node, "c", (3,))
    assert known.environment(function.node, {}) == {"a": (1,), "b": (2,), "c": None}
    assert known.is_explicit(function.node, "a")
    assert not known.is_explicit(function.node, "b")
    known.vary(function.node)
    assert known.environment(function.node, {}) == {"a": None, "b": None, "c": None}


PASSES_ON = """
def inner(way, depth=1, kind="one"):
    if kind == "other":
        return "other" * depth
    return way * depth
def outer(*args, **options):
    return inner(*args, **options)
def half(way, **options):
    return inner(way, **options)
"""


@pytest.mark.parametrize(
    "said", ["outer(3, 2)", "outer(3, kind='other')", "half(2, depth=4)", "half(2, kind='other')"]
)
def test_what_is_handed_on(said: str) -> None:
    text = small_text({"m": PASSES_ON}, f"from muros.m import {said[: said.index('(')]}\nprint({said})")
    assert ("other" in text) == ("other" in said)


def test_what_is_handed_on_from_anywhere_may_be_anything() -> None:
    program = "from muros.m import half\nmade = {'kind': 'other'}\nprint(half(2, **made), half(2))"
    assert "other" in small_text({"m": PASSES_ON}, program)
    program = "from muros.m import half\nf = half\nprint(f(2, kind='other'), half(2))"
    assert "other" in small_text({"m": PASSES_ON}, program)


def test_a_default_is_of_its_own_module() -> None:
    modules = {
        "a": "SIZE = 'aa'\ndef f(a, size=SIZE):\n if size == 'aa': return a\n return 5",
        "b": "SIZE = 'bb'\nfrom muros.a import f\ndef g(): return SIZE, f(1)",
    }
    small_text(modules, "from muros.b import g\nprint(g())")


@pytest.mark.parametrize(
    "text",
    [
        "TABLE = (1, 2, 3)\ndef f(a): return a or TABLE",
        "TABLE = (1, 2, 3)\ndef f(a): return True and TABLE",
        "class A:\n kind = 'yes'\ndef f(a):\n A.kind = 5 if a else 6\n return isinstance(A.kind, str)",
        "W = [5]\ndef g(x): return getattr(W, 'other', x)\ndef f(a): return g(1), g(2)",
        "class A:\n def __init__(self): self.kind = 'a rather long string'\ndef f(a): return a or A().kind",
    ],
    ids="or and isinstance getattr attribute".split(),
)
def test_constants_that_stay_are_there(text: str) -> None:
    """What an expression may be is known, and yet it is kept."""
    small_text({"m": text}, "from muros.m import f\nprint(f(0), f(1))")


def test_options_that_nobody_gives_are_none() -> None:
    modules = {
        "m": """
            class A:
                def __init__(self, way, **options):
                    self.way = way
                    if options:
                        self.take(options)
                def take(self, options):
                    self.way = sorted(options)
        """
    }
    assert "options" not in small_text(modules, "from muros.m import A\nprint(A(5).way)")
    small_text(modules, "from muros.m import A\nprint(A(5).way, A(5, high=3).way)")
    small_text(modules, "from muros.m import A\nmake = A\nprint(make(5, high=3).way)")


@pytest.mark.parametrize(
    ("text", "truth"),
    [
        ("x and 0", False),
        ("x or 1", True),
        ("x and 1", None),
        ("x() and 0", None),
        ("0 and x()", False),
        ("not (x and 0)", None),
    ],
)
def test_a_test_that_one_part_decides(text: str, truth: bool | None) -> None:
    assert knowledge().truth(ast.parse(text, mode="eval").body, {"x": None}) is truth


def test_what_packages_hand_on_is_given_what_programs_give() -> None:
    exports = 'PLACES = {"rclc": "way A"}\n'
    modules = {
        "exports": exports,
        "rclc": "from muros.rclc.way import A",
        "rclc.way": "class A:\n def __init__(self, x, by=2):\n  self.x = x * by if by else 'never'",
    }
    text = small_text(modules, "from muros.rclc import A\nprint(A(5).x)")
    assert "never" not in text
    small_text(modules, "from muros.rclc import A\nprint(A(5, 0).x)")
    small_text(modules, "import muros.rclc\nprint([kind(5, 0).x for kind in [muros.rclc.A]])")
