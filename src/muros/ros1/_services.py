"""Services of a ROS 1 node: those it offers to whoever connects, and those of others that it calls."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import NamedTuple

from muros.ros1._connection import Connection
from muros.ros1._errors import Ros1Error
from muros.ros1._topics import ANY
from muros.ros1._wire import BLOCK_LIMIT, block, header, header_untrusted

__all__ = ["Request", "ServiceClient", "ServiceServer", "ServiceType"]

CONNECT = 5.0
"""Seconds that connecting may take."""
ANSWER = 600.0
"""Seconds that an answer may take before its connection is given up."""
WAITING = 100
"""Requests of one service that wait for their answers; more are refused."""


class ServiceType(NamedTuple):
    """What both sides of a service have to agree on; ``md5`` covers request and response."""

    service: str
    type_name: str
    md5: str

    def fields(self, caller: str) -> dict[str, str]:
        """The fields of a header that say it."""
        return {
            "callerid": caller,
            "md5sum": self.md5,
            "request_type": f"{self.type_name}Request",
            "response_type": f"{self.type_name}Response",
            "service": self.service,
            "type": self.type_name,
        }


class Request:
    """A request that waits for its answer."""

    def __init__(self, server: ServiceServer, connection: Connection, body: bytes) -> None:
        self.body = body
        self.connection = connection
        self._server = server

    def answer(self, body: bytes) -> None:
        """Sends the response. Does nothing the second time, or when the caller has hung up."""
        self._send(b"\x01" + block(body))

    def fail(self, text: str) -> None:
        """Tells the caller that there is no response."""
        self._send(b"\x00" + block(text.encode()))

    def _send(self, data: bytes) -> None:
        if self in self._server.waiting:
            self._server.waiting.remove(self)
            self.connection.send(data)


class ServiceServer:
    """A service that a node offers; ``on_request(request)`` gets what callers want."""

    def __init__(self, node: str, kind: ServiceType, on_request: Callable[[Request], object]) -> None:
        self.kind = kind
        self.waiting: set[Request] = set()
        self._node = node
        self._on_request = on_request
        self._connections: list[Connection] = []

    def welcome(self, connection: Connection, fields: dict[str, str]) -> None:
        """A caller has connected and sent its header. Raises :class:`Ros1Error` if it is turned away."""
        if fields.get("md5sum") not in (self.kind.md5, ANY):
            raise Ros1Error(
                f"request from [{fields.get('callerid', '?')}]: md5sums do not match: "
                f"[{fields.get('md5sum', '')}] vs. [{self.kind.md5}]"
            )
        connection.blocks.limit = BLOCK_LIMIT
        connection.on_block = self._on_block
        connection.on_lost = self._on_lost
        self._connections.append(connection)
        connection.send(header(self.kind.fields(self._node)))

    def close(self) -> None:
        """Hangs up."""
        for connection in list(self._connections):
            connection.close()

    def _on_block(self, connection: Connection, body: bytes) -> None:
        request = Request(self, connection, body)
        self.waiting.add(request)
        if len(self.waiting) > WAITING:
            request.fail(f"{self.kind.service} has {WAITING} requests waiting")
        else:
            self._on_request(request)

    def _on_lost(self, connection: Connection) -> None:
        self._connections.remove(connection)
        self.waiting = {request for request in self.waiting if request.connection is not connection}


class ServiceClient:
    """Calls a service; keeps its connection."""

    def __init__(self, node: str, kind: ServiceType) -> None:
        self.kind = kind
        self._node = node
        self._connection: Connection | None = None
        self._answer: asyncio.Future[bytes] | None = None
        self._turn = asyncio.Lock()

    async def call(self, uri: str, body: bytes) -> bytes:
        """The response of the server at ``rosrpc://host:port``; calls take turns.

        Raises :class:`Ros1Error` if it refuses, OSError or TimeoutError if it cannot be reached.
        """
        async with self._turn:
            if self._connection is None:
                await self._connect(uri)
            self._answer = asyncio.get_running_loop().create_future()
            assert self._connection is not None
            self._connection.send(block(body))
            try:
                async with asyncio.timeout(ANSWER):
                    answer = await self._answer
            except BaseException:
                self.close()  # what comes later must not answer the next call
                raise
            finally:
                self._answer = None
            if answer[0] != 1:
                raise Ros1Error(f"{self.kind.service}: {answer[1:].decode('utf-8', 'replace')}")
            return answer[1:]

    def close(self) -> None:
        """Hangs up."""
        if self._connection is not None:
            self._connection.close()
            self._connection = None

    async def _connect(self, uri: str) -> None:
        host, _, port = uri.removeprefix("rosrpc://").rpartition(":")
        if not uri.startswith("rosrpc://") or not port.isdecimal() or not 0 < int(port) < 65536:
            raise Ros1Error(
                f"{self.kind.service}: the master names {uri!r}, which is no address of a service"
            )
        loop = asyncio.get_running_loop()
        ready: asyncio.Future[bytes] = loop.create_future()
        self._answer = ready
        async with asyncio.timeout(CONNECT):
            _, connection = await loop.create_connection(
                lambda: Connection(self._on_header, self._on_lost), host.strip("[]"), int(port)
            )
            self._connection = connection
            connection.send(header({**self.kind.fields(self._node), "persistent": "1", "tcp_nodelay": "1"}))
            try:
                await ready
            except BaseException:
                self.close()
                raise

    def _on_header(self, connection: Connection, body: bytes) -> None:
        fields = header_untrusted(body)
        if self._answer is None or self._answer.done():
            return
        if "error" in fields:
            self._answer.set_exception(Ros1Error(f"{self.kind.service}: {fields['error']}"))
            return
        connection.blocks.limit = BLOCK_LIMIT
        connection.blocks.lead = 1
        connection.on_block = self._on_answer
        self._answer.set_result(b"")

    def _on_answer(self, connection: Connection, body: bytes) -> None:
        if connection is self._connection and self._answer is not None and not self._answer.done():
            self._answer.set_result(body)

    def _on_lost(self, connection: Connection) -> None:
        if connection is self._connection:
            self._connection = None
            if self._answer is not None and not self._answer.done():
                self._answer.set_exception(ConnectionResetError(f"{self.kind.service} hung up"))
