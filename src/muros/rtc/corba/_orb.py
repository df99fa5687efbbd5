"""The ORB of the process: started once, with time limits on everything, and ended so that nothing hangs.

Objects are activated by `Orb.activate`, which remembers them until `Orb.deactivate`: one that has gone answers its
callers with OBJECT_NOT_EXIST. With a `key` an object can be reached as `corbaloc::HOST:PORT/KEY`, too, without a
name service.

Calls to other processes end after `call_timeout` and connecting after `connect_timeout`: whoever calls sees
`CORBA.TRANSIENT`, `CORBA.COMM_FAILURE` or `CORBA.TIMEOUT`, which `_lost.py` makes a PeerLostError.
"""

from __future__ import annotations

import atexit
import contextlib
import os
import threading
from collections.abc import Iterable, Sequence
from typing import Any, Final

from omniORB import CORBA

from muros.rtc.codes import RtcError
from muros.rtc.corba._adapter import Adapter, Place, object_key
from muros.rtc.corba._workers import wait_until_gone
from muros.rtc.properties import split_address

__all__ = ["Orb", "current_orb", "endpoint_arguments", "start_orb"]

CALL_TIMEOUT: Final = 10.0
"""Seconds that a call to another process may take."""

CONNECT_TIMEOUT: Final = 3.0
"""Seconds that making a connection to another process may take: a machine that is switched off does not refuse."""

MAX_MESSAGE: Final = 64 << 20
"""Octets of the largest message sent or taken. omniORB's own limit is 2 MiB, less than a camera's image."""

THREADS_SECONDS: Final = 5.0
"""Time that the ORB's threads have to end after it."""

_lock = threading.Lock()
_current: Orb | None = None


def start_orb(
    endpoints: str | Sequence[str] = "all",
    *,
    arguments: Sequence[str] = (),
    call_timeout: float = CALL_TIMEOUT,
    connect_timeout: float = CONNECT_TIMEOUT,
    max_message: int = MAX_MESSAGE,
) -> Orb:
    """Start the ORB of this process; the one that runs already, if there is one (whatever its endpoints).

    `endpoints` is the value of `corba.endpoints` (see `endpoint_arguments`); `arguments` are further ones for the
    ORB, as in `corba.args`, and win. RtcError if an endpoint cannot be opened or an argument is unknown.
    """
    global _current
    with _lock:
        if _current is not None and not _current.is_shut_down:
            return _current
    if _current is not None:
        _current.shutdown()
    with _lock:
        command = [
            "muros",
            *("-ORBclientCallTimeOutPeriod", str(round(call_timeout * 1000))),
            *("-ORBclientConnectTimeOutPeriod", str(round(connect_timeout * 1000))),
            *("-ORBsupportPerThreadTimeOut", "1"),
            *("-ORBinConScanPeriod", "0"),
            *("-ORBgiopMaxMsgSize", str(max_message)),
            *("-ORBnativeCharCodeSet", "UTF-8"),
            *arguments,
            *endpoint_arguments(endpoints),
        ]
        # What a machine has set up for others is not for us.
        os.environ.setdefault("OMNIORB_CONFIG", os.devnull)
        orb = None
        try:
            orb = CORBA.ORB_init(command, CORBA.ORB_ID)
            poa = orb.resolve_initial_references("RootPOA")
            keyed = orb.resolve_initial_references("omniINSPOA")
            poa._get_the_POAManager().activate()
            keyed._get_the_POAManager().activate()
        except CORBA.Exception as error:
            if orb is not None:
                orb.destroy()
            raise RtcError(
                f"the ORB does not start with endpoints {endpoints!r} and arguments {list(arguments)}: {error!r}. "
                "Is another program on that port?"
            ) from error
        _current = Orb(orb, Adapter(poa, keyed))
        return _current


def current_orb() -> Orb:
    """The ORB that `start_orb` has started. RtcError if none runs."""
    orb = _current
    if orb is None or orb.is_shut_down:
        raise RtcError("no ORB runs: call muros.rtc.corba.start_orb first, or let a Manager do it")
    return orb


def endpoint_arguments(endpoints: str | Iterable[str]) -> list[str]:
    """The ORB's arguments for a value of `corba.endpoints`.

    A list, with commas or as a sequence, of `all` (every address, each told to peers), `HOST`, `HOST:PORT`, `:PORT`
    (every address), `[IPV6]:PORT`; what already is one of the ORB's (`giop:...`) stays. RtcError for others.
    """
    given = endpoints.split(",") if isinstance(endpoints, str) else endpoints
    arguments = []
    for text in (one.strip() for one in given):
        if text.lower() == "all":
            arguments += ["-ORBendPoint", "giop:tcp::", "-ORBendPointPublish", "all(addr)"]
        elif text.startswith("giop:"):
            arguments += ["-ORBendPoint", text]
        elif text:
            arguments += ["-ORBendPoint", f"giop:tcp:{_address(text)}"]
    return arguments or ["-ORBendPoint", "giop:tcp::"]


class Orb:
    """The running ORB. Made by `start_orb`; may be used from any thread."""

    def __init__(self, orb: Any, adapter: Adapter) -> None:
        self._orb = orb
        self._adapter = adapter
        self._ending = threading.Lock()
        self._ended = threading.Event()
        self._begun = self._destroyed = False

    @property
    def is_shut_down(self) -> bool:
        """Whether `shutdown` has been called."""
        return self._ended.is_set()

    @property
    def servants(self) -> tuple[Any, ...]:
        """What is active, for tests and for those who look for leaks."""
        return self._adapter.servants

    def activate(self, servant: Any, key: str = "") -> Any:
        """Let other processes call `servant`; the reference to it. With `key`, by `corbaloc::HOST:PORT/KEY`, too.

        A key taken by another object goes to this one.
        """
        return self._adapter.activate(servant, key)

    def deactivate(self, servant: Any) -> None:
        """Take `servant` away: from now on its callers are told that it does not exist. Twice is allowed.

        The caller lets go of the servant, too (`_adapter.py` says why).
        """
        if not self.is_shut_down:
            self._adapter.deactivate(servant)

    def reserve(self, servant: Any) -> Place:
        """A reference for `servant` that stays the same while it comes and goes."""
        return self._adapter.reserve(servant)

    def is_local(self, reference: Any) -> bool:
        """Whether `reference` leads to an object of this process."""
        return self.servant_of(reference) is not None

    def servant_of(self, reference: Any) -> Any | None:
        """The servant behind `reference`, made with its key or without, if it is of this process and active."""
        return self._adapter.find(reference)

    def hash_of(self, reference: Any) -> int:
        """A hash of what `reference` leads to: the same for all references to it."""
        return hash(object_key(self.to_text(reference)))

    def to_text(self, reference: Any) -> str:
        """The reference as `IOR:...`."""
        text: str = self._orb.object_to_string(reference)
        return text

    def to_reference(self, text: str) -> Any:
        """The reference that an `IOR:...`, `corbaloc:...` or `corbaname:...` text holds; it may be nil (None).

        Nobody is called, but for a `corbaname`. RtcError for any other text.
        """
        try:
            return self._orb.string_to_object(text.strip())
        except (CORBA.Exception, UnicodeError, ValueError) as error:
            raise RtcError(f"'{text[:80]}' is no reference to an object: {error!r}") from error

    def wait(self, timeout: float | None = None) -> bool:
        """Wait until `shutdown` is called. True if it was, False if `timeout` seconds passed before."""
        return self._ended.wait(timeout)

    def shutdown(self) -> None:
        """End the ORB. Calls that are being served are waited for.

        Called by one of those, it only begins the end; whoever `wait`s for it calls `shutdown` again.
        """
        global _current
        self._ended.set()
        with self._ending:
            if self._destroyed:
                return
            # OBJECT_NOT_EXIST: another part of the process, which shares the ORB, has destroyed it.
            with contextlib.suppress(CORBA.OBJECT_NOT_EXIST):
                try:
                    self._orb.destroy()
                except CORBA.BAD_INV_ORDER:  # a call is being served by this very thread
                    if not self._begun:
                        self._begun = True
                        self._orb.shutdown(False)
                    return
            self._destroyed = True
        self._adapter.close()
        wait_until_gone(THREADS_SECONDS)
        with _lock:
            if _current is self:
                _current = None


@atexit.register
def _end_at_exit() -> None:
    """A process must not end before the ORB's threads have (`_workers.py`)."""
    if _current is not None:
        _current.shutdown()


def _address(text: str) -> str:
    """HOST:PORT, both parts of which may be empty, of an endpoint of rtc.conf."""
    host, port = split_address(text)
    if port and not (port.isascii() and port.isdigit() and int(port) < 65536):
        raise RtcError(
            f"endpoint '{text}' of corba.endpoints: '{port}' is no port. Write HOST:PORT, HOST, :PORT or all"
        )
    return f"{host}:{port}"
