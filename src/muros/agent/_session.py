"""The session of one client at the agent: its object tree, and what each submessage does to it.

The streams and their acknowledgements are `HostSession`'s; links, addresses and time are the agent core's. What cannot
be done is answered with the status of the specification and reported as a finding; a client can only harm itself.
"""

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.agent._calls import Call
from muros.agent._create import Refused, build, resolve, same
from muros.agent._messages import InvalidMessage, parse_read_data_untrusted, status
from muros.agent._proxies import (
    ParticipantProxy,
    Proxy,
    Readable,
    Reading,
    ReplierProxy,
    RequesterProxy,
    WriterProxy,
)
from muros.agent.events import EntityCreated, EntityDeleted, client_name
from muros.xrce._types import Buffer
from muros.xrce.beginning import make_input
from muros.xrce.constants import (
    CREATE,
    DELETE,
    FAILED,
    FORMAT_MASK,
    HANDLED,
    KIND_CLIENT,
    KIND_NAMES,
    LATER,
    LITTLE_ENDIAN,
    READ_DATA,
    REPLACE,
    RESET,
    REUSE,
    STATUS_ERR_ALREADY_EXISTS,
    STATUS_ERR_INVALID_DATA,
    STATUS_ERR_MISMATCH,
    STATUS_ERR_RESOURCES,
    STATUS_ERR_UNKNOWN_REFERENCE,
    STATUS_NAMES,
    STATUS_OK,
    STATUS_OK_MATCHED,
    STREAM_BEST_EFFORT,
    STREAM_RELIABLE,
    WRITE_DATA,
)
from muros.xrce.fragments import Joiner
from muros.xrce.queues import HostSession, QueuedBestEffortOutput, QueuedReliableOutput, resume
from muros.xrce.representation import InvalidRepresentation, Kind, parse_variant_untrusted

if TYPE_CHECKING:
    from muros.agent._core import AgentCore, Port
    from muros.xrce.streams import Input

__all__ = ["AgentSession"]

_UNMADE_KINDS = (Kind.TYPE, Kind.QOSPROFILE, Kind.APPLICATION)
_IDENTITY = 24


class AgentSession(HostSession):
    """A client's session. ``key`` is the client key as bytes, ``mtu`` the longest message the client takes."""

    def __init__(self, core: "AgentCore", port: "Port", address: Any, key: bytes, session_id: int) -> None:
        self.begin(session_id, key, self._send_lent, core.limits.max_sample)
        self.core = core
        self.port = port
        self.address = address
        self.key = key
        self.number = int.from_bytes(key, "big")
        self.who = client_name(self.number)
        self.mtu = 0
        self.attempt = ""
        self.liveliness = 0
        self.probes = 0
        self.heard = core.now
        self.lost_at: int | None = None
        self.given_up: Call | None = None
        self.closed = False
        self.objects: dict[int, Proxy] = {}
        self.created_at = 0
        self.joining = 0  # bytes in samples that are being joined
        self.moves = 0  # how often it was taken over from an address where it was alive
        self.told_silent = False
        self.stop_at_failure = core.limits.stop_at_failure
        self._waiting: list[Reading] = []

    # What the agent core calls

    @property
    def reachable(self) -> bool:
        """Whether there is a way to the client now."""
        return self.lost_at is None

    @property
    def tick(self) -> int:
        """The current tick in ms."""
        return self.core.now

    @property
    def max_sample(self) -> int:
        """Longest sample sent to the client, in bytes; a muros client takes as much as we take from it."""
        limits = self.core.limits
        return (
            max(limits.max_sample, limits.max_sample_to_client)
            if self.attempt
            else limits.max_sample_to_client
        )

    def restart(self) -> None:
        """The client began again: all streams at 0, what waited for it is dropped, entities and readings stay."""
        self._joins(0)
        self.reset()
        for stream_id in self.outputs:
            self.outputs[stream_id].mtu = self.mtu
        self._waiting.clear()

    def here(self) -> None:
        """There is a way to the client."""
        self.lost_at = None
        if self.given_up is not None:
            self.core.cancel(self.given_up)
            self.given_up = None

    def found(self) -> None:
        """There is a way to the client again: readings go on."""
        self.here()
        self._pump_all()

    def close(self) -> None:
        """Takes everything of the client out of the space. A message that is being handled has no further effect."""
        self.closed = True
        self.here()
        self._joins(0)
        self.reset()
        objects, self.objects = self.objects, {}
        for proxy in reversed(list(objects.values())):
            proxy.close()
        self._waiting.clear()
        self.core.unacknowledged.pop(self, None)

    def answer_control(self, submessage: bytes) -> None:
        """Sends a submessage on stream 0."""
        head = self.head
        self._send(bytes((head[0], 0, 0, 0)) + head[4:] + submessage)

    # What readings need

    def output(self, stream_id: int) -> QueuedBestEffortOutput | QueuedReliableOutput | None:
        """The output stream, made at need; None for stream 0."""
        stream = self.outputs.get(stream_id)
        if stream is None and stream_id:
            limits = self.core.limits
            if stream_id >= STREAM_RELIABLE:
                stream = QueuedReliableOutput(stream_id, self.mtu, self.head, limits.window, limits.heartbeat)
            else:
                stream = QueuedBestEffortOutput(stream_id, self.mtu, self.head)
            self.outputs[stream_id] = stream
        return stream

    def post(self, stream_id: int, submessage: bytes) -> bool:
        """Sends a submessage; False when it does not fit the MTU of a stream that cannot cut it."""
        output = self.output(stream_id)
        if output is None:
            if len(self.head) + len(submessage) > self.mtu:
                return False
            self.answer_control(submessage)
            return True
        if stream_id >= STREAM_RELIABLE:
            self.core.has_unacknowledged(self)
        return output.post(submessage, self._send_lent, self.core.now)

    def wait_for_room(self, reading: Reading) -> None:
        """Calls ``reading.pump()`` when its stream has room again."""
        if len(self._waiting) > len(self.objects):  # those that were replaced wait for nothing
            self._waiting = [other for other in self._waiting if other.active]
        if reading not in self._waiting:
            self._waiting.append(reading)

    def wait_until(self, tick: int, reading: Reading) -> Call:
        """Calls ``reading.pump()`` at ``tick``, unless the call is given to ``cancel``."""
        return self.core.call_at(tick, reading.pump)

    def cancel(self, call: Call) -> None:
        """The call is not made."""
        self.core.cancel(call)

    def sample_too_long(self, reading: Reading, n: int) -> None:
        """A sample of ``n`` bytes was dropped: it fits neither the stream nor the limits."""
        if n > self.max_sample:
            self.core.report(
                "sample-too-long",
                who=self.who,
                subject=reading.subject,
                what=f"{{n}} sample{{s}} of {reading.subject} to {self.who} dropped",
                why=f"{n} B are more than the {self.max_sample} B the agent sends to a client",
                remedy="Send smaller samples, or set limits.max_sample_to_client if this client can take longer ones.",
            )
            return
        self.core.report(
            "best-effort-too-big",
            who=self.who,
            subject=reading.subject,
            what=f"{{n}} sample{{s}} of {reading.subject} to {self.who} dropped",
            why=f"{n} B do not fit its best-effort MTU of {self.mtu} B",
            remedy="Raise the client's MTU, or read on a reliable stream.",
        )

    # Streams

    def make_input(self, stream_id: int) -> "Input | None":
        """Any stream a client uses comes into being, up to a limit."""
        if len(self.inputs) >= self.core.limits.max_streams:
            self.core.report(
                "too-many-streams",
                who=self.who,
                what=f"{{n}} message{{s}} of {self.who} on stream 0x{stream_id:02X} dropped",
                why=f"it uses {len(self.inputs)} streams already",
                remedy="Use fewer streams, or raise max_streams.",
            )
            return None
        stream = self.inputs[stream_id] = make_input(stream_id, 0xFFFF, self.core.limits.window)
        return stream

    def _on_fragment(self, buf: Buffer, at: int, n: int, stream: Any) -> None:
        """Takes a piece, as long as what all clients have under way stays within the limit."""
        core = self.core
        joiner = stream.fragments
        if core.joining + n > core.limits.max_joining and (joiner is None or joiner.limit > 0):
            if joiner is None:
                joiner = stream.fragments = Joiner(self.largest)
            joiner.limit = -1
            joiner.data = bytearray()
            core.report(
                "too-much-joining",
                who=self.who,
                what=f"{{n}} sample{{s}} of {self.who} dropped",
                why=f"samples that come in pieces make {core.joining} B of {core.limits.max_joining} B",
                remedy="Find the client that begins samples and does not end them, or raise limits.max_joining.",
            )
        try:
            super()._on_fragment(buf, at, n, stream)
        finally:
            self._joins(sum(len(s.fragments.data) for s in self.inputs.values() if s.fragments is not None))

    def _joins(self, n: int) -> None:
        self.core.joining += n - self.joining
        self.joining = n

    def too_long(self, n: int) -> None:
        """A joined submessage was longer than the limit."""
        self.core.report(
            "sample-too-long",
            who=self.who,
            subject=f"stream 0x{self.stream.stream_id:02X}",
            what=f"{{n}} sample{{s}} of {self.who} dropped",
            why=f"its fragments make {n} B, more than the {self.largest} B that are joined",
            remedy="Raise max_sample, or write smaller samples.",
        )

    def _on_acknack(self, buf: Buffer, at: int) -> None:
        super()._on_acknack(buf, at)
        if self._waiting:
            waiting, self._waiting = self._waiting, []
            for reading in waiting:
                reading.pump()

    def _send(self, message: bytes) -> None:
        self.port.link.send(message, self.address)

    def _send_lent(self, buf: Buffer, off: int, n: int) -> None:
        self.port.link.send(buf if type(buf) is bytes else bytes(buf[off : off + n]), self.address)

    def _pump_all(self) -> None:
        for proxy in list(self.objects.values()):
            if isinstance(proxy, Readable) and proxy.reading is not None:
                proxy.reading.pump()

    # Submessages

    def answer(self, kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        """Takes a submessage."""
        handler = _HANDLERS.get(kind)
        if handler is not None and not self.closed:
            return handler(self, flags, buf, off, n, stream_id)
        return self.core.other_submessage(self, kind, flags, buf, off, n, stream_id)

    def _write_data(self, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        if n < 4:
            return self._malformed("WRITE_DATA", "it is cut short")
        proxy = self.objects.get(buf[off + 2] << 8 | buf[off + 3])
        if flags & FORMAT_MASK:
            return self._dropped(
                "unsupported-format",
                f"data format 0x{flags & FORMAT_MASK:02X} is not supported",
                "Write in the format DATA, as every known client does.",
                buf,
                off,
            )
        if type(proxy) is WriterProxy:
            if proxy.writer.write(bytes(buf[off + 4 : off + n])):
                return HANDLED
            if stream_id >= STREAM_RELIABLE:
                proxy.writer.on_room = lambda: resume(self, stream_id, self.core.now)
                return LATER
            return self._dropped(
                "reader-full",
                "a reader that keeps all is full",
                "Write on a reliable stream, or read faster.",
                buf,
                off,
            )
        if type(proxy) is RequesterProxy:
            if not proxy.request(bytes(buf[off : off + 4]), bytes(buf[off + 4 : off + n])):
                self._dropped(
                    "request-given-up", "too many requests wait for replies", "Check the server.", buf, off
                )
            return HANDLED
        if type(proxy) is ReplierProxy:
            if n < 4 + _IDENTITY:
                return self._malformed("WRITE_DATA", "a reply without the identity of its request")
            body = off + 4 + _IDENTITY
            proxy.replier.reply(bytes(buf[off + 4 : body]), bytes(buf[body : off + n]))
            return HANDLED
        return self._dropped("unknown-writer", "it has no such writer", "Create the writer first.", buf, off)

    def _create(self, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        if self._status_must_wait(stream_id):
            return LATER
        if n < 5:
            return self._malformed("CREATE", "it is cut short")
        ids = bytes(buf[off : off + 4])
        result = self._made(flags, buf, off, n)
        self._status(ids, result, stream_id)
        return HANDLED

    def _made(self, flags: int, buf: Buffer, off: int, n: int) -> int:
        raw_id = buf[off + 2] << 8 | buf[off + 3]
        try:
            variant = parse_variant_untrusted(buf, off + 4, off + n, bool(flags & LITTLE_ENDIAN))
        except InvalidRepresentation as error:
            return self._refused(raw_id, Refused(STATUS_ERR_INVALID_DATA, str(error), "Correct the client."))
        if variant.kind in _UNMADE_KINDS:
            return STATUS_OK
        object_id = raw_id & 0xFFF0 | variant.kind
        try:
            entity = resolve(variant, self.core.references)
            old = self.objects.get(object_id)
            if old is not None:
                mode = flags & (REUSE | REPLACE)
                if not mode:
                    return STATUS_ERR_ALREADY_EXISTS
                if mode & REUSE:
                    if same(old, entity, variant.domain, self.objects, self.core.default_domain):
                        return STATUS_OK_MATCHED
                    if not mode & REPLACE:
                        return STATUS_ERR_MISMATCH
            elif len(self.objects) >= self.core.limits.max_objects:
                raise Refused(
                    STATUS_ERR_RESOURCES, f"it has {len(self.objects)} entities already", "Raise max_objects."
                )
            if old is not None:
                self._remove(object_id)
            proxy = build(
                variant,
                entity,
                object_id,
                self.objects,
                self.core.space,
                client=self.who,
                client_key=self.key,
                default_domain=self.core.default_domain,
                limits=self.core.limits,
            )
        except Refused as refused:
            return self._refused(object_id, refused)
        self.objects[object_id] = proxy
        self.created_at = self.core.now
        parent = proxy.parent
        self.core.tell(
            EntityCreated(
                self.number, proxy.kind, object_id, parent.object_id if parent else object_id, proxy.detail
            )
        )
        self.core.has_created(self)
        self.core.graph.made(proxy)
        if isinstance(proxy, ParticipantProxy):
            self._look_at_domain(proxy)
        return STATUS_OK

    def _look_at_domain(self, proxy: ParticipantProxy) -> None:
        """A board's domain is in its firmware; with the computer in another one they never meet, and wonder."""
        ours = self.core.space.domain
        if ours and proxy.domain != ours:
            self.core.report(
                "other-domain",
                who=self.who,
                subject=str(proxy.domain),
                what=f"{self.who} is in domain {proxy.domain}, this computer in domain {ours}",
                why=f"the client asks for domain {proxy.domain}",
                remedy=f"Set domain {ours} in the board's program, or ROS_DOMAIN_ID={proxy.domain} here.",
            )

    def _delete(self, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        if self._status_must_wait(stream_id):
            return LATER
        if n < 4:
            return self._malformed("DELETE", "it is cut short")
        ids = bytes(buf[off : off + 4])
        object_id = ids[2] << 8 | ids[3]
        if object_id & 0x0F == KIND_CLIENT:
            self.core.logout(self, ids)
            return HANDLED
        known = object_id in self.objects
        if known:
            self._remove(object_id)
        self._status(ids, STATUS_OK if known else STATUS_ERR_UNKNOWN_REFERENCE, stream_id)
        return HANDLED

    def _read_data(self, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        if self._status_must_wait(stream_id):
            return LATER
        if n < 4:
            return self._malformed("READ_DATA", "it is cut short")
        ids = bytes(buf[off : off + 4])
        proxy = self.objects.get(ids[2] << 8 | ids[3])
        if not isinstance(proxy, Readable):
            self._status(ids, STATUS_ERR_UNKNOWN_REFERENCE, STREAM_RELIABLE)
            return HANDLED
        try:
            specification = parse_read_data_untrusted(buf, off + 4, off + n, bool(flags & LITTLE_ENDIAN))
        except InvalidMessage as error:
            self._status(ids, STATUS_ERR_INVALID_DATA, STREAM_RELIABLE)
            return self._malformed("READ_DATA", str(error))
        if specification.content_filter:
            self.core.report(
                "no-content-filter",
                who=self.who,
                subject=proxy.topic.name,
                what=f"{self.who} gets all samples of {proxy.topic.name}",
                why=f"content filters are not supported ({specification.content_filter[:60]!r})",
                remedy="Filter in the client.",
            )
        if specification.stream_id not in self.outputs and len(self.outputs) >= self.core.limits.max_streams:
            self._status(ids, STATUS_ERR_RESOURCES, STREAM_RELIABLE)
            return HANDLED
        proxy.start(Reading(self, ids, specification, proxy.topic.name, proxy.take))
        return HANDLED

    def _reset(self, flags: int, buf: Buffer, off: int, n: int, stream_id: int) -> int:
        self.restart()
        self._pump_all()
        return HANDLED

    def _remove(self, object_id: int) -> None:
        proxy = self.objects.pop(object_id)
        proxy.close()
        self.core.tell(EntityDeleted(self.number, proxy.kind, object_id, proxy.detail))

    def _status(self, ids: bytes, result: int, stream_id: int) -> None:
        if stream_id < STREAM_RELIABLE:
            self.post(STREAM_BEST_EFFORT, status(ids, result))
        elif not self._is_full():
            self.post(STREAM_RELIABLE, status(ids, result))
        else:
            self.core.report(
                "status-dropped",
                who=self.who,
                what=f"{{n}} answer{{s}} to {self.who} dropped",
                why=f"it has left {self.core.limits.max_waiting} messages unacknowledged",
                remedy="Check that the client acknowledges what it gets on stream 0x80.",
            )

    def _is_full(self) -> bool:
        """Whether too much waits on the stream that answers go out on."""
        stream = self.outputs.get(STREAM_RELIABLE)
        return stream is not None and stream.waiting() >= self.core.limits.max_waiting

    def _status_must_wait(self, stream_id: int) -> bool:
        """Whether a request on a reliable stream stays unacknowledged until its answer can be kept: it is tried again
        when the client repeats it or sends a HEARTBEAT."""
        return stream_id >= STREAM_RELIABLE and self._is_full()

    def _refused(self, object_id: int, refused: Refused) -> int:
        name = KIND_NAMES.get(object_id & 0x0F, "object")
        self.core.report(
            "entity-refused",
            who=self.who,
            subject=f"{name} 0x{object_id:04X}",
            what=f"{name} 0x{object_id:04X} of {self.who} refused with {STATUS_NAMES[refused.status]}",
            why=str(refused),
            remedy=refused.remedy,
        )
        return refused.status

    def _dropped(self, code: str, why: str, remedy: str, buf: Buffer, off: int) -> int:
        object_id = buf[off + 2] << 8 | buf[off + 3]
        proxy = self.objects.get(object_id)
        subject = proxy.detail if proxy is not None else f"object 0x{object_id:04X}"
        self.core.report(
            code,
            who=self.who,
            subject=subject,
            what=f"{{n}} sample{{s}} of {self.who} for {subject} dropped",
            why=why,
            remedy=remedy,
        )
        return FAILED

    def _malformed(self, name: str, why: str) -> int:
        self.malformed += 1
        self.core.report(
            "malformed",
            who=self.who,
            subject=name,
            what=f"{{n}} {name} of {self.who} dropped",
            why=why,
            remedy="Check the line for noise and the client for its version.",
        )
        return FAILED


_HANDLERS: dict[int, Callable[[AgentSession, int, Buffer, int, int, int], int]] = {
    WRITE_DATA: AgentSession._write_data,
    CREATE: AgentSession._create,
    READ_DATA: AgentSession._read_data,
    DELETE: AgentSession._delete,
    RESET: AgentSession._reset,
}
