"""A node of ours among nodes of rospy, under Debian's rosmaster."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager

import pytest

from muros.ros1 import ApiError, ParameterTree, Ros1Error, Ros1Node, call, header
from muros.ros1._topics import BACKLOG
from tests.dds.peers import Peer
from tests.ros1.peers import Master

STRING = ("std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1")
SET_BOOL = ("std_srvs/SetBool", "09fb03525b03e7ea1fd3992bafd87e16")


@pytest.fixture(scope="module")
def master() -> Iterator[Master]:
    with Master() as made:
        yield made


@pytest.fixture(scope="module")
def ros(master: Master) -> Iterator[Peer]:
    with master.peer("peer") as made:
        yield made


class Station(Ros1Node):
    """A node that remembers what it reported."""

    def __init__(self, master: Master, name: str = "/muros") -> None:
        self.reports: list[tuple[str, ...]] = []
        super().__init__(name, master.uri, "127.0.0.1", lambda *report: self.reports.append(report))


@asynccontextmanager
async def station(master: Master, name: str = "/muros") -> AsyncIterator[Station]:
    made = Station(master, name)
    await made.open()
    try:
        yield made
    finally:
        await made.close()


async def until(done: object, wait: float = 15.0) -> None:
    """Waits until it is so."""
    assert callable(done)
    async with asyncio.timeout(wait):
        while not done():
            await asyncio.sleep(0.005)


def text(value: str) -> bytes:
    """A String in ROS 1 bytes."""
    return len(value.encode()).to_bytes(4, "little") + value.encode()


def test_topics_both_ways(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            got: list[bytes] = []
            up = node.publish("/up", *STRING)
            down = node.subscribe("/down", *STRING, got.append)
            heard = await ros.ask("subscriber", topic="/up", type="std_msgs/String")
            says = await ros.ask("publisher", topic="/down", type="std_msgs/String")
            assert await ros.ask("wait_for_publishers", subscriber=heard) == 1
            assert await ros.ask("wait_for_subscribers", publisher=says) == 1
            await until(lambda: down.connected and up.subscribers)
            for number in range(100):
                up.publish(text(f"up {number}"))
            taken = await ros.ask("take", subscriber=heard, count=100)
            assert [message["data"] for message in taken] == [f"up {number}" for number in range(100)]
            await ros.ask("publish", publisher=says, message={"data": "down"}, times=100)
            await until(lambda: len(got) == 100)
            assert set(got) == {text("down")}
            assert (up.dropped, node.reports) == (0, [])
            bus = await call(node.uri, "getBusInfo", "/test")
            assert [row[2:] for row in bus] == [["o", "TCPROS", "/up", True], ["i", "TCPROS", "/down", True]]
            assert bus[0][1] == "/peer"
            state = await ros.ask("state")
            assert state["publishers"]["/up"] == ["/muros"]
            assert state["subscribers"]["/down"] == ["/muros"]
            assert (await ros.ask("topics"))["/up"] == "std_msgs/String"
            node.remove(up)
            node.remove(down)
            assert await ros.ask("gone", node="/muros")
            await ros.ask("destroy", thing=heard)
            await ros.ask("destroy", thing=says)

    asyncio.run(main())


def test_a_latched_topic_and_one_of_any_type(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            latched = node.publish("/latched", *STRING, latch=True)
            latched.publish(text("old"))
            heard = await ros.ask("subscriber", topic="/latched", type="std_msgs/String")
            assert await ros.ask("take", subscriber=heard) == [{"data": "old"}]
            await ros.ask("destroy", thing=heard)
            got: list[bytes] = []
            says = await ros.ask("publisher", topic="/any", type="std_msgs/String", latch=True)
            node.subscribe("/any", "*", "*", got.append)
            await ros.ask("publish", publisher=says, message={"data": "whatever"})
            await until(lambda: got)
            assert got == [text("whatever")]
            await ros.ask("destroy", thing=says)

    asyncio.run(main())


def test_services_both_ways(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            asked: list[bytes] = []

            def on_request(request: object) -> None:
                asked.append(request.body)  # type: ignore[attr-defined]
                request.answer(b"\x01" + text("done"))  # type: ignore[attr-defined]
                request.answer(b"\x01" + text("again"))  # type: ignore[attr-defined]

            node.serve("/ours", *SET_BOOL, on_request)
            for _ in range(2):
                answer = await ros.ask(
                    "call", service="/ours", type="std_srvs/SetBool", request={"data": True}
                )
                assert answer == {"success": True, "message": "done"}
            assert asked == [b"\x01", b"\x01"]
            node.serve("/failing", *SET_BOOL, lambda request: request.fail("out of order"))
            with pytest.raises(AssertionError, match="out of order"):
                await ros.ask("call", service="/failing", type="std_srvs/SetBool", request={"data": True})
            theirs = await ros.ask(
                "serve", service="/theirs", type="std_srvs/SetBool", answer={"success": True, "message": "x"}
            )
            client = node.client("/theirs", *SET_BOOL)
            uri = await node.lookup("/theirs")
            answers = await asyncio.gather(*(client.call(uri, b"\0") for _ in range(5)))
            assert answers == [b"\x01" + text("x")] * 5
            client.close()
            assert await node.lookup("/nobody") == ""
            wrong = node.client("/theirs", SET_BOOL[0], "0" * 32)
            with pytest.raises(Ros1Error, match="md5sum"):
                await wrong.call(uri, b"\0")
            await ros.ask("destroy", thing=theirs)
            with pytest.raises((Ros1Error, OSError)):
                await client.call(uri, b"\0")

    asyncio.run(main())


def test_wrong_definitions_are_reported(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            node.publish("/wrong_up", "std_msgs/String", "0" * 32)
            node.subscribe("/wrong_down", "std_msgs/String", "0" * 32, lambda body: None)
            heard = await ros.ask("subscriber", topic="/wrong_up", type="std_msgs/String")
            says = await ros.ask("publisher", topic="/wrong_down", type="std_msgs/String")
            await until(lambda: {report[0] for report in node.reports} >= {"ros1-turned-away", "ros1-topic"})
            assert any(
                "wants topic /wrong_up to have datatype/md5sum" in report[2] for report in node.reports
            )
            await ros.ask("destroy", thing=heard)
            await ros.ask("destroy", thing=says)

    asyncio.run(main())


def test_parameters_are_followed(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            await ros.ask("set_param", name="/robot", value={"gain": 1.5, "names": ["a", "b"]})
            await ros.ask("set_param", name="/robot_description", value="<robot/>" * 100_000)
            tree = ParameterTree()
            tree.update("/", await node.watch_parameters(tree.update))
            assert tree.get("/robot/gain") == 1.5
            assert tree.get("/robot_description") == "<robot/>" * 100_000
            await ros.ask("delete_param", name="/robot_description")
            await ros.ask("set_param", name="/robot/gain", value=2)
            await until(lambda: tree.get("/robot/gain") == 2)
            await ros.ask("delete_param", name="/robot/gain")
            await until(lambda: tree.get("/robot/gain") is None)
            assert tree.get("/robot/names") == ["a", "b"]

    asyncio.run(main())


def test_a_new_master_is_told_everything() -> None:
    async def main() -> None:
        with Master() as master:
            async with station(master) as node:
                node.publish("/up", *STRING)
                node.serve("/ours", *SET_BOOL, lambda request: request.fail("no"))

                async def state() -> list[list[list[str]]]:
                    try:
                        found: list[list[list[str]]] = await master.ask("getSystemState")
                    except Ros1Error:
                        return [[], [], []]
                    return found

                async def registered() -> None:
                    async with asyncio.timeout(20):
                        while await state() != [[["/up", ["/muros"]]], [], [["/ours", ["/muros"]]]]:
                            await asyncio.sleep(0.05)

                await registered()
                master.stop()
                master.start()
                await registered()
                node.subscribe("/more", *STRING, lambda body: None)
                master.stop()
                node.publish("/late", *STRING)
                await until(lambda: any(report[0] == "ros1-master" for report in node.reports))
                master.start()
                async with asyncio.timeout(20):
                    while "/late" not in [name for name, _ in (await state())[0]]:
                        await asyncio.sleep(0.05)

    asyncio.run(main())


def test_a_node_that_is_told_to_end_leaves(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            node.publish("/up", *STRING)
            assert "/muros" in str(await ros.ask("state", publishers=["/up"]))
            assert await call(node.uri, "shutdown", "/rosnode", "user request") == 0
            assert await ros.ask("gone", node="/muros")
            assert [report[0] for report in node.reports] == ["ros1-shutdown"]
            node.publish("/later", *STRING).publish(text("to nobody"))

    asyncio.run(main())


def test_a_name_is_had_once(master: Master) -> None:
    async def main() -> None:
        async with station(master) as node:
            node.publish("/once", *STRING)
            node.serve("/once", *SET_BOOL, lambda request: None)
            with pytest.raises(Ros1Error, match="publishes /once already"):
                node.publish("/once", *STRING)
            with pytest.raises(Ros1Error, match="offers /once already"):
                node.serve("/once", *SET_BOOL, lambda request: None)
            async with station(master):  # of the same name: the graph throws the first out
                other = Station(master)
                await other.open()
                other.publish("/once", *STRING)
                await until(lambda: any(report[0] == "ros1-shutdown" for report in node.reports))
                await other.close()

    asyncio.run(main())


def test_a_subscriber_that_takes_nothing_stops_nobody(master: Master, ros: Peer) -> None:
    async def main() -> None:
        async with station(master) as node:
            up = node.publish("/up", *STRING)
            fields = {"callerid": "/stuck", "topic": "/up", "type": STRING[0], "md5sum": STRING[1]}
            _, writer = await asyncio.open_connection("127.0.0.1", node._port, limit=1)
            writer.write(header(fields))
            heard = await ros.ask("subscriber", topic="/up", type="std_msgs/String")
            await until(lambda: up.subscribers == 2)
            writer.transport.pause_reading()  # type: ignore[attr-defined]
            body = text("x" * 100_000)
            while not up.dropped:
                up.publish(body)
                await asyncio.sleep(0)
            stuck = next(each for each in up._connections if each.caller == "/stuck")
            assert BACKLOG < stuck.backlog < BACKLOG + 2 * len(body)
            await until(lambda: all(each.backlog == 0 for each in up._connections if each is not stuck))
            up.publish(text("the others hear it"))
            got = [{"data": ""}]
            while got[-1]["data"] != "the others hear it":
                got = await ros.ask("take", subscriber=heard)
                assert got
            writer.close()
            await until(lambda: up.subscribers == 1)
            await ros.ask("destroy", thing=heard)

    asyncio.run(main())


def test_a_slave_api_takes_no_nonsense(master: Master) -> None:
    async def main() -> None:
        async with station(master) as node:
            node.publish("/up", *STRING)
            down = node.subscribe("/down", *STRING, lambda body: None)
            await until(lambda: len(node._known) == 2)  # the master has told of the publishers there are
            for method, arguments in (
                ("requestTopic", ["/me", "/up", 5]),
                ("requestTopic", ["/me", "/up", [[], [1], ["UDPROS"]]]),
                ("requestTopic", ["/me", 7, []]),
                ("paramUpdate", []),
                ("shutdown", []),
            ):
                with pytest.raises(ApiError):
                    await call(node.uri, method, *arguments)
            await call(node.uri, "paramUpdate", "/me", 5, {})
            await call(node.uri, "publisherUpdate", "/me", "/down", "http://no.list")
            await call(
                node.uri,
                "publisherUpdate",
                "/me",
                "/down",
                ["nonsense", "http://" + "x" * 300, "http://[", 5],
            )
            assert len(down.publishers) == 4
            await call(
                node.uri, "publisherUpdate", "/me", "/down", [f"http://127.0.0.1:9/{n}" for n in range(100)]
            )
            assert len(down.publishers) == 64
            await asyncio.sleep(0.05)
            assert await call(node.uri, "getPublications", "/me") == [["/up", STRING[0]]]
            assert await call(node.uri, "getSubscriptions", "/me") == [["/down", STRING[0]]]

    asyncio.run(main())


@pytest.mark.parametrize(
    "junk", [b"\xff\xff\xff\x7f", b"GET / HTTP/1.1\r\n\r\n", b"\x04\0\0\0\x09\0\0\0", b"\0\0\0\0"]
)
def test_strangers_at_the_door(master: Master, junk: bytes) -> None:
    async def main() -> None:
        async with station(master) as node:
            node.publish("/up", *STRING)
            for _ in range(3):
                reader, writer = await asyncio.open_connection("127.0.0.1", node._port)
                writer.write(junk)
                writer.write_eof()
                await reader.read()
                writer.close()
            assert len(node._greeting) == 0

    asyncio.run(main())
