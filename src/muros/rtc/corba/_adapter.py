"""Objects that other processes can call: activated, found again by their references, taken away. The ORB's POAs.

Theory of operation. Besides Python's own lock, which one thread holds at a time, omniORB has one for its table of
objects. Activating an object takes the table's lock, then Python's; destroying a servant takes Python's, then the
table's: two threads that do so at once wait for each other for ever. So both happen under `Adapter._gate`, a lock that
is waited for without holding either:

- all activations are made here;
- a servant that is taken away is kept (`_retired`) until its last calls are long over and then dropped here. Whoever
  deactivates a servant lets go of it at once, so that nobody else drops it.

Two operations of the ORB take the two locks likewise and are not used: `reference_to_servant`, for which there is a
table of our own, and `_hash`, in whose place is `object_key`.
"""

from __future__ import annotations

import logging
import math
import struct
import threading
import time
from collections import deque
from collections.abc import Callable
from typing import Any, Final

from omniORB import CORBA, PortableServer

__all__ = ["Adapter", "Place", "object_key"]

RETIRED_SECONDS: Final = 30.0
"""Time for which a servant is kept after it was taken away: longer than any call may take."""

RETIRED_LIMIT: Final = 1000
"""Servants that are kept so at most; beyond it the oldest are dropped before their time."""

_POA: Final = PortableServer.POA
_log = logging.getLogger(__name__)


class Adapter:
    """The active objects of an ORB. Any thread may call. `poa` and `keyed` are its RootPOA and omniINSPOA."""

    def __init__(self, poa: Any, keyed: Any, *, clock: Callable[[], float] = time.monotonic) -> None:
        self._poa = poa
        self._keyed = keyed
        self._clock = clock
        self._gate = threading.RLock()  # what is dropped may end others
        self._active: dict[Any, tuple[bytes, bytes]] = {}
        """For each servant: its id among all, and its key or nothing."""
        self._by_id: dict[bytes, Any] = {}
        self._by_key: dict[bytes, tuple[Any, Any]] = {}
        """Servants by their keys, with the references that have these."""
        self._retired: deque[tuple[float, Any]] = deque()
        self._drop_at = math.inf

    @property
    def servants(self) -> tuple[Any, ...]:
        """What is active."""
        with self._gate:
            return tuple(self._active)

    def activate(self, servant: Any, key: str = "") -> Any:
        """Let others call `servant`; the reference to it. One that is active stays as it is.

        With a `key`, by `corbaloc::HOST:PORT/KEY`, too; a key that another object has goes to this one.
        """
        with self._gate:
            self._drop_retired()
            if servant not in self._active:
                number = self._poa.activate_object(servant)
                self._active[servant] = (number, self._take_key(servant, key.encode()) if key else b"")
                self._by_id[number] = servant
            return self._poa.id_to_reference(self._active[servant][0])

    def deactivate(self, servant: Any) -> None:
        """Take `servant` away. The caller lets go of it at once. Twice is allowed."""
        with self._gate:
            self._drop_retired()
            number, key = self._active.pop(servant, (b"", b""))
            if not number:
                return
            del self._by_id[number]
            if self._by_key.get(key, (None,))[0] is servant:
                del self._by_key[key]
                self._end(self._keyed, key)
            self._end(self._poa, number)
            self._retire(servant)

    def find(self, reference: Any) -> Any | None:
        """The servant behind `reference`, by whichever of its references; None if it is another process's, or gone."""
        if self._clock() > self._drop_at:
            with self._gate:
                self._drop_retired()
        try:
            return self._by_id.get(self._poa.reference_to_id(reference))
        except (CORBA.Exception, _POA.WrongAdapter):
            pass
        try:
            servant, own = self._by_key.get(self._keyed.reference_to_id(reference), (None, None))
            # Keys are names: an object of another process may have the same.
            return servant if servant is not None and own._is_equivalent(reference) else None
        except (CORBA.Exception, _POA.WrongAdapter):
            return None

    def reserve(self, servant: Any) -> Place:
        """A reference for `servant` that stays the same while it comes and goes."""
        return Place(self, self._poa.create_reference(servant._NP_RepositoryId), servant)

    def close(self) -> None:
        """The ORB has ended."""
        with self._gate:
            self._active.clear()
            self._by_id.clear()
            self._by_key.clear()
            self._retired.clear()

    def _take_key(self, servant: Any, key: bytes) -> bytes:
        try:
            self._keyed.activate_object_with_id(key, servant)
        except _POA.ObjectAlreadyActive:
            self._end(self._keyed, key)
            try:
                self._keyed.activate_object_with_id(key, servant)
            except _POA.ObjectAlreadyActive:  # the other one is still busy with a call
                _log.warning("corbaloc key %s stays with the object that has it", key.decode())
                return b""
        self._by_key[key] = servant, self._keyed.id_to_reference(key)
        return key

    def _end(self, poa: Any, number: bytes) -> None:
        try:
            poa.deactivate_object(number)
        except (CORBA.Exception, _POA.ObjectNotActive):
            _log.debug("object %r had gone already", number, exc_info=True)

    def _retire(self, servant: Any) -> None:
        """Keep what was taken away for some time; with the gate held."""
        self._retired.append((self._clock() + RETIRED_SECONDS, servant))
        self._drop_at = self._retired[0][0]

    def _drop_retired(self) -> None:
        """Drop what was taken away long ago; with the gate held."""
        now = self._clock()
        while self._retired and (self._retired[0][0] < now or len(self._retired) > RETIRED_LIMIT):
            self._retired.popleft()
        self._drop_at = self._retired[0][0] if self._retired else math.inf


class Place:
    """A reference behind which a servant is from time to time. Made by `Adapter.reserve`."""

    def __init__(self, adapter: Adapter, reference: Any, servant: Any) -> None:
        self.reference: Final = reference
        self._adapter = adapter
        self._number: bytes = adapter._poa.reference_to_id(reference)
        self._servant = servant
        self._active = False

    def activate(self) -> None:
        """The servant can be called. CORBA exceptions are the caller's. Twice is allowed."""
        adapter = self._adapter
        with adapter._gate:
            adapter._drop_retired()
            if not self._active:
                adapter._poa.activate_object_with_id(self._number, self._servant)
                self._active = True

    def deactivate(self) -> None:
        """The servant cannot be called any more. Twice is allowed."""
        adapter = self._adapter
        with adapter._gate:
            if self._active:
                self._active = False
                adapter._end(adapter._poa, self._number)
                adapter._retire(self._servant)


def object_key(ior: str) -> bytes:
    """What identifies an object within its ORB, of a reference's text `IOR:...`; empty where it has none.

    References that lead to the same object have the same key. CORBA 3.1, part 2, 9.6 and 9.7.2.
    """
    try:
        octets = bytes.fromhex(ior[4:])
        order = "<" if octets[0] else ">"
        at = _after(octets, 4, order)
        (count,) = struct.unpack_from(f"{order}I", octets, at)
        at += 4
        for _ in range(count):
            tag, size = struct.unpack_from(f"{order}II", octets, at)
            if tag == 0:
                return _key_of_profile(octets[at + 8 : at + 8 + size])
            at += 8 + size + (-size % 4)
    except (ValueError, IndexError, struct.error):
        pass
    return b""


def _key_of_profile(octets: bytes) -> bytes:
    """Of an IIOP profile: endianness, version, host, port, key."""
    order = "<" if octets[0] else ">"
    (host,) = struct.unpack_from(f"{order}I", octets, 4)
    at = 8 + host
    at += at % 2 + 2
    at += -at % 4
    (size,) = struct.unpack_from(f"{order}I", octets, at)
    return octets[at + 4 : at + 4 + size]


def _after(octets: bytes, at: int, order: str) -> int:
    """Where the next aligned number stands behind the text at `at`."""
    (size,) = struct.unpack_from(f"{order}I", octets, at)
    end = at + 4 + size
    return int(end + (-end % 4))
