"""Links of the user's own functions: functions that fail, end and come back."""

from __future__ import annotations

import asyncio
import socket
from collections import deque
from typing import Any

import pytest

from muros.links import CustomLink, LinkError
from muros.links._custom import PEER
from muros.xrce.framing import serial_frame
from tests.links.rigs import Watcher


class Radio:
    """A user's transport, polled."""

    def __init__(self) -> None:
        self.opened = 0
        self.closed = 0
        self.incoming: deque[bytes] = deque()
        self.outgoing: list[bytes] = []
        self.broken: str | None = None

    def call(self, name: str) -> None:
        if self.broken == name:
            raise ValueError(f"no antenna in {name}")

    def open(self) -> None:
        self.call("open")
        self.opened += 1

    def close(self) -> None:
        self.closed += 1
        self.call("close")

    def read(self) -> bytes | None:
        self.call("read")
        return self.incoming.popleft() if self.incoming else None

    def write(self, data: bytes) -> bool | None:
        self.call("write")
        self.outgoing.append(data)
        return False if data == b"busy" else None

    def link(self, **options: Any) -> CustomLink:
        return CustomLink(
            self.open, self.close, self.read, self.write, name="radio", poll=0.001, retry=0.001, **options
        )


class TestCustom:
    def test_whole_messages_of_one_peer(self) -> None:
        async def main() -> None:
            radio, events = Radio(), Watcher(echo=True)
            link = radio.link()
            link.open(events)
            assert events.up == ["radio"]
            radio.incoming.extend([b"one", b"two"])
            await events.until(lambda: len(events.messages) == 2)
            assert events.messages == [(b"one", PEER), (b"two", PEER)]
            assert radio.outgoing == [b"one", b"two"]
            assert link.send(b"busy", PEER) is False
            assert link.counters.dropped == {"queue-full": 1}
            link.close()
            assert (radio.opened, radio.closed) == (1, 1)

        asyncio.run(main())

    def test_open_that_fails_is_a_link_error(self) -> None:
        async def main() -> None:
            radio = Radio()
            radio.broken = "open"
            link = radio.link()
            words = r"radio: open failed \(ValueError: no antenna in open\)\. See the function open\."
            with pytest.raises(LinkError, match=words):
                link.open(Watcher())
            assert not link.is_open
            assert radio.closed == 0

        asyncio.run(main())

    @pytest.mark.parametrize("function", ["read", "write"])
    def test_a_function_that_raises_takes_the_link_down_until_it_works(self, function: str) -> None:
        async def main() -> None:
            radio, events = Radio(), Watcher(echo=True)
            link = radio.link()
            link.open(events)
            radio.broken = function
            if function == "write":
                assert link.send(b"into the void", PEER) is False
                assert not events.down  # told after send returned
            await events.until(lambda: events.down)
            assert events.down == [f"radio: {function} failed (ValueError: no antenna in {function})"]
            assert radio.closed == 1
            assert link.send(b"too late", PEER) is False
            radio.broken = "open"
            await events.until(lambda: "custom-function-failed" in events.codes())
            radio.broken = None
            await events.until(lambda: len(events.up) == 2)
            radio.incoming.append(b"back")
            await events.until(lambda: events.messages)
            assert radio.outgoing == [b"back"]
            link.close()
            assert radio.opened == radio.closed == 2

        asyncio.run(main())

    def test_close_that_raises_is_told_only(self) -> None:
        async def main() -> None:
            radio, events = Radio(), Watcher()
            link = radio.link()
            link.open(events)
            radio.broken = "close"
            link.close()
            assert not link.is_open
            assert radio.closed == 1

        asyncio.run(main())

    def test_the_end_of_a_watched_descriptor_takes_the_link_down(self) -> None:
        async def main() -> None:
            pairs: list[tuple[socket.socket, socket.socket]] = []

            def open_() -> int:
                pairs.append(socket.socketpair())
                return pairs[-1][0].fileno()

            link = CustomLink(
                open_,
                lambda: pairs[-1][0].close(),
                lambda: pairs[-1][0].recv(1000),
                lambda data: pairs[-1][0].send(data),
                retry=0.001,
            )
            events = Watcher(echo=True)
            link.open(events)
            pairs[0][1].close()
            await events.until(lambda: len(events.up) == 2)
            assert events.down == ["custom: read failed (EOFError: closed by the far end)"]
            pairs[1][1].send(b"hello")
            await events.until(lambda: events.messages)
            assert pairs[1][1].recv(100) == b"hello"
            link.close()
            pairs[1][1].close()

        asyncio.run(main())

    def test_a_stream_in_pieces_with_noise(self) -> None:
        async def main() -> None:
            radio, events = Radio(), Watcher(echo=True)
            link = radio.link(framing=True)
            link.open(events)
            bad = bytearray(serial_frame(b"damaged", 4, 0))
            bad[-1] ^= 1
            stream = b"noise" + bytes(bad) + serial_frame(b"hello", 4, 0)
            radio.incoming.extend(stream[at : at + 3] for at in range(0, len(stream), 3))
            await events.until(lambda: events.messages)
            assert events.messages == [(b"hello", 4)]
            assert link.describe(4) == "radio#4"
            assert radio.outgoing == [serial_frame(b"hello", 0, 4)]
            assert link.counters.framing == {"bad-crc": 1, "garbage": 5}
            assert events.codes() == ["line-noise"]
            link.close()

        asyncio.run(main())

    def test_one_poll_takes_a_bounded_number(self) -> None:
        async def main() -> None:
            radio, events = Radio(), Watcher()
            link = radio.link(drain=8)
            link.open(events)
            radio.incoming.extend(b"%d" % n for n in range(20))
            link._polled()
            assert len(events.messages) == 8
            await events.until(lambda: len(events.messages) == 20)
            link.close()

        asyncio.run(main())

    def test_framing_has_addresses_of_its_own(self) -> None:
        with pytest.raises(ValueError, match="leave out addressed or framing"):
            Radio().link(framing=True, addressed=True)
