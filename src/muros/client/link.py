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

Boards borrow this: it is the ``guide`` of a session until that is connected and steady. As programs may ask for the
names of states before there is a session, what sessions keep is not imported at the top.
"""

from muros.compat import MPY, borrow, const, ticks_add, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.session import Session
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
# The state after it, and before that how we are away then: not at all, to be accepted, or to be heard again
_NEXT = (
    b"\x01\x10\x10\x10\x10"  # from WAITING
    b"\x01\x02\x10\x01\x11"  # from CONNECTING
    b"\x02\x02\x23\x02\x11"  # from CONNECTED
    b"\x23\x23\x23\x02\x11"  # from LOST
)
_LOGIN = const(1)

_GET_INFO = const(2)
_ASK = const(0x0102)  # GET_INFO, little endian
_STATUS_AGENT = const(4)
_STATUS = const(5)
_INFO = const(6)
_OBJECT_AGENT = const(0xFFFD)
_OBJECT_CLIENT = const(0xFFFE)
_SOON = const(250)  # ms between attempts while an agent is expected back
_SLOWLY = const(5000)  # ms until a refused session asks again
_TRIES = const(4)  # unanswered attempts to connect again until we wait
_OLDEST = const(2000)  # ms: older acknowledgements than this do not come
_FOREIGN = const(8)

_PROBLEM_SESSION = const(1)
_PROBLEM_OUT_OF_STEP = const(2)


def turn(session: "Session", now: int) -> None:
    """Does what there is to do for the connection, and gives the session back when it is steady."""
    if not session.away:
        if session.up:
            session.watch(now)
        else:
            happened(session, _SILENT)
    if session.away:
        _attempt(session, now)
    else:
        if session.pending:
            borrow("muros.client.creating").go_through(session, now)
        if not session.pending:
            happened(session, _MADE)
            session.guide = None


def happened(session: "Session", event: int) -> None:
    """Takes an event through the table."""
    before = session.state
    new = _NEXT[before * _EVENTS + event]
    session._ping = session._tries = 0
    session.away = new >> 4
    session.state = new & 15
    if session.state != before:
        if session.state == CONNECTED and session.trouble:
            session.trouble = None
        if session.on_state is not None:
            session.on_state(session.state)


def answer(session: "Session", kind: int, buf: "Buffer", off: int, n: int) -> None:
    """Takes a submessage that has to do with the connection."""
    if kind == _STATUS_AGENT:
        if n >= 2:
            _on_status_agent(session, buf[off])
    elif n >= 6:
        request = buf[off] << 8 | buf[off + 1]
        number = buf[off + 2] << 8 | buf[off + 3]
        if kind == _GET_INFO:
            session.inform(_INFO, request, number, 0)
        elif kind == _INFO:
            if request and request == session._ping:
                happened(session, _KNOWN if buf[off + 5] else _UNKNOWN)
        elif kind == _STATUS:
            if number == _OBJECT_CLIENT:
                session.away = _LOGIN  # the agent has taken our leave
            else:
                borrow("muros.client.creating").status(session, request, number, buf[off + 4])


def stranger(session: "Session", buf: "Buffer", at: int) -> None:
    """The agent acknowledges what was never sent: it may be out of step with us, and at some time is sure to be."""
    session.malformed += 1
    if not session.foreign:
        session.suspected = session.now
    session.foreign += 1
    is_sure = session.foreign >= _FOREIGN and ticks_diff(session.now, session.suspected) >= _OLDEST
    if not (buf[at] or buf[at + 1]):
        missing = buf[at + 2] << 8 | buf[at + 3]
        probe = session.probe
        if not probe:
            _suspect(session)
        elif missing >> probe - 1 & 1 or (probe > 16 and not missing):
            is_sure = True
    if is_sure:
        happened(session, _UNKNOWN)
        session.problem(_PROBLEM_OUT_OF_STEP)


def _suspect(session: "Session") -> None:
    """The agent may have begun its streams again: two messages have it tell its numbers.

    An acknowledgement that waits for number 0 may be old. The first of the two is held back until it is asked
    for, so that only an agent which has the second and lacks all before can say that the first is missing.
    """
    stream = session.reliable
    stream.flush(session.send, session.now)
    if stream.first and (stream.next - stream.first & 0xFFFF) + 1 < stream.history:
        session.probe = stream.next + 1
        _ask(session)
        stream.flush(_nowhere, session.now)
    _ask(session)


def _ask(session: "Session") -> None:
    """Asks what ``Session.ask`` asks, but reliably."""
    borrow("muros.client.creating").submit(session, _ASK, session.number(), _OBJECT_AGENT, b"\2\0\0\0")


def _attempt(session: "Session", now: int) -> None:
    """Tries to reach the agent, when that is due, to have it accept us or to ask whether it still knows us."""
    if session._tries and ticks_diff(now, session._due) < 0:
        return
    if not MPY:
        session.attempting(now)
    session._due = ticks_add(now, _SOON if session.state else session.retry)
    session._tries += 1
    try:
        session.up = session.up or session.transport.open()
    except OSError as error:
        session.gone(error)
    if not session.up:
        return
    if session.away != _LOGIN:
        session.ask()
    elif session.state == CONNECTING and session._tries > _TRIES:
        happened(session, _SILENT)
    else:
        message = borrow("muros.client.hello").hello(session)
        session.send(message, 0, len(message))


def _on_status_agent(session: "Session", status: int) -> None:
    if session.away != _LOGIN:
        _suspect(session)  # the network repeated our CREATE_CLIENT
    elif status < 0x80:
        session.attempt = session.foreign = session.probe = 0
        borrow("muros.client.creating").accepted(session)
        happened(session, _ACCEPTED)
    else:
        session.problem(_PROBLEM_SESSION, status)
        session._due = ticks_add(session.now, _SLOWLY)


def _nowhere(buf: "Buffer", off: int, n: int) -> None:
    """Where a message goes that is held back."""
