"""One board on one line: negotiation, time, and the signs by which a server knows how the board is.

A board says nothing until it is asked for its topics; then it asks for the time, names everything it has, and counts
itself as connected for as long as its requests for the time are answered. There is no end mark, no acknowledgement,
and no sign of a restart. So the server goes by these:

- Any good frame is a sign of life, messages and requests for the time are signs of a connected board. One that has
  asked for the time before, and shows none longer than it takes until it must ask again, is asked for its topics once a
  second.
- A connected board passes over the two bytes ``FF 00``; an unconnected one answers with a request for the time, to show
  which version it speaks. While a board shows no sign it gets them twice a second, and a request for the time that
  is not due means that it has started again. Boards of Groovy show nothing of the kind; one that has sent nothing for a
  while is asked for its topics, and nothing goes to it until it has named them.
- A frame of an unknown topic means that something was lost, or that the board has started again with other topics.
- Topics that stay unnamed after two requests are gone. Damage on the line while they are named brings other requests,
  and then one that was named after any of them is there.

What a request names again stays as it is: nobody in the graph sees a board's restart.
"""

from __future__ import annotations

import math
from collections.abc import Hashable
from typing import TYPE_CHECKING

from muros.rosserial.constants import (
    ID_FIRST_TOPIC,
    ID_LOG,
    ID_PARAMETER_REQUEST,
    ID_PUBLISHER,
    ID_SERVICE_CLIENT,
    ID_TIME,
    ID_TX_STOP,
    VERSION_GROOVY,
    VERSION_HYDRO,
)
from muros.rosserial.messages import (
    MessageError,
    TopicInfo,
    log_untrusted,
    parameter_request_untrusted,
    topic_info_untrusted,
)
from muros.rosserial.packets import ANY_VERSION, Decoder, frame
from muros.rosserial.server._answers import parameter_answer, time_answer
from muros.rosserial.server._diagnosis import Suspicions
from muros.rosserial.server._door import Node, RefusedError
from muros.rosserial.server._endpoints import (
    Publication,
    ServiceClient,
    ServiceServer,
    Subscription,
)
from muros.rosserial.server._output import Link, Output
from muros.rosserial.server._roster import Roster
from muros.rosserial.server._states import (
    ANSWER,
    ASKING,
    AWAY,
    LINE_DOWN,
    LINE_UP,
    SILENCE,
    SILENT,
    SYNCED,
    TRANSITIONS,
)
from muros.rosserial.server.events import (
    BoardBack,
    BoardHeard,
    BoardLog,
    BoardLost,
    BoardReady,
    BoardReset,
    Event,
)

if TYPE_CHECKING:
    from muros.rosserial.server._core import ServerCore
    from muros.xrce._types import Buffer

__all__ = ["Board"]

PROBE = bytes.fromhex("fffe0000ff0000ff00ffff00000000ff00")
"""Topic requests of both versions, parted by 00 so that a board of either understands its own."""
CHECK = b"\xff\x00"
"""What an unconnected board answers and a connected one passes over."""

_TIME_PERIOD = 2_000
"""A request for the time that comes earlier after the last one is not the regular one, in ms (that is 2.5 s)."""
_OPEN = 3_000
"""How long a topic request may still be answered, in ms."""
_BOOT = 2_000
"""Silence until other rates are tried: boards may start when their port is opened, in ms."""
_CHECK_AFTER = 700
"""Silence before checks begin, in ms."""
_TRIES = 3
"""Unanswered topic requests in the version that was heard until both are tried again; also requests after damage."""
_MOST_TRIES = 12
"""Requests, at last one a second, until what was not named on a line with damage counts as gone."""
_LAST_HALF = ID_SERVICE_CLIENT + 1
"""Up to this id a frame names a topic or a half of a service."""
_MISSES = 2
_BITS = 10
"""Bits of a byte on a serial line, start and stop bit included."""


class Board:
    """A board. ``label`` is its line for people, ``key`` what it is known again by, ``node_name`` its full node name.

    Counters are those of its ``decoder`` and its ``output``, and ``received_bytes``, ``asks`` (topic requests),
    ``resets``, ``unknown`` (frames of unknown topics).
    """

    def __init__(
        self, core: ServerCore, key: Hashable, label: str, node_name: str, link: Link, address: Hashable
    ) -> None:
        self.core = core
        self.key = key
        self.label = label
        self.who = f"board {label}"
        self.node_name = node_name
        self.baud = 0
        self.state = AWAY
        self.version = 0
        """The version it speaks; 0 until it was heard."""
        self.decoder = Decoder(core.limits.max_payload, self._on_frame, ANY_VERSION)
        self.output = Output(link, address, 0, core.limits.lead, core.limits.max_requests)
        self.node: Node | None = None
        self.roster = Roster(self)
        self.came_at = 0
        """When its line came up."""
        self.heard_at = 0
        self.connected_at = 0
        """When it last sent something that only a connected board sends; logs and questions come from others, too."""
        self.last_time: int | None = None
        self.lost_at: int | None = None
        self.lost_last: int | None = None
        """When it was lost last, also if it has come back since."""
        self.due: int | None = None
        self.received_bytes = 0
        self.asks = 0
        self.resets = 0
        self.unknown = 0
        self.round_trip: int | None = None
        """From the last topic request to its first answer, in ms."""
        self.suspicions = Suspicions(self)
        self._now = 0
        self.round = 0
        """The number of the last topic request."""
        self.first_round = 0
        """The number of the first one that was made for the same reason."""
        self._incoming = self.roster.incoming
        self._open_asks: list[int] = []
        self._asked_at = 0
        self._first_ask = 0
        self._settle_at: int | None = None
        self._misses = 0
        self._damage = 0
        self._told_ready = False
        self._told_lost = False
        self._checked_at = 0
        self._sent_at = -1

    @property
    def in_sync(self) -> bool:
        """Whether it may be sent messages."""
        return self.state == SYNCED

    @property
    def reachable(self) -> bool:
        """Whether there is a line to it."""
        return self.state != AWAY

    # What happens to the line

    def line_up(self, link: Link, address: Hashable, baud: int, now: int) -> None:
        """The line is there: the board is asked."""
        self._now = now
        self._step(LINE_UP)
        self.output.link, self.output.address = link, address
        self.set_baud(baud)
        self.output.clear()
        self.decoder.reset()
        self.decoder.version = ANY_VERSION
        self.decoder.limit = self.core.limits.max_payload
        self.version = 0
        self.last_time = None
        self._open_asks.clear()
        self.came_at = self._first_ask = self.heard_at = self.connected_at = now
        self._told_ready = False
        self.roster.renew()
        self.suspicions.begin(now)
        self._ask(now)
        self._plan(now)

    def set_baud(self, baud: int) -> None:
        """The rate of the line in bits per second; 0 if it is no matter."""
        self.baud = baud
        self.output.byte_us = _BITS * 1e6 / baud if baud else 0.0
        self.decoder.byte_us = math.ceil(self.output.byte_us)

    def line_down(self, reason: str, now: int) -> None:
        """The line is gone; what the board has stays for a while."""
        self._now = now
        if self.state == AWAY:
            return
        self._step(LINE_DOWN)
        self.output.clear()
        self.roster.restart()
        if self.node is None:  # it never was a board, as far as one could hear
            self.core.remove(self, reason)
            return
        self._lose(reason, now)
        self._plan(now)

    def receive(self, data: bytes, now: int) -> None:
        """Bytes came."""
        self._now = now
        self.received_bytes += len(data)
        decoder = self.decoder
        before = decoder.frames
        decoder.feed(data, len(data), now)
        if decoder.frames == before:
            self.suspicions.noise(data)
        self.suspicions.look(now)
        if decoder.pending or decoder.frames == before:
            self._plan(now)
        self.pump(now)

    def stop(self) -> None:
        """Tells the board that nobody listens any more, so that it waits to be asked."""
        if self.state != AWAY and self.version:
            self.output.end(frame(ID_TX_STOP, b"", self.version))

    def close(self) -> None:
        """Takes everything of it out of the world."""
        self.roster.close()
        if self.node is not None:
            self.node.close()
            self.node = None

    # Time

    def tick(self, now: int) -> None:
        """Does what is due; ``due`` says when it wants to be called next."""
        self._now = now
        self.due = None
        if self.decoder.pending:
            self.decoder.tick(now)
            self.suspicions.look(now)
        if self.state == ASKING:
            if now >= self._asked_at + self.core.limits.ask:
                self._try_elsewhere(now)
                self._ask(now)
            self.suspicions.unanswered(now)
        elif self.state == SYNCED:
            self._watch(now)
        elif self.state == SILENT:
            if now >= self._asked_at + self.core.limits.ask:
                self.roster.forget()  # what has waited so long is too old to be carried out
                self._ask(now)
            if not self._told_lost and now >= self.heard_at + self.core.limits.lost:
                self._lose(f"silent for {(now - self.heard_at) / 1000:.0f} s", now)
        self.roster.tick(now)
        if self.lost_at is not None and now >= self.lost_at + self.core.limits.keep_lost:
            self._forget(now)
        self._plan(now)
        self.pump(now)

    def wake(self, when: int) -> None:
        """It wants to be called at ``when`` at the latest."""
        if self.due is None or when < self.due:
            self.due = when
            self.core.wake(when)

    def pump(self, now: int) -> None:
        """Sends what can be sent."""
        when = self.output.pump(now)
        if when is not None:
            self.wake(when)

    def send(self) -> None:
        """Sends what a topic has: at once, but what comes in the same millisecond together, which costs less."""
        now = self.core.clock()
        if now == self._sent_at:
            self.wake(now)
        else:
            self._sent_at = now
            self.pump(now)

    def tell(self, event: Event) -> None:
        """Hands an event to whoever watches; its node says it, too."""
        self.core.tell(event)
        if self.node is not None:
            self.node.log(event.severity, event.text())

    def report(self, code: str, *, what: str, why: str, remedy: str, subject: str = "", n: int = 1) -> None:
        """Counts a finding about it."""
        self.core.report(code, who=self.who, subject=subject, what=what, why=why, remedy=remedy, n=n)

    def _plan(self, now: int) -> None:
        """Sees to the next call of `tick`."""
        limits = self.core.limits
        if self.decoder.pending:
            self.wake(now + max(1, self.decoder.tick(now)))
        if self.state in (ASKING, SILENT):
            self.wake(self._asked_at + limits.ask)
        elif self.state == SYNCED:
            if self._settle_at is not None:
                self.wake(self._settle_at)
            elif self._repeats():
                self.wake(self._asked_at + limits.ask)
            if self.last_time is not None:
                self.wake(self.connected_at + self._patience())
                if limits.check and self.version == VERSION_HYDRO:
                    self.wake(max(self.connected_at + _CHECK_AFTER, self._checked_at + limits.check))
        if self.lost_at is not None:
            self.wake(self.lost_at + limits.keep_lost)

    def _watch(self, now: int) -> None:
        limits = self.core.limits
        if self._settle_at is not None and now >= self._settle_at:
            self._settled(now)
        elif self._repeats() and now >= self._asked_at + limits.ask:
            self._ask(now, again=True)
        if self.last_time is None:
            return  # it never asks for the time: its silence means nothing
        silence = now - self.connected_at
        if silence >= self._patience():
            if self.core.moves(self, now):
                return
            self._step(SILENCE)
            self.roster.doubt()
            self._ask(now)
        elif (
            limits.check
            and self.version == VERSION_HYDRO
            and silence >= _CHECK_AFTER
            and now >= self._checked_at + limits.check
        ):
            self._checked_at = now
            self.output.post(CHECK)

    def _patience(self) -> int:
        """How long it may show no sign of being connected.

        Boards of Groovy cannot be checked, only asked, which ends a call that they wait for.
        """
        limits = self.core.limits
        if self.version != VERSION_GROOVY or self.roster.calls(self._now - limits.lost):
            return limits.silent
        return min(limits.silent, limits.quiet)

    def _repeats(self) -> bool:
        """Whether a topic request got lost, as the board says something and has not named what it has."""
        return self._settle_at is None and bool(self._open_asks)

    def _step(self, what: str) -> None:
        self.state = TRANSITIONS.get((self.state, what), self.state)
        self.output.holds = self.state != SYNCED or self.roster.in_doubt

    def _be_sure(self) -> None:
        """The board has named what it has: what waits for it may go."""
        self.roster.in_doubt = False
        self.output.holds = self.state != SYNCED
        self.roster.resume()

    # Negotiation

    def ask(self, now: int) -> None:
        """Asks a board that should be well whether it is, unless that would end a call: it names what it has."""
        if self.state == SYNCED and not self.roster.calls(now - self.core.limits.lost):
            self._ask(now)
            self._plan(now)

    def _ask(self, now: int, again: bool = False) -> None:
        """Asks for topics, for a new reason or once more; in both versions while none was understood."""
        self._open_asks = [at for at in self._open_asks if now - at < _OPEN]
        if self.version and len(self._open_asks) >= _TRIES - 1:
            self.decoder.version = ANY_VERSION
        both = self.decoder.version == ANY_VERSION
        self.round += 1
        if not again:
            self._misses = 0
            self.first_round = self.round
        self.asks += 1
        self._asked_at = now
        self._open_asks.append(now)
        self._damage = self.suspicions.damage
        self.output.post(PROBE if both else frame(ID_PUBLISHER, b"", self.version))
        self.pump(now)

    def _try_elsewhere(self, now: int) -> None:
        """The rate of the line may be wrong: after a while, as a board may still be starting, others are tried."""
        tell = self.core.on_unanswered
        if tell is not None and not self.version and now - self._first_ask >= _BOOT and tell(self):
            self.decoder.reset()

    def _answered(self, now: int) -> None:
        """The board says something that belongs to negotiation."""
        if self._open_asks:
            self.round_trip = now - self._open_asks.pop(0)
        self._settle_at = now + self.core.limits.settle
        self.wake(self._settle_at)
        if self.state != SYNCED:
            self._heard_again(now)
            self._step(ANSWER)
        self.meet()

    def meet(self) -> None:
        """It is a board: it becomes a node, if it is none yet."""
        if self.node is None:
            try:
                self.node = self.core.world.node(self.node_name, self.who)
            except RefusedError as error:
                what = f"{self.who} cannot be the node {self.node_name}"
                self.report("node-refused", what=what, why=error.why, remedy=error.remedy)

    def _heard_again(self, now: int) -> None:
        if self.lost_at is not None:
            self.tell(BoardBack(self.label, (now - self.lost_at) / 1000))
            self.lost_at = None
        self._told_lost = False

    def _settled(self, now: int) -> None:
        """The board has said everything, as far as one can tell."""
        self._settle_at = None
        if self.roster.in_doubt:
            self._be_sure()
        missing = self.roster.missing()
        damaged = self.suspicions.damage != self._damage
        unsure = missing or self.roster.halved()
        most = _MISSES if not damaged else _MOST_TRIES if unsure else _TRIES
        if (unsure or damaged) and self._misses < most:
            if self._misses >= _TRIES and now < self._asked_at + self.core.limits.ask:
                self._settle_at = self._asked_at + self.core.limits.ask
                return
            self._misses += 1
            self._ask(now, again=True)
            return
        self._misses = 0
        self._open_asks.clear()
        for endpoint in missing:
            self.roster.remove(endpoint)
        if not self._told_ready and self.node is not None:
            self._told_ready = True
            self.tell(
                BoardReady(
                    self.label,
                    self.node_name,
                    self.roster.count(Publication),
                    self.roster.count(Subscription),
                    self.roster.count(ServiceServer),
                    self.roster.count(ServiceClient),
                    (now - self._first_ask) / 1000,
                )
            )
            if not self.roster.endpoints:
                self.suspicions.no_topics()
        due = now >= self._asked_at + self.core.limits.ask
        if self.roster.lacks(tell=due):
            if due:
                self._ask(now)
            self._settle_at = self._asked_at + self.core.limits.ask

    def _lose(self, reason: str, now: int) -> None:
        if self.node is not None and self.lost_at is None:
            self._told_lost = True
            self.lost_at = self.lost_last = now
            self.tell(BoardLost(self.label, reason, self.core.limits.keep_lost / 1000))

    def _forget(self, now: int) -> None:
        """It was away too long: its endpoints go, and it too if its line is gone."""
        self.lost_at = None
        if self.state == AWAY:
            self.core.remove(self, f"it did not come back within {self.core.limits.keep_lost / 1000:.0f} s")
            return
        self.close()
        self._told_ready = False

    # Frames

    def _on_frame(self, topic_id: int, buf: Buffer, off: int, n: int) -> bool:
        """A frame; False if it makes no sense."""
        now = self._now
        if self.decoder.version != self.decoder.heard and not self._learn(topic_id):
            return False
        self.heard_at = now
        receive = self._incoming.get(topic_id)
        if receive is not None:
            self.connected_at = now
            if self.state == SILENT:
                self._heard_again(now)
                self._step(ANSWER)
            return receive(bytes(memoryview(buf)[off : off + n]), now)
        try:
            return self._protocol(topic_id, buf, off, n, now)
        except MessageError as error:
            self.report(
                "bad-protocol-message",
                what=f"{{n}} message{{s}} of {self.who} on id {topic_id} passed over",
                why=str(error),
                remedy="Check that the firmware's rosserial library is whole; the board is asked again",
            )
            self._misses = 0
            self._settle_at = now + self.core.limits.settle
            self._damage = -1
            return False

    def _learn(self, topic_id: int) -> bool:
        """Which version the board speaks; False if that frame is more likely noise."""
        heard = self.decoder.heard
        if heard == VERSION_GROOVY and topic_id > ID_TX_STOP and not self._incoming:
            return False
        self.decoder.version = heard
        if self.version != heard:
            self.version = heard
            self.tell(BoardHeard(self.label, heard, self.baud))
        return True

    def _protocol(self, topic_id: int, buf: Buffer, off: int, n: int, now: int) -> bool:
        if topic_id == ID_TIME:
            self._time(now)
        elif topic_id <= _LAST_HALF:
            self._named(topic_id, topic_info_untrusted(buf, off, n), now)
        elif topic_id == ID_LOG:
            level, text = log_untrusted(buf, off, n)
            self._log(level, text.decode(errors="replace"))
        elif topic_id == ID_PARAMETER_REQUEST:
            self._parameter(parameter_request_untrusted(buf, off, n))
        else:
            self._strange(topic_id, now)
            return False
        return True

    def _time(self, now: int) -> None:
        """A board that asks for the time is connected, or shows that it is not when it asks too early."""
        self.output.post(time_answer(self, now))
        self.pump(now)
        last, self.last_time, self.connected_at = self.last_time, now, now
        early = last is not None and now - last < _TIME_PERIOD and self._settle_at is None
        if early and self.state == SYNCED and not self._open_asks:
            self.resets += 1
            self.roster.restart()
            self.tell(BoardReset(self.label))
            self._told_ready = False
            self._first_ask = now
            self._ask(now)
        elif self._open_asks or self.state != SYNCED:
            self._answered(now)

    def _named(self, half: int, info: TopicInfo, now: int) -> None:
        """The board names a topic, or one half of a service."""
        self._answered_topics(now)
        self.connected_at = now
        self.roster.named(half, info)
        if self.roster.in_doubt and all(endpoint.confirmed for endpoint in self.roster.endpoints.values()):
            self._be_sure()

    def _answered_topics(self, now: int) -> None:
        if self.state != SYNCED or self.node is None:
            self._answered(now)
        self._settle_at = now + self.core.limits.settle
        self.wake(self._settle_at)
        self._open_asks.clear()

    def _log(self, level: int, text: str) -> None:
        self.core.tell(BoardLog(self.label, level, text))
        self.meet()
        if self.node is not None:
            self.node.log(level, text)

    def _parameter(self, name: str) -> None:
        self.meet()
        self.output.post(parameter_answer(self, name))
        self.pump(self._now)

    def _strange(self, topic_id: int, now: int) -> None:
        """A frame on an id that the board has not named: something was lost, or it began anew with other topics."""
        self.unknown += 1
        if topic_id >= ID_FIRST_TOPIC or topic_id > ID_TX_STOP:
            self.report(
                "unknown-topic-id",
                subject=str(topic_id),
                what=f"{{n}} message{{s}} of {self.who} on topic id {topic_id} passed over",
                why=f"Tried to publish before configured, topic id {topic_id}: it has not named that topic",
                remedy="Nothing: the board is asked again",
            )
        if now >= self._asked_at + self.core.limits.ask:
            self._ask(now, again=self._settle_at is not None)
            self._plan(now)
