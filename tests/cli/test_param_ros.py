"""`muros param` on a node of rclpy, with the words that `ros2 param` has for it."""

from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.shell import Shell
from tests.dds.domains import free_domain
from tests.dds.peers import require, start

GIVEN = {"speed": 0.5, "motor.current": 3, "names": ["a", "b"], "on": True}


@pytest.fixture(scope="module", params=["jazzy", "kilted"])
def shell(request: pytest.FixtureRequest) -> Iterator[Shell]:
    """A shell beside the node /lab/robot of ROS 2, which has parameters."""
    require(request.param)
    with start(request.param, discovery="localhost") as ros, free_domain() as domain:
        ros.do("node", name="robot", namespace="/lab", domain=int(domain), parameters=GIVEN)
        yield Shell(domain)


def test_what_there_is(shell: Shell) -> None:
    listed, typed, speed, names, described = shell.outputs(
        "param list /lab/robot",
        "param list /lab/robot --param-type --filter ^motor",
        "param get /lab/robot speed",
        "param get /lab/robot names",
        "param describe /lab/robot motor.current",
    )
    assert {"  speed", "  motor.current", "  names", "  on", "  use_sim_time"} <= set(listed.splitlines())
    assert typed == "  motor.current (type: integer)\n"
    assert speed == "Double value is: 0.5\n"
    assert names == "String values are: ['a', 'b']\n"
    assert described.startswith("Parameter name: motor.current\n  Type: integer\n")


def test_what_is_set(shell: Shell) -> None:
    done = shell.run("param set /lab/robot speed 1.5")
    assert (done.stdout, done.returncode) == ("Set parameter successful\n", 0)
    assert shell.run("param get /lab/robot speed").stdout == "Double value is: 1.5\n"
    refused = shell.run("param set /lab/robot motor.current fast")
    assert refused.returncode == 1
    assert "Wrong parameter type" in refused.stdout + refused.stderr
    unknown = shell.run("param set /lab/robot nobody 1")
    assert unknown.returncode == 1


def test_what_is_dumped_is_loaded_again(shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "robot.yaml"
    before = shell.run("param dump /lab/robot").stdout
    assert before.startswith("/lab/robot:\n  ros__parameters:\n")
    assert "    motor:\n      current: 3\n" in before
    file.write_text("/lab/*:\n  ros__parameters:\n    motor: {current: 7}\n    on: false\n")
    loaded = shell.run(f"param load /lab/robot {file}")
    assert loaded.returncode == 0, loaded.stderr
    assert "Set parameter motor.current successful" in loaded.stdout
    current, state = shell.outputs("param get /lab/robot motor.current", "param get /lab/robot on")
    assert (current, state) == ("Integer value is: 7\n", "Boolean value is: False\n")
