"""A session with an agent, as it runs while it is connected: messages come and go, and the agent is watched.

A session holds everything that was created in it, and creates it again whenever the connection is made anew. What that
takes boards borrow: ``link`` leads the connection (the ``guide``, held until everything is steady), ``methods`` and
``entities`` hold what programs call now and then.
"""

from struct import pack_into

from muros.compat import borrow, const, lending, release, sleep_ms, ticks_add, ticks_diff, ticks_ms
from muros.xrce.session import SessionCore, control, flush

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client import entities, making, methods
    from muros.client._types import OnData, Outgoing, Transport
    from muros.client.backlog import Backlog
    from muros.xrce._types import Buffer
    from muros.xrce.create import Asked
    from muros.xrce.streams import Output

_CONNECTED = const(2)
_LOGIN = const(1)  # how we are away, see ``link``
_SILENT = const(2)  # an event
_GET_INFO = const(2)
_STATUS_AGENT = const(4)
_INFO = const(6)
_WRITE = const(0x0107)  # a WRITE_DATA, little endian
_DATA = const(9)
_TIMESTAMP_REPLY = const(15)
_OBJECT_AGENT = const(0xFFFD)
_OF_AGENTS = const(0x02000000)  # what we want to know of it
_FIRST_REQUEST = const(10)
_LAST_REQUEST = const(0xFFFE)
_PAYLOAD = const(12)  # where that of a control message lies
_NEVER = const(5000)

_NO_READER = const(3)


class Session(SessionCore):
    """A session with an agent over ``transport``. Nothing but wrong arguments raises; faults change ``state``.

    On hosts ``muros.client.Session`` is a subclass, which checks arguments and prints problems, see ``hosts``.

    ``client_key`` is an integer below 2**32 or 4 bytes, never 0; None draws one. With ``session_id`` from 0x80 on,
    headers carry no key. ``mtu`` (0: the transport's) bounds messages both ways to ``mtu - 4`` bytes. ``history``, a
    power of two, is how many reliable messages may be in flight, either way. ``creation`` is "binary", "xml" or
    "reference"; participants by reference have the profile ``reference``. ``properties`` lets CREATE_CLIENT name the
    attempt, so that a muros agent tells a repetition by the network from a new beginning; other agents ignore it.
    ``hard_liveliness`` (ms, 0: off) has the agent remove the session after so long a silence. ``queue`` is how many
    reliable samples wait while the session is down or its window is full; with 0 they are refused. ``largest`` is
    the longest received sample, in bytes, that is joined from fragments (0: one history on boards, 64 on hosts).
    ``heartbeat``, ``retry``, ``creation_timeout``, ``keepalive`` (0: off) and ``ping_timeout`` are in ms.

    ``on_state(state)`` is told each new state, ``on_problem(code, text)`` what was refused and why, see ``problems``.
    ``drops`` counts lost samples: while there was no session, because the window or queue was full, because they were
    larger than a message, because they were for no reader of ours, because they were larger than ``largest``.
    """

    raised: "Exception | None" = None  # what a callback raised
    guide: "Any" = None  # the module ``link`` while there is more to do than to watch
    backlog: "Backlog | None" = None
    create: "Any" = None  # makes representations that are not binary
    properties = True
    hard_liveliness = 0
    trouble: "Any" = None  # what was told that keeps us from the agent; hosts add since when
    on_state: "Callable[[int], object] | None" = None
    on_problem: "Callable[[int, str], object] | None" = None

    if TYPE_CHECKING:
        transport: "Transport"
        state: int
        request: int  # the request id that was used last
        away: int  # 0 while the agent knows us; 1: it has yet to accept us; 2: it fell silent
        up: bool  # the transport is open
        reliable: "Output"
        drops: "list[int]"
        objects: "dict[int, Any]"  # what takes DATA, by object id; what takes other submessages, by minus their kind
        entities: "list[Entity]"
        pending: int  # not 0 while there may be entities that are not whole yet
        asked: "dict[int, Entity]"  # by the ids of requests that have no STATUS yet
        late: int  # the tick at which they are made again
        laps: int  # how often that was in vain
        counts: "list[int]"  # the next index for each kind of object
        key: bytes
        attempt: int  # what names the attempt to connect, 0 until it is made
        suspected: int  # the tick since which the agent seems to be out of step
        queue: int
        retry: int
        creation_timeout: int
        keepalive: int
        ping_timeout: int
        ping_attempts: int
        _deliver: "OnData"
        _due: int  # the tick of the next attempt, if one was made
        _heard: int
        _tries: int  # attempts to reach the agent in vain
        _ping: int  # the request id of the question that is open

        participant = making.participant
        writer = making.writer
        reader = making.reader
        requester = making.requester
        replier = making.replier
        ping = methods.ping
        close = methods.close
        new_id = making.new_id
        make_input = methods.make_input
        too_long = methods.too_long
        dropped = methods.dropped
        keep = methods.keep
        problem = methods.problem
        stranger = methods.stranger
        defer = methods.defer
        gone = methods.gone
        attempting = methods.attempting
    else:
        lends = "muros.client.methods"
        __getattr__ = lending

    def __init__(self, *given: "Any", **options: "Any") -> None:
        borrow("muros.client.start").start(self, *given, **options)
        release()

    def spin_once(self, now: "int | None" = None) -> int:
        """Takes what has come and does what is due; returns the number of messages taken. Never waits.

        What a callback raises comes out here once everything else is done; what it was told counts as told.
        """
        if now is None:
            now = ticks_ms()
        self.now = now
        taken = _receive(self)
        _turn(self, now)
        if not self.away:
            if self.backlog:
                self.backlog.pump()
            flush(self, self.reliable, now)
        raised = self.raised
        if raised is not None:
            self.raised = None
            raise raised
        return taken

    def lead(self) -> "Any":
        """The guide, from now on until everything is steady."""
        if not self.guide:
            release()
            self.guide = borrow("muros.client.link")
        return self.guide

    def watch(self, now: int) -> None:
        """Asks whether the agent is there, after a silence."""
        if self.keepalive == 0 or ticks_diff(now, self._heard) < self.keepalive:
            self._ping = self._tries = 0
        elif not self._tries or ticks_diff(now, self._due) >= 0:
            self._due = ticks_add(now, self.ping_timeout)
            self._tries += 1
            if self._tries > self.ping_attempts:
                self.lead().happened(self, _SILENT)
            else:
                self.ask()

    def ask(self) -> None:
        """Asks the agent whether it knows the session."""
        if not self._ping:
            self._ping = self.number()
        self.inform(_GET_INFO, self._ping, _OBJECT_AGENT, _OF_AGENTS)

    def inform(self, kind: int, request: int, number: int, what: int) -> None:
        """Asks for information about an object or gives it, in a message of no stream."""
        pack_into(">HHI", self._control, _PAYLOAD, request, number, what)
        control(self, kind, 8)

    def number(self, count: int = 1) -> int:
        """A request id, the last of ``count`` in a row."""
        request = self.request + count
        if request > _LAST_REQUEST:
            request = _FIRST_REQUEST - 1 + count
        self.request = request
        return request

    def wait(self, timeout: int) -> None:
        """Waits until something may have come, at most ``timeout`` ms."""
        if self.up:
            self.transport.wait(timeout)
        else:
            sleep_ms(timeout)

    def deadline(self, now: int) -> int:
        """Milliseconds from ``now`` until ``spin_once`` has something to do of its own accord."""
        if self._tries:
            left = ticks_diff(self._due, now)
        elif self.away:
            left = 0
        elif self.keepalive:
            left = self.keepalive - ticks_diff(now, self._heard)
        else:
            left = _NEVER
        if self.pending:
            left = min(left, ticks_diff(self.late, now)) if self.asked else 0
        stream = self.reliable
        if stream.first != stream.next:
            left = min(left, ticks_diff(stream.due, now))
        return max(left, 1)

    def deliver(self, buf: "Buffer", off: int, n: int) -> None:
        """Takes a message of the transport."""
        if self.away == _LOGIN and (n <= self.body or buf[off + self.body] != _STATUS_AGENT):
            return  # it is about the streams of the session that was
        if self.receive(buf, off, n, self.now):
            self._heard = self.now

    def handle(self, kind: int, buf: "Buffer", off: int, n: int) -> int:
        """Takes a submessage."""
        try:
            if kind == _DATA:
                reader = self.objects.get(buf[off + 2] << 8 | buf[off + 3]) if n >= 4 else None
                if reader is None:
                    self.drops[_NO_READER] += 1
                elif reader.deliver:
                    reader.deliver(buf, off + 4, n - 4)
            else:
                taker = self.objects.get(-kind)
                if taker:
                    taker(buf, off, n)
                if kind == _INFO and not self.guide and n >= 6 and buf[off + 5]:
                    pass  # the agent is there, as we thought
                elif kind != _TIMESTAMP_REPLY:
                    self.lead().answer(self, kind, buf, off, n)
        except Exception as error:  # of a callback: the message counts as handled
            self.raised = error
        return 0


class Entity:
    """What a session creates at the agent: a participant, a writer, a reader, or one side of a service.

    It stands for the objects that make it up, one for each step of its creation, see ``entities``. ``name`` is its name
    in DDS; ``status`` is that of the request the agent refused, 0 while none was. ``todo`` is 0 once everything is
    created.
    """

    status = 0

    if TYPE_CHECKING:
        session: Session
        name: str
        id: int  # of its last object: index << 4 | kind
        todo: int  # bit i: step i has no good STATUS yet; bit 4: refused
        request: int  # the id of the request of step 0; those of the other steps come before it
        type_name: str
        qos: "Asked"
        above: int  # the topic's id << 12 | the participant's index
        domain: int
        stream: "Output"  # a writer's
        deliver: "OnData | None"  # a reader's, a service's
        limits: "tuple[int, int, int, int]"  # what ``read`` asked for

        object_id = entities.object_id
        destroy = entities.destroy
        write_bytes = entities.write_bytes
        read = entities.read
    else:
        lends = "muros.client.entities"
        __getattr__ = lending

    def publish(self, message: "Outgoing") -> bool:
        """Sends a message. False when it was not taken: the session's ``drops`` and ``on_problem`` say why.

        A reliable message that was taken arrives once and in order for as long as the agent keeps the session; when
        the session begins anew, what was not acknowledged is sent again.
        """
        session = self.session
        n = message.size()
        if not self.todo and session.state == _CONNECTED and not session.backlog and put(self, message, n):
            return True
        return session.defer(self, message, n)


def put(writer: Entity, message: "Outgoing", n: int) -> bool:
    """Sends a message of ``n`` bytes; False when the writer's stream has no room for it.

    Boards call functions with more local names than here through their heap.
    """
    n += 4
    stream = writer.stream
    at = stream.place(n)
    if at < 0:
        return False
    pack_into(">HH", stream.buf, at + 4, writer.session.number(), writer.id)
    message.write(stream.buf, at + 8)
    stream.commit(at, _WRITE, n)
    stream.flush(writer.session.send, writer.session.now)
    return True


def _turn(session: Session, now: int) -> None:
    """Does what the connection needs. When there is no room for the guide, there may be at the next turn."""
    try:
        if session.up and not (session.guide or session.pending):
            release()
            session.watch(now)
        else:
            session.lead().turn(session, now)
    except MemoryError:
        pass


def _receive(session: Session) -> int:
    """Takes what has come; the number of messages. The transport raises when the way is gone."""
    try:
        if session.up:
            return session.transport.receive(session._deliver)
    except OSError as error:
        session.gone(error)
    except MemoryError:
        pass  # no room for what mends streams: the message counts as lost
    return 0
