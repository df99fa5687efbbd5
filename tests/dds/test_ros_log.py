"""What a node of ours logs is seen by rclpy and by `muros topic echo`."""

from collections.abc import Callable

import pytest

from tests.cli.shell import Shell
from tests.dds.domains import Domain
from tests.dds.peers import Peer, start
from tests.rclc_space.test_ros import Program


@pytest.mark.parametrize("distro", ["jazzy", "kilted"])
def test_logs_are_seen(distro: str, domain: Domain, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    program = Program(f"dds:{int(domain)}")
    shown: list[str] = []
    camera = program.context.node("camera", "lab")
    log = camera.logger(level="debug", show=shown.append)
    again = camera.timer(0.1, lambda: log.info("again"), autostart=False)
    assert log.warn("early")
    program.start()
    try:
        with start(distro, discovery="localhost") as ros:
            node = ros.do("node", name="reader", domain=int(domain))
            heard = _subscription(ros, node)
            assert ros.do("matched", thing=heard, count=2) == 2, "its own node logs there, too"
            assert log.debug("late")
            told = ros.do("take", subscription=heard, count=2)
            assert [(m["level"], m["name"], m["msg"]) for m in told] == [
                (30, "lab.camera", "early"),
                (10, "lab.camera", "late"),
            ]
            assert told[0]["function"] == "test_logs_are_seen"
            assert told[0]["stamp"]["sec"] > 1_700_000_000
        assert len(shown) == 2
        again.reset()
        with Shell(domain).running("topic echo /rosout --field msg") as echo:
            echo.line("again")
        assert program.problems == []
    finally:
        program.close()


def _subscription(ros: Peer, node: int) -> int:
    """A subscription to /rosout, with what came before."""
    qos = {"depth": 100, "durability": "transient_local"}
    do: Callable[..., int] = ros.do
    return do("subscription", node=node, topic="/rosout", type="rcl_interfaces/msg/Log", qos=qos)
