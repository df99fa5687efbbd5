"""Boards in a ROS 1 graph: each is a node of the master, its messages pass as they are.

A board whose definition of a message is an older one is heard by today's nodes all the same: its messages are
converted, as for ROS 2. Types that are unknown here pass under the md5 sum that the board says.
"""

from __future__ import annotations

import asyncio
import struct
import time
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from muros import interfaces
from muros.findings import Findings
from muros.interfaces import CdrError, Converter, InterfaceError
from muros.ros1 import (
    ParameterTree,
    Publication,
    Request,
    Ros1Error,
    Ros1Node,
    ServiceServer,
    Subscription,
    UnreachableError,
    resolve,
)
from muros.rosserial.server._door import (
    LATCHED,
    READ_DEPTH,
    BodyError,
    NamedService,
    OnData,
    OnReply,
    RefusedError,
)

__all__ = ["Ros1World"]

_UNHEARD = 50
"""Lines of a log that are kept for its first reader."""
LOOK = 1.0
"""Seconds between looks at whether somebody serves what a board calls."""

_LEVELS = (1, 2, 4, 8, 16)
"""Levels of rosgraph_msgs/Log for those of rosserial."""
_BOX_REMEDY = "Generate the firmware's message headers from the definitions that the graph uses"


class Ros1World:
    """The graph of a ROS 1 master as boards meet it, in the running event loop.

    ``master`` is its address (default ``$ROS_MASTER_URI``), ``host`` the name or address that others reach this
    machine by (default ``$ROS_HOSTNAME``, ``$ROS_IP``, or the interface that leads to the master). ``wall`` gives the
    wall clock in ns; under ``/use_sim_time`` the graph's clock goes before it. ``remap`` renames topics and services,
    by the names that boards say.
    """

    def __init__(
        self,
        master: str = "",
        host: str = "",
        *,
        findings: Findings | None = None,
        wall: Callable[[], int] = time.time_ns,
        clock: Callable[[], float] = time.monotonic,
        remap: Mapping[str, str] | None = None,
    ) -> None:
        self._findings = findings
        self._clock = clock
        self._wall = wall
        self.remap = dict(remap or {})
        self._own = Ros1Node("/muros_rosserial", master, host, self._reporter("ROS 1"))
        self.master = self._own.master
        self.host = self._own.host
        self.parameters = ParameterTree()
        self._simulated: int | None = None
        self._tasks: set[asyncio.Task[Any]] = set()
        self.services: frozenset[str] = frozenset()
        """What the graph served when it was looked at last."""
        self._looking: asyncio.Task[Any] | None = None

    async def open(self) -> None:
        """Reads the parameters of the graph. Raises :class:`muros.ros1.Ros1Error` if there is no master."""
        try:
            await self._own.open()
            self.parameters = ParameterTree(await self._own.watch_parameters(self._on_parameter))
        except OSError as error:
            raise Ros1Error(f"cannot listen for ROS 1 nodes: {error}") from None
        except UnreachableError as error:
            await self._own.close()
            raise Ros1Error(f"no ROS 1 master: {error}. Start it (roscore), or set ROS_MASTER_URI") from None
        self._follow_clock()
        await asyncio.to_thread(
            interfaces.converter, "std_msgs/String"
        )  # definitions are read once, not for a board

    async def close(self) -> None:
        """Takes what is left out of the graph."""
        if self._looking is not None:
            self._looking.cancel()
        await self._own.close()
        while self._tasks:
            await asyncio.gather(*self._tasks, return_exceptions=True)

    def node(self, name: str, owner: str) -> Ros1BoardNode:
        """A node for a board."""
        try:
            full = resolve(name, "/")
        except Ros1Error as error:
            raise RefusedError(str(error), "Give it another name: --name") from None
        node = Ros1Node(full, self.master, self.host, self._reporter(owner))
        return Ros1BoardNode(self, node, owner, self.later(node.open()))

    def time(self) -> int:
        """The graph's time in ns: the wall clock's, or a simulation's."""
        return self._wall() if self._simulated is None else self._simulated

    def setting(self, node: str, name: str) -> Any:
        """The parameter ``~name`` of a node, or ``/name`` of the graph; None if it is not set."""
        return self.parameters.get(name if name.startswith("/") else f"{node}/{name}")

    def watch_services(self) -> None:
        """Keeps ``services`` up to date from now on: the master tells of none by itself."""
        if self._looking is None:
            self._looking = self.later(self._look())

    def later(self, work: Any) -> asyncio.Task[Any]:
        """Runs a coroutine beside everything else, until it is done."""
        task = asyncio.get_running_loop().create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    def report(
        self, code: str, who: str, what: str, why: str, remedy: str, subject: str = "", n: int = 1
    ) -> None:
        """Makes a finding."""
        if self._findings is not None:
            self._findings.report(
                code,
                who=who,
                what=what,
                why=why,
                remedy=remedy,
                now=self._clock(),
                subject=subject or what,
                n=n,
            )

    async def _look(self) -> None:
        while True:
            try:
                _, _, services = await self._own.ask("getSystemState")
                self.services = frozenset(str(name) for name, _ in services)
            except (Ros1Error, ValueError, TypeError):
                self.services = frozenset()
            await asyncio.sleep(LOOK)

    def _reporter(self, who: str) -> Callable[[str, str, str, str], None]:
        return lambda code, what, why, remedy: self.report(code, who, what, why, remedy)

    def _on_parameter(self, key: str, value: Any) -> None:
        self.parameters.update(key, value)
        self._follow_clock()

    def _follow_clock(self) -> None:
        if self.parameters.get("/use_sim_time") is True and self._simulated is None:
            self._simulated = 0
            clock = "rosgraph_msgs/Clock"
            self._own.subscribe("/clock", clock, interfaces.md5(clock), self._on_clock)

    def _on_clock(self, body: bytes) -> None:
        if len(body) == 8:
            seconds, nanoseconds = struct.unpack("<II", body)
            self._simulated = seconds * 1_000_000_000 + nanoseconds


class Ros1BoardNode:
    """A board as a node of the ROS 1 graph."""

    def __init__(self, world: Ros1World, node: Ros1Node, owner: str, opened: asyncio.Task[Any]) -> None:
        self.world = world
        self.node = node
        self.owner = owner
        self._opened = opened
        self._seq = 0
        self._log_type = "rosgraph_msgs/Log"
        self._rosout = node.publish(
            "/rosout", self._log_type, interfaces.md5(self._log_type), _text(self._log_type)
        )
        self._rosout.on_subscriber = self._catch_up
        self._unheard: deque[bytes] = deque(maxlen=_UNHEARD)
        self._diagnostics: tuple[Publication, Converter] | None = None
        self._callers: list[_Caller] = []

    def publisher(self, name: str, type_name: str, md5: str) -> _Publisher:
        """A board's publisher."""
        return _Publisher(self, self.resolve(name, "topic"), type_name, _Passing(type_name, md5))

    def subscriber(self, name: str, type_name: str, md5: str, on_data: OnData) -> _Subscriber:
        """A board's subscriber."""
        return _Subscriber(self, self.resolve(name, "topic"), type_name, _Passing(type_name, md5), on_data)

    def caller(self, service: NamedService, on_reply: OnReply) -> _Caller:
        """A board's service client."""
        made = _Caller(self, self._service(service), on_reply)
        self._callers.append(made)
        return made

    def server(self, service: NamedService, on_data: OnData) -> _Server:
        """A board's service."""
        return _Server(self, self._service(service), on_data)

    def time(self) -> int:
        """The graph's time in ns."""
        return self.world.time()

    def log(self, level: int, text: str) -> None:
        """A board's log goes to /rosout, as that of any node."""
        strings = (self.node.name, text, "", "")
        packed = b"".join(struct.pack("<I", len(raw)) + raw for raw in (each.encode() for each in strings))
        level = _LEVELS[min(level, len(_LEVELS) - 1)]
        line = self._header() + struct.pack("<B", level) + packed + struct.pack("<II", 0, 0)
        if self._rosout.subscribers:
            self._rosout.publish(line)
        else:
            self._unheard.append(line)

    def parameter(self, name: str) -> Any:
        """A parameter by the name that the board says."""
        try:
            value = self.world.parameters.get(resolve(name, self.node.name))
        except Ros1Error:
            return None
        return None if isinstance(value, dict) else value

    def diagnose(self, text: str, level: int, values: dict[str, str]) -> None:
        """How the board is."""
        kind = "diagnostic_msgs/DiagnosticArray"
        if self._diagnostics is None:
            made = self.node.publish("/diagnostics", kind, interfaces.md5(kind), _text(kind))
            self._diagnostics = made, interfaces.converter(kind)
        publication, converter = self._diagnostics
        pair = interfaces.message("diagnostic_msgs/msg/KeyValue")
        status = interfaces.message("diagnostic_msgs/msg/DiagnosticStatus")(
            level=level,
            name=f"{self.node.name.strip('/')}: rosserial",
            message=text,
            hardware_id=self.owner.removeprefix("board "),
            values=[pair(key=key, value=value) for key, value in values.items()],
        )
        array = interfaces.message("diagnostic_msgs/msg/DiagnosticArray")(status=[status])
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(self.world.time(), 1_000_000_000)
        self._seq += 1
        publication.publish(converter.to_ros1(array.serialize(), self._seq))

    def close(self) -> None:
        """The node leaves the graph."""
        for caller in self._callers:
            caller.close()
        self.world.later(self._leave())

    def resolve(self, name: str, what: str) -> str:
        """The absolute name that a board means. Raises RefusedError."""
        try:
            return resolve(name, self.node.name, self.world.remap)
        except Ros1Error as error:
            raise RefusedError(
                str(error), f"Give the {what} another name: --remap {name}:=NEW_NAME"
            ) from None

    def _service(self, named: NamedService) -> _ServiceIn:
        name, kind = self.resolve(named.name, "service"), named.type_name
        try:
            md5 = interfaces.service_converter(kind).md5
        except InterfaceError as error:
            raise RefusedError(
                str(error), "Name the folder that has its definition: --types FOLDER"
            ) from None
        request = _Passing(f"{kind}_Request", named.request_md5)
        return _ServiceIn(name, kind, md5, request, _Passing(f"{kind}_Response", named.response_md5))

    def _catch_up(self) -> None:
        """Says what nobody could hear: a board's first lines come before anybody has connected to its node."""
        while self._unheard:
            self._rosout.publish(self._unheard.popleft())

    async def _leave(self) -> None:
        await asyncio.gather(self._opened, return_exceptions=True)
        await self.node.close()

    def _header(self) -> bytes:
        self._seq += 1
        seconds, nanoseconds = divmod(self.world.time(), 1_000_000_000)
        return struct.pack("<IIII", self._seq & 0xFFFFFFFF, seconds & 0xFFFFFFFF, nanoseconds, 0)


class _Passing:
    """How messages of a type pass between a board and the graph: as they are, or between two definitions."""

    def __init__(self, type_name: str, md5: str) -> None:
        self.size: int | None = None
        self.least_size = 0
        self.drift = ""
        self.md5 = md5
        self.text = ""
        self._board: Converter | None = None
        self._graph: Converter | None = None
        try:
            _, known = interfaces.ros1_definition(type_name)
        except InterfaceError:
            return  # unknown here, but the nodes of the graph may know it
        try:
            converter = interfaces.converter(type_name, md5)
            self._graph = interfaces.converter(type_name)
        except InterfaceError as error:
            if md5 not in (known, "*"):
                raise RefusedError(f"Checksum does not match: {known},{md5}: {error}", _BOX_REMEDY) from None
            return
        self.size, self.least_size, self.drift = converter.ros1_size, converter.least_size, converter.drift
        self.md5 = known
        self.text = _text(type_name)
        if self.drift:
            self._board = converter

    def up(self, body: bytes) -> bytes:
        """A board's message as the graph defines it. Raises BodyError."""
        return self._between(body, self._board, self._graph)

    def down(self, body: bytes) -> bytes:
        """The graph's message as the board defines it. Raises BodyError."""
        return self._between(body, self._graph, self._board)

    def _between(self, body: bytes, source: Converter | None, target: Converter | None) -> bytes:
        if self._board is None or source is None or target is None:
            return body
        try:
            return target.to_ros1(source.to_cdr(body), int.from_bytes(body[:4], "little"))
        except CdrError as error:
            raise BodyError(str(error)) from None


class _Shaped:
    def __init__(self, passing: _Passing, *others: _Passing) -> None:
        self.size = passing.size
        self.least_size = passing.least_size
        self.drift = next((each.drift for each in (passing, *others) if each.drift), "")


class _Publisher(_Shaped):
    def __init__(self, owner: Ros1BoardNode, topic: str, type_name: str, passing: _Passing) -> None:
        super().__init__(passing)
        self._owner = owner
        self._node = owner.node
        self._topic = topic
        self._dropped = 0
        self._up = passing.up
        try:
            self._publication = owner.node.publish(
                topic, type_name, passing.md5, passing.text, topic == "/tf_static"
            )
        except Ros1Error as error:
            raise RefusedError(str(error), "Let the board have one publisher for each topic") from None

    def publish(self, body: bytes) -> None:
        self._publication.publish(self._up(body))
        if self._publication.dropped != self._dropped:
            new = self._publication.dropped - self._dropped
            self._dropped = self._publication.dropped
            self._owner.world.report(
                "ros1-slow-subscriber",
                self._owner.owner,
                f"{{n}} message{{s}} of {self._topic} not sent to a ROS 1 subscriber",
                "it takes less than comes",
                "Look at what its callback does, or subscribe to something slower",
                self._topic,
                new,
            )

    def close(self) -> None:
        self._node.remove(self._publication)


class _Subscriber(_Shaped):
    def __init__(
        self,
        owner: Ros1BoardNode,
        topic: str,
        type_name: str,
        passing: _Passing,
        on_data: OnData,
    ) -> None:
        super().__init__(passing)
        self._node = owner.node
        self._owner = owner
        self._topic = topic
        self._down = passing.down
        self._on_data = on_data
        self._waiting: deque[bytes] = deque(maxlen=READ_DEPTH)
        self._subscription: Subscription = owner.node.subscribe(topic, type_name, passing.md5, self._on_body)

    def take(self) -> bytes | None:
        return self._down(self._waiting.popleft()) if self._waiting else None

    @property
    def latched(self) -> bool:
        return self._topic in LATCHED

    def forget(self) -> None:
        while len(self._waiting) > 1 and not self.latched:  # the newest may be a latched one
            self._waiting.popleft()

    def close(self) -> None:
        self._node.remove(self._subscription)

    def _on_body(self, body: bytes) -> None:
        first = not self._waiting
        if len(self._waiting) == READ_DEPTH:
            self._owner.world.report(
                "ros1-overrun",
                self._owner.owner,
                f"{{n}} message{{s}} of {self._topic} replaced by newer ones",
                f"{READ_DEPTH} wait for the board, whose line is slower",
                "Publish less often, or raise the rate of the line",
                self._topic,
            )
        self._waiting.append(body)
        if first:
            self._on_data()


class _ServiceIn(NamedTuple):
    """A service in the graph: its full name, its type, the sum of the whole, and how its halves pass."""

    name: str
    type_name: str
    md5: str
    request: _Passing
    response: _Passing


class _Caller(_Shaped):
    def __init__(self, owner: Ros1BoardNode, its: _ServiceIn, on_reply: OnReply) -> None:
        super().__init__(its.response, its.request)
        self._owner = owner
        self._service = its.name
        self._request, self._response = its.request, its.response
        self._on_reply = on_reply
        self._client = owner.node.client(its.name, its.type_name, its.md5)
        self._number = 0
        self._calls: set[asyncio.Task[Any]] = set()
        owner.world.watch_services()

    @property
    def ready(self) -> bool:
        return self._service in self._owner.world.services

    def call(self, body: bytes) -> int:
        self._number += 1
        task = self._owner.world.later(self._answer(self._number, self._request.up(body)))
        self._calls.add(task)
        task.add_done_callback(self._calls.discard)
        return self._number

    def close(self) -> None:
        for task in self._calls:
            task.cancel()
        self._client.close()

    async def _answer(self, number: int, body: bytes) -> None:
        node = self._owner.node
        try:
            uri = await node.lookup(self._service)
            if not uri:
                raise Ros1Error("nobody serves it")
            answer = self._response.down(await self._client.call(uri, body))
        except (Ros1Error, BodyError, OSError, TimeoutError) as error:
            self._owner.world.report(
                "ros1-call-failed",
                self._owner.owner,
                f"{{n}} call{{s}} of {self._service} not answered",
                str(error) or "it cannot be reached",
                "Look at the service's node",
                self._service,
            )
            return
        self._on_reply(number, answer)


class _Server(_Shaped):
    def __init__(self, owner: Ros1BoardNode, its: _ServiceIn, on_data: OnData) -> None:
        super().__init__(its.request, its.response)
        self._node = owner.node
        self._request, self._response = its.request, its.response
        self._on_data = on_data
        self._waiting: deque[Request] = deque()
        try:
            self._server: ServiceServer = owner.node.serve(its.name, its.type_name, its.md5, self._on_request)
        except Ros1Error as error:
            raise RefusedError(str(error), "Let the board have one server for each service") from None

    def take(self) -> tuple[Any, bytes] | None:
        while self._waiting and self._waiting[0] not in self._server.waiting:
            self._waiting.popleft()  # who asked has hung up meanwhile
        if not self._waiting:
            return None
        request = self._waiting.popleft()
        try:
            return request, self._request.down(request.body)
        except BodyError as error:
            request.fail(str(error))
            raise

    def answer(self, request: Any, body: bytes) -> None:
        try:
            request.answer(self._response.up(body))
        except BodyError as error:
            request.fail(str(error))
            raise

    def fail(self, request: Any, text: str) -> None:
        """Tells the caller that there is no answer."""
        request.fail(text)

    def close(self) -> None:
        self._node.remove(self._server)

    def _on_request(self, request: Request) -> None:
        first = not self._waiting
        self._waiting.append(request)
        if first:
            self._on_data()


def _text(type_name: str) -> str:
    """The definition as TCPROS headers have it."""
    return interfaces.ros1_text(type_name)
