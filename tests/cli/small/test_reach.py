"""What a program reaches: nothing else is there, and all that it reaches does what it did."""

import pytest

from muros.cli._small import small
from tests.cli.small.floors import floor, small_text

WAY = """
class Way:
    def __init__(self, name, depth=10, lossy=False):
        self.name = name
        self.depth = depth
        self.lossy = lossy
    def tell(self):
        if self.lossy:
            return self.guess()
        return self.name * self.depth
    def guess(self):
        return "about " + self.name
def make(**options):
    return Way("a", **options)
def unused():
    return Way("b", lossy=True)
"""


def test_an_option_nobody_says_is_gone() -> None:
    text = small_text({"m": WAY}, "from muros.m import make\nprint(make().tell())")
    assert "about" not in text
    assert "depth" not in text
    assert "* 10" in text


@pytest.mark.parametrize(
    ("said", "there"),
    [
        ("make(lossy=True).tell()", True),
        ("make(depth=2).tell()", False),
        ("make(**{'lossy': True}).tell()", True),
        ("make(lossy=bool(1)).tell()", True),
        ("make(lossy=False).tell()", False),
        ("[one(lossy=True).tell() for one in (make,)]", True),
    ],
)
def test_an_option_that_a_program_says_stays(said: str, there: bool) -> None:
    text = small_text({"m": WAY}, f"from muros.m import make\nprint({said})\nprint(make().tell())")
    assert ("about" in text) == there


def test_what_only_unreached_code_mentions_is_gone() -> None:
    modules = {
        "m": "from muros.far import far\ndef near():\n return 1\ndef further():\n return far()",
        "far": "def far():\n return 'far'",
    }
    assert "far" not in small_text(modules, "from muros.m import near\nprint(near())")
    assert "'far'" in small_text(modules, "from muros.m import further\nprint(further())")


def test_a_programs_own_class_defines_what_the_floor_calls() -> None:
    modules = {"m": "class A:\n def size(self): return 5\n def get(self): return self.size() + 1"}
    program = "from muros.m import A\nclass B(A):\n def size(self): return 6\nprint(A().get(), B().get())"
    small_text(modules, program)


@pytest.mark.parametrize(
    "change",
    [
        "w.limit = 7",
        "w.limit += 2",
        "w.limit, x = 7, 8",
        "w.limit: int = 7",
        "for w.limit in (6, 7): pass",
        "A.limit = 7; w = A()",
        "setattr(w, 'limit', 7)",
        "w = type('B', (A,), {'limit': 7})()",
    ],
)
def test_attributes_that_a_program_stores_vary(change: str) -> None:
    modules = {
        "m": "class A:\n limit = 5\n def get(self):\n  if self.limit == 5: return 'five'\n  return self.limit"
    }
    program = f"from muros.m import A\nw = A()\n{change}\nprint(w.get(), w.limit)"
    assert "limit" in small_text(modules, program)
    assert "limit" not in small_text(modules, "from muros.m import A\nprint(A().get())")


def test_attributes_of_a_programs_own_classes_vary() -> None:
    modules = {"m": "def get(w):\n return w.limit\nclass A:\n limit = 5"}
    small_text(modules, "from muros.m import A, get\nclass B:\n limit = 7\nprint(get(A), get(B))")
    small_text(modules, "from muros.m import A, get\nclass B:\n limit: int = 7\nprint(get(A), get(B))")


def test_names_in_strings_of_getattr_stay() -> None:
    modules = {
        "m": """
            class A:
                def first(self): return 1
                def second(self): return 2
                def third(self): return 3
            def get(a, which):
                return [getattr(a, name)() for name in "first second".split()][which]
        """
    }
    text = small_text(modules, "from muros.m import A, get\nprint(get(A(), 0), getattr(A(), 'third')())")
    assert "def third" in text
    assert "def first" in text
    assert "third" not in small_text(modules, "from muros.m import A, get\nprint(get(A(), 1))")


def test_a_program_in_no_syntax_of_this_python_keeps_every_word() -> None:
    program = "from muros.m import make\nmake(depth=`3`) about lossy unused guess Way name tell"
    made, names = small(floor({"m": WAY}), [program])
    text = made["muros/m.py"].decode()
    for word in ("make", "depth", "lossy", "guess", "unused"):
        assert word in text
        assert word not in names


def test_what_a_program_only_adds_to_is_there() -> None:
    modules = {"m": "class A:\n def __init__(self): self.missed = 5"}
    small_text(modules, "from muros.m import A\na = A()\na.missed += 1\nprint(1)")


@pytest.mark.parametrize("change", ["setattr(a, 'limit', 7)", "a = type('B', (A,), {'limit': 7})()"])
def test_what_a_program_stores_by_a_name_in_a_string_varies(change: str) -> None:
    modules = {"m": "class A:\n def __init__(self): self.limit = 5\n def get(self): return self.limit"}
    modules["m"] += "\nclass C(A):\n limit = 5\n def __init__(self): pass"
    program = change.replace("(A,)", "(C,)")
    small_text(modules, f"from muros.m import A, C\na = A()\n{program}\nprint(a.get())")
