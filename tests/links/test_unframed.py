"""What servers of bare bytes need of links: who can be reached, what waits for them, and the rate of a port."""

from __future__ import annotations

import asyncio
import os
import socket
import termios
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from muros.links import Address, LineAddress, LinkError, SerialLink
from muros.rosserial.server import serial_line, tcp_line
from tests.links.rigs import Device, Watcher


def test_a_connection_is_told_of_before_it_says_anything_and_its_room_too() -> None:
    async def body() -> None:
        link = tcp_line(0, "127.0.0.1")
        peers: list[Address] = []
        room: list[Address] = []
        link.on_peer = peers.append
        link.on_room = room.append
        link.open(Watcher())
        with socket.create_connection(("127.0.0.1", link.port)) as far:
            far.setblocking(False)
            async with asyncio.timeout(10):
                while not peers:
                    await asyncio.sleep(0)
            (address,) = peers
            assert link.backlog(address) == 0
            while not link.backlog(address):
                assert link.send(bytes(60_000), address)
            assert room == []
            async with asyncio.timeout(10):
                while link.backlog(address):
                    with suppress(BlockingIOError):
                        far.recv(1 << 20)
                    await asyncio.sleep(0)
            assert room == [address]
        link.close()
        assert link.backlog(address) == 0

    asyncio.run(body())


def test_a_port_is_told_of_when_it_opens_and_when_it_goes(tmp_path: Path) -> None:
    async def body() -> None:
        path = tmp_path / "ttyUSB0"
        device = Device(path)
        events = Watcher()
        link = serial_line(str(path))
        peers: list[Any] = []
        link.on_peer = peers.append
        link.open(events)
        assert peers == [LineAddress(str(path), 0)]
        assert link.send(b"\xff\xfe", peers[0])
        assert os.read(device.master, 10) == b"\xff\xfe"
        os.close(device.master)
        await events.until(lambda: events.gone)
        assert events.gone[0][0] == peers[0]
        link.close()

    asyncio.run(body())


def test_a_handler_that_fails_harms_nobody(tmp_path: Path) -> None:
    async def body() -> None:
        failures: list[dict[str, Any]] = []
        asyncio.get_running_loop().set_exception_handler(lambda loop, context: failures.append(context))
        device = Device(tmp_path / "ttyUSB0")
        link = serial_line(str(tmp_path / "ttyUSB0"))
        link.on_peer = lambda address: 1 / 0
        link.open(Watcher())
        assert isinstance(failures[0]["exception"], ZeroDivisionError)
        assert link.ports
        link.close()
        os.close(device.master)

    asyncio.run(body())


def test_a_port_has_a_rate_of_its_own(tmp_path: Path) -> None:
    async def body() -> None:
        path = str(tmp_path / "ttyUSB0")
        device = Device(tmp_path / "ttyUSB0")
        link = SerialLink(path, 57600)
        link.set_baud(path, 9600)
        link.open(Watcher())
        assert link.baud_of(path) == 9600
        assert link.baud_of("another") == 57600
        fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
        assert termios.tcgetattr(fd)[4] == termios.B9600
        link.set_baud(path, 230400)
        assert termios.tcgetattr(fd)[4] == termios.B230400
        with pytest.raises(LinkError, match="57601 is not a baud rate"):
            link.set_baud(path, 57601)
        assert link.baud_of(path) == 230400
        os.close(fd)
        link.close()
        os.close(device.master)

    asyncio.run(body())
