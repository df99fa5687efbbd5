"""One TCPROS connection, either end: blocks in, bytes out (asyncio)."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from typing import cast

from muros.ros1._wire import Blocks, WireError

__all__ = ["Connection"]

OnBlock = Callable[["Connection", bytes], object]
OnLost = Callable[["Connection"], object]


class Connection(asyncio.Protocol):
    """Calls ``on_block(connection, body)`` for each block and ``on_lost(connection)`` once, when it is over.

    ``blocks`` may be set to another limit or lead from within ``on_block``. ``problem`` says why we ended it, if so;
    ``caller`` may hold the name of the node at the other end.
    """

    def __init__(self, on_block: OnBlock, on_lost: OnLost) -> None:
        self.on_block = on_block
        self.on_lost = on_lost
        self.blocks = Blocks()
        self.problem = ""
        self.peer = ""
        self.caller = ""
        self._transport: asyncio.Transport | None = None

    @property
    def backlog(self) -> int:
        """Bytes that the other side has not taken yet."""
        return self._transport.get_write_buffer_size() if self._transport is not None else 0

    def send(self, data: bytes) -> None:
        """Sends bytes; does nothing once the connection is over."""
        if self._transport is not None:
            self._transport.write(data)

    def close(self) -> None:
        """Ends the connection when what was sent has gone."""
        if self._transport is not None:
            self._transport.close()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = cast(asyncio.Transport, transport)
        address = transport.get_extra_info("peername")
        self.peer = f"{address[0]}:{address[1]}" if address else ""
        own = transport.get_extra_info("socket")
        if own is not None and own.family in (socket.AF_INET, socket.AF_INET6):
            own.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

    def data_received(self, data: bytes) -> None:
        try:
            self.blocks.feed_untrusted(data)
            while self._transport is not None and (body := self.blocks.next_untrusted()) is not None:
                self.on_block(self, body)
        except WireError as error:
            self.problem = str(error)
            if self._transport is not None:
                self._transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        self._transport = None
        self.on_lost(self)
