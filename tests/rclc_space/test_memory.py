"""Rules for memory and streamed samples on each way: through an agent and straight in a space."""

import pytest

from muros.rclc import Context, Rules, Streamer
from muros.rclc.memory import REFUSED
from tests.rclc_space.ways import Stage, ThroughAgent

from sensor_msgs.msg import Image
from std_msgs.msg import String

SIZE = 200_000


def test_what_is_longer_than_the_rules_allow_is_refused(stage: Stage) -> None:
    publisher = stage.node("talker").publisher(String, "words")
    node = stage.node("listener")
    problems: list[tuple[int, str]] = []
    node.context.on_problem(lambda code, text: problems.append((code, text)))
    heard: list[str] = []
    subscription = node.subscription(
        String, "words", lambda message: heard.append(message.data), memory=Rules({"data": 5})
    )
    stage.meet(publisher)
    for text in ("12345", "123456", "", "1234567", "end"):
        stage.publish(publisher, String(data=text))
    stage.until(lambda: "end" in heard)
    assert heard == ["12345", "", "end"]
    assert subscription.refused == 2
    assert problems == [
        (REFUSED, "11 B of std_msgs/msg/String dropped: data is longer than the rules allow"),
        (REFUSED, "12 B of std_msgs/msg/String dropped: data is longer than the rules allow"),
    ]


def test_without_on_problem_it_is_printed(capsys: pytest.CaptureFixture[str], stage: Stage) -> None:
    publisher = stage.node("talker").publisher(String, "words")
    subscription = stage.node("listener").subscription(String, "words", None, memory=Rules(strings=1))
    stage.meet(publisher)
    stage.publish(publisher, String(data="long"))
    stage.until(lambda: subscription.refused)
    assert "muros: 9 B of std_msgs/msg/String dropped: data is longer" in capsys.readouterr().err


def test_a_wrong_rule_leaves_nothing_behind(stage: Stage) -> None:
    node = stage.node("listener")
    with pytest.raises(ValueError, match="has no string or sequence 'date'"):
        node.subscription(String, "words", None, memory=Rules({"date": 5}))
    assert not node.entities
    assert not node.context.handles


def test_an_image_of_200_kb(stage: Stage) -> None:
    camera = stage.node("camera")
    came: list[Image] = []
    if isinstance(stage.way, ThroughAgent):
        context = stage.run(Context(stage.way.transport(), largest=SIZE + 1000))
        context.node("screen").subscription(Image, "image", came.append)
    else:
        stage.node("screen").subscription(Image, "image", came.append)
    ended: list[bool] = []

    def fill(buf: bytearray, off: int, n: int, at: int) -> None:
        buf[off : off + n] = bytes((i * 3) & 255 for i in range(at, at + n))

    publisher = camera.publisher(Image, "image")
    streamer = Streamer(publisher, fill, on_end=ended.append)
    stage.meet(publisher)
    image = Image(height=400, width=500, encoding="mono8", step=500)
    stage.until(lambda: streamer.publish(image, SIZE))
    stage.until(lambda: came and ended)
    assert ended == [True]
    assert (came[0].width, bytes(came[0].data)) == (500, bytes((i * 3) & 255 for i in range(SIZE)))
    with pytest.raises(TypeError, match="publish takes sensor_msgs/msg/Image here"):
        Streamer(publisher, fill, 0).publish(String(), 10)
