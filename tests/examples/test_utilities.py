"""The examples of streaming and diagnostics print what they say."""

from muros.client import Session, Udp
from muros.diagnostics import Bridge, Table
from muros.rclc import Context, Executor
from tests.examples.stage import Stage
from tests.running import PATIENCE

from std_msgs.msg import UInt8MultiArray


def test_a_streamed_image(stage: Stage, on: str) -> None:
    place = stage.agent()
    came: list[UInt8MultiArray] = []
    context = Context(Session(Udp("127.0.0.1", stage.link.port), largest=200_000))
    executor = Executor(context)
    try:
        context.node("screen").subscription(UInt8MultiArray, "image", came.append)
        assert context.wait_connected(PATIENCE)
        program = stage.start("streamed_image", place, on=on)
        stage.until(lambda: (executor.spin_some(), came and program.lines)[1])
    finally:
        context.close()
    assert program.lines[0] == "Sent: 100000 bytes"
    assert bytes(came[0].data) == bytes(i % 251 for i in range(100_000))


def test_diagnostics(stage: Stage, on: str) -> None:
    place = stage.agent()
    context = Context(Udp("127.0.0.1", stage.link.port))
    executor = Executor(context)
    try:
        bridge = Bridge(context.node("bridge"), Table())
        assert context.wait_connected(PATIENCE)
        program = stage.start("diagnostics", place, on=on)
        stage.until(lambda: (executor.spin_some(), bridge.converted >= 3 and len(program.lines) >= 2)[1])
    finally:
        context.close()
    assert program.lines[0] in ("2 of 2 tasks told", "1 of 2 tasks told")
    assert program.lines[1] == "1 of 2 tasks told"
