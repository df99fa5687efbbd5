"""The examples of services and parameters print what they say."""

import pytest

from tests.cli.shell import Shell
from tests.examples.stage import Stage, interrupt
from tests.micropython.runtimes import require


@pytest.mark.parametrize(
    ("place", "serves", "asks"),
    [("dds:", "python", "python"), ("agent", "python", "micropython"), ("agent", "micropython", "python")],
)
def test_a_sum(stage: Stage, place: str, serves: str, asks: str) -> None:
    if place == "agent":
        require("unix")
        place = stage.agent()
    server = stage.start("add_two_ints_server", place, on=serves)
    client = stage.start("add_two_ints_client", place, on=asks)
    client.ends()
    assert client.lines == ["24 + 42 = 66", "66 + 1 = 67"]
    stage.until(lambda: len(server.lines) >= 2)
    assert server.lines == ["Service request value: 24 + 42", "Service request value: 66 + 1"]
    if serves == "python":
        interrupt(server)


def test_parameters(stage: Stage) -> None:
    program = stage.start("parameter_server", "dds:")
    shell = Shell(stage.domain)
    assert shell.run("param set /robot max_speed 1.5").stdout.startswith("Set parameter successful")
    stage.until(lambda: program.lines)
    assert program.lines == ["max_speed 0.5 -> 1.5"]
    assert shell.run("param get /robot name").stdout == "String value is: marvin\n"
    assert shell.run("param set /robot name zaphod").returncode == 1
    assert shell.run("param set /robot max_speed 3.0").returncode == 1
    interrupt(program)
