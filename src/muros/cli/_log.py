"""What the agent prints: events, findings and messages, in muros' own words or in the reference agent's.

A style turns what happened into lines of (level, colour, text); the log prints those whose level is wanted. Levels
are the numbers of `-v`: 1 critical, 2 error, 3 warning, 4 info, 5 debug (each message's length), 6 trace (its
bytes).
"""

import os
import re
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, ClassVar, Final, NamedTuple, Protocol, TextIO

from muros.agent.events import (
    ClientBack,
    ClientConnected,
    ClientGone,
    ClientLost,
    ClientReady,
    EntityCreated,
    EntityDeleted,
    LinkDown,
    LinkUp,
)
from muros.findings import Finding, Severity
from muros.xrce.constants import KIND_NAMES

CRITICAL: Final = 1
ERROR: Final = 2
WARNING: Final = 3
INFO: Final = 4
DEBUG: Final = 5
TRACE: Final = 6

RED: Final = "31"
GREEN: Final = "32"
YELLOW: Final = "33"
DIM: Final = "2"
PLAIN: Final = ""

_SEVERITY: Final = {
    Severity.ERROR: (ERROR, RED),
    Severity.WARNING: (WARNING, YELLOW),
    Severity.INFO: (INFO, PLAIN),
}


class Line(NamedTuple):
    """One thing to print: from which `-v` on, its colour, and its text, which may go on in further lines."""

    level: int
    color: str
    text: str


class Message(NamedTuple):
    """A message that passed a link: the link's name, the peer, and the direction."""

    link: str
    peer: str
    incoming: bool
    data: bytes


class Told(Protocol):
    """Something that happened, at the agent or at another server."""

    def text(self) -> str:
        """One line for people."""


class Style(Protocol):
    """How things are said. Each method yields the lines for one thing; `now` is the wall clock in seconds."""

    def started(self, now: float, banner: str, links: Sequence[str], verbose: int) -> Iterator[Line]:
        """The agent runs; `links` are the names of its links."""

    def event(self, now: float, event: Told) -> Iterator[Line]:
        """Something happened at the agent, or at another server."""

    def finding(self, now: float, finding: Finding) -> Iterator[Line]:
        """Something was dropped, refused or unmatched."""

    def message(self, now: float, message: Message, verbose: int) -> Iterator[Line]:
        """A message passed; its bytes are shown from `-v 6` on."""


class Log:
    """Prints to `stream` what is wanted, a line at a time. Goes quiet when nobody reads any more.

    `color` None: colours if the stream is a terminal and the environment does not say no.
    """

    def __init__(
        self,
        stream: TextIO,
        style: Style,
        *,
        verbose: int = INFO,
        color: bool | None = None,
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._stream: TextIO | None = stream
        self._style = style
        self._verbose = verbose
        self._color = _wants_color(stream) if color is None else color
        self._clock = clock

    def started(self, banner: str, links: Sequence[str]) -> None:
        """Says that the agent runs."""
        self._print(self._style.started(self._clock(), banner, links, self._verbose))

    def event(self, event: Told) -> None:
        """Says an event of the agent, or of another server."""
        self._print(self._style.event(self._clock(), event))

    def finding(self, finding: Finding) -> None:
        """Says a finding."""
        self._print(self._style.finding(self._clock(), finding))

    def message(self, message: Message) -> None:
        """Says a message that passed, if messages are wanted."""
        if self._verbose >= DEBUG:
            self._print(self._style.message(self._clock(), message, self._verbose))

    def _print(self, lines: Iterator[Line]) -> None:
        if self._stream is None:
            return
        text = "".join(
            (f"\x1b[{line.color}m{line.text}\x1b[0m" if self._color and line.color else line.text) + "\n"
            for line in lines
            if line.level <= self._verbose
        )
        try:
            self._stream.write(text)
            self._stream.flush()
        except (OSError, ValueError):  # the reader has left, or the stream was closed: the agent goes on
            self._stream = None


class MurosStyle:
    """`[12:00:01] client 0xBA5EBA11 connected from 192.168.1.23:50210`"""

    EVENTS: ClassVar[Mapping[type[Any], tuple[int, str]]] = {
        LinkUp: (INFO, PLAIN),
        LinkDown: (WARNING, YELLOW),
        ClientConnected: (INFO, GREEN),
        ClientReady: (INFO, PLAIN),
        ClientBack: (INFO, GREEN),
        ClientLost: (WARNING, YELLOW),
        ClientGone: (INFO, PLAIN),
        EntityCreated: (DEBUG, DIM),
        EntityDeleted: (DEBUG, DIM),
    }

    def started(self, now: float, banner: str, links: Sequence[str], verbose: int) -> Iterator[Line]:
        """The banner."""
        yield Line(CRITICAL, PLAIN, banner)

    def event(self, now: float, event: Told) -> Iterator[Line]:
        """The event's own text."""
        level, color = self.EVENTS.get(type(event), (INFO, PLAIN))
        yield Line(level, color, f"{_stamp(now)} {printable(event.text())}")

    def finding(self, now: float, finding: Finding) -> Iterator[Line]:
        """Two lines: what and why, and what to do."""
        level, color = _SEVERITY[finding.severity]
        yield Line(level, color, f"{_stamp(now)} {finding.format()}")

    def message(self, now: float, message: Message, verbose: int) -> Iterator[Line]:
        """The length, and the bytes if wanted."""
        way = "<- from" if message.incoming else "-> to"
        size = len(message.data)
        text = f"{_stamp(now)} {size:>5} B {way} {message.peer} ({message.link.partition(' ')[0]})"
        if verbose >= TRACE:
            text = "\n".join([text, *(" " * 11 + line for line in _dump(message.data))])
        yield Line(DEBUG, DIM, text)


class ReferenceStyle:
    """Lines as the reference agent prints them, for scripts that search its output.

    `[1795304203.522608] info     | Root.cpp           | create_client            | create                 | ...`
    """

    def __init__(self) -> None:
        self._sessions: dict[int, tuple[int, str]] = {}
        """By client key: session id and address, for the line that says goodbye."""
        self._keys: dict[str, int] = {}

    def started(self, now: float, banner: str, links: Sequence[str], verbose: int) -> Iterator[Line]:
        """A line for each link, and the level of the log."""
        for name in links:
            kind = name.partition(" ")[0]
            if kind in _IP_KINDS:  # the others run when their device is there, which is an event
                detail = f"port: {name.rpartition(':')[2]}"
                yield self._line(now, INFO, _link_file(kind), "init", "running...", detail)
        detail = f"verbose_level: {verbose}"
        yield self._line(now, INFO, "Root.cpp", "set_verbose_level", "logger setup", detail)

    def event(self, now: float, event: Told) -> Iterator[Line]:
        """The lines the reference prints at that moment; events it does not have are passed over."""
        match event:
            case ClientConnected(key, session_id, address):
                self._remember(key, session_id, address)
                detail = f"client_key: {_key(key)}, session_id: 0x{session_id:02X}"
                yield self._line(now, INFO, "Root.cpp", "create_client", "create", detail)
                yield self._session(now, "establish_session", "session established", key, address)
            case ClientBack(key, session_id, address, _, restarted):
                self._remember(key, session_id, address)
                if restarted:
                    yield self._session(now, "establish_session", "session re-established", key, address)
            case ClientGone(key, _, _):
                _, address = self._sessions.pop(key, (0, ""))
                self._keys.pop(address, None)
                detail = f"client_key: {_key(key)}"
                yield self._line(now, INFO, "Root.cpp", "delete_client", "delete", detail)
                yield self._session(now, "destroy_session", "session closed", key, address)
            case EntityCreated(key, number, object_id, participant_id, _):
                name = KIND_NAMES[number].replace(" ", "_")
                detail = f"client_key: {_key(key)}, {name}_id: {_object(object_id)}"
                if name != "participant":
                    detail += f", participant_id: {_object(participant_id)}"
                yield self._line(now, INFO, "ProxyClient.cpp", f"create_{name}", f"{name} created", detail)
            case EntityDeleted(key, _, object_id, _):
                detail = f"client_key: {_key(key)}, object_id: {_object(object_id)}"
                yield self._line(now, INFO, "ProxyClient.cpp", "delete_object", "object deleted", detail)
            case LinkUp(link, what):
                kind, _, where = link.partition(" ")
                if kind not in _IP_KINDS and kind != "discovery":
                    text = f"device: {where if what in ('', link) else what}"
                    yield self._line(now, INFO, _link_file(kind), "init", "running...", text)
            case LinkDown(link, reason):
                text = f"{reason}, waiting for connection..."
                yield self._line(now, INFO, _link_file(link.partition(" ")[0]), "init", _ABSENT, text)
            case _:
                return

    def finding(self, now: float, finding: Finding) -> Iterator[Line]:
        """In the reference's words where it says the same, else under the finding's code."""
        level, _ = _SEVERITY[finding.severity]
        text = " ".join(finding.format().split()).removeprefix("finding: ")
        function, title = "finding", finding.code
        if finding.code == "port-absent":
            device = finding.what.removesuffix(" is not open")
            level, function, title = INFO, "init", _ABSENT
            text = f"device: {device}, error 2, waiting for connection..."
        elif numbers := _TOO_BIG.search(finding.why):
            text = f"Trying to serialize {numbers[1]} in {numbers[2]} MTU stream"
        file = _link_file(finding.who.partition(" ")[0]) if function == "init" else "muros"
        yield self._line(now, level, file, function, title, text)

    def message(self, now: float, message: Message, verbose: int) -> Iterator[Line]:
        """The length, and the bytes if wanted."""
        kind, way = message.link.partition(" ")[0], message.incoming
        short = _MESSAGE_WORDS.get(kind, "SER")
        file = "SerialAgentLinux.cpp" if short == "SER" else _link_file(kind)
        title = f"[==>> {short} <<==]" if way else f"[** <<{short}>> **]"
        key = self._keys.get(message.peer, 0)
        if len(message.data) >= 8 and message.data[0] < 0x80:
            key = int.from_bytes(message.data[4:8], "big")
        detail = f"client_key: {_key(key)}, len: {len(message.data)}"
        if verbose >= TRACE:
            detail = "\n".join([f"{detail}, data: ", *_dump(message.data)])
        yield self._line(now, DEBUG, file, "recv_message" if way else "send_message", title, detail)

    def _remember(self, key: int, session_id: int, address: str) -> None:
        self._keys.pop(self._sessions.get(key, (0, ""))[1], None)
        self._sessions[key] = session_id, address
        self._keys[address] = key

    def _session(self, now: float, function: str, title: str, key: int, address: str) -> Line:
        detail = f"client_key: {_key(key)}, address: {address}"
        return self._line(now, INFO, "SessionManager.hpp", function, title, detail)

    def _line(self, now: float, level: int, file: str, function: str, title: str, detail: str) -> Line:
        word, color = _LEVEL_WORDS[level]
        head = f"[{now:.6f}] {word:<8} | {file:<18} | {function:<24} | {title:<22} | "
        # The dump of a message is the only text of more than one line, and holds no foreign characters.
        return Line(level, color, head + (detail if "\n" in detail and level == DEBUG else printable(detail)))


STYLES: Final[dict[str, Callable[[], Style]]] = {"muros": MurosStyle, "reference": ReferenceStyle}
"""The words of `--log-style`."""

_ABSENT: Final = "Serial port not found."
_TOO_BIG: Final = re.compile(r"(\d+) B do not fit its best-effort MTU of (\d+) B")
_IP_KINDS: Final = frozenset({"udp4", "udp6", "tcp4", "tcp6"})
_LINK_FILES: Final = {
    "udp4": "UDPv4AgentLinux.cpp",
    "udp6": "UDPv6AgentLinux.cpp",
    "tcp4": "TCPv4AgentLinux.cpp",
    "tcp6": "TCPv6AgentLinux.cpp",
    "serial": "TermiosAgentLinux.cpp",
    "multiserial": "MultiTermiosAgentLinux.cpp",
    "pseudoterminal": "PseudoTerminalAgentLinux.cpp",
    "canfd": "CanAgentLinux.cpp",
}
_MESSAGE_WORDS: Final = {"udp4": "UDP", "udp6": "UDP", "tcp4": "TCP", "tcp6": "TCP", "canfd": "CAN"}
_LEVEL_WORDS: Final = {
    CRITICAL: ("critical", RED),
    ERROR: ("error", RED),
    WARNING: ("warning", YELLOW),
    INFO: ("info", PLAIN),
    DEBUG: ("debug", DIM),
    TRACE: ("trace", DIM),
}
_DUMP_WIDTH: Final = 32
"""Bytes in a line of a dump."""


def printable(text: str) -> str:
    """The text on one line without control characters; names in it may come from foreign bytes."""
    return "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)


def _wants_color(stream: TextIO) -> bool:
    return stream.isatty() and not os.environ.get("NO_COLOR") and os.environ.get("TERM") != "dumb"


def _link_file(kind: str) -> str:
    return _LINK_FILES.get(kind, "Agent.cpp")


def _stamp(now: float) -> str:
    return time.strftime("[%H:%M:%S]", time.localtime(now))


def _key(key: int) -> str:
    return f"0x{key:08X}"


def _object(object_id: int) -> str:
    return f"0x{object_id >> 4:03X}({object_id & 0xF:X})"


def _dump(data: bytes) -> Iterator[str]:
    for at in range(0, len(data), _DUMP_WIDTH):
        yield f"{at:04X}: {data[at : at + _DUMP_WIDTH].hex(' ').upper()}"
