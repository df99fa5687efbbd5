"""ROS 2's own tools hear what the bridge says: rclpy with its diagnostic_msgs."""

import pytest

from muros.diagnostics import Bridge, read_table_untrusted
from muros.rclc import DiagnosticUpdater
from muros.rclc.diagnostics import WARN, Task
from tests.dds.domains import free_domain
from tests.dds.peers import Peer
from tests.diagnostics.test_bridge import TABLE
from tests.rclc_space.ways import Direct, Stage


def test_d6_rclpy_hears_words(ros: Peer, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as domain:
        stage = Stage(Direct(f"dds:{domain}"))
        try:
            updater = DiagnosticUpdater(stage.node("board"))
            bridge = Bridge(stage.node("bridge"), read_table_untrusted(TABLE), time=lambda: (12, 34))
            node = ros.do("node", name="tool", domain=domain)
            heard = ros.do(
                "subscription", node=node, topic="/diagnostics", type="diagnostic_msgs/msg/DiagnosticArray"
            )
            stage.meet(updater.publisher, bridge.publisher)
            ros.do("matched", thing=heard)

            def check(task: Task) -> None:
                task.set(0, 11.5, WARN)
                task.lookup(1, 0)

            updater.task(1, 7, check)
            assert updater.update() == 1
            stage.until(lambda: bridge.converted)
            (array,) = ros.do("take", subscription=heard)
        finally:
            stage.close()
    assert array["header"]["stamp"] == {"sec": 12, "nanosec": 34}
    (status,) = array["status"]
    assert (status["name"], status["message"], status["hardware_id"]) == (
        "battery",
        "the accumulator",
        "left arm",
    )
    assert status["values"] == [
        {"key": "voltage", "value": "11.5"},
        {"key": "mode", "value": "charging"},
    ]
