"""A stock micro-ROS client, as it was recorded, through `muros agent` into the graph of ROS 2.

The client's datagrams are those of the recording, in its order; only the number of the domain is the test's own, and
in one test the type of its service, for machines where no `example_interfaces` can be compiled for ROS 2 from PyPI.
"""

import json
import re
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Self

import pytest

from tests.dds.bodies import basic, basic_value, string, text_of
from tests.dds.domains import Domain
from tests.dds.peers import Peer, require

RECORDING = Path(__file__).parents[1] / "vectors/rmw/session_capture.json"
SETTLED = 120
"""Rows of the recording until everything is created."""
NODES = ["/ns/listener", "/talker"]

CREATE, WRITE_DATA, DATA, ACKNACK = 1, 7, 9, 10
WRITER, READER, REPLIER = 0x0005, 0x0006, 0x0008
RELIABLE = 0x80

Fetch = Callable[[str], Peer]


class Client:
    """Sends what was recorded, then speaks for itself on the streams that the recording left."""

    def __init__(self, port: int, domain: int, service: str = "") -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self._socket.connect(("127.0.0.1", port))
        self._socket.settimeout(0.02)
        self._rows = json.loads(RECORDING.read_text())["rows"][:SETTLED]
        self._domain = domain
        self._service = service
        self._next = 0
        self._acknowledged = 0
        self._heard: set[bytes] = set()
        self.got: list[tuple[int, bytes]] = []

    def create(self) -> None:
        """The recorded session up to where everything is created, each answer awaited."""
        for number, (kind, _, content) in enumerate(self._rows):
            if kind == "tx" and bytes.fromhex(content)[4] != ACKNACK:
                expected = self._statuses_behind(number)
                message = self._ours(bytes.fromhex(content))
                if message[1] == RELIABLE:
                    self._next = struct.unpack_from("<H", message, 2)[0] + 1
                self._socket.send(message)
                self._listen(lambda expected=expected: expected <= self._heard)  # type: ignore[misc]

    def write(self, object_id: int, body: bytes) -> None:
        """WRITE_DATA on the reliable stream."""
        payload = struct.pack(">HH", 0x100 + self._next, object_id) + body
        head = struct.pack("<BBHBBH", 0x81, RELIABLE, self._next, WRITE_DATA, 1, len(payload))
        self._next += 1
        self._socket.send(head + payload)

    def data(self, object_id: int, wait: float = 15.0) -> bytes:
        """The body of the next DATA from a reader or replier."""
        found: list[tuple[int, bytes]] = []

        def came() -> bool:
            found.extend(each for each in self.got if each[0] == object_id)
            return bool(found)

        self._listen(came, wait)
        self.got.remove(found[0])
        return found[0][1]

    def close(self) -> None:
        self._socket.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _statuses_behind(self, number: int) -> set[bytes]:
        """The recorded statuses that came before the next message was sent."""
        said = set()
        for kind, _, content in self._rows[number + 1 :]:
            message = bytes.fromhex(content) if kind != "status" else b""
            if kind == "tx" and message[4] != ACKNACK:
                break
            if kind == "rx" and message[4] == 5:
                said.add(message[8:14])
        return said

    def _ours(self, message: bytes) -> bytes:
        """The same with the test's domain, and with another type of service where it is asked for."""
        at = 4
        while at + 4 <= len(message):
            kind, _, n = struct.unpack_from("<BBH", message, at)
            if kind == CREATE and message[at + 8] == 1:
                end = at + 4 + n
                message = message[: end - 2] + struct.pack("<H", self._domain) + message[end:]
            if kind == CREATE and message[at + 8] in (7, 8) and self._service:
                return message[:at] + self._with_service(message[at : at + 4 + n])
            at += 4 + n + (-n & 3)
        return message

    def _with_service(self, create: bytes) -> bytes:
        """CREATE of a requester or replier whose types are others: name, types, topics, parent."""
        representation = b""

        def text(value: str) -> None:
            nonlocal representation
            representation += bytes(-len(representation) & 3)
            representation += struct.pack("<I", len(value) + 1) + value.encode() + b"\0"

        text("/add_two_ints")
        for part in ("Request", "Response"):
            text(f"{self._service}_{part}_")
        for topic in ("rq/add_two_intsRequest", "rr/add_two_intsReply"):
            representation += b"\1"
            text(topic)
        body = create[4:10] + b"\0\0" + struct.pack("<I", len(representation)) + representation
        body += b"\0\1"  # the participant
        return create[:2] + struct.pack("<H", len(body)) + body

    def _listen(self, enough: Callable[[], bool], wait: float = 15.0) -> None:
        end = time.monotonic() + wait
        while not enough():
            assert time.monotonic() < end, "the agent does not say what it should"
            with suppress(TimeoutError):
                self._take(self._socket.recv(2048))

    def _take(self, message: bytes) -> None:
        stream, number = message[1], struct.unpack_from("<H", message, 2)[0]
        if stream == RELIABLE:
            if number != self._acknowledged:  # what comes early or twice comes again
                self._acknowledge()
                return
            self._acknowledged += 1
            self._acknowledge()
        at = 4
        while at + 4 <= len(message):
            kind, _, n = struct.unpack_from("<BBH", message, at)
            body = message[at + 4 : at + 4 + n]
            if kind == 5:
                self._heard.add(body[:6])
            elif kind == DATA:
                self.got.append((struct.unpack(">H", body[2:4])[0], body[4:]))
            at += 4 + n + (-n & 3)

    def _acknowledge(self) -> None:
        self._socket.send(
            bytes.fromhex("810000000a010500") + struct.pack("<HBBB", self._acknowledged, 0, 0, RELIABLE)
        )


@contextmanager
def agent(*options: str) -> Iterator[int]:
    """`muros agent` as users start it, on loopback; gives its port."""
    command = [sys.executable, "-m", "muros", "agent", "udp4", "-p", "0", "--bind", "127.0.0.1", *options]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
    assert process.stdout is not None
    try:
        banner = process.stdout.readline()
        port = re.search(r"udp4 127\.0\.0\.1:(\d+)", banner)
        assert port, banner + process.communicate(timeout=20)[0]
        yield int(port[1])
        process.send_signal(signal.SIGTERM)
        assert process.wait(20) == 0
    finally:
        process.kill()
        process.wait(20)
        process.stdout.close()


@pytest.mark.parametrize("name", ["jazzy", "kilted"])
def test_rclpy_meets_a_stock_client(name: str, peer: Fetch, domain: Domain) -> None:
    """Its nodes, its topics and services with their types, its messages, and ours to it; all of it goes with it."""
    ros = peer(name)
    with agent("-m", "dds") as port, Client(port, domain) as client:
        client.create()
        node = ros.do("node", name="ros", domain=domain)
        assert set(NODES) <= set(ros.do("nodes", node=node, names=NODES))
        here = ros.do("of_node", node=node, name="talker", names=["/chatter", "/imu/data", "/add_two_ints"])
        assert here["publishers"]["/chatter"] == ["std_msgs/msg/String"]
        assert here["publishers"]["/imu/data"] == ["sensor_msgs/msg/Imu"]
        assert here["services"]["/add_two_ints"] == ["example_interfaces/srv/AddTwoInts"]
        there = ros.do("of_node", node=node, name="listener", namespace="/ns", names=["/chatter"])
        assert there["subscribers"]["/chatter"] == ["std_msgs/msg/String"]
        (info,) = [
            each
            for each in ros.do("endpoints", node=node, topic="/chatter", publishers=1)["publishers"]
            if each["node"] == "/talker"
        ]
        assert info["hash"].startswith("RIHS01_df668c740482bbd4")

        heard = ros.do("subscription", node=node, topic="/chatter", type="std_msgs/msg/String")
        ros.do("matched", thing=heard, count=1)
        client.write(WRITER, string("hello"))
        assert text_of(client.data(READER)) == "hello"  # it reads its own topic, as in the recording
        assert ros.do("take", subscription=heard) == [{"data": "hello"}]
        said = ros.do("publisher", node=node, topic="/chatter", type="std_msgs/msg/String")
        ros.do("matched", thing=said, count=2)
        ros.do("publish", publisher=said, message={"data": "from ROS"})
        assert text_of(client.data(READER)) == "from ROS"
    assert not set(NODES) & set(ros.do("nodes_without", node=node, names=NODES))


@pytest.mark.parametrize("name", ["jazzy", "kilted"])
def test_rclpy_calls_the_service_of_a_stock_client(name: str, peer: Fetch, domain: Domain) -> None:
    """As it was recorded: AddTwoInts, found by its name and type, asked three times."""
    require(name, "example_interfaces")
    ros = peer(name)
    with agent("-m", "dds") as port, Client(port, domain) as client:
        client.create()
        node = ros.do("node", name="ros", domain=domain)
        asks = ros.do("client", node=node, name="/add_two_ints", type="example_interfaces/srv/AddTwoInts")
        for a, b in [(2, 3), (-(2**63), 2**63 - 1), (2**40, 1)]:
            ros.begin("call", client=asks, request={"a": a, "b": b})
            request = client.data(REPLIER)
            identity, body = request[:24], request[24:]
            assert struct.unpack("<qq", body) == (a, b)
            client.write(REPLIER, identity + struct.pack("<q", sum(struct.unpack("<qq", body))))
            assert ros.result(30) == [{"sum": a + b}]


@pytest.mark.parametrize("name", ["jazzy", "kilted"])
def test_rclpy_calls_a_service_of_another_type(name: str, peer: Fetch, domain: Domain) -> None:
    """The same, with a type that ROS 2 from PyPI has."""
    ros = peer(name)
    with agent() as port, Client(port, domain, "test_msgs::srv::dds_::BasicTypes") as client:
        client.create()
        node = ros.do("node", name="ros", domain=domain)
        asks = ros.do("client", node=node, name="/add_two_ints", type="test_msgs/srv/BasicTypes")
        ros.begin("call", client=asks, request={"int32_value": 2, "int64_value": 3})
        request = client.data(REPLIER)
        identity, body = request[:24], request[24:]
        client.write(REPLIER, identity + basic(0, sum(basic_value(body))))
        (answer,) = ros.result(30)
        assert answer["int64_value"] == 5
