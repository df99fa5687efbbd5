"""The XML-RPC of ROS 1, as a client of the master and of other nodes, and as a node's own server (asyncio).

Every call answers ``[code, text, value]`` with code 1 for success (ROS wiki: "ROS/Master_Slave_APIs").
"""

from __future__ import annotations

import asyncio
import xmlrpc.client
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import Any
from urllib.parse import urlsplit
from xml.parsers.expat import ExpatError

from muros.ros1._errors import Ros1Error

TIMEOUT = 5.0
"""Seconds that a call may take."""
ANSWER_LIMIT = 16 << 20
"""Bytes of the longest answer; a master's parameters may hold a robot's description."""
REQUEST_LIMIT = 1 << 20
"""Bytes of the longest request to a node."""
HEAD_LIMIT = 1 << 14
"""Bytes of the longest HTTP head."""
CONNECTIONS = 64
"""Connections that a server holds at once."""
IDLE = 60.0
"""Seconds after which a connection without a request is closed."""

SUCCESS = 1
Handler = Callable[..., Any]


class ApiError(Ros1Error):
    """The other side was reached and refuses, or answers what is no answer."""


class UnreachableError(Ros1Error):
    """Nobody answers at that address."""


async def call(uri: str, method: str, *arguments: Any, timeout: float = TIMEOUT) -> Any:
    """Calls a method and returns its value. Raises :class:`ApiError` and :class:`UnreachableError`."""
    try:
        split = urlsplit(uri)
        host, port = split.hostname or "", split.port or 80
    except ValueError:
        raise ApiError(f"{uri!r} is no address: it looks like http://host:11311") from None
    if not host:
        raise ApiError(f"{uri!r} is no address: it looks like http://host:11311")
    try:
        body = xmlrpc.client.dumps(arguments, method).encode()
    except (TypeError, OverflowError) as error:
        raise ApiError(f"{method}: {error}") from None
    head = (
        f"POST {split.path or '/RPC2'} HTTP/1.1\r\nHost: {split.netloc}\r\nContent-Type: text/xml\r\n"
        f"Content-Length: {len(body)}\r\nConnection: close\r\n\r\n"
    )
    try:
        async with asyncio.timeout(timeout):
            reader, writer = await asyncio.open_connection(host, port, limit=HEAD_LIMIT)
            try:
                writer.write(head.encode() + body)
                status, answer = await _message_untrusted(reader, ANSWER_LIMIT)
            finally:
                writer.close()
    except TimeoutError:
        raise UnreachableError(f"{uri} did not answer within {timeout:g} s") from None
    except (OSError, EOFError, UnicodeError) as error:
        raise UnreachableError(f"{uri} cannot be reached: {error or 'it hung up'}") from None
    if " 200 " not in f"{status} ":
        raise ApiError(f"{uri} answers {status!r}")
    return _value_untrusted(uri, method, answer)


class ApiServer:
    """A node's XML-RPC server. ``handlers`` maps methods to functions that return the value of their answer.

    What a handler raises as :class:`Ros1Error` becomes the answer's text.
    """

    def __init__(self, handlers: Mapping[str, Handler]) -> None:
        self._handlers = handlers
        self._server: asyncio.Server | None = None
        self._connections: dict[asyncio.Task[None], asyncio.StreamWriter] = {}
        self.port = 0

    async def open(self, host: str) -> None:
        """Listens on a port of its own. Raises OSError."""
        self._server = await asyncio.start_server(self._accept, host, 0, limit=HEAD_LIMIT)
        self.port = self._server.sockets[0].getsockname()[1]

    async def close(self) -> None:
        """Listens no more."""
        if self._server is not None:
            self._server.close()
            await asyncio.sleep(0)  # what was accepted comes in now
            for task in self._connections:
                task.cancel()
            await asyncio.gather(*self._connections, return_exceptions=True)
            await self._server.wait_closed()
            self._server = None

    def _accept(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """A connection has a task, and is closed with it, also where that is cancelled before it begins."""
        task = asyncio.get_running_loop().create_task(self._attend(reader, writer))
        self._connections[task] = writer
        task.add_done_callback(lambda task: self._connections.pop(task).close())

    async def _attend(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        if len(self._connections) <= CONNECTIONS:
            with suppress(OSError, EOFError, TimeoutError, ApiError):
                await self._serve(reader, writer)

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        while True:
            async with asyncio.timeout(IDLE):
                line, body = await _message_untrusted(reader, REQUEST_LIMIT)
            answer = self._answer_untrusted(body)
            writer.write(
                b"HTTP/1.1 200 OK\r\nContent-Type: text/xml\r\nContent-Length: %d\r\n\r\n" % len(answer)
                + answer
            )
            await writer.drain()
            if line.rstrip().endswith("HTTP/1.0"):
                return

    def _answer_untrusted(self, body: bytes) -> bytes:
        try:
            arguments, method = xmlrpc.client.loads(body, use_builtin_types=True)
        except Exception as error:  # expat's, xmlrpc's and those of values it cannot make
            return xmlrpc.client.dumps(xmlrpc.client.Fault(-1, f"no XML-RPC: {error}")).encode()
        handler = self._handlers.get(method or "")
        if handler is None:
            return xmlrpc.client.dumps(xmlrpc.client.Fault(-1, f"no method {method!r}")).encode()
        try:
            answer = [SUCCESS, "", handler(*arguments)]
        except (Ros1Error, TypeError, ValueError, AttributeError, LookupError) as error:
            answer = [0, str(error), 0]  # arguments that are none of the method's
        return xmlrpc.client.dumps((answer,), methodresponse=True, allow_none=True).encode()


async def _message_untrusted(reader: asyncio.StreamReader, limit: int) -> tuple[str, bytes]:
    """The first line and the body of an HTTP message. Raises EOFError, OSError and :class:`ApiError`."""
    try:
        head = (await reader.readuntil(b"\r\n\r\n")).decode("latin-1")
    except asyncio.LimitOverrunError:
        raise ApiError("an HTTP head without end") from None
    first, *lines = head.split("\r\n")
    fields = {
        name.strip().lower(): value.strip() for name, _, value in (line.partition(":") for line in lines)
    }
    if fields.get("expect", "").lower() == "100-continue":
        raise ApiError("HTTP that waits for a go-ahead is not supported")
    length = fields.get("content-length", "")
    if length.isdecimal():
        if int(length) > limit:
            raise ApiError(f"a message of {length} bytes, more than {limit}")
        return first, await reader.readexactly(int(length))
    if fields.get("transfer-encoding"):
        raise ApiError("HTTP in chunks is not supported")
    body = b""
    with suppress(asyncio.IncompleteReadError):
        while piece := await reader.read(1 << 16):
            body += piece
            if len(body) > limit:
                raise ApiError(f"a message of more than {limit} bytes")
    return first, body


def _value_untrusted(uri: str, method: str, body: bytes) -> Any:
    try:
        values: Any = xmlrpc.client.loads(body, use_builtin_types=True)[0]
        ((code, text, value),) = values
    except xmlrpc.client.Fault as fault:
        raise ApiError(f"{uri} {method}: {fault.faultString}") from None
    except (ExpatError, ValueError, TypeError, xmlrpc.client.Error, LookupError) as error:
        raise ApiError(f"{uri} {method}: no answer of ROS: {error}") from None
    if code != SUCCESS:
        raise ApiError(f"{method}: {text}")
    return value
