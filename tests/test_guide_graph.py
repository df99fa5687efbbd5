"""The programs of the guides to the graph, to names and to quality of service run, and print what is said of them."""

import re
import subprocess
import sys
from pathlib import Path

from tests.test_guides import PATIENCE, ROOT, Bench, bench, programs

from std_msgs.msg import Int32

__all__ = ["bench"]

GRAPH, QOS = "docs/graph-and-names.md", "docs/qos.md"


def printed(document: str) -> list[str]:
    """What a document says that its programs print."""
    return re.findall(r"^```text\n(.*?)^```", (ROOT / document).read_text(), re.MULTILINE | re.DOTALL)


def run(program: str, *arguments: str) -> str:
    """What a program prints that ends by itself."""
    done = subprocess.run(
        [sys.executable, "-c", program, *arguments],
        capture_output=True,
        text=True,
        timeout=PATIENCE,
        check=False,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_no_program_goes_untested() -> None:
    assert (len(programs(GRAPH)), len(programs(QOS))) == (3, 1)


def test_the_watcher(bench: Bench) -> None:
    got: list[int] = []
    ears = bench.context.node("ears")
    bench.node.destroy()
    ears.subscription(Int32, "/lab/count", lambda message: got.append(message.data))
    running = bench.start(GRAPH, 0)
    bench.until(lambda: len(running.lines) == 3)
    assert got == [1]
    assert "".join(f"{line}\n" for line in running.lines) == printed(GRAPH)[0]
    assert running.end() == (0, "")


def test_names_and_values_that_are_given() -> None:
    assert run(programs(GRAPH)[1]) == printed(GRAPH)[1]


def test_what_a_context_is_told(bench: Bench) -> None:
    running = bench.start(GRAPH, 2)
    bench.until(lambda: running.lines)
    assert running.lines == ["True"]
    assert running.end() == (0, "")


def test_the_command_line_of_the_guide(tmp_path: Path) -> None:
    """The thermometer of the guide, started with the arguments that the guide shows."""
    line = re.search(r"^\$ python thermometer.py (.*)$", (ROOT / GRAPH).read_text(), re.MULTILINE)
    assert line is not None
    program = """
from muros.rclc import Context
context = Context("local:")
node = context.node("thermometer")
print(node.full_name, node.resolve_topic("temperature"), node.parameters().declare("rate", 1.0), node.log.level)
context.close()
"""
    assert run(program, *line[1].split()) == "/greenhouse/thermometer /cellar/temperature 2.0 10\n"


def test_quality_of_service() -> None:
    lines = run(programs(QOS)[0]).splitlines()
    assert "level 42" in lines
    assert any("best effort" in line for line in lines)
