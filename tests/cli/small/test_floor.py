"""What holds for the real floor, whatever program it is made small for."""

import ast
import builtins
import re
import symtable
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

from muros.cli._floor import Tree, is_native
from muros.cli._small import small
from muros.interfaces import board
from muros.links import UdpLink
from tests.client.agent_thread import RunningAgent
from tests.micropython.runtimes import ROOT, require
from tests.micropython.tree import board_tree, small_compiled, write
from tests.micropython.unix import run_mpy

PUBLISHER = """
from muros.client import Udp
from muros.rclc import Context, Executor
from std_msgs.msg import Int32
context = Context(Udp("192.168.1.10", 8888))
node = context.node("board")
publisher = node.publisher(Int32, "number")
message = Int32()
def tell():
    message.data += 1
    publisher.publish(message)
node.timer(1.0, tell)
Executor(context).spin()
"""
FIRMWARE = {"__name__", "__file__", "__path__"}.union(dir(builtins))


@cache
def sources() -> Tree:
    """The floor and a class of messages."""
    made = board.sources(["std_msgs/msg/Int32", "std_msgs/msg/String"], True)
    floor = {path: text for path, text in board_tree().items() if not is_native(text)}
    return floor | {path: text.encode() for path, text in made.items()}


@cache
def publisher() -> tuple[Tree, dict[str, str]]:
    return small(dict(sources()), [PUBLISHER])


def test_the_order_of_files_makes_no_difference() -> None:
    assert small(dict(reversed(sources().items())), [PUBLISHER]) == publisher()


def test_modules_compile_and_every_name_is_there() -> None:
    tree, _ = publisher()
    names = {}
    for path, text in tree.items():
        compile(text, path, "exec")
        table = symtable.symtable(text.decode(), path, "exec")
        own = {one.get_name() for one in table.get_symbols() if one.is_assigned() or one.is_imported()}
        names[path.removesuffix(".py").removesuffix("/__init__").replace("/", ".")] = own
        assert not set(_globals(table)) - own - FIRMWARE, path
    for path, text in tree.items():
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("muros"):
                for one in node.names:
                    whole = f"{node.module}.{one.name}"
                    assert whole in names or one.name in names[str(node.module)] | {"*"}, (path, whole)
            elif isinstance(node, ast.Constant) and re.fullmatch(r"muros(\.\w+)+", str(node.value)):
                assert node.value in names or "host" in str(node.value), path


def test_modules_compile_with_mpy_cross() -> None:
    require("mpy-cross")
    tree, _ = publisher()
    assert len(small_compiled(tree)) == len(tree)


def test_what_is_renamed_is_told() -> None:
    tree, names = publisher()
    assert "SessionCore" in names
    assert not set(names) & {"publisher", "Context", "message", "data", "std_msgs", "tell"}
    before = sum(map(len, sources().values()))
    assert sum(map(len, tree.values())) < before / 4


def _globals(table: symtable.SymbolTable) -> Iterator[str]:
    for one in table.get_symbols():
        if one.is_referenced() and (one.is_global() or table.get_type() == "module"):
            yield one.get_name()
    for inner in table.get_children():
        yield from _globals(inner)


@pytest.mark.parametrize("path", [path for path, text in board_tree().items() if not is_native(text)])
def test_the_floor_has_nothing_that_is_judged_wrongly(path: str) -> None:
    """Constants and dead stores are judged by names: see ``how-small-works.md``."""
    for node in ast.walk(ast.parse(board_tree()[path])):
        assert not isinstance(node, ast.Global | ast.Nonlocal), "variables of modules are taken for constants"
        match node:
            case ast.Attribute(attr="setter"):
                raise AssertionError("a store that nobody reads is left out, and with it what a setter does")
            case ast.Call(func=ast.Attribute(value=owner, attr=str(name))) if name[:2] == name[-2:] == "__":
                assert (name, type(owner)) == ("__init__", ast.Call), "parameters are what calls give"
            case ast.FunctionDef(args=ast.arguments(kwarg=ast.arg(arg=options)), body=body):
                for one in (one for each in body for one in ast.walk(each)):
                    if isinstance(one, ast.Subscript | ast.Attribute) and isinstance(one.value, ast.Name):
                        assert one.value.id != options, "what is handed on is what was given"


PLAY = """
import sys
import ping_pong
from muros.client import Udp
from muros.rclc import Context, Executor
players = []
for name in ("alice", "bob"):
    context = Context(Udp("127.0.0.1", int(sys.argv[1])))
    players.append((ping_pong.PingPong(context, name, 0.02), Executor(context)))
while min(player.pongs for player, _ in players) < 2:
    for _, executor in players:
        executor.spin_some(0.01)
print("played")
"""


@pytest.mark.parametrize("form", ["normal", "small"])
def test_an_example_works_on_both(form: str, tmp_path: Path) -> None:
    require("unix")
    require("mpy-cross")
    game = (ROOT / "examples/ping_pong.py").read_bytes()
    made = board.sources(["std_msgs/msg/Header"], True)
    tree = dict(sources()) | {path: text.encode() for path, text in made.items()}
    if form == "small":
        tree, names = small(tree, [PLAY, game.decode()])
        assert names
        tree = small_compiled(tree)
    link = UdpLink(0, "127.0.0.1")
    agent = RunningAgent(link)
    try:
        output = run_mpy(PLAY, [str(link.port)], library=[write(tree | {"ping_pong.py": game}, tmp_path)])
    finally:
        agent.stop()
    lines = output.splitlines()
    assert lines[-1] == "played"
    assert sum(line.startswith("Pong for seq") for line in lines) >= 4
    assert {line.split()[0] for line in lines} == {"state", "Ping", "Pong", "played"}
