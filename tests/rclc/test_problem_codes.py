"""The numbers that ``on_problem`` is given: each says one thing, whoever gives it."""

import ast
from itertools import pairwise
from pathlib import Path

import muros
from muros.client import problems, reasons
from muros.rclc import lifecycles
from muros.space.rclc import _problems

ROOT = Path(muros.__file__).parent
ROOMS = ("client", "rclc", "space/rclc", "diagnostics")


def said() -> dict[str, int]:
    """Constants whose docstring says that they are such numbers, by file and name."""
    found = {}
    for room in ROOMS:
        for path in sorted((ROOT / room).rglob("*.py")):
            body = ast.parse(path.read_bytes()).body
            for line, text in pairwise(body):
                match (line, text):
                    case (
                        ast.Assign(targets=[ast.Name(name)], value=value)
                        | ast.AnnAssign(target=ast.Name(name), value=value),
                        ast.Expr(ast.Constant(str(words))),
                    ) if words.startswith("The code with which"):
                        number = value.args[0] if isinstance(value, ast.Call) else value
                        assert isinstance(number, ast.Constant)
                        assert isinstance(number.value, int)
                        found[f"{path.relative_to(ROOT)} {name}"] = number.value
    return found


def test_no_number_says_two_things() -> None:
    everywhere = said()
    assert len(everywhere) > 10
    session = {
        name: getattr(problems, name) for name in ("SESSION", "READ", "NO_ANSWER", "TOO_LARGE", "FULL")
    }
    session |= {name: getattr(problems, name) for name in ("OUT_OF_STEP", "ENTITY", "OFFLINE")}
    hosts = {name: getattr(reasons, name) for name in ("UNREACHABLE", "LARGEST", "SILENT")}
    states = {name: getattr(lifecycles, name) for name in ("INACTIVE", "ILLEGAL", "RAISED")}
    spaces = {name: getattr(_problems, name) for name in ("NOT_SPUN", "ENCODING", "OTHER", "NETWORK")}
    numbers = [*everywhere.values(), *session.values(), *hosts.values(), *states.values(), *spaces.values()]
    numbers += _problems.PROBLEMS.values()
    twice = {number for number in numbers if numbers.count(number) > 1}
    assert not twice, {name: number for name, number in everywhere.items() if number in twice}
