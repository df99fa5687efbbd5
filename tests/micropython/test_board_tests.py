"""The tests in ``tests/board`` once more, on MicroPython with 64 and with 32 bits.

Each function is reported by itself, with the source line that failed.
"""

import ast
import re
from pathlib import Path

import pytest

from muros.interfaces import board
from tests.micropython.gauge import run_gauge
from tests.micropython.runtimes import ROOT, BoardError, require
from tests.micropython.tree import Tree, board_tree
from tests.micropython.unix import LIBRARY, run_mpy

_FOLDER = ROOT / "tests" / "board"
_FILES = sorted(_FOLDER.glob("test_*.py"))
TYPES = (
    "std_msgs/msg/Int32",
    "std_msgs/msg/String",
    "std_msgs/msg/Empty",
    "example_interfaces/srv/AddTwoInts",
    "example_interfaces/action/Fibonacci",
    *(f"rcl_interfaces/srv/{name}Parameters" for name in ("Get", "Set", "List", "Describe")),
    "rcl_interfaces/srv/GetParameterTypes",
    "rcl_interfaces/srv/SetParametersAtomically",
    "rcl_interfaces/msg/ParameterEvent",
    "rcl_interfaces/msg/Log",
    "rosgraph_msgs/msg/Clock",
    *(f"lifecycle_msgs/srv/{name}" for name in ("ChangeState", "GetState")),
    *(f"lifecycle_msgs/srv/GetAvailable{name}" for name in ("States", "Transitions")),
    "lifecycle_msgs/msg/TransitionEvent",
    "micro_ros_diagnostic_msgs/msg/MicroROSDiagnosticStatus",
)
"""What programs on boards would have copied beside muros."""


@pytest.fixture(scope="module")
def messages(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the message classes of boards."""
    folder = tmp_path_factory.mktemp("messages")
    board.generate(TYPES, folder, action_services=True, constants=())
    return folder


@pytest.mark.parametrize("runtime", ["unix", "gauge"])
@pytest.mark.parametrize("path", _FILES, ids=[path.stem for path in _FILES])
def test_on_board(path: Path, runtime: str, messages: Path, subtests: pytest.Subtests) -> None:
    if runtime in _not_on(path):
        pytest.skip(f"{path.name} says that it cannot run on {runtime}")
    require(runtime)
    program = f"from tests.board.harness import run_all\nrun_all('tests.board.{path.stem}')"
    if runtime == "unix":
        output = run_mpy(program, library=(*LIBRARY, messages))
    else:
        output = run_gauge(_tree(messages), program)[0].output
    report = read_report(output)
    assert set(report) == _functions(path), f"not every test ran:\n{output}"
    for name, failure in report.items():
        with subtests.test(name):
            if failure:
                pytest.fail(f"on {runtime}: {_with_source(failure)}", pytrace=False)


def test_a_failure_is_reported_with_its_source(tmp_path: Path) -> None:
    require("unix")
    folder = tmp_path / "tests" / "board"
    folder.mkdir(parents=True)
    (folder / "harness.py").write_bytes((_FOLDER / "harness.py").read_bytes())
    (folder / "test_x.py").write_text("def test_good():\n    pass\n\ndef test_bad():\n    assert 1 == 2\n")
    program = "from tests.board.harness import run_all\nrun_all('tests.board.test_x')"
    output = run_mpy(program, library=[tmp_path, ROOT / "src"])
    report = read_report(output)
    assert report["test_good"] == ""
    assert "AssertionError" in report["test_bad"]
    assert "assert 1 == 2" in _with_source(report["test_bad"], tmp_path)


def test_a_file_that_does_not_import_is_an_error() -> None:
    require("unix")
    with pytest.raises(BoardError, match="no module named"):
        run_mpy("from tests.board.harness import run_all\nrun_all('tests.board.test_that_is_not_there')")


def read_report(output: str) -> dict[str, str]:
    """The report of ``run_all`` as test name -> traceback, empty when the test passed."""
    report = {}
    for match in re.finditer(r"^ok (\w+)$|^FAIL (\w+)\n(.*?)^end$", output, re.MULTILINE | re.DOTALL):
        passed, failed, traceback = match.groups()
        report[passed or failed] = traceback or ""
    return report


def _functions(path: Path) -> set[str]:
    body = ast.parse(path.read_bytes()).body
    return {node.name for node in body if isinstance(node, ast.FunctionDef) and node.name.startswith("test_")}


def _not_on(path: Path) -> tuple[str, ...]:
    for node in ast.parse(path.read_bytes()).body:
        if isinstance(node, ast.Assign) and [ast.unparse(target) for target in node.targets] == ["NOT_ON"]:
            return tuple(ast.literal_eval(node.value))
    return ()


def _tree(messages: Path) -> Tree:
    tree = board_tree()
    tree.update((str(path.relative_to(messages)), path.read_bytes()) for path in messages.rglob("*.py"))
    tree.update((f"tests/board/{path.name}", path.read_bytes()) for path in _FOLDER.glob("*.py"))
    return tree


def _with_source(traceback: str, *roots: Path) -> str:
    """The traceback with the text of its last line of source, which MicroPython does not print."""
    places = re.findall(r'File "([^"]+)", line (\d+)', traceback)
    if not places:
        return traceback
    name, line = places[-1]
    for path in (root / name.removeprefix("/lib/") for root in (*roots, ROOT, ROOT / "src")):
        if path.is_file():
            return f"{traceback}    {path.read_text().splitlines()[int(line) - 1].strip()}"
    return traceback
