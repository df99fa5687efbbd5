"""Logging: what is published and shown, from which level on, and what becomes of what cannot be published."""

import threading
from typing import Any

import pytest

from muros.rclc import Logger
from tests.client.world import World
from tests.rclc.test_rclc import Board


class Logged:
    """A logger of /lab/camera, and what it published and showed."""

    def __init__(self, **arguments: Any) -> None:
        self.node = Board(World()).context.node("camera", "/lab")
        self.shown: list[str] = []
        self.log: Logger = self.node.logger(time=lambda: (12, 34), show=self.shown.append, **arguments)
        self.published: list[Any] = []
        self.taken = True
        publisher: Any = self.log.publisher
        publisher.publish = self._publish

    def _publish(self, message: Any) -> bool:
        self.published.append(message)
        return self.taken


def test_what_is_published_and_shown() -> None:
    logged = Logged(level="debug")
    log = logged.log
    for method in (log.debug, log.info, log.warn, log.error, log.fatal):
        assert method("hello")
    assert [message.level for message in logged.published] == [10, 20, 30, 40, 50]
    message = logged.published[0]
    assert (message.name, message.msg) == ("lab.camera", "hello")
    assert (message.stamp.sec, message.stamp.nanosec) == (12, 34)
    assert logged.shown == [
        f"[{level}] [12.000000034] [lab.camera]: hello"
        for level in ("DEBUG", "INFO", "WARN", "ERROR", "FATAL")
    ]


def test_where_it_was_called() -> None:
    logged = Logged()
    logged.log.info("here")
    logged.log.log(20, "there")
    line = test_where_it_was_called.__code__.co_firstlineno
    places = [(message.file, message.function, message.line) for message in logged.published]
    assert places == [(__file__, "test_where_it_was_called", line + n) for n in (2, 3)]


def test_the_publisher_is_that_of_ros() -> None:
    node = Board(World()).context.node("camera")
    log = node.logger()
    publisher: Any = log.publisher
    assert publisher.name == "rt/rosout"
    assert publisher.type_name == "rcl_interfaces/msg/Log"
    assert log.name == "camera"


@pytest.mark.parametrize(("level", "count"), [("debug", 2), (15, 1), ("info", 1), ("warn", 0)])
def test_levels(level: Any, count: int) -> None:
    logged = Logged(level=level)
    logged.log.debug("one")
    logged.log.info("two")
    assert len(logged.published) == len(logged.shown) == count
    logged.log.level = 30
    assert not logged.log.info("three")
    assert (len(logged.published), logged.log.lost) == (count, 0)


def test_any_text_and_any_level() -> None:
    logged = Logged(level=1)
    log: Any = logged.log
    log.info(5)
    log.log(3, "odd")
    log.log(200, "odder")
    assert logged.published[0].msg == "5"
    assert [line.split("]")[0] for line in logged.shown] == ["[INFO", "[DEBUG", "[FATAL"]


@pytest.mark.parametrize("level", ["loud", 0, 256, b"info"])
def test_levels_that_there_are_not(level: Any) -> None:
    node = Board(World()).context.node("camera")
    with pytest.raises(ValueError, match="it must be one of debug, info, warn, error, fatal"):
        node.logger(level=level)
    with pytest.raises(ValueError, match="it must be a number from 10"):
        node.logger().log(level, "text")


def test_what_is_no_function() -> None:
    wrong: Any = {"show": 5}
    with pytest.raises(TypeError, match="time or show of a logger is a function, not 5"):
        Board(World()).context.node("camera").logger(**wrong)


def test_what_is_not_taken_is_counted() -> None:
    logged = Logged()
    logged.taken = False
    assert not logged.log.info("text")
    assert (logged.log.lost, len(logged.shown)) == (1, 1)


def test_a_problem_of_logging_may_be_logged() -> None:
    """It is shown; publishing it in turn would never end."""
    node = Board(World()).context.node("camera")
    shown: list[str] = []
    log = node.logger(show=shown.append)
    node.context.on_problem(lambda code, text: log.warn(text) and None)
    assert not log.info("nobody is there")
    assert log.lost == 2
    assert [line.split("]")[0] for line in shown] == ["[INFO", "[WARN"]
    assert "rt/rosout dropped" in shown[1]


def test_the_node_s_own_logger(capsys: pytest.CaptureFixture[str]) -> None:
    node = Board(World()).context.node("camera")
    node.context.on_problem(lambda code, text: None)
    node.log.info("hello")
    assert node.log is node.log
    assert capsys.readouterr().err.endswith("] [camera]: hello\n")


def test_another_thread_may_log_while_one_publishes() -> None:
    logged = Logged()
    publisher: Any = logged.log.publisher

    def publish(message: Any) -> bool:
        if message.msg == "first":
            other = threading.Thread(target=logged.log.info, args=("of another thread",))
            other.start()
            other.join()
            logged.log.info("of a problem of publishing")  # is shown, and no more
        return logged._publish(message)

    publisher.publish = publish
    assert logged.log.info("first")
    assert [message.msg for message in logged.published] == ["of another thread", "first"]
    assert logged.log.lost == 1
