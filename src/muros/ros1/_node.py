"""A node of a ROS 1 graph (asyncio): what it publishes, hears, offers and calls, and the master that knows of it.

What a node has and what the master knows are two things, and the master may be away or start anew at any time. So an
endpoint is only put on a list; one task brings the master's knowledge in line with the list, in the order of the list,
tries again while the master cannot be reached, and tells a new master everything.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

from muros.ros1._connection import Connection
from muros.ros1._errors import Ros1Error
from muros.ros1._names import master_uri, own_host
from muros.ros1._services import Request, ServiceClient, ServiceServer, ServiceType
from muros.ros1._topics import Publication, Subscription, TopicType
from muros.ros1._wire import header, header_untrusted
from muros.ros1._xmlrpc import ApiError, ApiServer, UnreachableError, call

__all__ = ["Ros1Node"]

RETRY = 1.0
"""Seconds between attempts to reach the master."""
WATCH = 5.0
"""Seconds between looks at whether the master is still the same."""
LEAVE = 0.1
"""Seconds from being told to end until it does, so that whoever told it has its answer."""
GREETING = 10.0
"""Seconds that a connection may take to send its header."""

Report = Callable[[str, str, str, str], object]
"""``report(code, what, why, remedy)`` of something that is wrong."""


@dataclass(frozen=True)
class _Entry:
    """What the master shall know: one of ``Publisher``, ``Subscriber``, ``Service``."""

    kind: str
    name: str
    type_name: str


class Ros1Node:
    """A node called ``name``. ``open`` it in a running event loop before anything else. Told to end by the graph, as
    when a node of the same name appears, it leaves.

    ``master`` is the master's address (default ``$ROS_MASTER_URI``), ``host`` the name or address that others reach
    this machine by (default ``$ROS_HOSTNAME``, ``$ROS_IP``, or the interface that leads to the master).
    """

    def __init__(self, name: str, master: str = "", host: str = "", report: Report | None = None) -> None:
        self.name = name
        self.master = master or master_uri()
        self.host = host or own_host(self.master)
        self.uri = ""
        self._report = report or (lambda code, what, why, remedy: None)
        self._api = ApiServer(
            {
                "getBusInfo": self._bus_info,
                "getBusStats": lambda caller: [[], [], []],
                "getMasterUri": lambda caller: self.master,
                "getPid": lambda caller: os.getpid(),
                "getPublications": lambda caller: [
                    [p.kind.topic, p.kind.type_name] for p in self._publications.values()
                ],
                "getSubscriptions": lambda caller: [
                    [s.kind.topic, s.kind.type_name] for s in self._subscriptions
                ],
                "paramUpdate": self._on_parameter,
                "publisherUpdate": self._on_publishers,
                "requestTopic": self._on_topic_request,
                "shutdown": self._on_shutdown,
            }
        )
        self._server: asyncio.Server | None = None
        self._port = 0
        self._publications: dict[str, Publication] = {}
        self._subscriptions: list[Subscription] = []
        self._services: dict[str, ServiceServer] = {}
        self._greeting: set[Connection] = set()
        self._wanted: dict[_Entry, None] = {}
        self._known: set[_Entry] = set()
        self._changed = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []
        self._master_pid = 0
        self._on_parameter_update: Callable[[str, Any], object] | None = None
        self._ended = False
        self._leaving: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Listens for other nodes; from now on the master is told. Raises OSError."""
        loop = asyncio.get_running_loop()
        bind = self.host if self.host.startswith("127.") or self.host == "localhost" else None
        await self._api.open(bind or "0.0.0.0")
        self._server = await loop.create_server(self._accept, bind or "0.0.0.0", 0)
        self._port = self._server.sockets[0].getsockname()[1]
        self.uri = f"http://{self.host}:{self._api.port}/"
        self._tasks = [loop.create_task(self._keep_registered()), loop.create_task(self._watch_master())]

    async def close(self) -> None:
        """Takes everything out of the graph; the master is told if it answers."""
        if self._ended:
            if self._leaving is not None and self._leaving is not asyncio.current_task():
                await self._leaving
            return
        self._ended = True
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)
        things: list[Publication | Subscription | ServiceServer] = [
            *self._publications.values(),
            *self._subscriptions,
            *self._services.values(),
        ]
        for thing in things:
            thing.close()
        with suppress(Ros1Error):
            for entry in list(self._known):
                await self._unregister(entry)
        for connection in list(self._greeting):
            connection.close()
        if self._server is not None:
            self._server.close()
            await self._server.wait_closed()
        await self._api.close()

    # ---- endpoints ----

    def publish(
        self, topic: str, type_name: str, md5: str, definition: str = "", latch: bool = False
    ) -> Publication:
        """A publication of a topic by its absolute name. Raises :class:`Ros1Error` if the node has one already."""
        if topic in self._publications:
            raise Ros1Error(f"{self.name} publishes {topic} already")
        made = Publication(self.name, TopicType(topic, type_name, md5, definition), latch)
        self._publications[topic] = made
        self._want(_Entry("Publisher", topic, type_name))
        return made

    def subscribe(
        self, topic: str, type_name: str, md5: str, on_body: Callable[[bytes], object]
    ) -> Subscription:
        """A subscription to a topic by its absolute name."""

        def report(what: str, why: str, remedy: str) -> None:
            self._report("ros1-topic", what, why, remedy)

        made = Subscription(self.name, TopicType(topic, type_name, md5), on_body, report)
        others = [each for each in self._subscriptions if each.kind.topic == topic]
        self._subscriptions.append(made)
        if others:
            made.update(others[0].publishers)
        self._want(_Entry("Subscriber", topic, type_name))
        return made

    def serve(
        self, service: str, type_name: str, md5: str, on_request: Callable[[Request], object]
    ) -> ServiceServer:
        """A service by its absolute name. Raises :class:`Ros1Error` if the node has it already."""
        if service in self._services:
            raise Ros1Error(f"{self.name} offers {service} already")
        made = ServiceServer(self.name, ServiceType(service, type_name, md5), on_request)
        self._services[service] = made
        self._want(_Entry("Service", service, type_name))
        return made

    def client(self, service: str, type_name: str, md5: str) -> ServiceClient:
        """A client of a service by its absolute name."""
        return ServiceClient(self.name, ServiceType(service, type_name, md5))

    def remove(self, thing: Publication | Subscription | ServiceServer) -> None:
        """Takes an endpoint out of the graph."""
        thing.close()
        if isinstance(thing, Publication):
            if self._publications.pop(thing.kind.topic, None) is not None:
                self._unwant("Publisher", thing.kind.topic)
        elif isinstance(thing, ServiceServer):
            if self._services.pop(thing.kind.service, None) is not None:
                self._unwant("Service", thing.kind.service)
        elif thing in self._subscriptions:
            self._subscriptions.remove(thing)
            if not any(each.kind.topic == thing.kind.topic for each in self._subscriptions):
                self._unwant("Subscriber", thing.kind.topic)

    # ---- the master ----

    async def ask(self, method: str, *arguments: Any) -> Any:
        """A call of the master's API in the node's name. Raises :class:`Ros1Error`."""
        return await call(self.master, method, self.name, *arguments)

    async def lookup(self, service: str) -> str:
        """Where a service is, ``rosrpc://host:port``; empty if nobody offers it. Raises UnreachableError."""
        try:
            return str(await self.ask("lookupService", service))
        except ApiError:
            return ""

    async def watch_parameters(self, on_update: Callable[[str, Any], object]) -> Any:
        """The whole tree of parameters; ``on_update(key, value)`` is told of changes. Raises :class:`Ros1Error`."""
        self._on_parameter_update = on_update
        return await self.ask("subscribeParam", self.uri, "/")

    def _want(self, entry: _Entry) -> None:
        self._wanted[entry] = None
        self._changed.set()

    def _unwant(self, kind: str, name: str) -> None:
        for entry in [each for each in self._wanted if (each.kind, each.name) == (kind, name)]:
            del self._wanted[entry]
        self._changed.set()

    async def _keep_registered(self) -> None:
        while True:
            await self._changed.wait()
            self._changed.clear()
            try:
                for entry in [each for each in self._known if each not in self._wanted]:
                    await self._unregister(entry)
                for entry in list(self._wanted):
                    if entry not in self._known and entry in self._wanted:
                        await self._register(entry)
            except UnreachableError as error:
                self._report(
                    "ros1-master",
                    f"the ROS 1 master at {self.master} cannot be reached",
                    str(error),
                    "Start it (roscore), or say where it is: ROS_MASTER_URI or --ros1 URI",
                )
                self._known.clear()
                self._changed.set()
                await asyncio.sleep(RETRY)

    async def _register(self, entry: _Entry) -> None:
        try:
            if entry.kind == "Service":
                await self.ask("registerService", entry.name, self._rpc_uri(), self.uri)
            else:
                others = await self.ask(f"register{entry.kind}", entry.name, entry.type_name, self.uri)
                if entry.kind == "Subscriber":
                    self._on_publishers(self.name, entry.name, others)
        except ApiError as error:
            self._report("ros1-refused", f"{entry.name} is not in the ROS 1 graph", str(error), "")
        self._known.add(entry)

    async def _unregister(self, entry: _Entry) -> None:
        with suppress(ApiError):
            own = self._rpc_uri() if entry.kind == "Service" else self.uri
            await self.ask(f"unregister{entry.kind}", entry.name, own)
        self._known.discard(entry)

    async def _watch_master(self) -> None:
        """A master that was started anew knows nothing."""
        while True:
            try:
                pid = await self.ask("getPid")
                if self._master_pid and pid != self._master_pid:
                    self._known.clear()
                    self._changed.set()
                    if self._on_parameter_update is not None:
                        tree = await self.ask("subscribeParam", self.uri, "/")
                        self._on_parameter_update("/", tree)
                self._master_pid = pid
            except Ros1Error:
                pass  # told of by who needs it
            await asyncio.sleep(WATCH)

    def _rpc_uri(self) -> str:
        return f"rosrpc://{self.host}:{self._port}"

    # ---- what other nodes want ----

    def _bus_info(self, caller: str) -> list[list[Any]]:
        """Every connection of a topic, as ``rosnode info`` shows them."""
        found: list[tuple[str, str, str]] = []
        for publication in self._publications.values():
            found += [(node, "o", publication.kind.topic) for node in publication.callers]
        for subscription in self._subscriptions:
            found += [(uri, "i", subscription.kind.topic) for uri in sorted(subscription.connected)]
        return [
            [number, other, way, "TCPROS", topic, True] for number, (other, way, topic) in enumerate(found, 1)
        ]

    def _on_publishers(self, caller: str, topic: str, publishers: list[str]) -> int:
        if isinstance(publishers, list):
            for subscription in self._subscriptions:
                if subscription.kind.topic == topic:
                    subscription.update([str(uri) for uri in publishers])
        return 0

    def _on_topic_request(self, caller: str, topic: str, protocols: Any) -> list[Any]:
        if topic not in self._publications:
            raise Ros1Error(f"{self.name} does not publish {topic}")
        if not any(offer and offer[0] == "TCPROS" for offer in protocols if isinstance(offer, list)):
            raise Ros1Error("only TCPROS is spoken here")
        return ["TCPROS", self.host, self._port]

    def _on_parameter(self, caller: str, key: str, value: Any) -> int:
        if self._on_parameter_update is not None:
            self._on_parameter_update(key, value)
        return 0

    def _on_shutdown(self, caller: str, reason: str = "") -> int:
        if not self._ended:
            self._report(
                "ros1-shutdown",
                f"the ROS 1 graph wants node {self.name} to end",
                reason or "no reason is given",
                "It has left. Two nodes of one name throw each other out: give one another name",
            )
            asyncio.get_running_loop().call_later(LEAVE, self._leave)
        return 0

    def _leave(self) -> None:
        if not self._ended:
            self._leaving = asyncio.get_running_loop().create_task(self.close())

    def _accept(self) -> Connection:
        connection = Connection(self._greet, self._greeting.discard)
        self._greeting.add(connection)
        asyncio.get_running_loop().call_later(GREETING, self._too_late, connection)
        return connection

    def _too_late(self, connection: Connection) -> None:
        if connection in self._greeting:
            connection.close()

    def _greet(self, connection: Connection, body: bytes) -> None:
        self._greeting.discard(connection)
        fields = header_untrusted(body)
        try:
            if "service" in fields:
                service = self._services.get(fields["service"])
                if service is None:
                    raise Ros1Error(f"{self.name} does not offer {fields['service']}")
                service.welcome(connection, fields)
            else:
                publication = self._publications.get(fields.get("topic", ""))
                if publication is None:
                    raise Ros1Error(f"{self.name} does not publish {fields.get('topic')}")
                publication.welcome(connection, fields)
        except Ros1Error as error:
            connection.send(header({"error": str(error)}))
            connection.on_block = _deaf
            connection.close()
            self._report("ros1-turned-away", f"{connection.peer} is turned away", str(error), "")


def _deaf(connection: Connection, body: bytes) -> None:
    """A connection that is being closed."""
