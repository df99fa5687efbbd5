"""A device's connection to an agent: it connects, keeps watch, and comes back by itself after any fault.

Theory of operation. The connection walks through four states, by the table ``_NEXT``:

- WAITING: no agent has answered yet. CREATE_CLIENT goes out every ``retry`` ms.
- CONNECTING: the agent is there. Streams begin at 0 and what the session holds is created anew.
- CONNECTED: data flows. After ``keepalive`` ms of silence the agent is asked whether it still knows the session.
- LOST: it did not answer, or the way is gone. The streams are kept. If the agent still knows the session when it is
  heard again, everything goes on where it stopped and nothing is lost or doubled; if it does not (it was started
  anew, or our address changed), the session connects again and sends once more what was never acknowledged.

A CREATE_CLIENT that the network repeats or delays makes the reference agent begin its streams again behind our back.
Such a session is out of step: the agent acknowledges numbers of another one. When it waits for number 0 although that
is acknowledged and later messages came, or says ``_FOREIGN`` times in a row what cannot be, and for longer than an
old acknowledgement may be under way, the session connects again. Rules of the wire: DDS-XRCE 1.0, clauses 7.8.2,
8.3.5 and 8.4.
"""

from struct import pack_into

from muros.compat import const, ticks_add, ticks_diff, ticks_ms, urandom
from muros.xrce.session import SessionCore

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.client._types import Transport
    from muros.xrce._types import Buffer

WAITING = const(0)
CONNECTING = const(1)
CONNECTED = const(2)
LOST = const(3)

# What happens, in the order of the columns of the table
_ACCEPTED = const(0)  # the agent made or renewed the session
_MADE = const(1)  # every entity is created or refused
_SILENT = const(2)  # pings went unanswered, or the way is gone
_KNOWN = const(3)  # the agent answered and knows the session
_UNKNOWN = const(4)  # the agent answered and does not know it, or is out of step with it
_EVENTS = const(5)
_NEXT = (
    b"\1\0\0\0\0"  # from WAITING
    b"\1\2\0\1\1"  # from CONNECTING
    b"\2\2\3\2\1"  # from CONNECTED
    b"\3\3\3\2\1"  # from LOST
)

_GET_INFO = const(2)
_STATUS_AGENT = const(4)
_INFO = const(6)
_LITTLE_ENDIAN = const(0x01)
_OBJECT_AGENT = const(0xFFFD)
_FIRST_REQUEST = const(10)
_STREAM_RELIABLE = const(0x80)
_SOON = const(250)  # ms between attempts while an agent is expected back
_SLOWLY = const(5000)  # ms until a refused session asks again
_TRIES = const(4)  # unanswered attempts to connect again until we wait
_OLDEST = const(2000)  # ms: older acknowledgements than this do not come
_FOREIGN = const(8)

_PROBLEM_SESSION = const(1)
_PROBLEM_OUT_OF_STEP = const(2)
_PROBLEM_UNREACHABLE = const(9)


class Link(SessionCore):
    """The connection of a session; ``Session`` adds what is created over it, and says what the settings mean."""

    properties = True
    hard_liveliness = 0
    retry = 1000
    keepalive = 1000
    ping_timeout = 300
    ping_attempts = 3
    raised: "Exception | None" = None  # what a callback raised
    on_state: "Callable[[int], object] | None" = None
    on_problem: "Callable[[int, str], object] | None" = None
    on_time: "Callable[[Buffer, int], object] | None" = None
    trouble: "tuple[str, int | None] | None" = None  # what was told that keeps us from the agent

    def __init__(
        self, transport: "Transport", client_key: "int | bytes | None", session_id: int, mtu: int
    ) -> None:
        if client_key is None:
            client_key = urandom(3) + bytes((urandom(1)[0] | 1,))
        elif isinstance(client_key, int):
            client_key = bytes([client_key >> shift & 255 for shift in (24, 16, 8, 0)])
        if len(client_key) != 4 or client_key == b"\0\0\0\0":
            raise ValueError("client_key must be 4 bytes or an integer from 1 to 0xFFFFFFFF")
        super().__init__(session_id, client_key, transport.send, self._on, 0)
        self.transport = transport
        self._deliver = self.deliver  # taking a method from its object costs a board memory each time
        self.key = client_key
        self.mtu = mtu
        self.state = WAITING
        self.request = _FIRST_REQUEST  # behind the request id that was used last
        self.login = True  # the agent has yet to accept us
        self.up = False  # the transport is open
        self._attempt = b""
        self._due: "int | None" = None  # the tick of the next attempt; None: at once
        self._heard = 0
        self._tries = 0
        self._ping = 0  # the request id of the question that is open
        self._suspected = 0
        self._probe = 0  # the number of a message that tells whether the agent's streams began again, plus 1

    def spin_once(self, now: "int | None" = None) -> int:
        """Takes what has come and does what is due; returns the number of messages taken. Never waits.

        What a callback raises comes out here once everything else is done; what it was told counts as told.
        """
        if now is None:
            now = ticks_ms()
        self.now = now
        taken = 0
        if self.up:
            try:
                taken = self.transport.receive(self._deliver)
            except OSError as error:
                self.up = False
                self.problem(_PROBLEM_UNREACHABLE, 0, error)
        if not self.up and not self.login and self.state != LOST:
            self.happened(_SILENT)
        if self.login:
            self._connect(now)
        elif self.state == LOST:
            self._seek(now)
        else:
            self._watch(now)
            self.work(now)
            self.flush(now)
        if self.raised is not None:
            raised, self.raised = self.raised, None
            raise raised
        return taken

    def next(self, now: int) -> int:
        """Milliseconds from ``now`` until the connection has something to do."""
        if self.login or self.state == LOST or self._ping:
            return 0 if self._due is None else ticks_diff(self._due, now)
        return self.keepalive - ticks_diff(now, self._heard) if self.keepalive else _SLOWLY

    def requests(self, count: int) -> int:
        """The first of ``count`` request ids in a row."""
        first = self.request
        if first + count > 0xFFFF:
            first = _FIRST_REQUEST
        self.request = first + count
        return first

    def problem(self, code: int, value: int = 0, what: "object" = "") -> None:
        """Tells ``on_problem``."""
        try:
            if self.on_problem is not None:
                from muros.client.problems import tell

                tell(self, code, value, what)
        except Exception as error:
            self.raised = error

    def work(self, now: int) -> None:
        """What there is to do while CONNECTING or CONNECTED."""

    def accepted(self) -> None:
        """The agent has made the session: everything begins anew."""

    def happened(self, event: int) -> None:
        """Takes an event through the table."""
        new = _NEXT[self.state * _EVENTS + event]
        self._ping = self._tries = 0
        self._due = None
        if event == _UNKNOWN or new == WAITING:
            self.login = True
        self.enter(new)

    def ask(self, request: int) -> None:
        """Asks the agent whether it knows the session."""
        pack_into(">HHI", self._control, self.control(_GET_INFO, 8), request, _OBJECT_AGENT, 0x02000000)
        self.send_control()

    def enter(self, state: int) -> None:
        """Is in a state, and tells when it is a new one."""
        if state != self.state:
            self.state = state
            if state == CONNECTED:
                self.trouble = None
            if self.on_state is not None:
                self.on_state(state)

    def on_other(self, kind: int, buf: "Buffer", off: int, n: int) -> None:
        """Takes the submessages that keep up the connection."""
        if kind == _INFO:
            if n >= 6 and self._ping and (buf[off] << 8 | buf[off + 1]) == self._ping:
                self.happened(_KNOWN if buf[off + 5] else _UNKNOWN)
        elif kind == _STATUS_AGENT:
            if n >= 2:
                self._on_status_agent(buf[off])
        elif kind == _GET_INFO and n >= 4:
            at = self.control(_INFO, 8)
            out = self._control
            for i in range(8):
                out[at + i] = buf[off + i] if i < 4 else 0
            self.send_control()

    if TYPE_CHECKING:

        def submit(self, kind: int, flags: int, request: int, object_id: int, payload: bytes) -> bool:
            """Puts a submessage with ids into the reliable stream."""

        def _on(self, kind: int, flags: int, buf: "Buffer", off: int, n: int, stream_id: int) -> int:
            """Takes a submessage."""

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a message of the transport."""
        size = len(self.head)
        if self.login and (n <= size or buf[off + size] != _STATUS_AGENT):
            return  # it is about the streams of the session that was
        if self.receive(buf, off, n, self.now):
            self._heard = self.now

    def _on_acknack(self, buf: "Buffer", at: int, flags: int) -> None:
        super()._on_acknack(buf, at, flags)
        if self.foreign == 0:
            self._probe = 0
            return
        if self.foreign == 1:
            self._suspected = self.now
        if buf[at] == 0 and buf[at + 1] == 0:
            missing = buf[at + 2] << 8 | buf[at + 3]
            if self._probe == 0:
                self._suspect()
            elif missing >> self._probe - 1 & 1 or (self._probe > 16 and missing == 0):
                self.foreign = _FOREIGN
                self._suspected = ticks_add(self.now, -_OLDEST)

    def _suspect(self) -> None:
        """The agent may have begun its streams again: two messages have it tell its numbers.

        An acknowledgement that waits for number 0 may be old. The first of the two is held back until it is asked
        for, so that only an agent which has the second and lacks all before can say that the first is missing.
        """
        stream = self.outputs[_STREAM_RELIABLE]
        stream.flush(self.send, self.now)
        if stream.first and (stream.next - stream.first & 0xFFFF) + 1 < stream.history:
            self._probe = stream.next + 1
            self.submit(_GET_INFO, _LITTLE_ENDIAN, self.requests(1), _OBJECT_AGENT, b"\2\0\0\0")
            stream.flush(_nowhere, self.now)
        self.submit(_GET_INFO, _LITTLE_ENDIAN, self.requests(1), _OBJECT_AGENT, b"\2\0\0\0")

    def _is_due(self, now: int, again: int) -> bool:
        """Whether the next attempt is due and the transport open; if so, the one after comes in ``again`` ms."""
        if self._due is not None and ticks_diff(now, self._due) < 0:
            return False
        self._due = ticks_add(now, again)
        if not self.up:
            try:
                self.up = self.transport.open()
            except OSError as error:
                self.problem(_PROBLEM_UNREACHABLE, 0, error)
                return False
        return self.up

    def _connect(self, now: int) -> None:
        if self._is_due(now, self.retry if self.state == WAITING else _SOON):
            if self.state == CONNECTING:
                self._tries += 1
                if self._tries > _TRIES:
                    self.happened(_SILENT)
                    return
            self._hello()

    def _seek(self, now: int) -> None:
        if self._is_due(now, _SOON):
            self._ask()

    def _watch(self, now: int) -> None:
        if self.foreign >= _FOREIGN and ticks_diff(now, self._suspected) >= _OLDEST:
            self.foreign = 0
            self.happened(_UNKNOWN)
            self.problem(_PROBLEM_OUT_OF_STEP)
        elif self.keepalive and ticks_diff(now, self._heard) >= self.keepalive:
            if self._ping == 0:
                self._due = None
            if self._is_due(now, self.ping_timeout):
                self._tries += 1
                if self._tries > self.ping_attempts:
                    self.happened(_SILENT)
                else:
                    self._ask()
        elif self._ping:
            self._ping = self._tries = 0

    def _ask(self) -> None:
        if self._ping == 0:
            self._ping = self.requests(1)
        self.ask(self._ping)

    def _hello(self) -> None:
        from muros.client.hello import hello

        if not self._attempt:
            self._attempt = urandom(4)
        message = hello(
            self.head[0], self.key, self.mtu, self._attempt if self.properties else None, self.hard_liveliness
        )
        self.send(message, 0, len(message))

    def _on_status_agent(self, status: int) -> None:
        if not self.login:
            self._suspect()  # the network repeated our CREATE_CLIENT
        elif status < 0x80:
            self.login = False
            self._attempt = b""
            self.foreign = 0
            self._probe = 0
            self._heard = self.now
            self.accepted()
            self.happened(_ACCEPTED)
        else:
            self.problem(_PROBLEM_SESSION, status)
            self._due = ticks_add(self.now, _SLOWLY)


def _nowhere(buf: "Buffer", off: int, n: int) -> None:
    """Where a message goes that is held back."""
