"""Modules become one, and whoever refers to them finds everything."""

import ast
import textwrap

import pytest

from muros.cli._small import small
from muros.cli._small._exports import find_exports, import_exports
from muros.cli._small._join import join
from muros.cli._small._program import Programs
from muros.cli._small._trees import Modules
from tests.cli.small.floors import COMPAT, floor, run, small_text

LINK = {
    "client.hello": "def start(): return limit() + 1\ndef limit(): return 5",
    "client.link": """
        from muros.compat import borrow
        from muros.client.hello import limit as most
        def limit(): return 7
        def go(): return borrow("muros.client.hello").start(), limit(), most()
    """,
    "use": "from muros.compat import borrow\ndef go(): return borrow('muros.client.link').go()",
}
PROGRAM = "from muros.use import go\nprint(go())"


def joined(modules: dict[str, str], program: str) -> Modules:
    trees = {f"muros.{name}": ast.parse(textwrap.dedent(text)) for name, text in modules.items()}
    trees |= {"muros": ast.parse(""), "muros.compat": ast.parse(COMPAT)}
    return join(trees, {}, (), Programs([program]))


def test_modules_that_are_borrowed_together_are_one_and_what_clashes_is_renamed() -> None:
    small_text(LINK, PROGRAM)
    made = joined(LINK, PROGRAM)
    assert "muros.link" in made
    assert not {"muros.client.hello", "muros.client.link", "muros.compat"} & set(made)
    names = [node.name for node in made["muros.link"].body if isinstance(node, ast.FunctionDef)]
    assert len(names) == len(set(names)) == 4
    assert sum(name.startswith("limit") for name in names) == 2


def test_a_variable_named_as_what_clashes_stays() -> None:
    modules = LINK | {
        "client.hello": "def start(): return more(2)\ndef more(limit): return limit\ndef limit(): return 5"
    }
    small_text(modules, PROGRAM)


def test_a_module_whose_functions_are_taken_by_their_names_does_not_join_when_they_clash() -> None:
    modules = LINK | {
        "use": """
            from muros.compat import borrow
            def any(i): return getattr(borrow("muros.client.link"), ("limit", "go")[i])()
            def go(): return any(0), borrow("muros.client.link").go()
        """
    }
    assert "muros.client.link" in joined(modules, PROGRAM)
    small_text(modules, PROGRAM)


def test_modules_that_a_program_names_by_their_path_stay() -> None:
    program = "from muros.client.link import go\nfrom muros.compat import MPY\nimport muros.client.hello\n"
    program += "print(go(), MPY)"
    made = joined(LINK, program)
    assert {"muros.client.link", "muros.client.hello"} <= set(made)
    assert ast.unparse(made["muros.compat"]) == "from muros import MPY", "it hands on what the program says"
    small_text(LINK, program)


def test_a_module_that_is_a_value_stays() -> None:
    modules = LINK | {
        "use": "from muros.client import hello\ndef give(x): return x\ndef go(): return give(hello).start()"
    }
    assert "muros.client.hello" in joined(modules, PROGRAM)
    small_text(modules, PROGRAM)


EXPORTS = {
    "exports": "PLACES = {'client': 'way Way Other Third\\n*far Far'}",
    "client": "from muros.compat import borrow",
    "client.way": "class Way: pass\nclass Other: pass\nclass Third: pass",
    "client.far": "def Far(): return 8",
}


def test_only_said_names_are_found() -> None:
    program = "from muros.client import Way, Far\nprint(Way.__name__, Far())"
    made, _ = small(floor(EXPORTS), [program])
    assert run(made, program) == "Way 8"
    assert "Error" in run(made, "from muros.client import Other")
    assert b"Third" not in b"".join(made.values())


@pytest.mark.parametrize(
    "program", ["import muros.client\nmuros.client.Other", "from muros import client\nclient.Other"]
)
def test_who_has_the_package_as_a_whole_finds_all_that_it_says(program: str) -> None:
    made, _ = small(floor(EXPORTS), [program])
    assert run(made, f"{program}\nprint(5)") == "5"


def test_names_of_what_is_in_memory_are_imported() -> None:
    trees = {f"muros.{name}": ast.parse(text) for name, text in EXPORTS.items()}
    find_exports(trees, lambda package: {"Way", "Other"})
    import_exports(trees["muros.client"], {"Way"}, "muros")
    text = ast.unparse(trees["muros.client"])
    assert "from muros import Way" in text
    assert "'Way'" not in text
    assert "'Other'" in text
    import_exports(trees["muros.client"], {"Other"}, "muros")
    assert "__getattr__" not in ast.unparse(trees["muros.client"])
