"""What a session reports on hosts, in words: why something was dropped or no agent is reached, and what to do about it.

Boards have no room for so many words, see ``problems``.
"""

from __future__ import annotations

import errno
import os
import socket
import sys
from typing import TYPE_CHECKING, Any

from muros.client import problems
from muros.client.link import CONNECTED

if TYPE_CHECKING:
    from muros.client.session import Session

UNREACHABLE = 9
LARGEST = 10
SILENT = 11
"""Codes beside those of ``problems``."""

_DROPS = {problems.OFFLINE: 0, problems.FULL: 1, problems.TOO_LARGE: 2, LARGEST: 4}
"""Where samples are counted that are dropped so, in ``drops`` of a session."""
_AGAIN = "Trying again."


def say(text: str) -> None:
    """Prints a problem for programs without ``on_problem``; one without a standard error does without."""
    if sys.stderr is not None:
        print(f"muros: {text}", file=sys.stderr, flush=True)


def text(session: Session, code: int, value: int, what: Any) -> str:
    """The problem ``code`` in words; arguments as for ``problems.text``, with silences in ms."""
    if code == UNREACHABLE:
        return _unreachable(session.transport, what)
    if code == SILENT:
        return _silent(session.transport, value)
    said = problems.text(code, value, what)
    if code == LARGEST:
        said = (
            f"a sample of {value} B dropped: larger than largest={session.largest}, "
            "the longest that Session(largest=...) joins from fragments"
        )
    elif code in (problems.OFFLINE, problems.FULL):
        why = _offline(session, what) if code == problems.OFFLINE else _full(session)
        said = f"{value} B of {what.name} dropped: {why}"
    count = session.drops[_DROPS[code]] if code in _DROPS else 1
    return said if count == 1 else said.replace(" dropped:", f" dropped ({count} samples by now):", 1)


def _offline(session: Session, writer: Any) -> str:
    """Why nothing can be sent."""
    if writer.status:
        return f"the agent refused to create it: {problems.status(writer.status)}"
    missing = "no agent is connected" if session.state != CONNECTED else "the agent has not created it yet"
    if not writer.stream.reliable:
        return f"{missing}. Best effort does not wait."
    return f"{missing}. Session(queue=N) keeps up to N samples until then."


def _full(session: Session) -> str:
    """Why there is no room."""
    if session.queue:
        return f"the queue is full, queue={session.queue}. Publish less often or raise it."
    if session.backlog is not None and session.backlog.items:
        return "a sample larger than a message is still on its way. Publish less often or set queue."
    return (
        f"history={session.reliable.history} messages are on their way and not acknowledged. "
        "Publish less often, raise history or set queue."
    )


def _silent(transport: Any, ms: int) -> str:
    """Nobody has answered for so long."""
    kind, address = _address(transport)
    if not kind:
        return f"no agent has answered for {ms // 1000} s. {_AGAIN}"
    hint = (
        "with the same baud rate" if kind == "serial" else f"as in: muros agent {kind} -p {transport._port}"
    )
    return f"no agent has answered at {address} for {ms // 1000} s. Is one running, {hint}? {_AGAIN}"


def _unreachable(transport: Any, error: OSError) -> str:
    """The way cannot be opened, or is gone."""
    kind, address = _address(transport)
    if isinstance(error, socket.gaierror):
        return f"no host is called {transport._host!r} ({(error.strerror or 'unknown').lower()}). {_AGAIN}"
    number = error.errno or (error.args[0] if error.args and isinstance(error.args[0], int) else 0)
    if number == errno.ECONNREFUSED and kind:
        hint = f"as in: muros agent {kind} -p {transport._port}"
        return f"nobody listens at {address}. Is an agent running, {hint}? {_AGAIN}"
    if kind == "serial" and number in (errno.ENOENT, errno.ENODEV, errno.ENXIO):
        return f"{address} is not there. {_AGAIN}"
    if kind == "serial" and number == errno.EACCES:
        return f"{address}: permission denied. Is your user in its group (dialout)? {_AGAIN}"
    why = os.strerror(number).lower() if number else str(error)
    return f"cannot reach an agent{' at ' + address if address else ''}: {why}. {_AGAIN}"


def _address(transport: Any) -> tuple[str, str]:
    """The agent's word for the kind of a transport, and where it leads; empty for kinds of the user's own."""
    if hasattr(transport, "device"):
        return "serial", str(transport.device)
    if not hasattr(transport, "_host"):
        return "", ""
    return ("udp4" if type(transport).__name__ == "Udp" else "tcp4"), f"{transport._host}:{transport._port}"
