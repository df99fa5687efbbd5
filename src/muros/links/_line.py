"""What links over lines share: ports with framing, several clients told apart by the address byte of their frames."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from muros.links._door import PORT_GONE, QUEUE_FULL, Address, Cause, Link
from muros.links._framing import MESSAGE_BYTES, NOT_FRAMES, MakeFraming
from muros.links._stream import Channel

QUEUE_BYTES = 16 * 1024
"""Bytes that may wait for a line beyond the kernel's few kB: 1.4 s at 115200 baud."""
GARBAGE_BYTES = 4096
"""So many bytes without one good frame make a finding."""


class LineAddress(NamedTuple):
    """A client on a serial line: the device, and the address byte in its frames."""

    device: str
    peer: int


class LineLink(Link):
    """A link of one or more ports by device name. Subclasses open the ports and are told when one ends."""

    mtu = MESSAGE_BYTES

    def __init__(self, queue_bytes: int, make_framing: MakeFraming) -> None:
        super().__init__()
        self.queue_bytes = queue_bytes
        self.make_framing = make_framing
        self._ports: dict[str, Port] = {}

    @property
    def ports(self) -> list[str]:
        """The devices that are open now."""
        return list(self._ports)

    def backlog(self, address: Address) -> int:
        port = self._ports.get(address.device) if isinstance(address, LineAddress) else None
        return 0 if port is None else port.channel.queued

    def describe(self, address: Address) -> str:
        return f"{address.device}#{address.peer}" if isinstance(address, LineAddress) else str(address)

    def _send(self, message: bytes, address: Address) -> Cause | None:
        port = self._ports.get(address.device) if isinstance(address, LineAddress) else None
        if port is None or not isinstance(address, LineAddress):
            return PORT_GONE
        return None if port.channel.send(message, address.peer) else QUEUE_FULL

    def _close(self) -> None:
        for port in self._ports.values():
            port.shut()
        self._ports.clear()

    def _noise_remedy(self) -> str:
        return "Check what the far end sends: frames of DDS-XRCE for serial lines are expected."

    def _opened(self, port: Port, detail: str) -> None:
        """A port is open: whoever sits there alone can be spoken to."""
        self._up(detail)
        if self.on_peer is not None and self._ports.get(port.device) is port:
            address = port.addresses[0] = LineAddress(port.device, 0)
            self._peer(address)

    def _messages(self, port: Port, messages: list[tuple[bytes, int]]) -> None:
        port.garbage = 0
        for message, peer in messages:
            address = port.addresses.get(peer)
            if address is None:
                address = port.addresses[peer] = LineAddress(port.device, peer)
            self._deliver(message, address)

    def _damaged(self, port: Port, errors: dict[str, int]) -> None:
        self.counters.framing.update(errors)
        bad = {kind: n for kind, n in errors.items() if kind not in NOT_FRAMES}
        if bad:
            kinds = ", ".join(f"{n} {kind}" for kind, n in bad.items())
            cause = Cause("line-noise", f"line noise or wrong baud rate ({kinds})", self._noise_remedy())
            self._problem(cause, f"bad frames on {port.device} dropped", sum(bad.values()))
        port.garbage += errors.get("garbage", 0)
        if port.garbage >= GARBAGE_BYTES:
            why = "wrong baud rate, or the far end writes something else there"
            what = f"{port.garbage} B without one good frame on {port.device}"
            port.garbage = 0
            self._problem(Cause("line-garbage", why, self._noise_remedy()), what)

    def _drained(self, port: Port) -> None:
        for address in list(port.addresses.values()):
            self._room(address)

    def _ended(self, port: Port, reason: str) -> None:
        """The port has ended by itself."""
        del self._ports[port.device]
        port.shut()
        for address in port.addresses.values():
            self._gone(address, reason)
        self._down(reason)


class Port:
    """An open line: its descriptor, its channel, and the clients heard on it. ``close(fd)`` gives it back."""

    def __init__(self, link: LineLink, device: str, fd: int, close: Callable[[int], None]) -> None:
        self.device = device
        self.real_path = os.path.realpath(device)
        self.addresses: dict[int, LineAddress] = {}
        self.garbage = 0
        self.fd = fd
        self._close = close
        self.channel = Channel(
            fd,
            link.make_framing(),
            link.queue_bytes,
            partial(link._messages, self),
            partial(link._damaged, self),
            partial(link._ended, self),
            on_room=partial(link._drained, self),
        )

    def shut(self) -> None:
        """Ends the line at once and in silence."""
        self.channel.stop()
        self._close(self.fd)
