"""The server on real lines: TCP connections and pseudoterminals, with boards played by the client library."""

from __future__ import annotations

import asyncio
import os
import pty
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from muros import interfaces
from muros.findings import Finding
from muros.links import LinkError, PseudoterminalLink
from muros.links._terminal import make_raw
from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.packets import frame
from muros.rosserial.serial import Serial
from muros.rosserial.server import BoardBack, BoardHeard, BoardLost, BoardReady, Event, RawFraming, Server
from muros.rosserial.tcp import Tcp
from muros.rosserial.types import message, service
from muros.space import Participant, Qos, Service, Topic, open_space

PATIENCE_S = 20.0
String: Any = message("std_msgs/String")
Byte: Any = message("std_msgs/Byte")
SetBool: Any = service("std_srvs/SetBool")


class Rig:
    """A running server on a local space, what it tells, and the boards that are played here."""

    def __init__(self, **given: Any) -> None:
        self.space = open_space("local:")
        self.server = Server(self.space, **given)
        self.events: list[Event] = []
        self.told: list[Finding] = []
        self.server.on_event(self.events.append)
        self.server.on_finding(self.told.append)
        self.nodes: list[NodeHandle] = []

    def board(self, port: Any) -> NodeHandle:
        """A board on a line."""
        made = NodeHandle(port)
        self.nodes.append(made)
        return made

    async def until(self, condition: Callable[[], object]) -> None:
        """Lets server and boards work until something holds."""
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                for node in self.nodes:
                    node.spin_once(0)
                await asyncio.sleep(0.001)

    def said(self, kind: type[Event]) -> list[Any]:
        """The events of a kind so far."""
        return [event for event in self.events if isinstance(event, kind)]

    def other(self) -> Participant:
        """Another program in the space."""
        return self.space.participant("other")


@asynccontextmanager
async def rig(**given: Any) -> AsyncIterator[Rig]:
    made = Rig(**given)
    try:
        yield made
    finally:
        made.server.close()
        made.space.close()
        for node in made.nodes:
            node._port.close()


def topic(name: str, type_name: str) -> Topic:
    return Topic(interfaces.dds_topic(name), interfaces.dds_type_name(type_name))


def test_many_boards_dial_in_to_one_port() -> None:
    async def scenario() -> None:
        async with rig() as scene:
            link: Any = scene.server.add_tcp(0, "127.0.0.1")
            await scene.server.start()
            boards = [scene.board(Tcp("127.0.0.1", link.port)) for _ in range(5)]
            got: list[tuple[int, int]] = []
            pubs = []

            def note(number: int, led: Any) -> None:
                got.append((number, led.data))

            for i, board in enumerate(boards):
                pubs.append(board.advertise("chatter", String))
                board.subscribe("led_out", Byte, partial(note, i))
            await scene.until(lambda: len(scene.said(BoardReady)) == 5)
            other = scene.other()
            heard: list[str] = []
            kind = interfaces.message("std_msgs/msg/String")

            def take(reader: Any) -> None:
                while (sample := reader.take()) is not None:
                    heard.append(kind.deserialize(sample.data).data)

            other.reader(topic("/chatter", "std_msgs/msg/String"), Qos(depth=1000), take)
            switch = other.writer(topic("/led_out", "std_msgs/msg/Byte"), Qos.preset("default"))
            switch.write(interfaces.message("std_msgs/msg/Byte")(data=4).serialize())
            for i, pub in enumerate(pubs):
                for n in range(20):
                    assert pub.publish(String(data=f"{i}.{n}")) > 0
            await scene.until(lambda: len(heard) == 100 and len(got) == 5)
            assert sorted(got) == [(i, 4) for i in range(5)]
            for i in range(5):
                assert [text for text in heard if text[0] == str(i)] == [f"{i}.{n}" for n in range(20)]
            names = {node.full_name for node in scene.space.graph.nodes}
            assert "/serial_node_127_0_0_1" in names
            assert "/serial_node_127_0_0_1_5" in names
            assert not scene.told

    asyncio.run(scenario())


def test_services_both_ways_over_a_pseudoterminal() -> None:
    async def scenario() -> None:
        async with rig() as scene:
            line = PseudoterminalLink(make_framing=RawFraming)
            scene.server.add_link(line, name="/opencr")
            await scene.server.start()
            assert line.device is not None
            board = scene.board(Serial(line.device, 57600))
            board.advertise_service(
                "switch", SetBool, lambda r: SetBool.Response(success=r.data, message="ok")
            )
            lamp = board.service_client("lamp", SetBool)
            await scene.until(lambda: scene.said(BoardReady))
            assert scene.said(BoardReady)[0].node == "/opencr"
            other = scene.other()
            kind = interfaces.service("std_srvs/srv/SetBool")
            names = {
                name: Service(
                    name,
                    interfaces.dds_request_topic(name),
                    interfaces.dds_reply_topic(name),
                    "std_srvs::srv::dds_::SetBool_Request_",
                    "std_srvs::srv::dds_::SetBool_Response_",
                )
                for name in ("/switch", "/lamp")
            }
            answers: list[Any] = []
            client = other.requester(
                names["/switch"], None, lambda n, data: answers.append(kind.Response.deserialize(data))
            )
            served = other.replier(
                names["/lamp"],
                None,
                lambda i, data: served.reply(
                    i, kind.Response(success=kind.Request.deserialize(data).data, message="lamp").serialize()
                ),
            )
            client.send(kind.Request(data=True).serialize())
            await scene.until(lambda: answers)
            assert (answers[0].success, answers[0].message) == (True, "ok")
            asked: list[Any] = []

            def ask() -> None:
                asked.append(lamp.call(SetBool.Request(data=True), 5_000))

            task = asyncio.get_running_loop().run_in_executor(None, ask)
            nodes, scene.nodes = scene.nodes, []  # the board spins in its call
            await task
            scene.nodes = nodes
            assert (asked[0].success, asked[0].message) == (True, "lamp")

    asyncio.run(scenario())


def test_a_cable_is_pulled_and_plugged_in(tmp_path: Path) -> None:
    async def scenario() -> None:
        port = tmp_path / "ttyACM0"
        async with rig() as scene:
            scene.server.add_serial(str(port), 115200, name="/board")
            await scene.server.start()
            await scene.until(lambda: any(told.code == "port-absent" for told in scene.told))

            def plug() -> tuple[int, NodeHandle]:
                near, far = pty.openpty()
                make_raw(far)
                name = os.ttyname(far)
                os.close(far)
                scene.nodes.clear()
                port.symlink_to(name)
                os.set_blocking(near, False)
                return near, scene.board(FdPort(near))

            near, board = plug()
            board.advertise("chatter", String)
            await scene.until(lambda: scene.said(BoardReady))
            gids = [writer.gid for writer in scene.space.graph.writers]
            port.unlink()
            os.close(near)
            scene.nodes.clear()
            await scene.until(lambda: scene.said(BoardLost))
            near, board = plug()
            board.advertise("chatter", String)
            await scene.until(lambda: scene.said(BoardBack))
            await scene.until(lambda: board.connected)
            assert [writer.gid for writer in scene.space.graph.writers] == gids
            os.close(near)

    asyncio.run(scenario())


class FdPort:
    """The far end of a pseudoterminal, as a port of a board."""

    def __init__(self, fd: int) -> None:
        self.fd = fd

    def open(self) -> bool:
        return True

    def close(self) -> None:
        pass

    def wait(self, timeout: int) -> None:
        pass

    def send(self, buf: Any, off: int, n: int) -> None:
        os.write(self.fd, bytes(memoryview(buf)[off : off + n]))

    def receive(self, feed: Callable[[Any, int], object]) -> None:
        try:
            data = os.read(self.fd, 4096)
        except BlockingIOError:
            return
        feed(data, len(data))


def test_the_rate_of_a_line_is_found_out(tmp_path: Path) -> None:
    """A pseudoterminal keeps the rate that is set at its far end, so a board can tell whether it would understand."""
    import termios

    async def scenario() -> None:
        near, far = pty.openpty()
        make_raw(far)
        os.set_blocking(near, False)
        port = tmp_path / "ttyUSB0"
        port.symlink_to(os.ttyname(far))

        class Picky(FdPort):
            def receive(self, feed: Callable[[Any, int], object]) -> None:
                right = termios.tcgetattr(far)[4] == termios.B230400
                super().receive(feed if right else lambda data, n: None)

        async with rig(ask=20) as scene:
            scene.server.add_serial(str(port), None, name="/board")
            await scene.server.start()
            board = scene.board(Picky(near))
            board.advertise("chatter", String)
            await scene.until(lambda: scene.said(BoardHeard))
            assert scene.said(BoardHeard)[0].board == str(port)
            await scene.until(lambda: board.connected)
        os.close(near)
        os.close(far)

    asyncio.run(scenario())


def test_boards_are_told_when_the_server_stops() -> None:
    async def scenario() -> None:
        async with rig() as scene:
            link: Any = scene.server.add_tcp(0, "127.0.0.1")
            await scene.server.start()
            board = scene.board(Tcp("127.0.0.1", link.port))
            board.advertise("chatter", String)
            await scene.until(lambda: board.connected)
            await scene.server.stop()
            await scene.until(lambda: not board.connected)
            with pytest.raises(RuntimeError, match="make a new one"):
                await scene.server.start()

    asyncio.run(scenario())


def test_hostile_bytes_harm_only_who_sends_them() -> None:
    async def scenario() -> None:
        async with rig() as scene:
            link: Any = scene.server.add_tcp(0, "127.0.0.1")
            await scene.server.start()
            board = scene.board(Tcp("127.0.0.1", link.port))
            pub = board.advertise("chatter", String)
            await scene.until(lambda: board.connected)
            loop = asyncio.get_running_loop()
            foes = [socket.create_connection(("127.0.0.1", link.port)) for _ in range(3)]
            for foe in foes:
                foe.setblocking(False)
            evil = (
                b"\xff\xfe\xff\xff\x01" * 2000,
                frame(0, b"\xff" * 60) * 50 + frame(6, b"\x10\x00\x00\x00abc") * 50 + frame(7, b"") * 50,
                b"".join(frame(i, bytes(4)) for i in range(256)),
            )
            for foe, data in zip(foes, evil, strict=True):
                await loop.sock_sendall(foe, data * 3)
            heard: list[Any] = []
            scene.other().reader(
                topic("/chatter", "std_msgs/msg/String"),
                Qos(depth=100),
                lambda reader: heard.append(reader.take()),
            )
            pub.publish(String(data="unharmed"))
            await scene.until(lambda: heard)
            for foe in foes:
                foe.close()

    asyncio.run(scenario())


def test_what_cannot_be_opened_is_said() -> None:
    async def scenario() -> None:
        async with rig() as scene:
            scene.server.add_tcp(0, "203.0.113.7")
            with pytest.raises(LinkError):
                await scene.server.start()

    asyncio.run(scenario())


def test_a_failure_of_ours_at_a_timer_ends_nothing() -> None:
    async def scenario() -> None:
        failures: list[Any] = []
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: failures.append(context))
        async with rig(ask=20) as scene:
            link: Any = scene.server.add_tcp(0, "127.0.0.1")
            tick = scene.server.core.tick

            def fail(now: int) -> int | None:
                if len(failures) < 2:
                    raise RuntimeError("a mistake")
                return tick(now)

            scene.server.core.tick = fail  # type: ignore[method-assign]
            await scene.server.start()
            board = scene.board(Tcp("127.0.0.1", link.port))
            board.advertise("chatter", String)
            await scene.until(lambda: scene.said(BoardReady))
            assert [str(each["exception"]) for each in failures] == ["a mistake"] * 2

    asyncio.run(scenario())
