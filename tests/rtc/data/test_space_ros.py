"""Data ports and real ROS 2: a node of rclpy hears an OutPort, an InPort hears a node of rclpy."""

from __future__ import annotations

import time
from collections.abc import Iterator

import pytest

from muros.rtc.codes import ReturnCode
from muros.rtc.data import DataPort
from muros.rtc.profiles import ConnectorProfile
from tests.dds.domains import Domain, free_domain
from tests.dds.peers import Peer, start
from tests.rtc.data.kit import Pair, Time, TimedLong, long

pytestmark = pytest.mark.flaky(reruns=1)  # meets another program in real time

INT32 = "std_msgs/msg/Int32"


@pytest.fixture(scope="module")
def ros() -> Iterator[Peer]:
    with start("jazzy", discovery="localhost") as peer:
        yield peer


@pytest.fixture
def domain(monkeypatch: pytest.MonkeyPatch) -> Iterator[Domain]:
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with free_domain() as number:
        yield number


def join(port: DataPort[TimedLong], domain: int) -> None:
    properties = {
        "dataport.interface_type": "ros2",
        "dataport.dataflow_type": "push",
        "dataport.subscription_type": "flush",
        "dataport.marshaling_type": "ros2:std_msgs/Int32",
        "dataport.topic": "/counter",
        "dataport.node.name": "console",
        "dataport.domain.id": str(domain),
    }
    code, _ = port.connect(ConnectorProfile("ros", "", (port,), properties))
    assert code is ReturnCode.RTC_OK


def test_a_node_hears_an_outport(pair: Pair, ros: Peer, domain: Domain) -> None:
    node = ros.do("node", name="listener", domain=int(domain))
    heard = ros.do("subscription", node=node, topic="/counter", type=INT32)
    join(pair.out, int(domain))
    assert ros.do("matched", thing=heard, count=1) == 1
    deadline = time.monotonic() + 20
    messages: list[object] = []
    number = 0
    while not messages and time.monotonic() < deadline:  # our side may match a moment later
        number += 1
        assert pair.out.write(long(number))
        messages = ros.do("take", subscription=heard, wait=0.2)
    assert messages[0] in [{"data": n} for n in range(1, number + 1)]


def test_an_inport_hears_a_node(pair: Pair, ros: Peer, domain: Domain) -> None:
    node = ros.do("node", name="talker", domain=int(domain))
    teller = ros.do("publisher", node=node, topic="/counter", type=INT32)
    join(pair.in_, int(domain))
    assert ros.do("matched", thing=teller, count=1) == 1
    deadline = time.monotonic() + 20
    while not pair.in_.is_new() and time.monotonic() < deadline:
        ros.do("publish", publisher=teller, message={"data": -40})
        time.sleep(0.1)
    assert pair.in_.read() == TimedLong(Time(), -40)
