"""Data ports of one machine: values lie in a block of shared memory, CORBA calls only signal. `shared_memory`.

Both sides have an OpenRTM::PortSharedMemory object and know each other's. Who sends (push: the OutPort, pull: the
OutPort, too, when it is asked) owns the block: it makes one under a name of its own, tells the receiver that name
(`open_memory`), writes the value and signals (push), or answers the signal (pull). Once the receiver has opened the
block its name is taken away, so that nothing stays of processes that are killed. A value that does not fit gets a new
block. In the block: the count of octets as a CDR unsigned long long in the agreed endianness, then the octets.

The block is a file of the memory file system, read and written with pread and pwrite: as quick as a mapping for whole
values, and a peer that cuts it short cannot end this process. Names and counts are the peer's word and are checked.
"""

from __future__ import annotations

import contextlib
import os
import re
import threading
import uuid
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from omniORB import CORBA

from muros.findings import Finding
from muros.rtc.codes import PeerLostError, PortStatus
from muros.rtc.corba._lost import LOST, describe
from muros.rtc.corba._orb import Orb
from muros.rtc.corba._stubs import OpenRTM, OpenRTM__POA
from muros.rtc.corba._transports import CorbaOffer, reference_in
from muros.rtc.data import Connection, Get, Inlet, Offer, Outlet, Put, TransportError
from muros.rtc.profiles import PropertyValue

__all__ = ["SharedMemoryTransport", "is_available"]

FOLDER: Final = Path("/dev/shm")
"""Where POSIX shared memory is on Linux."""

BLOCK_SIZE: Final = 2 << 20
"""Octets of a block at first (OpenRTM-aist: 2 MiB)."""

MAX_BLOCK: Final = 1 << 30
"""Octets of a block at most, whatever a peer says."""

_HEAD: Final = 8
_NAME: Final = re.compile(r"/?([A-Za-z0-9_-][A-Za-z0-9_.-]{0,200})")
_ITEMS: Final = tuple(OpenRTM.PortStatus._items)
_STATUS: Final = tuple(PortStatus)


def is_available() -> bool:
    """Whether this machine has what is needed."""
    return FOLDER.is_dir() and os.access(FOLDER, os.W_OK)


class SharedMemoryTransport:
    """Push and pull through shared memory. Property names are those of `corba_cdr`."""

    def __init__(self, orb: Orb, *, block_size: int = BLOCK_SIZE) -> None:
        self._orb = orb
        self._size = block_size

    def offer_inlet(self, connection: Connection, put: Put) -> Offer:
        """Of the InPort: reads the sender's block at each signal."""
        return _Offer(
            self._orb, _End(connection, self._orb, self._size, put=put), "dataport.corba_cdr.inport"
        )

    def offer_outlet(self, connection: Connection, get: Get) -> Offer:
        """Of the OutPort: writes its block when it is asked."""
        return _Offer(
            self._orb, _End(connection, self._orb, self._size, get=get), "dataport.corba_cdr.outport"
        )

    def reach_inlet(self, connection: Connection) -> Inlet:
        """Of the OutPort: writes its block and signals."""
        return _Line(connection, self._orb, self._size, "dataport.corba_cdr.inport")

    def reach_outlet(self, connection: Connection) -> Outlet:
        """Of the InPort: asks, then reads the sender's block."""
        return _Line(connection, self._orb, self._size, "dataport.corba_cdr.outport")


class _Block:
    """A piece of shared memory, made here or opened. OSError and ValueError for what cannot be."""

    def __init__(self, name: str, size: int, *, make: bool) -> None:
        found = _NAME.fullmatch(name)
        if found is None or not _HEAD < size <= MAX_BLOCK:
            raise ValueError(f"no block of shared memory: {name[:80]!r} of {size} octets")
        self.name: Final = found[1]
        self.size: Final = size
        self._made = make
        flags = os.O_RDWR | os.O_CLOEXEC | os.O_NOFOLLOW | (os.O_CREAT | os.O_EXCL if make else 0)
        self._file = os.open(FOLDER / self.name, flags, 0o600)
        if make:
            os.ftruncate(self._file, size)

    def write(self, octets: bytes, order: str) -> None:
        """The count, then the octets; the caller sees to it that they fit."""
        os.pwrite(self._file, len(octets).to_bytes(_HEAD, order) + octets, 0)  # type: ignore[arg-type]

    def read(self, order: str) -> bytes:
        """What was written last."""
        count = int.from_bytes(os.pread(self._file, _HEAD, 0), order)  # type: ignore[arg-type]
        if count > self.size - _HEAD:
            raise ValueError(f"{count} octets in a block of {self.size}")
        octets = os.pread(self._file, count, _HEAD)
        if len(octets) != count:
            raise ValueError("the block has been cut short")
        return octets

    def forget_name(self) -> None:
        """Nobody else needs to find it: it ends with those who have it, however they end."""
        if self._made:
            self._made = False
            with contextlib.suppress(OSError):
                os.unlink(FOLDER / self.name)

    def close(self) -> None:
        """Let go of it; one that was made here ends."""
        os.close(self._file)
        self.forget_name()


class _End(OpenRTM__POA.PortSharedMemory):  # type: ignore[misc]
    """One side's PortSharedMemory: keeps the block and, once it is told, the other side's object."""

    def __init__(
        self,
        connection: Connection,
        orb: Orb,
        size: int,
        *,
        put: Put | None = None,
        get: Get | None = None,
    ) -> None:
        self._connection = connection
        self._orb = orb
        self._size = size
        self._order = "little" if connection.little else "big"
        self._put = put
        self._get = get
        self._lock = threading.Lock()
        self._block: _Block | None = None
        self._ended = False
        self.peer: Any = None

    # What the other side calls

    def open_memory(self, memory_size: int, shm_address: str) -> None:
        try:
            self._replace(_Block(shm_address, memory_size, make=False))
        except (OSError, ValueError) as error:
            self._tell(f"the sender's block cannot be opened: {error}")
            raise CORBA.BAD_PARAM(0, CORBA.COMPLETED_NO) from error

    def create_memory(self, memory_size: int, shm_address: str) -> None:
        """A sender is asked to make its block so; ours names its blocks itself, when it has something to send."""

    def close_memory(self, unlink: bool) -> None:
        self._replace(None)

    def setInterface(self, sm: Any) -> None:  # noqa: N802 (the interface's name)
        self.peer = sm

    def setEndian(self, endian: bool) -> None:  # noqa: N802
        self._order = "little" if endian else "big"

    def put(self) -> Any:
        if self._put is None:
            return OpenRTM.PORT_ERROR
        octets = self.received()
        return OpenRTM.PORT_ERROR if octets is None else _ITEMS[self._put(octets)]

    def get(self) -> Any:
        if self._get is None:
            return OpenRTM.PORT_ERROR
        status, octets = self._get()
        if status is PortStatus.PORT_OK and not self.place(octets):
            status = PortStatus.PORT_ERROR
        return _ITEMS[status]

    # What this side does

    def received(self) -> bytes | None:
        """The value in the sender's block; None, and a finding, if there is none."""
        with self._lock:
            if self._ended:  # a value that was on its way when the connection ended
                return None
            try:
                if self._block is None:
                    raise ValueError("the sender has not told of its block")
                return self._block.read(self._order)
            except (OSError, ValueError) as error:
                self._tell(str(error))
                return None

    def place(self, octets: bytes) -> bool:
        """Write a value into a block of our own, a new one if it does not fit. False, and a finding, if it cannot be.

        CORBA exceptions of the peer, which is told of a new block, are the caller's.
        """
        try:
            with self._lock:
                block = self._block
                if block is not None and len(octets) + _HEAD <= block.size:
                    block.write(octets, self._order)
                    return True
            size = max(self._size, len(octets) + _HEAD)
            block = _Block(f"muros-{os.getpid()}-{uuid.uuid4()}", size, make=True)
            block.write(octets, self._order)
        except (OSError, ValueError) as error:
            self._tell(f"the value cannot be placed: {error}")
            return False
        if self.peer is None:
            block.close()
            self._tell("the peer has not told of its object")
            return False
        try:
            self.peer.open_memory(block.size, block.name)
        except CORBA.Exception:
            block.close()
            raise
        block.forget_name()
        self._replace(block)
        return True

    def end(self) -> None:
        """Let go of the block; one that comes now is not kept: calls may be on their way."""
        with self._lock:
            self._ended = True
        self._replace(None)

    def _replace(self, block: _Block | None) -> None:
        with self._lock:
            if self._ended and block is not None:
                unwanted: _Block | None = block
            else:
                unwanted, self._block = self._block, block
        if unwanted is not None:
            unwanted.close()

    def _tell(self, why: str) -> None:
        self._connection.report(
            Finding(
                "shared-memory-failed",
                f"port {self._connection.port_name}",
                "{n} value{s} not carried through shared memory",
                why,
                "both ports must run on one machine, as the same user; otherwise connect with corba_cdr",
                subject=self._connection.profile.name,
            )
        )


class _Offer:
    """The side that is called."""

    def __init__(self, orb: Orb, end: _End, name: str) -> None:
        self._end: _End | None = end
        self._offer = CorbaOffer(orb, end, OpenRTM.PortSharedMemory, name, True)

    @property
    def properties(self) -> Mapping[str, PropertyValue]:
        """The reference to its object."""
        return self._offer.properties

    def close(self) -> None:
        """Take the object and the block away."""
        end, self._end = self._end, None
        if end is not None:
            self._offer.close()
            end.end()


class _Line:
    """The side that calls: its own object, and the other's."""

    def __init__(self, connection: Connection, orb: Orb, size: int, name: str) -> None:
        self._connection = connection
        self._orb = orb
        self._peer = reference_in(connection.profile, name, OpenRTM.PortSharedMemory, orb)
        self._end: _End | None = _End(connection, orb, size)
        self._end.peer = self._peer
        own = orb.activate(self._end)._narrow(OpenRTM.PortSharedMemory)
        try:
            self._peer.setInterface(own)
            self._peer.setEndian(connection.little)
        except CORBA.Exception as error:
            self.close()
            raise TransportError(f"{name}: the peer's object does not answer: {describe(error)}") from error

    def put(self, octets: bytes) -> PortStatus:
        """Place the value and signal."""
        end = self._end
        try:
            placed = end is not None and end.place(octets)
            return _STATUS[self._peer.put()._v] if placed else PortStatus.PORT_ERROR
        except CORBA.Exception as error:
            return self._failed(error)

    def get(self) -> tuple[PortStatus, bytes]:
        """Ask, then read."""
        try:
            status = _STATUS[self._peer.get()._v]
        except CORBA.Exception as error:
            return self._failed(error), b""
        if status is not PortStatus.PORT_OK:
            return status, b""
        end = self._end
        octets = end.received() if end is not None else None
        return (PortStatus.PORT_ERROR, b"") if octets is None else (status, octets)

    def close(self) -> None:
        """Take the own object and block away."""
        end, self._end = self._end, None
        if end is not None:
            self._orb.deactivate(end)
            end.end()

    def _failed(self, error: CORBA.Exception) -> PortStatus:
        if isinstance(error, LOST):
            raise PeerLostError(
                f"{self._connection.port_name}: the peer does not answer: {describe(error)}"
            ) from error
        return PortStatus.UNKNOWN_ERROR
