"""The agent without I/O: who may speak, which session a message belongs to, and what time does to sessions.

A link hands every message to its `Port`; answers leave through the link's ``send``. ``tick`` does what has become due
and returns when it wants to be called next. All times are milliseconds of one monotonic clock, handed in.

Finding a session: ids from 0x80 on belong to the address they come from; ids below carry the client key in every
header, so such a client may change its address, and several may share a line.
"""

from collections.abc import Callable, Hashable
from functools import partial
from typing import Any, Protocol

from muros.agent import _attempts
from muros.agent._calls import Call, Calls
from muros.agent._graph_topic import GraphTopic
from muros.agent._limits import Limits
from muros.agent._messages import (
    CreateClient,
    InvalidMessage,
    Locator,
    info,
    parse_create_client_untrusted,
    status,
    status_agent,
)
from muros.agent._proxies import Answered, ParticipantProxy
from muros.agent._session import AgentSession
from muros.agent.events import (
    ClientBack,
    ClientConnected,
    ClientGone,
    ClientLost,
    ClientReady,
    ClientSilent,
    Event,
)
from muros.agent.profiles import References
from muros.findings import Findings
from muros.links.voice import Voice
from muros.space import Space
from muros.xrce._types import Buffer
from muros.xrce.constants import (
    CREATE_CLIENT,
    DELETE,
    FAILED,
    GET_INFO,
    HANDLED,
    INFO,
    KIND_CLIENT,
    KIND_DATAREADER,
    KIND_DATAWRITER,
    KIND_REPLIER,
    KIND_REQUESTER,
    LITTLE_ENDIAN,
    STATUS_ERR_INCOMPATIBLE,
    STATUS_ERR_INVALID_DATA,
    STATUS_ERR_RESOURCES,
    STATUS_NAMES,
    STATUS_OK,
    TIMESTAMP,
    TIMESTAMP_REPLY,
)

__all__ = ["AgentCore", "Outlet", "Port"]

LIVELINESS_PROPERTY = "uxr_hl"
_TICK = 50
"""How exactly heartbeats keep their time, in ms."""
_DEAD_TICK = 1_000
"""When to look again for clients that have fallen silent and are owed HEARTBEATs, in ms."""
_LIVELINESS_TICK = 200
_TWINS = 3
"""How often a living client may change its address until two devices are suspected."""
_QUIET = 200
"""Silence after the last CREATE until a client counts as ready, in ms."""
_REFUSALS = {
    STATUS_ERR_INVALID_DATA: (
        "its cookie, key or session id is none of DDS-XRCE",
        "Give it a key other than 0.",
    ),
    STATUS_ERR_INCOMPATIBLE: ("it speaks another version than DDS-XRCE 1", "Update the client."),
    STATUS_ERR_RESOURCES: ("the agent serves as many clients as it may", "Raise max_clients."),
}
"""Why a client is refused, and what to do about it, by status."""
_PROBE = bytes((GET_INFO, 1, 8, 0, 0, 0, 0xFF, 0xFE, 1, 0, 0, 0))


class Outlet(Protocol):
    """What the agent needs of a link."""

    @property
    def name(self) -> str:
        """The link in words."""

    def send(self, message: bytes, address: Any) -> bool:
        """Sends a whole message."""

    def describe(self, address: Any) -> str:
        """An address in words."""


class Port:
    """A link at the agent, with the sessions that were found by its addresses."""

    __slots__ = ("core", "discovery_only", "link", "locators", "sessions")

    def __init__(
        self, core: "AgentCore", link: Outlet, discovery_only: bool, locators: Callable[[], list[Locator]]
    ) -> None:
        self.core = core
        self.link = link
        self.discovery_only = discovery_only
        self.locators = locators
        self.sessions: dict[Hashable, AgentSession] = {}

    def receive(self, data: bytes, address: Hashable, now: int) -> None:
        """Takes one whole message that came from ``address`` at ``now``."""
        core = self.core
        core.now = now
        session = self.sessions.get(address)
        if (
            session is not None
            and len(data) >= 4
            and data[0] == session.head[0]
            and (data[0] >= 0x80 or data[4:8] == session.key)
        ):
            if session.told_silent or session.lost_at is not None:
                core.found_again(session)
            session.heard = now
            session.probes = 0
            session.receive(data, 0, len(data), now)
            return
        core.receive_elsewhere(self, data, address, session)


class AgentCore(Voice[Event]):
    """Sessions, time and findings of an agent; everything in the space is made through ``space``.

    ``wall`` gives the wall clock in ns, also for answers to TIMESTAMP.
    """

    def __init__(
        self,
        space: Space,
        references: References,
        findings: Findings,
        *,
        limits: Limits,
        wall: Callable[[], int],
        default_domain: int | None = None,
    ) -> None:
        super().__init__(findings, wall)
        self.space = space
        self.references = references
        self.limits = limits
        self.default_domain = space.domain if default_domain is None else default_domain
        self.now = 0
        # dicts are sets that keep their order: the same input gives the same output
        self.unacknowledged: dict[AgentSession, None] = {}
        self.clients: dict[bytes, AgentSession] = {}
        self._ports: list[Port] = []
        self._fresh: dict[AgentSession, None] = {}
        self._watched: dict[AgentSession, None] = {}
        self._calls = Calls()
        self._attempts = _attempts.Attempts(limits.max_clients)
        self.joining = 0
        self.graph = GraphTopic(self)
        self._heartbeat_at = 0
        self._liveliness_at = 0
        self._silence_at = 0
        self._next: int | None = None

    # Links

    def attach(
        self,
        link: Outlet,
        *,
        discovery_only: bool = False,
        locators: Callable[[], list[Locator]] | None = None,
    ) -> Port:
        """A port for ``link``; one with ``discovery_only`` answers GET_INFO and nothing else."""
        port = Port(self, link, discovery_only, locators or list)
        self._ports.append(port)
        return port

    def detach(self, port: Port, now: int) -> None:
        """The link is closed for good: its clients go."""
        self.now = now
        for session in [session for session in self.clients.values() if session.port is port]:
            self.remove(session, "its link was closed")
        self._ports.remove(port)

    def gone(self, port: Port, address: Hashable, reason: str, now: int) -> None:
        """The way to ``address`` is gone: the client behind it is kept for a while."""
        self.now = now
        lost = [
            session
            for session in self.clients.values()
            if session.port is port and session.address == address and session.lost_at is None
        ]
        for session in lost:
            session.lost_at = now
            self.unacknowledged.pop(session, None)
            keep = self.limits.keep_lost
            self.tell(ClientLost(session.number, reason, None if keep is None else keep / 1000))
            if keep is not None:
                session.given_up = self.call_at(
                    now + keep, partial(self.remove, session, "it did not come back")
                )

    # Time

    def tick(self, now: int) -> int | None:
        """Does what is due; returns when to call again (ms), None: when asked to through ``on_wake``."""
        self.now = now
        self._next = None
        self._calls.run(now)
        awaited = self._heartbeats(now)
        self._probe(now)
        self._forget_silent(now)
        self._ready(now)
        waits = [due for due in (self._calls.next(), self._attempts.tick(now)) if due is not None]
        if awaited or self._fresh:
            waits.append(now + _TICK)
        elif self.unacknowledged:
            waits.append(now + _DEAD_TICK)
        if self._watched:
            waits.append(self._liveliness_at)
        if self.limits.forget_silent is not None and self.clients:
            waits.append(self._silence_at)
        self._next = min(waits) if waits else None
        return self._next

    def call_at(self, tick: int, call: Callable[[], object]) -> Call:
        """Calls ``call`` at ``tick``, unless it is cancelled."""
        made = self._calls.at(tick, call)
        self._wake(tick)
        return made

    def cancel(self, call: Call) -> None:
        """It is not called. Cancelling twice, or what was called, is allowed."""
        self._calls.cancel(call)

    def _wake(self, tick: int) -> None:
        if self._next is None or tick < self._next:
            self._next = tick
            if self.on_wake is not None:
                self.on_wake(tick)

    def _wake_in(self, ms: int) -> None:
        self._wake(self.now + ms)

    def has_unacknowledged(self, session: AgentSession) -> None:
        """The session has sent something that wants an acknowledgement."""
        if session not in self.unacknowledged:
            self.unacknowledged[session] = None
            self._wake(self.now + _TICK)

    def has_created(self, session: AgentSession) -> None:
        """The session has made an entity."""
        if session not in self._fresh:
            self._fresh[session] = None
            self._wake(self.now + _TICK)

    def _heartbeats(self, now: int) -> bool:
        """Whether any client that is there has something to acknowledge."""
        awaited = False
        dead = self.limits.dead_time
        for session in list(self.unacknowledged):
            silence = now - session.heard
            if silence > self.limits.silent and not session.told_silent and session.lost_at is None:
                session.told_silent = True
                self.tell(ClientSilent(session.number, silence / 1000))
            if silence > dead or session.lost_at is not None:
                continue
            session.flush(now)
            if all(stream_id < 0x80 or stream.idle() for stream_id, stream in session.outputs.items()):
                self.unacknowledged.pop(session, None)
            else:
                awaited = True
        return awaited

    def _probe(self, now: int) -> None:
        if not self._watched or now < self._liveliness_at:
            return
        self._liveliness_at = now + _LIVELINESS_TICK
        for session in list(self._watched):
            if now - session.heard < session.liveliness:
                continue
            if session.probes < self.limits.liveliness_tries:
                session.probes += 1
                session.answer_control(_PROBE)
            else:
                self.remove(
                    session,
                    f"silent for {(now - session.heard) / 1000:.1f} s although it promised to be lively",
                )

    def _forget_silent(self, now: int) -> None:
        limit = self.limits.forget_silent
        if limit is None or now < self._silence_at:
            return
        self._silence_at = now + max(_LIVELINESS_TICK, limit // 10)
        for session in [s for s in self.clients.values() if now - s.heard >= limit]:
            self.remove(session, f"silent for {(now - session.heard) / 1000:.0f} s")

    def _ready(self, now: int) -> None:
        for session in [s for s in self._fresh if now - s.created_at >= _QUIET]:
            self._fresh.pop(session, None)
            proxies = session.objects.values()
            nodes = tuple(p.participant.name and p.detail for p in proxies if isinstance(p, ParticipantProxy))
            kinds = [proxy.kind for proxy in proxies if not isinstance(proxy, Answered)]
            self.tell(
                ClientReady(
                    session.number,
                    tuple("/" + name.lstrip("/") for name in nodes if name),
                    kinds.count(KIND_DATAWRITER),
                    kinds.count(KIND_DATAREADER),
                    kinds.count(KIND_REQUESTER),
                    kinds.count(KIND_REPLIER),
                )
            )

    # Sessions

    def remove(self, session: AgentSession, reason: str) -> None:
        """Removes a client and everything it made."""
        if self.clients.get(session.key) is session:
            del self.clients[session.key]
        if session.port.sessions.get(session.address) is session:
            del session.port.sessions[session.address]
        self._fresh.pop(session, None)
        self._watched.pop(session, None)
        session.close()
        self.findings.forget(session.who)
        self.tell(ClientGone(session.number, session.head[0], reason))

    def logout(self, session: AgentSession, ids: bytes) -> None:
        """The client says goodbye."""
        session.answer_control(status(ids, STATUS_OK))
        if session.attempt:
            self._wake(self._attempts.remember(session.key, session.attempt, self.now))
        self.remove(session, "it said goodbye")

    def found_again(self, session: AgentSession) -> None:
        """A client that was lost is heard on the way it had: it goes on where it was."""
        lost_at = session.heard if session.lost_at is None else session.lost_at
        session.told_silent = False
        session.found()
        if session.outputs:
            self.has_unacknowledged(session)
        away = (self.now - lost_at) / 1000
        self.tell(
            ClientBack(
                session.number, session.head[0], session.port.link.describe(session.address), away, False
            )
        )

    def receive_elsewhere(
        self, port: Port, data: bytes, address: Hashable, here: AgentSession | None
    ) -> None:
        """Takes a message that is not of the session at this address: of none, of a key, or of nobody known."""
        if len(data) < 8:
            self._dropped(port, address, "malformed", f"{len(data)} B are no message")
            return
        session_id = data[0]
        at = 4 if session_id >= 0x80 else 8
        if session_id & 0x7F and session_id < 0x80 and not port.discovery_only:
            session = self.clients.get(data[4:8])
            if session is not None and session.head[0] == session_id:
                self._move(session, port, address)
                session.heard = self.now
                session.probes = 0
                session.receive(data, 0, len(data), self.now)
                return
        if len(data) < at + 4:
            self._dropped(port, address, "malformed", f"{len(data)} B are no message")
            return
        kind, flags = data[at], data[at + 1]
        if kind == GET_INFO:
            self._send_info(port, address, data, at, here)
        elif port.discovery_only:
            self._dropped(port, address, "not-discovery", "only GET_INFO is answered on the discovery port")
        elif kind == CREATE_CLIENT:
            self._create_client(port, address, data, at + 4, flags)
        elif kind == DELETE and len(data) >= at + 8 and data[at + 7] & 0x0F == KIND_CLIENT:
            self._answer(port, address, data, at, status(data[at + 4 : at + 8], STATUS_OK))
        else:
            self._dropped(
                port,
                address,
                "unknown-session",
                f"session 0x{session_id:02X} is not known: the agent was restarted, or the client never connected",
                "The client has to connect anew; muros clients do so by themselves.",
            )

    def other_submessage(
        self, session: AgentSession, kind: int, flags: int, buf: Buffer, off: int, n: int, stream_id: int
    ) -> int:
        """Submessages of a session that are not about its entities."""
        if session.closed:
            return FAILED  # the rest of a message in which it said goodbye
        if kind == GET_INFO and n >= 4:
            session.answer_control(info(bytes(buf[off : off + 4]), 1, []))
        elif kind == TIMESTAMP and n >= 8:
            session.answer_control(self._timestamp_reply(bytes(buf[off : off + 8]), flags))
        elif kind == CREATE_CLIENT and n == 0:
            session.malformed += 1  # how the reference client answers a liveliness probe: it is alive
        elif kind == CREATE_CLIENT:
            self._create_client(session.port, session.address, bytes(buf), off, flags)
        elif kind != INFO:
            session.malformed += 1
            self.report(
                "unknown-submessage",
                who=session.who,
                subject=f"id {kind}",
                what=f"{{n}} submessage{{s}} of {session.who} ignored",
                why=f"submessage id {kind} with {n} B is not one a client sends",
                remedy="Check the line for noise and the client for its version.",
            )
            return FAILED
        return HANDLED

    def _create_client(self, port: Port, address: Hashable, data: bytes, at: int, flags: int) -> None:
        try:
            asked = parse_create_client_untrusted(data, at, len(data), bool(flags & LITTLE_ENDIAN))
        except InvalidMessage as error:
            self._dropped(port, address, "malformed", f"CREATE_CLIENT: {error}")
            return
        result = asked.status
        known = self.clients.get(asked.key)
        if result == STATUS_OK and known is None and len(self.clients) >= self.limits.max_clients:
            result = STATUS_ERR_RESOURCES
        if result == STATUS_OK and asked.session_id & 0x7F == 0:
            result = STATUS_ERR_INVALID_DATA
        if result != STATUS_OK:
            self.report(
                "client-refused",
                who=port.link.describe(address),
                subject=STATUS_NAMES[result],
                what=f"{{n}} client{{s}} at {port.link.describe(address)} refused with {STATUS_NAMES[result]}",
                why=_REFUSALS[result][0],
                remedy=_REFUSALS[result][1],
            )
            self._answer_create(port, address, asked, result)
            return
        attempt = asked.properties.get(_attempts.PROPERTY, "")
        if attempt and (asked.key, attempt) in self._attempts:
            return  # the network repeats what a client said before it left
        self._replace_neighbour(port, address, asked)
        if known is None or known.head[0] != asked.session_id:
            if known is not None:
                self.remove(known, "it connected anew with another session id")
            self._connect(port, address, asked, attempt)
        elif attempt and known.attempt == attempt and known.port is port and known.address == address:
            pass  # the network repeats it, or our answer was lost: the session has begun already
        else:
            self._reconnect(known, port, address, asked, attempt)
        self._answer_create(port, address, asked, STATUS_OK)
        session = self.clients[asked.key]
        session.heard = self.now
        session._pump_all()

    def _replace_neighbour(self, port: Port, address: Hashable, asked: CreateClient) -> None:
        """A client without key in its headers has its address for itself; several with keys may share one."""
        neighbour = port.sessions.get(address)
        if neighbour is None or neighbour.key == asked.key:
            return
        if asked.session_id >= 0x80 or neighbour.head[0] >= 0x80:
            self.remove(neighbour, f"client 0x{asked.key.hex().upper()} took its address")

    def _connect(self, port: Port, address: Hashable, asked: CreateClient, attempt: str) -> None:
        session = AgentSession(self, port, address, asked.key, asked.session_id)
        session.attempt = attempt
        self.clients[asked.key] = session
        port.sessions[address] = session
        self._configure(session, asked)
        if self.limits.forget_silent is not None:
            self._wake(self.now + self.limits.forget_silent)
        self.tell(ClientConnected(session.number, asked.session_id, port.link.describe(address)))

    def _reconnect(
        self, session: AgentSession, port: Port, address: Hashable, asked: CreateClient, attempt: str
    ) -> None:
        away = (self.now - (session.heard if session.lost_at is None else session.lost_at)) / 1000
        self._see_twins(session, port, address)
        session.attempt = attempt
        session.told_silent = False
        session.here()
        self._rebind(session, port, address)
        self._configure(session, asked)
        session.restart()
        self.tell(ClientBack(session.number, asked.session_id, port.link.describe(address), away, True))

    def _see_twins(self, session: AgentSession, port: Port, address: Hashable) -> None:
        """Two devices with one client key take the session from each other again and again."""
        if (
            port is session.port and address == session.address
        ) or self.now - session.heard > self.limits.silent:
            session.moves = 0
            return
        session.moves += 1
        if session.moves >= _TWINS:
            self.report(
                "client-key-in-use-twice",
                who=session.who,
                what=f"{session.who} changes its address again and again",
                why=f"it was alive at {session.port.link.describe(session.address)} when it connected from "
                f"{port.link.describe(address)}: two devices seem to use one client key",
                remedy="Give each device a client key of its own.",
            )

    def _configure(self, session: AgentSession, asked: CreateClient) -> None:
        session.mtu = max(asked.mtu, len(session.head) + 12)
        text = asked.properties.get(LIVELINESS_PROPERTY, "")
        session.liveliness = int(text) if text.isascii() and text.isdigit() and len(text) <= 9 else 0
        session.probes = 0
        if session.liveliness:
            self._watched[session] = None
            self._liveliness_at = min(self._liveliness_at, self.now + session.liveliness)
            self._wake(self.now + min(session.liveliness, _LIVELINESS_TICK))
        else:
            self._watched.pop(session, None)

    def _move(self, session: AgentSession, port: Port, address: Hashable) -> None:
        if session.port is not port or session.address != address:
            self._rebind(session, port, address)
        if session.told_silent or session.lost_at is not None:
            self.found_again(session)

    def _rebind(self, session: AgentSession, port: Port, address: Hashable) -> None:
        if session.port.sessions.get(session.address) is session:
            del session.port.sessions[session.address]
        session.port = port
        session.address = address
        neighbour = port.sessions.get(address)
        if (
            neighbour is None or neighbour.head[0] < 0x80
        ):  # who has no key in its headers is found by address alone
            port.sessions[address] = session

    # Answers

    def _answer_create(self, port: Port, address: Hashable, asked: CreateClient, result: int) -> None:
        head = bytes((asked.session_id, 0, 0, 0))
        if asked.session_id < 0x80:
            head += asked.key
        port.link.send(head + status_agent(result), address)

    def _answer(self, port: Port, address: Hashable, data: bytes, at: int, submessage: bytes) -> None:
        port.link.send(data[:at] + submessage, address)

    def _send_info(
        self, port: Port, address: Hashable, data: bytes, at: int, here: AgentSession | None
    ) -> None:
        if len(data) < at + 8:
            self._dropped(port, address, "malformed", "GET_INFO is cut short")
            return
        known = 1 if here is not None and here.head[0] == data[0] else 0
        self._answer(port, address, data, at, info(data[at + 4 : at + 8], known, port.locators()))

    def _timestamp_reply(self, originate: bytes, flags: int) -> bytes:
        seconds, nanoseconds = divmod(self._wall(), 1_000_000_000)
        stamp = seconds.to_bytes(4, "little") + nanoseconds.to_bytes(4, "little")
        if not flags & LITTLE_ENDIAN:
            originate = originate[3::-1] + originate[:3:-1]
        return bytes((TIMESTAMP_REPLY, 1, 24, 0)) + stamp + stamp + originate

    # Words

    def _dropped(
        self,
        port: Port,
        address: Hashable,
        code: str,
        why: str,
        remedy: str = "Check who sends to the agent.",
    ) -> None:
        who = port.link.describe(address)
        self.report(code, who=who, what=f"{{n}} message{{s}} from {who} dropped", why=why, remedy=remedy)
