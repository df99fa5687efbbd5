"""The session of hosts: it checks what it is given, says what is wrong, and says goodbye when the program ends.

Boards have no room for the first two and no end for the last.
"""

from __future__ import annotations

import atexit
import os
import threading
import weakref
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from muros.client import closing, echo, making, reasons
from muros.client import session as board
from muros.client.entities import STEPS
from muros.client.link import CONNECTED
from muros.client.problems import SESSION
from muros.client.sharing import Endpoint, Replier, Requester, Turnstile
from muros.compat import ticks_add, ticks_ms

if TYPE_CHECKING:
    from typing import Unpack

    from muros.client._types import OnData, Options, Transport
    from muros.client.qos import AnyQos
    from muros.client.services import OnReply, OnRequest
    from muros.xrce._types import Buffer

_INDICES = 4096
_PATIENCE = 1000  # ms to take leave in
_SILENCE = 3000  # ms without an answer until that is told
_SILENT = "silent"
_DELETE = 3
_LEAST_MTU = 64
_LARGEST_MTU = 65535 + 4
_LONGEST_LIVELINESS = 999_999  # ms: the property has six digits
_LARGEST_HISTORY = 0x4000
_CREATIONS = ("binary", "xml", "reference")
_TRANSPORT = ("open", "close", "send", "receive", "wait", "mtu")
_LEAST = {
    "queue": 0,
    "largest": 0,
    "heartbeat": 1,
    "retry": 1,
    "creation_timeout": 1,
    "keepalive": 0,
    "ping_timeout": 1,
    "ping_attempts": 1,
    "hard_liveliness": 0,
    "destroy_timeout": 0,
}
"""The smallest value of each number among the settings."""
_OTHERS = {"creation", "reference", "properties"}

_sessions: weakref.WeakSet[Session] = weakref.WeakSet()
_process = 0


class Session(board.Session):
    """A session with an agent over ``transport``; see ``muros.client.session.Session`` for arguments and attributes.

    Raises TypeError and ValueError for wrong arguments. Problems are printed on standard error unless ``on_problem``
    is set. What keeps us from the agent is told once for each cause, and again when the cause has changed or the
    session was connected meanwhile. A session that is connected when the program ends is closed. ``close`` waits for
    the agent at most ``destroy_timeout`` ms; with 0 it says goodbye once and does not wait.

    Any thread may use a session and what is made in it, see ``sharing``; ``lock`` is held while one does.
    """

    def __init__(
        self,
        transport: Transport,
        client_key: int | bytes | None = None,
        session_id: int = 0x81,
        mtu: int = 0,
        history: int = 4,
        **options: Unpack[Options],
    ) -> None:
        _check(transport, client_key, session_id, mtu, history, dict(options))
        self.lock = threading.RLock()
        self._gate = Turnstile()
        self._pinging = threading.RLock()  # one at a time: they would take each other's answers
        self._patience = options.pop("destroy_timeout", _PATIENCE)
        super().__init__(transport, client_key, session_id, mtu, history, **options)
        _remember(self)

    @property
    def mtu(self) -> int:
        """The longest message either way, in bytes."""
        return self.reliable.mtu

    def participant(self, name: str, domain: int = 0) -> board.Entity:
        """A DDS participant; see ``methods``."""
        with self._making():
            return _shared(making.participant(self, name, domain))

    def writer(self, node: board.Entity, topic: str, kind: str, qos: AnyQos = "default") -> board.Entity:
        """A writer of ``topic``; see ``methods``."""
        with self._making():
            return _shared(making.writer(self, node, topic, kind, qos))

    def reader(
        self,
        node: board.Entity,
        topic: str,
        kind: str,
        qos: AnyQos = "default",
        on_data: OnData | None = None,
    ) -> board.Entity:
        """A reader of ``topic``; see ``methods``."""
        with self._making():
            return _shared(making.reader(self, node, topic, kind, qos, on_data))

    def requester(
        self, node: board.Entity, name: str, kind: str, on_reply: OnReply, qos: AnyQos = "services"
    ) -> Requester:
        """A client of the service ``name``; see ``methods``."""
        with self._making():
            return making.enter(Requester(on_reply), self, node, name, kind, qos, Requester.KIND)

    def replier(
        self, node: board.Entity, name: str, kind: str, on_request: OnRequest, qos: AnyQos = "services"
    ) -> Replier:
        """A server of the service ``name``; see ``methods``."""
        with self._making():
            return making.enter(Replier(on_request), self, node, name, kind, qos, Replier.KIND)

    def spin_once(self, now: int | None = None) -> int:
        """Does what is due and takes what has come; from any thread. See ``muros.client.session.Session``."""
        gate = self._gate
        gate.look()
        taken = 1
        try:
            with self.lock:
                taken = super().spin_once(now)
        finally:
            if gate.several:
                self._pass_on(taken)
        return taken

    def wait(self, timeout: int) -> None:
        """Waits until something may have come or ``wake`` is called, at most ``timeout`` ms; any number of threads."""
        self._gate.wait(self.transport if self.up else None, timeout)

    @property
    def seen(self) -> int:
        """Where this thread is in what has come, for ``adopt``."""
        return self._gate.seen

    def adopt(self, seen: int) -> None:
        """Has this thread wait in the place of the one that asked ``seen``, and looks at the session itself."""
        self._gate.adopt(seen)

    def wake(self) -> None:
        """Ends a wait, from any thread."""
        self._gate.wake()

    def hurry(self) -> None:
        """Something was published: whoever waits may have to repeat it sooner than he meant to get up."""
        if self._gate.leading and self.reliable.first != self.reliable.next:
            self._gate.due(self.reliable.due)

    def ping(self, timeout: int = 1000, clock: Callable[[], int] = ticks_ms) -> bool:
        """Asks the agent, within the session: whether it answers within ``timeout`` ms and knows us."""

        def send(session: board.Session) -> None:
            with self.lock:
                echo.question(session)

        with self._pinging:
            return echo.ask(self, timeout, clock, send)

    def close(self) -> None:
        """Takes leave of the agent, for at most one second, and closes the transport."""
        self._gate.wake()
        with self.lock:
            closing.close(self, self._patience)

    @contextmanager
    def _making(self) -> Iterator[None]:
        """Something is made, which the agent is asked for in the next turn."""
        with self.lock:
            yield
        if self._gate.leading:
            self._gate.wake()

    def _pass_on(self, taken: int) -> None:
        """Something was taken, or is due by now: wakes the threads whom that may concern."""
        if taken:
            self._gate.wake(others=True)
        elif self._gate.leading:
            self._gate.due(ticks_add(self.now, self.deadline(self.now)))

    def problem(self, code: int, value: int = 0, what: object = "") -> None:
        """Tells ``on_problem``, or whoever reads standard error."""
        said = reasons.text(self, code, value, what)
        if code in (SESSION, reasons.UNREACHABLE):
            told = self.trouble is not None and self.trouble[0] == said
            self.trouble = (said, None)
            if told:
                return
        if self.on_problem is None:
            reasons.say(said)
            return
        try:
            self.on_problem(code, said)
        except Exception as error:
            self.raised = error

    def new_id(self, kind: int) -> int:
        """The id of a new object of a kind; when each was used, that of a deleted one. ValueError for none."""
        unused = _unused(self, kind) if self.counts[kind] == _INDICES else None
        return unused[0] if unused else making.new_id(self, kind)

    def attempting(self, now: int) -> None:
        """Tells how long nobody has answered."""
        if self.state == CONNECTED or not self.transport.mtu:
            return  # the transport of a closed session has no MTU
        cause, since = self.trouble or ("", None)
        if since is None:
            since = now
        told = now - since < _SILENCE or cause == _SILENT
        self.trouble = (cause if told else _SILENT, since)
        if not told:
            self.problem(reasons.SILENT, now - since)


def _shared(made: board.Entity) -> board.Entity:
    """An entity for any thread; what makes it serves boards too, and knows their class alone."""
    made.__class__ = Endpoint
    return made


def _check(
    transport: Any,
    client_key: int | bytes | None,
    session_id: int,
    mtu: int,
    history: int,
    options: dict[str, Any],
) -> None:
    """Raises TypeError or ValueError for what no session can be made of."""
    if isinstance(transport, type) or not all(hasattr(transport, name) for name in _TRANSPORT):
        raise TypeError(f"{transport!r} is no transport: Session takes one such as Udp('192.168.1.10', 8888)")
    port = getattr(transport, "_port", 1)
    if not isinstance(port, int) or not 0 < port <= 0xFFFF:
        raise ValueError(f"the agent's port is {port!r}: it must be an integer from 1 to 65535")
    if isinstance(client_key, int) and not 0 < client_key <= 0xFFFFFFFF:
        raise ValueError(f"client_key is {client_key:#x}: it must be from 1 to 0xFFFFFFFF")
    if not isinstance(session_id, int) or not 0 < session_id <= 0xFF or session_id == 0x80:
        raise ValueError(
            f"session_id is {session_id!r}: it must be from 0x81 to 0xFF, "
            "or from 0x01 to 0x7F to have the client key in every message"
        )
    mtu = mtu or transport.mtu
    if not isinstance(mtu, int) or not _LEAST_MTU <= mtu <= _LARGEST_MTU:
        raise ValueError(f"mtu is {mtu!r}: it must be from {_LEAST_MTU} to {_LARGEST_MTU} bytes")
    if not isinstance(history, int) or history & history - 1 or not 0 < history <= _LARGEST_HISTORY:
        raise ValueError(f"history is {history!r}: it must be a power of two up to {_LARGEST_HISTORY}")
    unknown = options.keys() - _LEAST.keys() - _OTHERS
    if unknown:
        raise TypeError(f"Session has no option {', '.join(sorted(unknown))}")
    creation = options.get("creation", _CREATIONS[0])
    if creation not in _CREATIONS:
        raise ValueError(f"creation is {creation!r}: it must be one of {', '.join(_CREATIONS)}")
    for name, least in _LEAST.items():
        value = options.get(name, least)
        if not isinstance(value, int) or value < least:
            raise ValueError(f"{name} is {value!r}: it must be an integer of at least {least}")
    if options.get("hard_liveliness", 0) > _LONGEST_LIVELINESS:
        raise ValueError(f"hard_liveliness is {options['hard_liveliness']}: at most {_LONGEST_LIVELINESS} ms")


def _unused(session: board.Session, kind: int) -> list[int]:
    """The ids that no object of a kind has, nor one whose DELETE is not acknowledged."""
    used = {
        entity.object_id(step)
        for entity in session.entities
        for step in (1, 2, 3)
        if STEPS[entity.id & 15] >> step & 1
    }

    def deleted(buf: Buffer, off: int, n: int) -> None:
        """Takes the DELETEs out of ``n`` bytes of submessages."""
        pos = 0
        while pos + 8 <= n:
            at = off + pos
            if buf[at] == _DELETE:
                used.add(buf[at + 6] << 8 | buf[at + 7])
            pos += 4 + (buf[at + 2] | buf[at + 3] << 8) + 3 & ~3

    size = len(session.head)
    stream = session.reliable
    stream.transmit(stream.first, stream.next, lambda buf, off, n: deleted(buf, off + size, n - size))
    if session.backlog is not None:
        for data in session.backlog.items:
            deleted(data, 0, len(data))
    return [number for number in range(kind, _INDICES << 4, 16) if number not in used]


def _remember(session: Session) -> None:
    """Has a session closed when the program ends."""
    global _process
    if _process != os.getpid():  # the end of a forked child must not end the sessions of its parent
        _process = os.getpid()
        _sessions.clear()
        atexit.register(_goodbye)
    _sessions.add(session)


def _goodbye() -> None:
    """Closes the sessions that are still connected, so that no ghost of them stays at the agent."""
    if os.getpid() != _process:
        return
    for session in [session for session in _sessions if session.state == CONNECTED]:
        try:
            session.close()
        except Exception:
            pass  # the program is over: there is nobody left to tell
