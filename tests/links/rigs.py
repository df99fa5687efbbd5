"""One rig for each transport: the link under test on our side, real peers on the other.

The tests see peers that send and receive whole messages, whatever the transport does with them.
"""

from __future__ import annotations

import asyncio
import errno
import os
import pty
import socket
import struct
from abc import ABC, abstractmethod
from collections import deque
from collections.abc import Callable
from pathlib import Path
from typing import Any, ClassVar

from muros.links import (
    CanLink,
    CustomLink,
    DiscoveryLink,
    Link,
    PseudoterminalLink,
    SerialLink,
    TcpLink,
    UdpLink,
)
from muros.links._can import can_frame_bytes, parse_can_frame_untrusted
from muros.links._terminal import make_raw
from muros.links.testing import PairLink, Recorder, SimulatedLink, SimulatedNetwork
from muros.xrce.framing import SerialDeframer, TcpDeframer, serial_frame, tcp_frame

PATIENCE_S = 10.0
"""Longest wait for an event that must come."""


class Watcher(Recorder):
    """A recorder that tests can wait on; with ``echo`` it answers each message with itself."""

    def __init__(self, echo: bool = False) -> None:
        super().__init__()
        self.echo = echo
        self._bell = asyncio.Event()
        self.on_any = self._bell.set

    def on_message(self, link: Link, data: bytes, address: Any) -> None:
        if self.echo:
            link.send(data, address)
        super().on_message(link, data, address)

    async def until(self, condition: Callable[[], object]) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while not condition():
                self._bell.clear()
                await self._bell.wait()

    def codes(self) -> list[str]:
        return [problem[0] for problem in self.problems]


class Client(ABC):
    """A peer of the link under test."""

    @abstractmethod
    async def send(self, message: bytes) -> None: ...

    @abstractmethod
    async def receive(self) -> bytes: ...

    closed = False

    def close(self) -> None:
        """Leaves, if the transport knows of that."""
        self.closed = True


class Rig(ABC):
    """Makes a link and its peers. ``damages``: garbage on the wire shows in the framing counters."""

    damages: ClassVar[bool] = False
    link: Link

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.clients: list[Client] = []

    @abstractmethod
    async def client(self) -> Client: ...

    async def garbage(self, data: bytes) -> None:
        """Puts bytes on the wire that no peer of the protocol would."""
        assert not self.damages

    def forget(self) -> None:
        """Lets go of the far end."""
        for client in self.clients:
            client.close()
        self.clients.clear()

    def close(self) -> None:
        self.link.close()
        self.forget()


class _SocketClient(Client):
    def __init__(self, sock: socket.socket, address: Any) -> None:
        sock.setblocking(False)
        self.sock = sock
        self.address = address
        self.loop = asyncio.get_running_loop()

    async def send(self, message: bytes) -> None:
        async with asyncio.timeout(PATIENCE_S):
            await self.loop.sock_sendto(self.sock, message, self.address)

    async def receive(self) -> bytes:
        async with asyncio.timeout(PATIENCE_S):
            return await self.loop.sock_recv(self.sock, 65536)

    def close(self) -> None:
        self.sock.close()


class UdpRig(Rig):
    family = 4
    host = "127.0.0.1"

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.link: UdpLink = UdpLink(0, self.host, family=self.family)

    async def client(self) -> Client:
        made = _SocketClient(
            socket.socket(socket.AF_INET if self.family == 4 else socket.AF_INET6, socket.SOCK_DGRAM),
            (self.host, self.link.port),
        )
        made.sock.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
        self.clients.append(made)
        return made

    async def garbage(self, data: bytes) -> None:
        await (await self.client()).send(data)


class Udp6Rig(UdpRig):
    family = 6
    host = "::1"


class DiscoveryRig(UdpRig):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.link = DiscoveryLink(0, interface="lo")


class TcpClient(_SocketClient):
    def __init__(self, sock: socket.socket) -> None:
        super().__init__(sock, None)
        self.inbox: deque[bytes] = deque()
        self.deframer = TcpDeframer(
            65535, lambda buf, off, n, _: self.inbox.append(bytes(buf[off : off + n]))
        )

    async def send(self, message: bytes) -> None:
        await self.raw(tcp_frame(message))

    async def raw(self, data: bytes) -> None:
        async with asyncio.timeout(PATIENCE_S):
            await self.loop.sock_sendall(self.sock, data)

    async def receive(self) -> bytes:
        while not self.inbox:
            data = await super().receive()
            if not data:
                raise ConnectionError("closed")
            self.deframer.feed(data, len(data))
        return self.inbox.popleft()


class TcpRig(Rig):
    family = 4
    host = "127.0.0.1"
    damages = True

    def __init__(self, folder: Path, **options: Any) -> None:
        super().__init__(folder)
        self.link: TcpLink = TcpLink(0, self.host, family=self.family, **options)

    async def client(self) -> TcpClient:
        sock = socket.socket(socket.AF_INET if self.family == 4 else socket.AF_INET6)
        sock.setblocking(False)
        async with asyncio.timeout(PATIENCE_S):
            await asyncio.get_running_loop().sock_connect(sock, (self.host, self.link.port))
        made = TcpClient(sock)
        self.clients.append(made)
        return made

    async def garbage(self, data: bytes) -> None:
        await (await self.client()).raw(b"\0\0" + data)


class Tcp6Rig(TcpRig):
    family = 6
    host = "::1"


class FarEnd:
    """The other end of a line: everything that comes goes to all who listen, writes wait for room."""

    def __init__(self, fd: int) -> None:
        os.set_blocking(fd, False)
        self.fd = fd
        self.listeners: list[Callable[[bytes], None]] = []
        self.loop = asyncio.get_running_loop()
        self.loop.add_reader(fd, self._readable)
        self.bell = asyncio.Event()

    async def write(self, data: bytes) -> None:
        async with asyncio.timeout(PATIENCE_S):
            while data:
                try:
                    data = data[os.write(self.fd, data) :]
                except BlockingIOError:
                    room = self.loop.create_future()
                    self.loop.add_writer(self.fd, room.set_result, None)
                    await room
                    self.loop.remove_writer(self.fd)

    def close(self) -> None:
        self.loop.remove_reader(self.fd)
        os.close(self.fd)

    def _readable(self) -> None:
        try:
            data = os.read(self.fd, 65536)
        except OSError as error:
            if error.errno != errno.EAGAIN:
                self.loop.remove_reader(self.fd)
            return
        for listener in self.listeners:
            listener(data)
        self.bell.set()


class LineClient(Client):
    """A client with an address byte on a line."""

    def __init__(self, line: FarEnd, address: int) -> None:
        self.line = line
        self.address = address
        self.inbox: deque[bytes] = deque()
        deframer = SerialDeframer(
            address, 65535, lambda buf, off, n, _: self.inbox.append(bytes(buf[off : off + n]))
        )
        line.listeners.append(lambda data: deframer.feed(data, len(data)))

    async def send(self, message: bytes) -> None:
        await self.line.write(serial_frame(message, self.address, 0))

    async def receive(self) -> bytes:
        async with asyncio.timeout(PATIENCE_S):
            while not self.inbox:
                self.line.bell.clear()
                await self.line.bell.wait()
        return self.inbox.popleft()


class LineRig(Rig):
    damages = True
    line: FarEnd | None = None

    @abstractmethod
    def far_end(self) -> FarEnd: ...

    async def client(self) -> LineClient:
        if self.line is None:
            self.line = self.far_end()
        made = LineClient(self.line, len(self.line.listeners) + 1)
        self.clients.append(made)
        return made

    async def garbage(self, data: bytes) -> None:
        if self.line is None:
            self.line = self.far_end()
        await self.line.write(data)

    def forget(self) -> None:
        super().forget()
        if self.line is not None:
            self.line.close()
            self.line = None


class Device:
    """A serial port as tests have it: a symlink to a pty's slave, whose cable can be pulled."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.master, slave = pty.openpty()
        make_raw(slave)
        path.symlink_to(os.ttyname(slave))
        self.slave = slave

    def pull(self) -> None:
        self.path.unlink()
        os.close(self.slave)
        os.close(self.master)


class SerialRig(LineRig):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.device = Device(folder / "ttyUSB0")
        self.link = SerialLink(str(self.device.path), 4000000)

    def far_end(self) -> FarEnd:
        return FarEnd(os.dup(self.device.master))

    def close(self) -> None:
        super().close()
        self.device.pull()


class PseudoterminalRig(LineRig):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.link = PseudoterminalLink(str(folder / "board"))

    def far_end(self) -> FarEnd:
        return FarEnd(os.open(self.folder / "board", os.O_RDWR | os.O_NOCTTY))


class _BusClient(Client):
    def __init__(self, rig: CanRig, identifier: int) -> None:
        self.rig = rig
        self.identifier = identifier

    async def send(self, message: bytes) -> None:
        await self.rig.put(can_frame_bytes(self.identifier, message))

    async def receive(self) -> bytes:
        inbox = self.rig.inboxes.setdefault(self.identifier, deque())
        while not inbox:
            await self.rig.take()
        return inbox.popleft()


class BusLink(CanLink):
    """A CAN link on one end of a socket pair instead of a bus."""

    def __init__(self) -> None:
        super().__init__("can0", retry=0.001)
        self.bus: socket.socket | None = None

    def _bind(self) -> socket.socket:
        near, self.bus = socket.socketpair(socket.AF_UNIX, socket.SOCK_DGRAM)
        near.setblocking(False)
        self.bus.setblocking(False)
        return near


class CanRig(Rig):
    damages = True

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.link: BusLink = BusLink()
        self.inboxes: dict[int, deque[bytes]] = {}

    async def client(self) -> Client:
        made = _BusClient(self, 0x1ABC0000 + len(self.clients))
        self.clients.append(made)
        return made

    async def garbage(self, data: bytes) -> None:
        await self.put(struct.pack("=IBBxx8s", 0x123, 8, 0, data[:8]))

    async def put(self, frame: bytes) -> None:
        assert self.link.bus is not None
        async with asyncio.timeout(PATIENCE_S):
            await asyncio.get_running_loop().sock_sendall(self.link.bus, frame)

    async def take(self) -> None:
        assert self.link.bus is not None
        async with asyncio.timeout(PATIENCE_S):
            frame = await asyncio.get_running_loop().sock_recv(self.link.bus, 100)
        found = parse_can_frame_untrusted(frame)
        assert found is not None
        self.inboxes.setdefault(found[0], deque()).append(found[1])

    def forget(self) -> None:
        super().forget()
        if self.link.bus is not None:
            self.link.bus.close()


class CustomStreamRig(LineRig):
    """User functions over one end of a socket pair, with framing, watched."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.near: socket.socket | None = None
        self.far: socket.socket | None = None

        def open_pair() -> socket.socket:
            self.near, self.far = socket.socketpair()
            for end in (self.near, self.far):
                end.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 1 << 20)
            self.near.setblocking(False)
            return self.near

        def close_pair() -> None:
            assert self.near is not None
            self.near.close()

        def read() -> bytes:
            assert self.near is not None
            return self.near.recv(4096)

        def write(data: bytes) -> bool:
            assert self.near is not None
            return self.near.send(data) == len(data)

        self.link = CustomLink(open_pair, close_pair, read, write, framing=True, name="my radio")

    def far_end(self) -> FarEnd:
        assert self.far is not None
        return FarEnd(self.far.detach())

    def forget(self) -> None:
        super().forget()
        if self.far is not None:
            self.far.close()


class _QueueClient(Client):
    def __init__(self, rig: CustomMessageRig, address: int) -> None:
        self.rig = rig
        self.address = address
        self.inbox: asyncio.Queue[bytes] = asyncio.Queue()

    async def send(self, message: bytes) -> None:
        self.rig.incoming.append((message, self.address))

    async def receive(self) -> bytes:
        async with asyncio.timeout(PATIENCE_S):
            return await self.inbox.get()


class CustomMessageRig(Rig):
    """User functions that move whole messages with addresses, polled."""

    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.incoming: deque[tuple[bytes, int]] = deque()
        self.queues: list[_QueueClient] = []
        self.link = CustomLink(
            None,
            None,
            lambda: self.incoming.popleft() if self.incoming else None,
            lambda data, address: self.queues[address].inbox.put_nowait(data),
            addressed=True,
            poll=0.001,
        )

    async def client(self) -> Client:
        made = _QueueClient(self, len(self.queues))
        self.queues.append(made)
        return made


class _SimulatedClient(Client):
    def __init__(self, network: SimulatedNetwork, address: str) -> None:
        self.network = network
        self.endpoint = network.endpoint(address)

    async def send(self, message: bytes) -> None:
        self.endpoint.send(message, "agent")
        self.network.step(self.network.now + 1)

    async def receive(self) -> bytes:
        self.network.step(self.network.now + 1)
        got = self.endpoint.receive()
        assert got is not None
        return got[0]

    def close(self) -> None:
        self.endpoint.close()


class SimulatedRig(Rig):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.network = SimulatedNetwork(seed=1, delay=(0.1, 0.4))
        self.link = SimulatedLink(self.network)

    async def client(self) -> Client:
        made = _SimulatedClient(self.network, f"client {len(self.clients)}")
        self.clients.append(made)
        return made


class _PairClient(Client):
    def __init__(self, link: PairLink, address: int) -> None:
        self.peer = link.peer(address)

    async def send(self, message: bytes) -> None:
        self.peer.send(message)

    async def receive(self) -> bytes:
        got = self.peer.receive()
        assert got is not None
        return got


class PairRig(Rig):
    def __init__(self, folder: Path) -> None:
        super().__init__(folder)
        self.link: PairLink = PairLink()

    async def client(self) -> Client:
        made = _PairClient(self.link, len(self.clients))
        self.clients.append(made)
        return made


RIGS: dict[str, type[Rig]] = {
    "udp4": UdpRig,
    "udp6": Udp6Rig,
    "discovery": DiscoveryRig,
    "tcp4": TcpRig,
    "tcp6": Tcp6Rig,
    "serial": SerialRig,
    "pseudoterminal": PseudoterminalRig,
    "canfd": CanRig,
    "custom stream": CustomStreamRig,
    "custom messages": CustomMessageRig,
    "simulated": SimulatedRig,
    "pair": PairRig,
}


def has_ipv6() -> bool:
    """Whether this machine has the IPv6 loopback."""
    try:
        with socket.socket(socket.AF_INET6, socket.SOCK_DGRAM) as probe:
            probe.bind(("::1", 0))
    except OSError:
        return False
    return True
