"""The programs of the guides to memory, large messages and diagnostics do what is said of them."""

import io
import re
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import pytest

from muros import cli
from muros.cli.diagnostics import line
from muros.client import Session, Udp
from muros.diagnostics import Bridge, read_table_untrusted
from muros.interfaces import message
from muros.rclc import Context, Executor, ParameterClient, ParameterError
from tests.test_guides import PATIENCE, ROOT, Bench, bench, programs

from sensor_msgs.msg import Image, JointState
from std_msgs.msg import String

__all__ = ["bench"]

MEMORY, LARGE, DIAGNOSTICS = "docs/memory.md", "docs/large-messages.md", "docs/diagnostics.md"


def said(document: str, kind: str, number: int = 0) -> str:
    """A block of a document that is no program."""
    found = re.findall(rf"^```{kind}\n(.*?)^```", (ROOT / document).read_text(), re.MULTILINE | re.DOTALL)
    text: str = found[number]
    return text


@pytest.mark.parametrize(("document", "count"), [(MEMORY, 3), (LARGE, 1), (DIAGNOSTICS, 1)])
def test_no_program_goes_untested(document: str, count: int) -> None:
    assert len(programs(document)) == count


def test_rules(bench: Bench) -> None:
    publisher = bench.node.publisher(JointState, "joint_states")
    running = bench.start(MEMORY, 0)
    good = JointState(name=["shoulder", "elbow"])
    bench.until(lambda: running.lines, lambda: publisher.publish(good))
    bad = JointState(name=[f"joint_{i}" for i in range(9)], position=[0.0] * 8, velocity=[0.0] * 8)
    bench.until(lambda: running.lines[-1].startswith("problem"), lambda: publisher.publish(bad))
    seen = dict.fromkeys(running.lines)
    assert list(seen)[:2] == said(MEMORY, "text").splitlines()
    bench.says_goodbye(running)


def test_rules_of_parameters(bench: Bench) -> None:
    assert bench.context.wait_connected(PATIENCE)
    running = bench.start(MEMORY, 1)
    client = ParameterClient(bench.node, "board", timeout=1.0)
    assert client.wait(PATIENCE)
    client.set("mode", "x" * 32)
    assert client.get("mode") == "x" * 32
    with pytest.raises(ParameterError, match="did not answer"):
        client.set("mode", "x" * 33, timeout=0.2)
    bench.until(lambda: running.lines)
    (line,) = running.lines
    assert line.startswith("problem 17 ")
    assert line.endswith("dropped: parameters.value.string_value is longer than the rules allow")
    bench.says_goodbye(running)


def test_what_the_command_says(capsys: pytest.CaptureFixture[str]) -> None:
    text = said(MEMORY, "console")
    command, _, expected = text.partition("\n")
    assert cli.main(command.removeprefix("$ muros ").split()) == 0
    assert capsys.readouterr().out == expected


def test_a_text_in_its_place(bench: Bench) -> None:
    got: list[str] = []
    bench.node.subscription(String, "status", lambda message: got.append(message.data))
    assert bench.context.wait_connected(PATIENCE)
    running = bench.start(MEMORY, 2)
    bench.until(lambda: len(got) >= 2)
    assert set(got) == {"running, 21.5 degrees"}
    bench.says_goodbye(running)


def test_an_image_in_pieces(bench: Bench) -> None:
    came: list[Image] = []
    context = Context(Session(Udp("127.0.0.1", bench.link.port), largest=300_000))
    context.node("screen").subscription(Image, "image", came.append)
    executor = Executor(context)
    assert context.wait_connected(PATIENCE)
    running = bench.start(LARGE, 0)
    try:
        bench.until(lambda: came and running.lines, lambda: executor.spin_some())
    finally:
        context.close()
    assert (came[0].width, bytes(came[0].data)) == (500, bytes(range(256)) * 781 + bytes(range(64)))
    assert running.lines[0] == "sent"
    bench.says_goodbye(running)


def test_diagnostics(bench: Bench, tmp_path: Path) -> None:
    heard: list[Any] = []
    bridge = Context(Udp("127.0.0.1", bench.link.port))
    Bridge(bridge.node("bridge"), read_table_untrusted(said(DIAGNOSTICS, "yaml")), on_status=heard.append)
    executor = Executor(bridge)
    array = message("diagnostic_msgs/msg/DiagnosticArray")
    listened: list[Any] = []
    bench.node.subscription(array, "/diagnostics", listened.append)
    assert bridge.wait_connected(PATIENCE)
    assert bench.context.wait_connected(PATIENCE)
    running = bench.start(DIAGNOSTICS, 0)
    try:
        bench.until(lambda: len(heard) == 2 and len(listened) == 2, lambda: executor.spin_some())
    finally:
        bridge.close()
    printed = io.StringIO()
    with redirect_stdout(printed):
        for status in heard:
            print(line(status))
    assert printed.getvalue() == said(DIAGNOSTICS, "console").partition("\n")[2]
    bench.says_goodbye(running)
