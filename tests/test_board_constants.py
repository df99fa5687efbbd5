"""Each module of the board floor repeats the wire constants it needs; every repetition agrees with the table.

A repeated constant is ``_NAME = const(expression)`` where ``NAME`` stands in ``constants`` of `muros.xrce`, or of
`muros.rosserial` for the modules of that room.
"""

import ast
from pathlib import Path
from types import ModuleType

import pytest

from muros.rosserial import constants as rosserial
from muros.xrce import constants
from tests.micropython.tree import board_files, board_path

_FILES = board_files()


def _numbers(module: ModuleType) -> dict[str, int]:
    return {name: value for name, value in vars(module).items() if type(value) is int and name.isupper()}


_TABLE = _numbers(constants)
_ROSSERIAL = _numbers(rosserial)


@pytest.mark.parametrize("path", _FILES, ids=[board_path(path) for path in _FILES])
def test_repeated_constants_agree(path: Path) -> None:
    table = _ROSSERIAL if path.parent.name == "rosserial" else _TABLE
    for name, value in repeated(path.read_text()).items():
        if name in table:
            assert value == table[name], f"{board_path(path)}: _{name} is {value:#x}, not {table[name]:#x}"


def test_constants_are_found_whatever_their_expression() -> None:
    source = "_A = const(0x10)\n_B = const(_A << 4 | 1)\n_C: int = const(-1)\nD = const(3)\n_E = other(5)\n"
    assert repeated(source) == {"A": 0x10, "B": 0x101, "C": -1}


def test_some_module_repeats_some_constant() -> None:
    found = {name for path in _FILES for name in repeated(path.read_text())}
    for table in (_TABLE, _ROSSERIAL):
        assert found & set(table), "nothing to compare: are the names still those of the table?"


def repeated(source: str) -> dict[str, int]:
    """The underscored constants of a module, by their names without the underscore."""
    values: dict[str, int] = {}
    for node in ast.parse(source).body:
        if not isinstance(node, ast.Assign | ast.AnnAssign) or not isinstance(node.value, ast.Call):
            continue
        target = node.targets[0] if isinstance(node, ast.Assign) else node.target
        if ast.unparse(node.value.func) == "const" and isinstance(target, ast.Name):
            expression = compile(ast.Expression(node.value.args[0]), "<const>", "eval")
            values[target.id] = int(eval(expression, {"__builtins__": {}}, values))
    return {name[1:]: value for name, value in values.items() if name.startswith("_")}
