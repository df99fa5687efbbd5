"""A board with rosserial firmware is used from rclpy: the node, its LEDs, its topics, its services, its parameters."""

from __future__ import annotations

import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import partial
from queue import SimpleQueue
from typing import Any

import pytest

from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.server import Server
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message, service
from tests.dds.domains import Domain
from tests.dds.peers import Peer
from tests.dds.rig import PATIENCE, Rig

ROS = ("jazzy", "kilted")
Fetch = Callable[[str], Peer]
Byte: Any = message("std_msgs/Byte")
String: Any = message("std_msgs/String")
Imu: Any = message("sensor_msgs/Imu")
SetBool: Any = service("std_srvs/SetBool")


class OpenCr:
    """The board, on a thread of its own: it switches LEDs, talks, serves /switch and calls /lamp."""

    def __init__(self, port: int, server: Server) -> None:
        self.server = server
        self.leds: list[int] = []
        self.port = Tcp("127.0.0.1", port)
        self.node = NodeHandle(self.port, 1024, 1024)
        self.node.subscribe("led_out", Byte, lambda led: self.leds.append(led.data))
        self.chatter = self.node.advertise("chatter", String)
        self.imu = self.node.advertise("imu", Imu)
        self.node.advertise_service(
            "switch", SetBool, lambda r: SetBool.Response(success=r.data, message="switched")
        )
        self.lamp = self.node.service_client("lamp", SetBool)
        self._work: SimpleQueue[Callable[[], object] | None] = SimpleQueue()
        self._results: SimpleQueue[Any] = SimpleQueue()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def do(self, rig: Rig, work: Callable[[], object]) -> Any:
        """Has something done on the board's thread, while our loop runs."""
        self._work.put(work)
        rig.until(lambda: not self._results.empty())
        return self._results.get()

    def close(self) -> None:
        """It is switched off."""
        self._work.put(None)
        self._thread.join(PATIENCE)
        self.port.close()

    def _run(self) -> None:
        while True:
            self.node.spin_once(5)
            if not self._work.empty():
                work = self._work.get()
                if work is None:
                    return
                self._results.put(work())


@contextmanager
def opencr(rig: Rig, domain: int) -> Iterator[OpenCr]:
    server = Server(rig.space(domain), parameters=lambda node: {"gain": 2.5})
    link: Any = server.add_tcp(0, "127.0.0.1", name="/opencr")
    rig.loop.run_until_complete(server.start())
    board = OpenCr(link.port, server)
    try:
        rig.until(lambda: board.node.connected)
        yield board
    finally:
        board.close()
        server.close()


@pytest.mark.parametrize("distro", ROS)
def test_the_node_is_there_with_everything_it_has(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="looker", domain=domain)
    with opencr(rig, domain):
        assert "/opencr" in rig.ask(ros, "nodes", node=node, names=["/opencr"])
        rig.ask(ros, "services", node=node, names=["/switch", "/lamp", "/opencr/get_parameters"])
        found = rig.ask(ros, "of_node", node=node, name="opencr")
        assert found["publishers"]["/chatter"] == ["std_msgs/msg/String"]
        assert found["publishers"]["/imu"] == ["sensor_msgs/msg/Imu"]
        assert found["subscribers"]["/led_out"] == ["std_msgs/msg/Byte"]
        assert found["services"]["/switch"] == ["std_srvs/srv/SetBool"]
        assert found["clients"]["/lamp"] == ["std_srvs/srv/SetBool"]


@pytest.mark.parametrize("distro", ROS)
def test_leds_are_switched_and_topics_are_heard(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="program", domain=domain)
    with opencr(rig, domain) as board:
        switch = rig.ask(ros, "publisher", node=node, topic="/led_out", type="std_msgs/msg/Byte")
        rig.ask(ros, "matched", thing=switch)
        for value in (1, 2, 4, 8, 0):
            rig.ask(ros, "publish_raw", publisher=switch, data=f"00010000{value:02x}")
        rig.until(lambda: len(board.leds) == 5)
        assert board.leds == [1, 2, 4, 8, 0]
        heard = rig.ask(ros, "subscription", node=node, topic="/chatter", type="std_msgs/msg/String", qos=100)
        imus = rig.ask(ros, "subscription", node=node, topic="/imu", type="sensor_msgs/msg/Imu")
        for name in ("chatter", "imu"):
            made: Any = board.server.core.boards[0].roster.endpoints[0, name, 0]
            rig.until(partial(lambda each: each.publisher._writer.matched, made))

        def talk() -> None:
            for i in range(50):
                board.chatter.publish(String(data=f"grüße {i}"))
            imu = Imu()
            imu.header.seq, imu.header.stamp, imu.header.frame_id = 7, (1700000000, 5), "base"
            imu.linear_acceleration.z = 9.81
            board.imu.publish(imu)

        board.do(rig, talk)
        texts = rig.ask(ros, "take", subscription=heard, count=50)
        assert [text["data"] for text in texts] == [f"grüße {i}" for i in range(50)]
        (imu,) = rig.ask(ros, "take", subscription=imus)
        assert imu["header"] == {"stamp": {"sec": 1700000000, "nanosec": 5}, "frame_id": "base"}
        assert imu["linear_acceleration"]["z"] == 9.81


@pytest.mark.parametrize("distro", ROS)
def test_services_both_ways(distro: str, peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer(distro)
    node = ros.do("node", name="program", domain=domain)
    with opencr(rig, domain) as board:
        client = rig.ask(ros, "client", node=node, name="/switch", type="std_srvs/srv/SetBool")
        answers = rig.ask(ros, "call", client=client, request={"data": True}, count=10)
        assert answers == [{"success": True, "message": "switched"}] * 10
        rig.ask(
            ros,
            "service",
            node=node,
            name="/lamp",
            type="std_srvs/srv/SetBool",
            rule="{'success': request.data, 'message': 'lit'}",
        )
        lamp: Any = board.server.core.boards[0].roster.endpoints[4, "lamp", 0]
        rig.until(lambda: lamp.caller.ready)
        answer = board.do(rig, lambda: board.lamp.call(SetBool.Request(data=True), 10_000))
        assert (answer.success, answer.message) == (True, "lit")


@pytest.mark.parametrize("distro", ROS)
def test_parameters_that_rclpy_sets_reach_the_board(
    distro: str, peer: Fetch, rig: Rig, domain: Domain
) -> None:
    ros = peer(distro)
    node = ros.do("node", name="program", domain=domain)
    with opencr(rig, domain) as board:
        assert board.do(rig, lambda: board.node.get_param("~gain", float)) == [2.5]
        client = rig.ask(
            ros, "client", node=node, name="/opencr/set_parameters", type="rcl_interfaces/srv/SetParameters"
        )
        (answer,) = rig.ask(
            ros,
            "call",
            client=client,
            request={
                "parameters": [
                    {"name": "gain", "value": {"type": 3, "double_value": 4.5}},
                    {"name": "motor.max", "value": {"type": 2, "integer_value": 9}},
                ]
            },
        )
        assert [result["successful"] for result in answer["results"]] == [True, True]
        assert board.do(rig, lambda: board.node.get_param("~gain", float)) == [4.5]
        assert board.do(rig, lambda: board.node.get_param("~motor/max", int)) == [9]


def test_logs_are_heard(peer: Fetch, rig: Rig, domain: Domain) -> None:
    ros = peer("jazzy")
    node = ros.do("node", name="program", domain=domain)
    with opencr(rig, domain) as board:
        logs = rig.ask(ros, "subscription", node=node, topic="/rosout", type="rcl_interfaces/msg/Log")
        made: Any = board.server.core.boards[0].node
        rig.until(lambda: made._rosout.matched)
        board.do(rig, lambda: board.node.logwarn("battery is low"))
        for _ in range(20):
            (log,) = rig.ask(ros, "take", subscription=logs)
            if log["name"] == "opencr":
                break
        assert (log["level"], log["msg"]) == (30, "battery is low")
