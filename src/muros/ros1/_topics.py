"""Topics of a ROS 1 node: what it publishes to whoever connects, and what it hears from whoever publishes."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable
from typing import Any

from muros.ros1._connection import Connection
from muros.ros1._errors import Ros1Error
from muros.ros1._wire import BLOCK_LIMIT, WireError, block, header, header_untrusted
from muros.ros1._xmlrpc import call

__all__ = ["ANY", "BACKLOG", "Publication", "Subscription", "TopicType"]

ANY = "*"
"""The md5 sum, or type, of one who takes anything, such as ``rostopic``."""
BACKLOG = 4 << 20
"""Bytes that wait for one subscriber; beyond, it gets no more until it has taken some."""
PUBLISHERS = 64
"""Publishers of one topic that a subscription listens to."""
RETRY = 1.0
"""Seconds between attempts to reach a publisher that the master names."""
CONNECT = 5.0
"""Seconds that connecting may take."""

Report = Callable[[str, str, str], object]
"""``report(what, why, remedy)`` of something that is wrong with an endpoint."""


class TopicType:
    """What both sides of a topic have to agree on."""

    def __init__(self, topic: str, type_name: str, md5: str, definition: str = "") -> None:
        self.topic = topic
        self.type_name = type_name
        self.md5 = md5
        self.definition = definition

    def fields(self, caller: str) -> dict[str, str]:
        """The fields of a header that say it."""
        return {
            "callerid": caller,
            "topic": self.topic,
            "type": self.type_name,
            "md5sum": self.md5,
            "message_definition": self.definition,
        }

    def objection(self, fields: dict[str, str]) -> str:
        """Why the other side's header does not fit, empty if it does."""
        sum_ = fields.get("md5sum", "")
        if ANY not in (sum_, self.md5) and sum_ != self.md5:
            theirs = fields.get("type", "?")
            return (
                f"{fields.get('callerid', 'somebody')} wants topic {self.topic} to have datatype/md5sum "
                f"[{theirs}/{sum_}], but it is [{self.type_name}/{self.md5}]"
            )
        return ""


class Publication:
    """A topic that a node publishes. ``latch``: who connects gets the last message at once."""

    def __init__(self, node: str, kind: TopicType, latch: bool = False) -> None:
        self.kind = kind
        self.latch = latch
        self.dropped = 0
        """Messages that one subscriber or another did not get."""
        self.on_subscriber: Callable[[], object] | None = None
        """Called when a subscriber has connected."""
        self._node = node
        self._last: bytes | None = None
        self._connections: list[Connection] = []

    @property
    def subscribers(self) -> int:
        """Subscribers that are connected."""
        return len(self._connections)

    @property
    def callers(self) -> list[str]:
        """The nodes that are connected."""
        return [connection.caller for connection in self._connections]

    def publish(self, body: bytes) -> None:
        """Sends a message to every subscriber that has taken what it got before."""
        data = block(body)
        if self.latch:
            self._last = data
        for connection in self._connections:
            if connection.backlog > BACKLOG:
                self.dropped += 1
            else:
                connection.send(data)

    def welcome(self, connection: Connection, fields: dict[str, str]) -> None:
        """A subscriber has connected and sent its header. Raises :class:`Ros1Error` if it is turned away."""
        if objection := self.kind.objection(fields):
            raise Ros1Error(objection)
        connection.caller = fields.get("callerid", "")
        connection.on_block = _ignore
        connection.on_lost = self._connections.remove
        connection.send(header({**self.kind.fields(self._node), "latching": str(int(self.latch))}))
        self._connections.append(connection)
        if self._last is not None:
            connection.send(self._last)
        if self.on_subscriber is not None:
            self.on_subscriber()

    def close(self) -> None:
        """Hangs up."""
        for connection in list(self._connections):
            connection.close()


class Subscription:
    """A topic that a node hears: ``on_body(body)`` gets the messages of all publishers that :meth:`update` names."""

    def __init__(
        self, node: str, kind: TopicType, on_body: Callable[[bytes], object], report: Report | None = None
    ) -> None:
        self.kind = kind
        self._node = node
        self._on_body = on_body
        self._report = report or (lambda what, why, remedy: None)
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self.connected: set[str] = set()

    @property
    def publishers(self) -> tuple[str, ...]:
        """The addresses of all publishers that are known."""
        return tuple(self._tasks)

    def update(self, publishers: Iterable[str]) -> None:
        """The addresses of all publishers, from the master."""
        wanted = set(list(dict.fromkeys(publishers))[:PUBLISHERS])
        for uri in set(self._tasks) - wanted:
            self._tasks.pop(uri).cancel()
        for uri in wanted - set(self._tasks):
            self._tasks[uri] = asyncio.get_running_loop().create_task(self._listen(uri))

    def close(self) -> None:
        """Hangs up."""
        self.update(())

    async def _listen(self, uri: str) -> None:
        """Stays connected to a publisher for as long as the master names it."""
        while True:
            try:
                await self._hear(uri)
            except (Ros1Error, WireError, UnicodeError) as error:
                self._report(
                    f"cannot hear {uri} on {self.kind.topic}",
                    str(error),
                    "Build both sides with the same definition of the message",
                )
            except (OSError, TimeoutError):
                pass  # it is gone: the master will say so, or it comes back
            finally:
                self.connected.discard(uri)
            await asyncio.sleep(RETRY)

    async def _hear(self, uri: str) -> None:
        """One connection to a publisher, until it is over."""
        answer: Any = await call(uri, "requestTopic", self._node, self.kind.topic, [["TCPROS"]])
        try:
            protocol, host, port = answer
            host, port = str(host), int(port)
            if protocol != "TCPROS" or not 0 < port < 65536:
                raise ValueError(protocol)
        except (TypeError, ValueError):
            raise Ros1Error(f"{uri} offers no TCPROS but {answer!r}") from None
        loop = asyncio.get_running_loop()
        over: asyncio.Future[None] = loop.create_future()

        def on_lost(connection: Connection) -> None:
            if not over.done():
                over.set_result(None)

        def on_header(connection: Connection, body: bytes) -> None:
            fields = header_untrusted(body)
            objection = fields.get("error") or self.kind.objection(fields)
            if objection:
                connection.problem = objection
                connection.close()
                return
            self.connected.add(uri)
            connection.blocks.limit = BLOCK_LIMIT
            connection.on_block = lambda connection, body: self._on_body(body)

        async with asyncio.timeout(CONNECT):
            transport, connection = await loop.create_connection(
                lambda: Connection(on_header, on_lost), host, port
            )
        try:
            connection.send(header({**self.kind.fields(self._node), "tcp_nodelay": "1"}))
            await over
            if connection.problem:
                raise Ros1Error(connection.problem)
        finally:
            transport.abort()


def _ignore(connection: Connection, body: bytes) -> None:
    """Subscribers have nothing to say after their header."""
