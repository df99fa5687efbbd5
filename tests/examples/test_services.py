"""The examples of services and parameters print what they say."""

import pytest

from muros.client import Udp
from muros.rclc import Context, ParameterClient, ParameterRejectedError
from tests.cli.shell import Shell
from tests.examples.stage import Stage, interrupt
from tests.micropython.runtimes import require
from tests.running import PATIENCE


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


def test_parameters_by_command(stage: Stage) -> None:
    program = stage.start("parameter_server", "dds:")
    shell = Shell(stage.domain)
    stage.until(lambda: shell.run("param get /robot max_speed").stdout == "Double value is: 0.5\n")
    assert shell.run("param set /robot max_speed 1.5").stdout.startswith("Set parameter successful")
    stage.until(lambda: program.lines)
    assert program.lines == ["max_speed 0.5 -> 1.5"]
    assert shell.run("param get /robot name").stdout == "String value is: marvin\n"
    assert shell.run("param set /robot name zaphod").returncode == 1
    assert shell.run("param set /robot max_speed 3.0").returncode == 1
    interrupt(program)


def test_parameters_of_a_board(stage: Stage) -> None:
    require("unix")
    place = stage.agent()
    program = stage.start("parameter_server", place, on="micropython")
    context = Context(Udp("127.0.0.1", stage.link.port))
    client = ParameterClient(context.node("asking"), "/robot")
    try:
        assert client.wait(PATIENCE)
        assert client.get("max_speed", timeout=PATIENCE) == 0.5
        client.set("max_speed", 1.5, timeout=PATIENCE)
        with pytest.raises(ParameterRejectedError):
            client.set("max_speed", 3.0, timeout=PATIENCE)
        with pytest.raises(ParameterRejectedError):
            client.set("name", "zaphod", timeout=PATIENCE)
        assert client.get("name", timeout=PATIENCE) == "marvin"
    finally:
        context.close()
    stage.until(lambda: program.lines)
    assert program.lines == ["max_speed 0.5 -> 1.5"]
