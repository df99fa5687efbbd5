"""A rosserial server in virtual time: a local space, a link that the test owns, and boards that are like ros_lib."""

from __future__ import annotations

import json
from collections.abc import Callable, Hashable
from pathlib import Path
from typing import Any

from muros import interfaces
from muros.findings import Finding, Findings
from muros.rosserial.constants import (
    ID_LOG,
    ID_PARAMETER_REQUEST,
    ID_PUBLISHER,
    ID_SERVICE_CLIENT,
    ID_SERVICE_SERVER,
    ID_SUBSCRIBER,
    ID_TIME,
    ID_TX_STOP,
)
from muros.rosserial.messages import (
    TopicInfo,
    Values,
    time_untrusted,
    values_untrusted,
    write_log,
    write_string,
)
from muros.rosserial.packets import VERSION_HYDRO, Decoder, frame
from muros.rosserial.server import Event, Identity, Limits, ServerCore, SpaceWorld
from muros.space import Qos, Reader, Requester, Service, Topic, Writer, open_space
from muros.xrce._types import Buffer

VECTORS = Path(__file__).parent.parent / "vectors" / "rosserial"
START = 1_700_000_000 * 10**9
"""The wall clock at tick 0, in ns."""


def vector(name: str) -> dict[str, Any]:
    """A recorded session."""
    loaded: dict[str, Any] = json.loads((VECTORS / f"{name}.json").read_text())
    return loaded


class Scene:
    """The server and its surroundings. ``step`` and ``run`` move the time, in ms."""

    def __init__(self, parameters: dict[str, Any] | None = None, baud: int = 0, **limits: int) -> None:
        self.now = 1_000
        self.space = open_space("local:", clock=lambda: self.now * 1_000_000)
        self.findings = Findings()
        self.told: list[Finding] = []
        self.findings.on_finding(self.told.append)
        self.events: list[Event] = []
        self.soon: list[Callable[[], object]] = []
        self.baud = baud
        self.world = SpaceWorld(
            self.space, wall=self.wall, later=self.soon.append, parameters=lambda node: parameters or {}
        )
        self.core = ServerCore(
            self.world, self.findings, limits=Limits(**limits), wall=self.wall, clock=lambda: self.now
        )
        self.core.on_event = self.events.append
        self.link = SceneLink(self)
        self.port = self.core.attach(self.link, self.identify)
        self.other = self.space.participant("other")
        self.boards: list[RosLib] = []

    def wall(self) -> int:
        """The wall clock in ns."""
        return START + self.now * 1_000_000

    def identify(self, address: Hashable) -> Identity:
        """Boards are called after their address."""
        return Identity(address, str(address), f"/board_{address}", self.baud)

    def step(self, ms: int = 1) -> None:
        """Lets time pass, a millisecond at a time."""
        for _ in range(ms):
            self.now += 1
            self.core.tick(self.now)
            for board in self.boards:
                board.tick()
            self.space.tick()
            soon, self.soon[:] = list(self.soon), []
            for call in soon:
                call()

    def until(self, condition: Callable[[], object], within: int = 5_000) -> int:
        """Lets time pass until something holds; returns how long it took."""
        start = self.now
        while not condition():
            assert self.now - start < within, f"not within {within} ms"
            self.step()
        return self.now - start

    def codes(self) -> set[str]:
        """The findings so far."""
        return {finding.code for finding in self.told}

    def said(self, kind: type[Event]) -> list[Any]:
        """The events of a kind so far."""
        return [event for event in self.events if isinstance(event, kind)]

    # Programs in the space

    def writer(self, name: str, type_name: str, qos: Qos | None = None) -> Callable[..., bool]:
        """A publisher in the graph: call it with the fields of a message."""
        made: Writer = self.other.writer(_topic(name, type_name), qos or Qos.preset("default"))
        kind = interfaces.message(type_name)
        return lambda **fields: made.write(kind(**fields).serialize())

    def reader(self, name: str, type_name: str, depth: int = 10_000) -> Callable[[], list[Any]]:
        """A subscriber in the graph: call it for what has come since; None is what cannot be decoded."""
        made: Reader = self.other.reader(_topic(name, type_name), Qos(depth=depth))
        kind = interfaces.message(type_name)

        def take() -> list[Any]:
            found = []
            while (sample := made.take()) is not None:
                try:
                    found.append(kind.deserialize(sample.data))
                except interfaces.CdrError:
                    found.append(None)
            return found

        return take

    def service(self, name: str, type_name: str) -> Service:
        """A service by its names."""
        return Service(
            name,
            interfaces.dds_request_topic(name),
            interfaces.dds_reply_topic(name),
            interfaces.dds_type_name(f"{type_name}_Request"),
            interfaces.dds_type_name(f"{type_name}_Response"),
        )

    def client(self, name: str, type_name: str) -> tuple[Callable[..., int], list[Any]]:
        """A client in the graph: a function that asks, and the answers."""
        kind = interfaces.service(type_name)
        answers: list[Any] = []
        made: Requester = self.other.requester(
            self.service(name, type_name),
            Qos.preset("services_default"),
            lambda number, data: answers.append(kind.Response.deserialize(data)),
        )
        return lambda **fields: made.send(kind.Request(**fields).serialize()), answers

    def server(self, name: str, type_name: str, answer: Callable[[Any], Any]) -> None:
        """A service in the graph."""
        kind = interfaces.service(type_name)

        def serve(identity: bytes, data: bytes) -> None:
            response = answer(kind.Request.deserialize(data))
            if response is not None:
                made.reply(identity, response.serialize())

        made = self.other.replier(self.service(name, type_name), Qos.preset("services_default"), serve)


class SceneLink:
    """A link whose far ends are the boards of the scene."""

    name = "scene"

    def __init__(self, scene: Scene) -> None:
        self.scene = scene
        self.sent: list[bytes] = []
        self.waiting = 0
        """What `backlog` says."""

    def send(self, message: bytes, address: Any) -> bool:
        """To the board, which gets it when it spins next."""
        self.sent.append(message)
        for board in self.scene.boards:
            if board.address == address:
                board.came += message
        return True

    def backlog(self, address: Any) -> int:
        """What waits."""
        return self.waiting


class RosLib:
    """A board as ros_lib makes it: silent until asked, asks for the time every 2.5 s, gives up after 11 s.

    Topics are added with `publisher`, `subscriber`, `server` and `client`, before or after it is plugged in.
    """

    def __init__(
        self, scene: Scene, address: str = "a", version: int = VERSION_HYDRO, buffer: int = 512
    ) -> None:
        self.scene = scene
        self.address = address
        self.version = version
        self.buffer = buffer
        self.infos: list[tuple[int, TopicInfo]] = []
        self.got: list[tuple[int, bytes]] = []
        """Frames that came, those of the protocol too."""
        self.came = bytearray()
        self.running = True
        self.clock: int | None = None
        """What it takes the time for at the last answer, in ns."""
        self.values: Values | None = None
        self.asked_time = 0
        scene.boards.append(self)
        self._next = 100
        self.boot()

    def boot(self) -> None:
        """It starts, or starts again."""
        self.connected = False
        self._synced_at = 0
        self._answered_at = 0
        self.decoder = Decoder(self.buffer, self._on_frame, self.version)
        self.came.clear()

    def plug(self) -> None:
        """Its line is there."""
        self.scene.port.up(self.address, self.scene.now)

    def pull(self) -> None:
        """Its cable is pulled."""
        self.scene.port.down(self.address, "cable pulled", self.scene.now)

    def publisher(self, name: str, type_name: str, md5: str | None = None) -> int:
        """A publisher; returns its id."""
        return self._add(ID_PUBLISHER, name, type_name, md5 or interfaces.md5(type_name))

    def subscriber(self, name: str, type_name: str, md5: str | None = None) -> int:
        """A subscriber; returns its id."""
        return self._add(ID_SUBSCRIBER, name, type_name, md5 or interfaces.md5(type_name))

    def server(self, name: str, type_name: str) -> tuple[int, int]:
        """A service; returns the ids of responses and requests."""
        return self._service(ID_SERVICE_SERVER, name, type_name, ("Response", "Request"))

    def client(self, name: str, type_name: str) -> tuple[int, int]:
        """A service client; returns the ids of requests and responses."""
        return self._service(ID_SERVICE_CLIENT, name, type_name, ("Request", "Response"))

    def send(self, topic_id: int, body: bytes) -> None:
        """A frame from the board."""
        self.raw(frame(topic_id, body, self.version))

    def raw(self, data: bytes) -> None:
        """Bytes from the board."""
        self.scene.port.receive(data, self.address, self.scene.now)

    def say(self, topic_id: int, type_name: str, **fields: Any) -> None:
        """Publishes, as far as ros_lib does: not while it is unconnected."""
        if self.connected:
            body = interfaces.message(type_name)(**fields).serialize()
            self.send(topic_id, interfaces.converter(type_name.replace("/msg/", "/")).to_ros1(body))

    def log(self, level: int, text: str) -> None:
        """Logs."""
        body = bytearray(5 + len(text.encode()))
        write_log(body, 0, level, text.encode())
        self.send(ID_LOG, bytes(body))

    def ask(self, name: str) -> None:
        """Asks for a parameter; the answer will be in ``values``."""
        body = bytearray(4 + len(name))
        write_string(body, 0, name.encode())
        self.values = None
        self.send(ID_PARAMETER_REQUEST, bytes(body))

    def taken(self, topic_id: int) -> list[bytes]:
        """What has come on an id since the last call."""
        found = [body for each, body in self.got if each == topic_id]
        self.got = [(each, body) for each, body in self.got if each != topic_id]
        return found

    def tick(self) -> None:
        """Spins once."""
        if not self.running:
            return
        now = self.scene.now
        data, self.came = bytes(self.came), bytearray()
        if self.connected and now - self._answered_at > 11_000:
            self.connected = False
        if data:
            self.decoder.feed(data, len(data), now)
            if self.version == VERSION_HYDRO and not self.connected and b"\xff\x00" in data:
                self._ask_time()
        self.decoder.tick(now)
        if self.connected and now - self._synced_at > 2_500:
            self._ask_time()

    def _ask_time(self) -> None:
        self._synced_at = self.scene.now
        self.asked_time += 1
        self.send(ID_TIME, bytes(8))

    def _on_frame(self, topic_id: int, buf: Buffer, off: int, n: int) -> None:
        body = bytes(memoryview(buf)[off : off + n])
        self.got.append((topic_id, body))
        if topic_id == ID_PUBLISHER:
            self._answered_at = self.scene.now
            self._ask_time()
            for half, info in self.infos:
                made = bytearray(info.size())
                info.write(made, 0)
                self.send(half, bytes(made))
            self.connected = True
        elif topic_id == ID_TIME:
            seconds, nanoseconds = time_untrusted(body, 0, n)
            trip = self.scene.now - self._synced_at
            self.clock = seconds * 10**9 + nanoseconds + trip * 1_000_000
            self._answered_at = self.scene.now
        elif topic_id == ID_PARAMETER_REQUEST:
            self.values = values_untrusted(body, 0, n)
        elif topic_id == ID_TX_STOP:
            self.connected = False

    def _add(self, half: int, name: str, type_name: str, md5: str) -> int:
        self._next += 1
        self.infos.append((half, TopicInfo(self._next, name, type_name, md5, self.buffer)))
        self.infos.sort(key=lambda pair: pair[0] in (1, 3, 5))
        return self._next

    def _service(self, half: int, name: str, type_name: str, halves: tuple[str, str]) -> tuple[int, int]:
        package, short = type_name.split("/")
        sums = [interfaces.md5(f"{package}/srv/{short}_{each}") for each in halves]
        return (
            self._add(half, name, type_name, sums[0]),
            self._add(half + 1, name, type_name, sums[1]),
        )


def string(text: str) -> bytes:
    """A std_msgs/String in ROS 1."""
    return len(text.encode()).to_bytes(4, "little") + text.encode()


def _topic(name: str, type_name: str) -> Topic:
    return Topic(interfaces.dds_topic(name), interfaces.dds_type_name(type_name))
