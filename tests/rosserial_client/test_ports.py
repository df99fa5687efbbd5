"""NodeHandle over real lines: TCP, a serial port, and from MicroPython, with a host made of frames."""

from __future__ import annotations

import os
import pty
import select
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pytest

from muros.rosserial import types
from muros.rosserial.messages import topic_info_untrusted, write_time
from muros.rosserial.node_handle import NodeHandle, parse
from muros.rosserial.packets import Decoder, frame
from muros.rosserial.serial import Serial
from muros.rosserial.tcp import Tcp
from tests.micropython.runtimes import ROOT, UNIX, require

String = types.message("std_msgs/String")
PATIENCE = 10.0
"""Seconds that something may take on a busy machine."""


class Host:
    """A host on a file descriptor: it asks for topics, tells the time, and echoes ``talks`` on ``hears``."""

    def __init__(self, fd: int) -> None:
        self.fd = fd
        self.names: dict[int, str] = {}
        self.heard: list[str] = []
        self._decoder = Decoder(4096, self._take)
        self.put(0)

    def put(self, topic_id: int, payload: bytes = b"") -> None:
        os.write(self.fd, frame(topic_id, payload))

    def turn(self) -> None:
        """Takes what is there."""
        if select.select([self.fd], [], [], 0)[0]:
            data = os.read(self.fd, 4096)
            self._decoder.feed(data, len(data), 0)

    def _take(self, topic_id: int, buf: Any, off: int, n: int) -> None:
        if topic_id == 10:
            stamp = bytearray(8)
            write_time(stamp, 0, 1000, 0)
            self.put(10, bytes(stamp))
        elif topic_id < 6:
            info = topic_info_untrusted(buf, off, n)
            self.names[info.topic_id] = info.topic_name
        else:
            payload = bytes(buf[off : off + n])
            self.heard.append(str(parse(String, payload, 0, n).data))
            back = [other for other, name in self.names.items() if name == "hears"]
            self.put(back[0], payload)


def until(done: Callable[[], object], *turns: Callable[[], object]) -> None:
    """Turns everything until it is so."""
    end = time.monotonic() + PATIENCE
    while not done():
        assert time.monotonic() < end, "not in time"
        for turn in turns:
            turn()


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    with closing(socket.create_server(("127.0.0.1", 0))) as made:
        yield made


def talk(node: NodeHandle, host: Host, heard: list[str]) -> None:
    """Board and host meet and speak."""
    talks = node.advertise("talks", String)
    node.subscribe("hears", String, lambda message: heard.append(message.data))
    until(lambda: node.connected, lambda: node.spin_once(5), host.turn)
    assert talks.publish(String("over the line")) > 0
    until(lambda: heard, lambda: node.spin_once(5), host.turn)
    assert heard == host.heard == ["over the line"]


def test_tcp_dials_again(listener: socket.socket) -> None:
    node = NodeHandle(Tcp("127.0.0.1", listener.getsockname()[1]))
    heard: list[str] = []
    node.spin_once()
    connection = listener.accept()[0]
    talk(node, Host(connection.fileno()), heard)
    connection.close()
    until(lambda: not node.connected, lambda: node.spin_once(5))
    listener.settimeout(0.0)
    again: list[socket.socket] = []

    def accept() -> None:
        try:
            again.append(listener.accept()[0])
        except BlockingIOError:
            node.spin_once(5)

    until(lambda: again, accept)
    host = Host(again[0].fileno())
    until(lambda: node.connected, lambda: node.spin_once(5), host.turn)
    until(lambda: len(host.names) == 2, lambda: node.spin_once(5), host.turn)
    again[0].close()
    node.close()


def test_serial_port() -> None:
    ours, theirs = pty.openpty()
    try:
        node = NodeHandle(Serial(os.ttyname(theirs), 115200))
        node.spin_once()
        talk(node, Host(ours), [])
        node.close()
    finally:
        os.close(ours)
        os.close(theirs)


def test_serial_port_that_is_not_there(tmp_path: Path) -> None:
    node = NodeHandle(Serial(str(tmp_path / "ttyUSB7")))
    assert not node.spin_once()
    with pytest.raises(ValueError, match="no such speed"):
        Serial("/dev/null", 12345)


PROGRAM = """
from muros.rosserial.node_handle import NodeHandle
from muros.rosserial.tcp import Tcp
from ros1.std_msgs import String
from ros1.sensor_msgs import JointState
from ros1.std_srvs import SetBool
import sys, time

node = NodeHandle(Tcp("127.0.0.1", int(sys.argv[1])))
talks = node.advertise("talks", String)
heard = []
node.subscribe("hears", String, heard.append)
while not node.spin_once(10):
    pass
talks.publish(String("from a board"))
while not heard:
    node.spin_once(10)
print("heard", heard[0].data)
state = JointState(name=["a", "b"], position=[0.5, -1.5])
buf = bytearray(state.size())
assert state.write(buf, 0) == len(buf)
again = JointState()
assert again.read(buf, 0, len(buf)) == len(buf)
print("read", again.name, again.position, again.header.stamp)
print("sums", JointState.MD5, SetBool.Request.MD5)
"""


def test_micropython_with_written_types(listener: socket.socket, tmp_path: Path) -> None:
    require("unix")
    written = types.write(["std_msgs/String", "sensor_msgs/JointState", "std_srvs/SetBool"], tmp_path)
    assert [path.name for path in written] == ["__init__.py", "sensor_msgs.py", "std_msgs.py", "std_srvs.py"]
    (tmp_path / "program.py").write_text(PROGRAM)
    process = subprocess.Popen(
        [str(UNIX), str(tmp_path / "program.py"), str(listener.getsockname()[1])],
        env={"MICROPYPATH": f".frozen:{tmp_path}:{ROOT / 'src'}"},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    try:
        listener.settimeout(PATIENCE)
        with closing(listener.accept()[0]) as connection:
            host = Host(connection.fileno())
            until(lambda: host.heard, host.turn)
            output = process.communicate(timeout=PATIENCE)[0]
    finally:
        process.kill()
        process.communicate()
    assert host.heard == ["from a board"]
    state = types.message("sensor_msgs/JointState")
    half = types.message("std_srvs/SetBool_Request")
    assert output.splitlines() == [
        "heard from a board",
        "read ['a', 'b'] [0.5, -1.5] (0, 0)",
        f"sums {state.MD5} {half.MD5}",
    ]
