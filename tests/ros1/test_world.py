"""The ROS 1 graph as boards meet it, beside rospy: messages pass as they are, older definitions are converted."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import Any

import pytest

from muros.findings import Findings
from muros.interfaces import converter, md5, message, ros1_text, service_converter
from muros.ros1 import Ros1Error
from muros.ros1._services import ServiceClient, ServiceType
from muros.rosserial import types
from muros.rosserial.server._door import BodyError, NamedService, RefusedError
from muros.rosserial.server._ros1_world import Ros1BoardNode, Ros1World
from tests.dds.peers import Peer
from tests.ros1.peers import Master
from tests.ros1.test_graph import text, until

STRING = ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1")
OLD_BATTERY = "476f837fa6771f6e16e3bf4ef96f8770"
HALVES = ("std_srvs/SetBool", md5("std_srvs/srv/SetBool_Request"), md5("std_srvs/srv/SetBool_Response"))


@pytest.fixture(scope="module")
def master() -> Iterator[Master]:
    with Master() as made:
        yield made


@pytest.fixture(scope="module")
def ros(master: Master) -> Iterator[Peer]:
    with master.peer("peer") as made:
        yield made


@asynccontextmanager
async def board(
    master: Master, name: str = "/serial_node", findings: Findings | None = None, **options: Any
) -> AsyncIterator[Ros1BoardNode]:
    """A board's node, and all of it gone in the end."""
    world = Ros1World(master.uri, "127.0.0.1", findings=findings, **options)
    await world.open()
    node = world.node(name, "board ttyACM0")
    try:
        yield node
    finally:
        node.close()
        await world.close()


async def taken(thing: Any) -> Any:
    """What comes next."""
    found: list[Any] = []

    def come() -> bool:
        if (one := thing.take()) is not None:
            found.append(one)
        return bool(found)

    await until(come)
    return found[0]


def nothing(*_: Any) -> None:
    """A callback for what does not matter."""


def test_a_board_is_a_node(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with board(master, remap={"old_name": "/new_name"}) as node:
            data: list[str] = []
            up = node.publisher("chatter", *STRING)
            down = node.subscriber("~led", *STRING, lambda: data.append("led"))
            other = node.publisher("old_name", *STRING)
            assert (up.size, up.least_size, up.drift) == (None, 4, "")
            heard = await ros.ask("subscriber", topic="/chatter", type="std_msgs/String")
            says = await ros.ask("publisher", topic="/serial_node/led", type="std_msgs/String")
            await until(lambda: up._publication.subscribers)
            await ros.ask("wait_for_subscribers", publisher=says)
            up.publish(text("from a board"))
            assert await ros.ask("take", subscriber=heard) == [{"data": "from a board"}]
            await ros.ask("publish", publisher=says, message={"data": "on"}, times=3)
            assert {await taken(down) for _ in range(3)} == {text("on")}
            assert data
            state = await ros.ask("state", publishers=["/new_name", "/rosout", "/chatter"])
            assert "/serial_node" in state["publishers"]["/rosout"]
            assert "/muros_rosserial" not in str(state)
            other.close()
            with pytest.raises(RefusedError, match="publishes /chatter already"):
                node.publisher("/chatter", *STRING)
            with pytest.raises(RefusedError, match="no name in ROS 1"):
                node.subscriber("a-b", *STRING, nothing)
        assert await ros.ask("gone", node="/serial_node")
        await ros.ask("destroy", thing=heard)
        await ros.ask("destroy", thing=says)

    asyncio.run(main())


def test_services_both_ways(master: Master, ros: Peer) -> None:
    async def main() -> None:
        findings = Findings()
        async with board(master, findings=findings) as node:
            served = node.server(NamedService("~set", *HALVES), nothing)
            call = asyncio.create_task(
                ros.ask("call", service="/serial_node/set", type="std_srvs/SetBool", request={"data": True})
            )
            request, body = await taken(served)
            assert body == b"\x01"
            served.answer(request, b"\x01" + text("set"))
            assert await call == {"success": True, "message": "set"}
            call = asyncio.create_task(
                ros.ask("call", service="/serial_node/set", type="std_srvs/SetBool", request={"data": True})
            )
            request, _ = await taken(served)
            served.fail(request, "the board did not answer")
            with pytest.raises(AssertionError, match="the board did not answer"):
                await call
            served.close()
            replies: list[tuple[int, bytes]] = []
            caller = node.caller(NamedService("/host_service", *HALVES), lambda *reply: replies.append(reply))
            assert not caller.ready
            assert caller.call(b"\x01") == 1
            await until(lambda: any(each.code == "ros1-call-failed" for each in findings.snapshot()))
            theirs = await ros.ask(
                "serve",
                service="/host_service",
                type="std_srvs/SetBool",
                answer={"success": True, "message": "x"},
            )
            await until(lambda: caller.ready)
            assert caller.call(b"\x01") == 2
            await until(lambda: replies)
            assert replies == [(2, b"\x01" + text("x"))]
            caller.close()
            await ros.ask("destroy", thing=theirs)

    asyncio.run(main())


def test_calls_of_those_who_have_hung_up_are_not_made(master: Master) -> None:
    async def main() -> None:
        async with board(master) as node:
            served: Any = node.server(NamedService("~set", *HALVES), nothing)
            found: list[str] = []
            while not found:
                found = [uri for uri in [await node.node.lookup("/serial_node/set")] if uri]
            whole = service_converter("std_srvs/SetBool").md5
            caller = ServiceClient("/impatient", ServiceType("/serial_node/set", "std_srvs/SetBool", whole))
            call = asyncio.create_task(caller.call(found[0], b"\x01"))
            await until(lambda: served._waiting)
            call.cancel()
            await until(lambda: not served._server.waiting)
            assert served.take() is None

    asyncio.run(main())


def test_parameters_logs_and_diagnostics(master: Master, ros: Peer) -> None:
    async def main() -> None:
        await ros.ask("set_param", name="/serial_node", value={"port": "/dev/ttyACM7", "pid": {"p": 1.5}})
        await ros.ask("set_param", name="/names", value=["a", "b"])
        async with board(master) as node:
            assert node.world.setting("/serial_node", "port") == "/dev/ttyACM7"
            assert node.parameter("~port") == "/dev/ttyACM7"
            assert node.parameter("names") == ["a", "b"]
            assert node.parameter("~pid") is None
            assert node.parameter("~nothing") is None
            assert node.parameter("~pid/p") == 1.5
            await ros.ask("set_param", name="/serial_node/pid/p", value=2.5)
            await until(lambda: node.parameter("~pid/p") == 2.5)
            assert node.parameter("no name!") is None
            node.log(1, "said before anybody could hear it")
            rosout = await ros.ask("subscriber", topic="/rosout", type="rosgraph_msgs/Log")
            await until(lambda: node._rosout.subscribers)
            node.log(2, "battery is low")
            logs: list[Any] = []
            while len(logs) < 2:
                logs += await ros.ask("take", subscriber=rosout)
            assert [(each["level"], each["name"], each["msg"]) for each in logs] == [
                (2, "/serial_node", "said before anybody could hear it"),
                (4, "/serial_node", "battery is low"),
            ]
            assert logs[0]["header"]["stamp"]["secs"] > 1_000_000_000
            node.diagnose("all well", 0, {"frames": "7"})
            state = await ros.ask("state", publishers=["/diagnostics"])
            assert state["publishers"]["/diagnostics"] == ["/serial_node"]
            await ros.ask("destroy", thing=rosout)

    asyncio.run(main())


def test_old_definitions_meet_todays_nodes(master: Master, ros: Peer) -> None:
    battery = message("sensor_msgs/msg/BatteryState")
    state = battery(voltage=12.5, percentage=0.5, location="slot").serialize()
    old = converter("sensor_msgs/BatteryState", OLD_BATTERY)

    async def main() -> None:
        async with board(master) as node:
            up = node.publisher("battery", "sensor_msgs/BatteryState", OLD_BATTERY)
            assert "without temperature" in up.drift
            heard = await ros.ask("subscriber", topic="/battery", type="sensor_msgs/BatteryState")
            await until(lambda: up._publication.subscribers)
            up.publish(old.to_ros1(state, 7))
            (got,) = await ros.ask("take", subscriber=heard)
            assert (got["voltage"], got["location"], got["header"]["seq"]) == (12.5, "slot", 7)
            with pytest.raises(BodyError, match="bytes"):
                up.publish(b"short")
            down = node.subscriber("battery_in", "sensor_msgs/BatteryState", OLD_BATTERY, nothing)
            says = await ros.ask("publisher", topic="/battery_in", type="sensor_msgs/BatteryState")
            await ros.ask("wait_for_subscribers", publisher=says)
            await ros.ask("publish", publisher=says, message={"voltage": 3.5, "temperature": 20.0})
            assert battery.deserialize(old.to_cdr(await taken(down))).voltage == 3.5
            with pytest.raises(RefusedError, match="Checksum does not match"):
                node.publisher("bad", "std_msgs/String", "0" * 32)
            unknown = node.publisher("unknown", "no_such_msgs/Thing", "1" * 32)
            unknown.publish(b"whatever")
            with pytest.raises(RefusedError, match="no_such_msgs"):
                node.server(NamedService("unknown", "no_such_msgs/Do", "1" * 32, "2" * 32), nothing)
            await ros.ask("destroy", thing=heard)
            await ros.ask("destroy", thing=says)

    asyncio.run(main())


def test_definitions_in_headers_are_those_of_ros1(ros: Peer) -> None:
    """Comments aside, what rospy would write."""
    for name in ("sensor_msgs/Imu", "std_msgs/Float64MultiArray", "sensor_msgs/JointState"):
        theirs = ros.do("definition", type=name)
        lines = [line.partition("#")[0].split() for line in theirs.splitlines()]
        ours = [line.split() for line in ros1_text(name).splitlines()]
        assert normal(ours) == normal(lines)


def normal(lines: list[list[str]]) -> set[str]:
    """Definitions as sets of lines: names of the own package may be short."""
    words = (" ".join(line) for line in lines if line)
    return {each.replace("std_msgs/", "").replace("geometry_msgs/", "") for each in words}


def test_simulated_time(master: Master, ros: Peer) -> None:
    async def main() -> None:
        await ros.ask("set_param", name="/use_sim_time", value=True)
        try:
            async with board(master) as node:
                assert node.world.time() == 0
                clock = await ros.ask("publisher", topic="/clock", type="rosgraph_msgs/Clock", latch=True)
                await ros.ask("publish", publisher=clock, message={"clock": {"secs": 5, "nsecs": 6}})
                await until(lambda: node.world.time() == 5_000_000_006)
                await ros.ask("destroy", thing=clock)
        finally:
            await ros.ask("delete_param", name="/use_sim_time")

    asyncio.run(main())


def test_no_master() -> None:
    async def main() -> None:
        world = Ros1World("http://127.0.0.1:9/", "127.0.0.1")
        with pytest.raises(
            Ros1Error, match=r"no ROS 1 master: http://127.0.0.1:9/ cannot be reached.*ROS_MASTER_URI"
        ):
            await world.open()

    asyncio.run(main())


def test_messages_of_the_client_library_are_what_rospy_reads(ros: Peer) -> None:
    imu = types.message("sensor_msgs/Imu")
    made = imu(orientation=types.message("geometry_msgs/Quaternion")(w=0.5))
    buf = bytearray(made.size())
    made.write(buf, 0)
    assert ros.do("serialized", type="sensor_msgs/Imu", message={"orientation": {"w": 0.5}}) == buf.hex()
