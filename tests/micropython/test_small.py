"""The board floor made small for a program: ``tests/board`` once more on it, and what the pass promises."""

import re
from functools import cache
from pathlib import Path

import pytest

from muros.cli._small import small
from muros.cli._small._names import COMMON, STATIC
from muros.cli._small._program import named_in
from tests.micropython.client_budgets import messages as messages_of
from tests.micropython.gauge import run_gauge
from tests.micropython.runtimes import ROOT, require
from tests.micropython.test_board_tests import _FILES, _functions, _not_on, read_report
from tests.micropython.test_board_tests import messages as messages
from tests.micropython.test_client_budgets import CONNECT, STEADY
from tests.micropython.tree import Tree, board_tree, small_compiled, small_tree, write
from tests.micropython.unix import run_mpy


@pytest.mark.parametrize("path", _FILES, ids=[path.stem for path in _FILES])
def test_on_a_small_board(path: Path, messages: Path, tmp_path: Path, subtests: pytest.Subtests) -> None:
    classes = {file.relative_to(messages).as_posix(): file.read_bytes() for file in messages.rglob("*.py")}
    tests = _with_imports(path)
    tree = small_tree(classes, [content.decode() for content in tests.values()], native=True) | tests
    program = f"from tests.board.harness import run_all\nrun_all('tests.board.{path.stem}')"
    for runtime in {"unix", "gauge"}.difference(_not_on(path)):
        require(runtime)
        if runtime == "unix":
            output = run_mpy(program, library=[write(tree, tmp_path)])
        else:
            output = run_gauge(tree, program)[0].output
        report = read_report(output)
        assert set(report) == _functions(path), f"not every test ran:\n{output}"
        for name, failure in report.items():
            with subtests.test(name, runtime=runtime):
                if failure:
                    pytest.fail(f"on {runtime}: {failure}", pytrace=False)


_OFFERED = """
import builtins
found = set()
def look(what, depth):
    for name in dir(what):
        found.add(name)
        try:
            inner = getattr(what, name)
        except Exception:
            continue
        if depth and type(inner) in (type, type(builtins)):
            look(inner, depth - 1)
look(builtins, 2)
modules = "sys struct array time io os errno binascii json re collections gc micropython uctypes select socket heapq"
for name in (modules + " hashlib math random cmath deflate platform asyncio framebuf vfs termios").split():
    try:
        look(__import__(name), 2)
        found.add(name)
    except ImportError:
        pass
print(" ".join(found))
"""


_NOT_USED = {"Stream", "stream", "run", "cancel", "clock"}
"""Of asyncio and time, which the floor does not use."""


@pytest.mark.parametrize("runtime", ["unix", "gauge"])
def test_new_names_are_the_firmwares_and_its_names_stay(runtime: str) -> None:
    """No name of the floor's that something of the firmware has, too, may change."""
    require(runtime)
    output = run_mpy(_OFFERED) if runtime == "unix" else run_gauge({}, _OFFERED)[0].output
    offered = set(output.split())
    assert set(COMMON) <= offered
    assert not _renamed() & offered - _NOT_USED


@cache
def _renamed() -> frozenset[str]:
    """The names that change where a program uses the whole floor."""
    everything = "\n".join(
        content.decode() for path, content in board_tree().items() if "/__init__" not in path
    )
    _, names = small(board_tree(), ["from muros.client import *\nfrom muros.rclc import *", everything])
    return frozenset(names)


def test_names_that_every_board_has_take_no_room_in_a_compiled_file() -> None:
    require("mpy-cross")
    content = small_compiled({"names.py": "\n".join(f"x.{name}" for name in STATIC).encode()})["names.mpy"]
    assert not [name for name in STATIC if bytes((2 * len(name),)) + name.encode() + b"\0" in content]


def test_a_program_keeps_its_words_and_the_result_is_always_the_same() -> None:
    tree = board_tree()
    program = "from muros.rclc import Context, Executor\nExecutor(Context(way)).spin_some(); way._heard"
    made, names = small(tree, [program])
    assert not {"Context", "Executor", "spin_some", "_heard"} & set(names)
    assert {"SessionCore", "Subscription"} & set(names) == {"SessionCore"}
    assert (made, names) == small(dict(reversed(tree.items())), [program])


def test_what_a_program_names_by_its_path_is_there() -> None:
    for runtime in ("gauge", "mpy-cross"):
        require(runtime)
    program = (
        "from muros.compat import ticks_add, ticks_ms\nfrom muros.client.session import Session\n"
        "from muros.xrce import streams\nimport muros.client.timesync\n"
        "print(Session.__name__, muros.client.timesync.TimeSync.__name__, ticks_add(5, 2), streams.__name__)"
    )
    tree = small_compiled(small_tree({}, [program]))
    assert run_gauge(tree, program)[0].output == "Session TimeSync 7 muros.xrce.streams\n"


def test_a_connected_board_keeps_no_more_than_is_measured() -> None:
    for runtime in ("gauge", "mpy-cross"):
        require(runtime)
    program = CONNECT + STEADY
    extra = messages_of("std_msgs/msg/Int32")
    agent = (ROOT / "tests/board/agent.py").read_bytes()
    tree = small_compiled(small_tree(extra, [program, agent.decode()])) | {"tests/board/agent.py": agent}
    kept = {name for name in run_gauge(tree, program)[0].output.split() if name.startswith("muros")}
    assert kept <= {"muros", "muros.client", "muros.rclc", *named_in(agent.decode())}


def _with_imports(path: Path) -> Tree:
    """A test and the modules of its folder that it uses, as files of a board."""
    found: Tree = {}
    todo = [path.stem, "harness"]
    while todo:
        name = todo.pop()
        file = f"tests/board/{name}.py"
        if file not in found:
            found[file] = (ROOT / file).read_bytes()
            todo += re.findall(r"tests\.board\.(\w+)", found[file].decode())
    return found
