"""The programs of the guide that play a board or a node of ROS 1 do what is said of them."""

from __future__ import annotations

import asyncio
import re
import socket
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing, contextmanager
from pathlib import Path

from muros.ros1 import Ros1Node
from muros.rosserial import types
from muros.rosserial.messages import Values, log_untrusted, topic_info_untrusted, write_time
from muros.rosserial.node_handle import parse
from muros.rosserial.packets import Decoder, frame
from tests.ros1.peers import Master

GUIDE = (Path(__file__).parents[2] / "docs/rosserial.md").read_text()
BOARD, ROS1 = (
    next(text for text in re.findall(r"```python\n(.*?)```", GUIDE, re.DOTALL) if word in text)
    for word in ("NodeHandle(", "Ros1Node(")
)
PATIENCE = 20.0


@contextmanager
def running(program: str, *words: str, **variables: str) -> Iterator[subprocess.Popen[str]]:
    """A program of the guide."""
    process = subprocess.Popen(
        [sys.executable, "-u", "-c", program, *words],
        env=variables or None,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        yield process
    finally:
        process.kill()
        process.communicate()


class Host:
    """A server at the other end of a connection, which answers what every server answers."""

    def __init__(self, connection: socket.socket) -> None:
        self.connection = connection
        self.ids: dict[tuple[str, int], int] = {}
        self.got: list[tuple[int, bytes]] = []
        self._decoder = Decoder(4096, self._take)
        self.put(0, b"")

    def put(self, topic_id: int, payload: bytes | bytearray) -> None:
        self.connection.sendall(frame(topic_id, payload))

    def wait_for(self, topic_id: int) -> bytes:
        """The next payload with that id."""
        while True:
            for at, (found, payload) in enumerate(self.got):
                if found == topic_id:
                    del self.got[at]
                    return payload
            data = self.connection.recv(4096)
            assert data, "the board hung up"
            self._decoder.feed(data, len(data), 0)

    def _take(self, topic_id: int, buf: bytearray, off: int, n: int) -> None:
        if topic_id == 10:
            stamp = bytearray(8)
            write_time(stamp, 0, 1000, 0)
            self.put(10, stamp)
        elif topic_id < 6:
            info = topic_info_untrusted(buf, off, n)
            self.ids[info.topic_name, topic_id] = info.topic_id
        else:
            if topic_id == 6:
                values = Values([], [2.5], [])
                answer = bytearray(values.size())
                values.write(answer, 0)
                self.put(6, answer)
            self.got.append((topic_id, bytes(buf[off : off + n])))


def test_the_board() -> None:
    string = types.message("std_msgs/String")
    with closing(socket.create_server(("127.0.0.1", 0))) as listener:
        listener.settimeout(PATIENCE)
        with running(BOARD, str(listener.getsockname()[1])), closing(listener.accept()[0]) as connection:
            connection.settimeout(PATIENCE)
            host = Host(connection)
            payload = host.wait_for(7)
            assert log_untrusted(payload, 0, len(payload)) == (1, b"ready")
            assert b"~gain" in host.wait_for(6)
            host.put(host.ids["led_out", 1], b"\x04")
            payload = host.wait_for(host.ids["chatter", 0])
            assert parse(string, payload, 0, len(payload)).data == "LEDs are 0100"
            host.put(host.ids["beep", 3], b"\x01")
            payload = host.wait_for(host.ids["beep", 2])
            response = parse(types.service("std_srvs/SetBool").Response, payload, 0, len(payload))
            assert (response.success, response.message) == (True, "beep")


def test_the_node() -> None:
    async def main(process: subprocess.Popen[str], master: Master) -> None:
        node = Ros1Node("/talker", master.uri, "127.0.0.1")
        await node.open()
        chatter = node.publish("/chatter", "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1")
        async with asyncio.timeout(PATIENCE):
            while not chatter.subscribers:
                await asyncio.sleep(0.01)
        chatter.publish(b"\x02\0\0\0hi")
        assert process.stdout is not None
        assert await asyncio.to_thread(process.stdout.readline) == "b'\\x02\\x00\\x00\\x00hi'\n"
        await node.close()

    with Master() as master, running(ROS1, **master.environment) as process:
        asyncio.run(main(process, master))
