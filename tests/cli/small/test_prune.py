"""What has no effect, or cannot be, is taken out."""

import pytest

from tests.cli.small.floors import small_text


def test_a_counter_that_nobody_reads_is_gone() -> None:
    modules = {
        "m": """
            class A:
                def __init__(self):
                    self.count = 0
                    self.seen = 0
                def tell(self, what):
                    self.count += 1
                    self.seen += len(what)
                    return what
        """
    }
    text = small_text(modules, "from muros.m import A\na = A()\nprint(a.tell('b'), a.seen)")
    assert "count" not in text
    assert "seen" in text
    assert "count" in small_text(
        modules, "from muros.m import A\na = A()\na.tell('b')\nprint(a.count, a.seen)"
    )


def test_what_a_dead_store_does_is_still_done() -> None:
    modules = {"m": "class A:\n def f(self):\n  self.last = print('done')"}
    text = small_text(modules, "from muros.m import A\nA().f()")
    assert "last" not in text
    assert "print('done')" in text


IDLE = {
    "m": """
        class A:
            def changed(self, x):
                pass
            def work(self, x):
                self.changed(x + 1)
                return x
    """
}


def test_idle_calls_are_gone() -> None:
    assert "changed" not in small_text(IDLE, "from muros.m import A\nprint(A().work(1))")


@pytest.mark.parametrize(
    "program",
    [
        "class B(A):\n def changed(self, x): print(x)\nb = B()",
        "b = A(); b.changed = print",
        "def tell(self, x): print(x)\nclass B(A):\n changed = tell\nb = B()",
    ],
)
def test_what_a_program_hooks_in_is_called(program: str) -> None:
    small_text(IDLE, f"from muros.m import A\n{program}\nprint(b.work(1))")


def test_methods_of_lists_are_called_though_one_of_that_name_is_idle() -> None:
    modules = {"m": "class A:\n def sort(self): pass\ndef f(x):\n x.sort()\n return x"}
    small_text(modules, "from muros.m import A, f\nprint(f([2, 1]), A.__name__)")


@pytest.mark.parametrize(
    ("body", "gone"),
    [
        ("if a.on: return 'gone'\n return 1", "gone"),
        ("return 'gone' if a.on else 1", "gone"),
        ("while a.on: return 'gone'\n return 1", "gone"),
        ("while a.on: return 'gone'\n else: return 1", "gone"),
        ("if not a.on: return 1\n return 'gone'", ""),
        ("return 1\n print('gone')", "gone"),
        ("if a.on: x = 'gone'\n else: x = 1\n return x", "gone"),
        ("try:\n  if a.on: return 'gone'\n finally: print(1)\n return 1", "gone"),
        ("x = [1, 2]\n return x", "x ="),
        ("n = N\n return n[0]", "n = "),
    ],
)
def test_branches_and_ends(body: str, gone: str) -> None:
    text = small_text(
        {"m": f"N = [5]\nclass A:\n on = False\ndef f(a):\n {body}"},
        "from muros.m import A, f\nprint(f(A()))",
    )
    assert not gone or gone not in text


def test_parameters_that_are_always_the_same_are_gone() -> None:
    modules = {"m": "def g(x, by=2, *, more=3):\n return x * by + more\ndef f(x):\n return [g(x), g(1)]"}
    text = small_text(modules, "from muros.m import f\nprint(f(5))")
    assert "* 2 + 3" in text


def test_a_default_that_every_call_gives_is_gone() -> None:
    modules = {"m": "def g(x, by=2):\n return x * by\ndef f(x):\n return [g(x, x), g(1, 4)]"}
    assert "by=2" not in small_text(modules, "from muros.m import f\nprint(f(5))")


@pytest.mark.parametrize(
    "body",
    [
        "return [g(x, 3), g(x)]",
        "def g(x, by=2): return x * by\n return [g(x, 3), g(x)]",
        "work = lambda x, by=2: g(x, by)\n return [work(x), work(x, 4), g(x, 3)]",
        "from muros.n import A\n return [A(x).by, B(x, 3).by]",
        "return [h(*[x]), g(x, 3), g(*[x])]",
    ],
    ids="left-out inner lambda imported-within star".split(),
)
def test_a_default_that_somebody_needs_stays(body: str) -> None:
    modules = {
        "n": "class A:\n def __init__(self, x, by=2): self.by = x * by",
        "m": f"""
            from muros.n import A as B
            def g(x, by=2): return x * by
            def h(x, by=3): return g(x, by)
            def f(x):
             {body.replace(chr(10), chr(10) + "            ")}
        """,
    }
    small_text(modules, "from muros.m import f\nprint(f(5))")


LENDING = """
def lend(owner, module, name):
    method = getattr(__import__(module, None, None, ("*",)), name)
    return lambda *given: method(owner, *given)
class A:
    lends = "muros.m"
    def __getattr__(self, name):
        return lend(self, self.lends, name)
"""


def test_nothing_is_looked_for_where_nothing_is_left() -> None:
    modules = {"a": LENDING, "m": "def grow(self, by):\n self.n = by\n return by"}
    assert "muros.m" in small_text(modules, "from muros.a import A\nprint(A().grow(5))")
    assert "muros.m" not in small_text(modules, "from muros.a import A\nprint(A.__name__)")


def test_a_constant_is_known_not_to_have_what_objects_have() -> None:
    modules = {
        "m": """
            class A:
                def __init__(self):
                    self.age = 3
            def f(x):
                return age(x) + age("young")
            def age(x):
                return getattr(x, "age", 0)
            def g(x="old"):
                return getattr(x, "age", 7)
        """
    }
    text = small_text(modules, "from muros.m import A, f, g\nprint(f(A()), g())")
    assert "7" in text
    assert text.count("getattr") == 1
