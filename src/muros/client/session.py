"""A session with an agent and everything created in it: participants, writers, readers, requesters, repliers.

Every entity is created again whenever the connection is made anew (see ``link``). Requests go out a few at a time
and in the order of adding, each matched with its STATUS by request id and object id and asked for again when none
comes; creating twice does no harm, as REUSE and REPLACE are set. A refused entity is reported and left alone, the
others go on. Rules of the wire: DDS-XRCE 1.0, clauses 7.8.3 and 7.8.5.
"""

from array import array

from muros.client.link import CONNECTING, Link
from muros.compat import MPY, const, sleep_ms, ticks_diff, ticks_ms
from muros.xrce import create
from muros.xrce.create import head
from muros.xrce.inputs import Input
from muros.xrce.outputs import Output

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, Unpack

    from muros.client._types import OnData, Options, Outgoing, Transport
    from muros.client.backlog import Backlog
    from muros.client.entities import Entity, Participant, Writer
    from muros.client.qos import AnyQos
    from muros.client.reader import Reader
    from muros.client.services import OnReply, OnRequest, Replier, Requester
    from muros.xrce._types import Buffer

_STATUS = const(5)
_DATA = const(9)
_TIMESTAMP_REPLY = const(15)
_STREAM_BEST_EFFORT = const(0x01)
_STREAM_RELIABLE = const(0x80)
_OBJECT_CLIENT = const(0xFFFE)
_MADE = const(1)
_TOO_LONG = const(4)
_PROBLEM_LARGEST = const(10)
_INDICES = const(4096)

NO_READER = const(3)

_PROBLEM_NO_ANSWER = const(5)


class Session(Link):
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

    creation = "binary"
    reference = "participant_profile"
    queue = 0
    largest = 0
    heartbeat = 100
    creation_timeout = 1000

    def __init__(
        self,
        transport: "Transport",
        client_key: "int | bytes | None" = None,
        session_id: int = 0x81,
        mtu: int = 0,
        history: int = 4,
        **options: "Unpack[Options]",
    ) -> None:
        mtu = (mtu or transport.mtu) - 4
        super().__init__(transport, client_key, session_id, mtu)
        for name in options:
            if not hasattr(Session, name):
                raise TypeError("Session has no option " + name)
            setattr(self, name, options[name])  # type: ignore[literal-required]
        self.largest = self.largest or mtu * history * (1 if MPY else 64)
        self.reliable = Output(_STREAM_RELIABLE, mtu, self.head, history, self.heartbeat)
        self.outputs[_STREAM_RELIABLE] = self.reliable
        self.inputs[_STREAM_RELIABLE] = Input(_STREAM_RELIABLE, mtu, history)
        self.create: "Any" = create
        if self.creation != "binary":
            from muros.xrce import create_text

            self.create = (
                create_text.Xml() if self.creation == "xml" else create_text.Reference(self.reference)
            )
        self.drops = array("I", (0, 0, 0, 0, 0))
        self.entities: "list[Entity]" = []
        self.objects: "dict[int, Any]" = {}  # what takes DATA, by object id
        self.backlog: "Backlog | None" = None
        self.pending = 0  # entities that are not whole yet
        self.waiting = 0  # requests without a STATUS
        self.counts = array("H", bytearray(18))  # the next index for each kind of object
        self.late = 0  # the tick when those are made again
        self.laps = 0  # how often that happened since the last STATUS

    def participant(self, name: str, domain: int = 0) -> "Participant":
        """A DDS participant, the node of ROS. ValueError for a name longer than 59 characters, or for no domain."""
        from muros.client.entities import Participant

        return Participant(self, name, domain)

    def writer(self, node: "Participant", topic: str, kind: str, qos: "AnyQos" = "default") -> "Writer":
        """A writer of ``topic`` with messages of a type, named as in ROS or in DDS. ``publish(message)`` sends."""
        from muros.client.entities import Writer

        return Writer(self, node, topic, kind, qos)

    def reader(
        self,
        node: "Participant",
        topic: str,
        kind: str,
        qos: "AnyQos" = "default",
        on_data: "OnData | None" = None,
    ) -> "Reader":
        """A reader of ``topic``; ``on_data(buf, off, n)`` gets each sample, whose bytes are only lent."""
        from muros.client.reader import Reader

        return Reader(self, node, topic, kind, qos, on_data)

    def requester(
        self, node: "Participant", name: str, kind: str, on_reply: "OnReply", qos: "AnyQos" = "services"
    ) -> "Requester":
        """A client of the service ``name``; ``on_reply(number, buf, off, n)`` gets replies, see ``services``."""
        from muros.client.services import Requester

        return Requester(self, node, name, kind, on_reply, qos)

    def replier(
        self, node: "Participant", name: str, kind: str, on_request: "OnRequest", qos: "AnyQos" = "services"
    ) -> "Replier":
        """A server of the service ``name``; ``on_request(identity, buf, off, n)`` gets requests, see ``services``."""
        from muros.client.services import Replier

        return Replier(self, node, name, kind, on_request, qos)

    def ping(self, timeout: int = 1000, clock: "Callable[[], int]" = ticks_ms) -> bool:
        """Asks the agent, within the session: whether it answers within ``timeout`` ms and knows us."""
        from muros.client.echo import ask

        return ask(self, timeout, clock)

    def wait(self, timeout: int) -> None:
        """Waits until something may have come, at most ``timeout`` ms."""
        if self.up:
            self.transport.wait(timeout)
        else:
            sleep_ms(timeout)

    def deadline(self, now: int) -> int:
        """Milliseconds from ``now`` until ``spin_once`` has something to do of its own accord."""
        left = self.next(now)
        if self.pending:
            left = min(left, ticks_diff(self.late, now)) if self.waiting else 0
        if not self.reliable.idle():
            left = min(left, ticks_diff(self.reliable.due, now))
        return max(left, 1)

    def close(self) -> None:
        """Takes leave of the agent, for at most one second, and closes the transport."""
        from muros.client.closing import close

        close(self)

    # For entities

    def output(self, reliable: int) -> "Output":
        """The stream to write to; the one for best effort is made at the first need."""
        if reliable:
            return self.reliable
        if _STREAM_BEST_EFFORT not in self.outputs:
            self.outputs[_STREAM_BEST_EFFORT] = Output(_STREAM_BEST_EFFORT, self.mtu, self.head)
        return self.outputs[_STREAM_BEST_EFFORT]  # type: ignore[no-any-return]

    def make_input(self, stream_id: int) -> "Input | None":
        """The stream for best effort is made when something comes on it; there are no others."""
        if stream_id != _STREAM_BEST_EFFORT:
            return None
        made = self.inputs[stream_id] = Input(stream_id)
        return made

    def index(self, kind: int) -> int:
        """A new index for an object of a kind. ValueError after the last; hosts use those of deleted objects again."""
        index = self.counts[kind]
        if index == _INDICES:
            raise ValueError("no room for one more: a session has at most 4096 objects of a kind")
        self.counts[kind] = index + 1
        return index

    def add(self, entity: "Entity") -> None:
        """Has an entity created, now or when the session is connected."""
        self.entities.append(entity)
        entity.renew()
        self.pending += 1

    def submit(
        self, kind: int, flags: int, request: int, object_id: int, payload: "bytes | bytearray"
    ) -> bool:
        """Puts a submessage with ids into the reliable stream; False when there is no room now."""
        n = 4 + len(payload)
        stream = self.reliable
        backlog = self.backlog
        at = -1 if backlog is not None and backlog.cutter is not None else stream.reserve(n)
        if at < 0:
            if n <= stream.capacity():
                return False
            data = bytearray(4 + n)
            head(data, 0, kind, flags, n, request, object_id)
            data[8:] = payload
            return self.keep().first(data)
        head(stream.buf, at, kind, flags, n, request, object_id)
        stream.buf[at + 8 : at + 4 + n] = payload
        return True

    def defer(self, writer: "Any", message: "Outgoing", n: int) -> bool:
        """What becomes of a sample that cannot go out now: it is queued, cut up, or refused and counted."""
        return self.keep().defer(writer, message, n)

    def too_long(self, stream_id: int, n: int) -> None:
        """A sample that came was larger than ``largest``."""
        from muros.client.backlog import dropped

        dropped(self, _TOO_LONG, _PROBLEM_LARGEST, n)

    def keep(self) -> "Backlog":
        """The backlog, made at the first need."""
        if self.backlog is None:
            from muros.client.backlog import Backlog

            self.backlog = Backlog(self)
        return self.backlog

    # Connecting

    def accepted(self) -> None:
        """Begins the streams again and has every entity created."""
        if not self.reliable.idle() or self.backlog is not None:
            self.keep().hold()
        self.reset()
        self.waiting = 0
        self.pending = len(self.entities)
        for entity in self.entities:
            entity.renew()

    def work(self, now: int) -> None:
        """Creates what is to be created, and sends what waits."""
        if self.pending:
            if self.waiting and ticks_diff(now, self.late) >= 0:
                self.waiting = 0
                for entity in self.entities:
                    entity.asked = 0
                self.laps += 1
                if self.laps == 3:
                    self.problem(_PROBLEM_NO_ANSWER)
            for entity in self.entities:
                if entity.todo and not entity.create(now):
                    break
        if self.pending == 0 and self.state == CONNECTING:
            self.happened(_MADE)
        if self.backlog is not None:
            self.backlog.pump()

    def _on(self, kind: int, flags: int, buf: "Buffer", off: int, n: int, stream_id: int) -> int:
        try:
            if kind == _DATA:
                reader = self.objects.get(buf[off + 2] << 8 | buf[off + 3]) if n >= 4 else None
                if reader is None:
                    self.drops[NO_READER] += 1
                else:
                    reader.deliver(buf, off + 4, n - 4)
            elif kind == _STATUS:
                if n >= 6:
                    self._on_status(
                        buf[off] << 8 | buf[off + 1], buf[off + 2] << 8 | buf[off + 3], buf[off + 4]
                    )
            elif kind == _TIMESTAMP_REPLY and n >= 24 and self.on_time is not None:
                self.on_time(buf, off)
            else:
                self.on_other(kind, buf, off, n)
        except Exception as error:  # of a callback: the message counts as handled
            self.raised = error
        return 0

    def _on_status(self, request: int, object_id: int, status: int) -> None:
        if object_id == _OBJECT_CLIENT:
            self.login = True  # the agent has taken our leave
            return
        for entity in self.entities:
            if entity.answered(request - entity.request, object_id, status):
                return
