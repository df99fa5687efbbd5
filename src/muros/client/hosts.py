"""The session of hosts: it checks what it is given, says what is wrong, and says goodbye when the program ends.

Boards have no room for the first two and no end for the last.
"""

from __future__ import annotations

import atexit
import os
import weakref
from typing import TYPE_CHECKING, Any

from muros.client import methods, reasons
from muros.client import session as board
from muros.client.entities import steps
from muros.client.link import CONNECTED
from muros.client.problems import SESSION

if TYPE_CHECKING:
    from typing import Unpack

    from muros.client._types import Options, Transport
    from muros.xrce._types import Buffer

_INDICES = 4096
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
}
"""The smallest value of each number among the settings."""

_sessions: weakref.WeakSet[Session] = weakref.WeakSet()
_process = 0


class Session(board.Session):
    """A session with an agent over ``transport``; see ``muros.client.session.Session`` for arguments and attributes.

    Raises TypeError and ValueError for wrong arguments. Problems are printed on standard error unless ``on_problem``
    is set. What keeps us from the agent is told once for each cause, and again when the cause has changed or the
    session was connected meanwhile. A session that is connected when the program ends is closed.
    """

    participant = methods.participant
    writer = methods.writer
    reader = methods.reader
    requester = methods.requester
    replier = methods.replier
    ping = methods.ping
    close = methods.close

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
        super().__init__(transport, client_key, session_id, mtu, history, **options)
        _remember(self)

    @property
    def key(self) -> bytes:
        """The client key, 4 bytes."""
        key: bytes = self.notes["key"]
        return key

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

    def index(self, kind: int) -> int:
        """A new index for an object of a kind; when each was used, that of a deleted one. ValueError for none."""
        unused = _unused(self, kind) if self.counts[kind] == _INDICES else None
        return unused[0] if unused else methods.index(self, kind)

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
    """The indices that no object of a kind has, nor one whose DELETE is not acknowledged."""
    used = {entity.object_id(step) for entity in session.entities for step in range(steps(entity))}

    def deleted(buf: Buffer, off: int, n: int) -> None:
        """Takes the DELETEs out of ``n`` bytes of submessages."""
        pos = 0
        while pos + 8 <= n:
            at = off + pos
            if buf[at] == _DELETE:
                used.add(buf[at + 6] << 8 | buf[at + 7])
            pos += 4 + (buf[at + 2] | buf[at + 3] << 8) + 3 & ~3

    size = len(session.head)
    session.reliable.unacknowledged(lambda buf, off, n: deleted(buf, off + size, n - size))
    if session.backlog is not None:
        for data in session.backlog.items:
            deleted(data, 0, len(data))
    return [index for index in range(_INDICES) if index << 4 | kind not in used]


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
