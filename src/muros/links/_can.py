"""CAN FD through SocketCAN: a message of up to 63 bytes in one frame, peers told apart by extended identifiers.

`can_frame_bytes` and `parse_can_frame_untrusted` are the codec for the kernel's ``struct canfd_frame``; they need
no CAN to be tried. An answer goes out under the identifier of the message it answers, as peers compatible with
micro-ROS expect.
"""

from __future__ import annotations

import asyncio
import socket
import struct
from pathlib import Path
from typing import ClassVar

from muros.links._datagram import DRAIN, QUEUE_BYTES, DatagramLink
from muros.links._door import Address, LinkError
from muros.xrce.framing import CAN_MTU, can_frame, can_message_untrusted

RETRY_S = 0.5
"""How often an interface that went down is looked at, in seconds."""

_FRAME = struct.Struct("=IBBxx64s")
_HEAD = struct.Struct("=IBBxx")
_EXTENDED = 0x8000_0000
_REMOTE = 0x4000_0000
_ERROR = 0x2000_0000
_ID_MASK = 0x1FFF_FFFF
_FD_BYTES = 72
_CLASSIC_BYTES = 16
_INTERFACE_UP = 1
_NETWORK = Path("/sys/class/net")


def can_frame_bytes(identifier: int, message: bytes) -> bytes:
    """The kernel's CAN FD frame with ``message`` under the extended ``identifier`` (0 to 0x1FFFFFFF).

    Raises ValueError when the message is longer than 63 bytes.
    """
    data = can_frame(message)
    return _FRAME.pack(identifier & _ID_MASK | _EXTENDED, len(data), 0, data)


def parse_can_frame_untrusted(frame: bytes) -> tuple[int, bytes] | None:
    """Identifier and message of a frame as the kernel gives it; None when it carries no message.

    That are frames with standard identifiers, remote and error frames, and lengths that do not fit. Never raises.
    """
    if len(frame) not in (_FD_BYTES, _CLASSIC_BYTES):
        return None
    head, size, _ = _HEAD.unpack_from(frame)
    if not head & _EXTENDED or head & (_REMOTE | _ERROR):
        return None
    message = can_message_untrusted(frame[8 : 8 + size])
    return None if message is None else (head & _ID_MASK, message)


class CanLink(DatagramLink):
    """The CAN FD interface ``interface``. An address is the extended identifier of a peer, an int.

    Frames that carry no XRCE message are counted as ``foreign-frame``: other devices may share the bus. When the
    interface goes down or is unplugged, the link waits for it, looking every ``retry`` seconds.
    """

    kind: ClassVar[str] = "canfd"
    mtu = CAN_MTU

    def __init__(
        self,
        interface: str,
        *,
        drain: int = DRAIN,
        queue_bytes: int = QUEUE_BYTES,
        retry: float = RETRY_S,
    ) -> None:
        super().__init__(drain, queue_bytes)
        self.interface = interface
        self._retry_period = retry
        self._reopen: asyncio.TimerHandle | None = None

    @property
    def name(self) -> str:
        return f"{self.kind} {self.interface}"

    def describe(self, address: Address) -> str:
        return f"{self.interface}#{address:08X}" if isinstance(address, int) else str(address)

    def _open(self) -> None:
        self._connect()

    def _close(self) -> None:
        super()._close()
        if self._reopen is not None:
            self._reopen.cancel()
            self._reopen = None

    def _connect(self) -> None:
        self._start(self._bind())
        self._up(self.name)

    def _bind(self) -> socket.socket:
        where = self.name
        up = f"sudo ip link set {self.interface} up type can bitrate 1000000 dbitrate 5000000 fd on"
        try:
            sock = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
        except (OSError, AttributeError) as error:
            raise LinkError(
                where, "this system has no CAN", "Load it: sudo modprobe can can_raw vcan."
            ) from error
        try:
            flags = int((_NETWORK / self.interface / "flags").read_text(), 16)
            size = int((_NETWORK / self.interface / "mtu").read_text())
        except (OSError, ValueError) as error:
            sock.close()
            known = ", ".join(_can_interfaces()) or "none"
            raise LinkError(where, "no such interface", f"Choose one of: {known}.") from error
        if not flags & _INTERFACE_UP:
            sock.close()
            raise LinkError(where, "the interface is down", f"Bring it up: {up}.")
        try:
            if size < _FD_BYTES:
                remedy = f"Set it up for CAN FD: {up}, or for vcan: ip link set {self.interface} mtu 72."
                raise LinkError(where, "the interface carries classic CAN only", remedy)
            sock.setblocking(False)
            sock.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FD_FRAMES, 1)
            sock.bind((self.interface,))
        except OSError as error:
            sock.close()
            raise LinkError(where, error.strerror or str(error), f"Bring it up: {up}.") from error
        except LinkError:
            sock.close()
            raise
        return sock

    def _receive(self, sock: socket.socket) -> tuple[bytes, Address] | None:
        found = parse_can_frame_untrusted(sock.recv(_FD_BYTES))
        if found is None:
            self.counters.framing["foreign-frame"] += 1
            return None
        return found[1], found[0]

    def _transmit(self, sock: socket.socket, message: bytes, address: Address) -> None:
        sock.send(can_frame_bytes(int(address), message))  # type: ignore[call-overload]

    def _receive_failed(self, error: OSError) -> None:
        super()._close()
        self._reopen = asyncio.get_running_loop().call_later(self._retry_period, self._look)
        self._down(f"{self.interface}: {error.strerror or error}")

    def _look(self) -> None:
        self._reopen = None
        try:
            self._connect()
        except LinkError:
            self._reopen = asyncio.get_running_loop().call_later(self._retry_period, self._look)


def _can_interfaces() -> list[str]:
    found = []
    for path in sorted(_NETWORK.glob("*/type")):
        try:
            if path.read_text().strip() == "280":  # ARPHRD_CAN
                found.append(path.parent.name)
        except OSError:
            continue
    return found
