"""The sending side of a topic: a stateful writer, best effort or reliable (DDSI-RTPS 2.3, 8.4.7 to 8.4.9).

Theory of operation. A sample is sent once to every place where a matched reader listens, addressed to all readers
there. A reliable writer keeps it until the readers have acknowledged it, and knows of each of them (`ReaderProxy`)
up to where it has. While one of them lags it is told by HEARTBEATs what there is: with a sample now and then as
samples flow, and by a timer of each reader that backs off while nothing comes back. When all have everything the
writer is silent. What a reader misses it asks for in ACKNACK or NACK_FRAG; that is sent to it alone, with a GAP for
what it shall not wait for, and a HEARTBEAT behind, so that it asks for more at once. A reader that comes late to a
transient local writer is simply one that lags from the oldest sample kept.

Nothing is sent in floods. What reliable readers have not acknowledged fits a `Window`, and acknowledgement is asked for
in time to keep it open; what goes beyond it waits. A window that stays shut opens by itself after a while: a silent
reader slows the others down, but does not stop them. Repairs, what is beyond the window of one large sample, and the
fragments of best-effort samples leave within an allowance of `burst` bytes that is filled up every `pace`.

A writer that keeps all refuses a sample when `limit` samples wait for acknowledgement. A reader that acknowledges
nothing for `patience` in that situation is set aside: it holds nobody any more, and is served again from what there
is when it returns.
"""

from collections.abc import Callable, Iterable
from typing import Final

from muros.rtps._beats import Beats
from muros.rtps._constants import ENTITYID_UNKNOWN
from muros.rtps._endpoint import NEVER, Place, Problem, Report, Send, newer, next_slot
from muros.rtps._fragments import fragments_of
from muros.rtps._history import Sample
from muros.rtps._keeping import Keeper
from muros.rtps._reader_proxy import Audience, ReaderProxy
from muros.rtps._repairs import Repairs
from muros.rtps._sending import OVERHEAD, WINDOW_LEAST, Allowance, Window, data_of, fragment_of, skips_of
from muros.rtps._settings import WRITER_DEFAULTS, WriterSettings
from muros.rtps._values import Guid, split_guid
from muros.rtps._wire import MAX_SUBMESSAGE, AckNack, NackFrag, info_dst, info_ts

__all__ = ["WriterCore"]

FRAGMENT_HEAD: Final = 32
"""Bytes of a DATA_FRAG between its header and its inline QoS."""

SENTINEL_SIZE: Final = 4
"""Bytes of the mark at the end of a parameter list."""

ASK_LEAST: Final = 8
"""A writer that keeps few samples asks for acknowledgement this often, in samples, ..."""

ASK_MOST: Final = 64
"""... and one that keeps many this often."""

LARGE: Final = 8192
"""Bytes from which on a sample is held back when too much is on its way, though newer ones may push it out."""

EVERYBODY: Final = bytes(12)
"""As destination: whoever listens."""


class WriterCore:
    """One writer. Calls with `now` (ns, monotonic) may change `deadline`; look at it afterwards.

    guid: the writer's GUID; the entity kind in it says whether the topic has a key.
    send: takes what is to be sent; called from within the methods.
    reliable: what readers do not acknowledge is sent again to those that match as reliable ones.
    transient_local: reliable readers that come late and want it get what is kept.
    depth: samples kept of each instance, None = all; with a depth, new samples push old ones out, acknowledged or not.
    lifespan: a sample is not sent any more when older than this (ns); 0 = none.
    endpoint_qos: a parameter list sent with every sample while a reader is matched that expects inline QoS.
    last: the sequence number of the last sample written by an earlier life of the same GUID.
    report: told of `Problem`s. on_room: called when samples are accepted again after `write` has refused one.

    Raises ValueError for settings out of range.
    """

    __slots__ = (
        "_allowance", "_ask_at", "_ask_every", "_audience", "_beat_at", "_beats", "_cursor", "_endpoint_qos",
        "_entity", "_history", "_idle", "_keeper", "_lagging", "_leaving", "_proxies", "_repair_at", "_repairs",
        "_report", "_send", "_unasked", "_unsent", "_window", "due", "guid", "last", "reliable", "sent", "settings",
    )  # fmt: skip

    def __init__(
        self,
        guid: Guid,
        send: Send,
        *,
        reliable: bool = True,
        transient_local: bool = False,
        depth: int | None = 1,
        lifespan: int = 0,
        endpoint_qos: bytes = b"",
        last: int = 0,
        settings: WriterSettings = WRITER_DEFAULTS,
        report: Report | None = None,
        on_room: Callable[[], object] | None = None,
    ) -> None:
        self.guid: Final = guid
        self.reliable: Final = reliable
        self.settings: Final = settings
        self.last = last
        """Sequence number of the last sample written."""
        self.sent = last
        """Everything up to here has left; less than `last` while fragments wait."""
        self._entity = split_guid(guid)[1]
        self._send = send
        self._report = report
        self._endpoint_qos = endpoint_qos
        self._audience = Audience()
        self._proxies = self._audience.proxies
        self._idle: dict[ReaderProxy, None] = {}  # those that have everything
        self._lagging: dict[ReaderProxy, None] = {}  # those that do not
        self._keeper = Keeper(
            depth,
            self._lagging,
            settings,
            retains=reliable and transient_local,
            lifespan=lifespan,
            tell=self._tell,
            on_room=on_room,
        )
        self._history = self._keeper.history
        self._unsent: list[int] = []  # samples waiting to leave
        self._leaving: Sample | None = None  # the first of them, when part of it has left:
        self._cursor = 0  # so many of its fragments
        self._allowance = Allowance(settings.burst, settings.pace)
        self._window = Window(settings.window)
        self._repairs = Repairs(
            self._entity,
            send,
            self._history,
            self._allowance,
            settings.fragment_size,
            settings.hold_off,
            together=settings.together > 0,
        )
        self._beats = Beats(self._entity, send, self._keeper, self._audience)
        self._ask_at = 0
        kept = settings.limit if depth is None else max(depth, ASK_LEAST * 4)
        self._ask_every = max(1, min(ASK_MOST, kept // 4))
        self._unasked = 0
        self._repair_at = NEVER
        self._beat_at = NEVER  # or earlier than it need be
        self.due = NEVER
        """When `tick` is needed next, `NEVER` = not before something else happens."""

    @property
    def deadline(self) -> int | None:
        """When `tick` is needed next; None = not before something else happens."""
        return None if self.due == NEVER else self.due

    @property
    def readers(self) -> tuple[ReaderProxy, ...]:
        """The matched readers."""
        return tuple(self._proxies.values())

    def is_heard_by(self, reader: Guid) -> bool:
        """Whether a matched reader has answered."""
        proxy = self._proxies.get(split_guid(reader))
        return proxy is not None and proxy.count is not None

    @property
    def held(self) -> int:
        """Samples kept."""
        return len(self._history)

    def held_of(self, instance: bytes) -> int:
        """Samples kept of an instance."""
        return self._history.count(instance)

    @property
    def acknowledged(self) -> int:
        """All reliable readers that are not set aside have everything up to this sequence number."""
        return self._keeper.acknowledged(self.sent)

    def match(
        self,
        reader: Guid,
        places: Iterable[Place],
        now: int,
        *,
        reliable: bool,
        transient_local: bool = False,
        expects_inline_qos: bool = False,
        patient: bool = False,
    ) -> None:
        """A reader wants the samples from now on (8.4.9.1.1); `transient_local`: those kept, too. patient: it may be
        told a little later, together with others (`WriterSettings.together`), and is given what is kept unasked.

        Everything for it goes to each of `places`. For a reader that is matched already only they are changed; it is
        then told anew what there is.
        """
        self._beats.begin(now)
        key = split_guid(reader)
        proxy = self._proxies.get(key)
        if proxy is not None:
            before = proxy.places
            self._audience.move(proxy, tuple(places))
            if proxy.reliable and proxy.places != before:
                self._beats.send(proxy, self.sent, final=False)
            return
        start = self.sent + 1
        if self._keeper.retains and reliable and transient_local:
            self._keeper.expire(now)
            start = self._lowest()
        proxy = ReaderProxy(*key, tuple(places), self.reliable and reliable, start)
        proxy.inline_qos = expects_inline_qos
        proxy.patient = patient and self.settings.together > 0
        self._audience.add(proxy)
        if proxy.reliable:
            lags = proxy.acked < self.sent
            if lags:
                self._now_lags(proxy, now)
            else:
                self._idle[proxy] = None
            if proxy.patient:
                self._repairs.offer(proxy, self._lowest(), self.sent, now)
                self._repair_soon(proxy, now)
            else:
                self._beats.send(proxy, self.sent, final=not lags)

    def unmatch(self, reader: Guid, now: int) -> None:
        """The reader has gone or no longer fits; nothing happens when it is not matched."""
        proxy = self._proxies.get(split_guid(reader))
        if proxy is None:
            return
        self._idle.pop(proxy, None)
        self._lags_no_more(proxy)
        self._repairs.drop(proxy)
        self._audience.drop(proxy)
        if not self._lagging:
            self._window.reset(now)
        if not self._audience.routes:
            self._unsent.clear()
            self._leaving = None
            self._cursor = 0
            self.sent = self.last
        self._keeper.release(self.sent, now)

    def write(
        self,
        payload: bytes | tuple[bytes, ...],
        now: int,
        source_time: int | None = None,
        inline_qos: bytes = b"",
        *,
        key: bool = False,
        instance: bytes = b"",
        last: bool = False,
        to: Guid | None = None,
    ) -> int | None:
        """Write a sample; returns its sequence number, or None when a writer that keeps all has no room now.

        payload: begins with its encapsulation; may come in pieces, which are joined in the datagram. source_time: ns
        since 1970. inline_qos: a little-endian parameter list. instance: names the instance of a topic with a key.
        key: the payload is only the key. last: the instance ends here, and is forgotten when all readers know. to:
        only this matched reader gets the sample, the others get a GAP.

        ValueError when the inline QoS are too large, the time does not fit RTPS, or `to` is not matched.
        """
        settings = self.settings
        stamp = info_ts(source_time)
        qos = inline_qos
        if self._endpoint_qos and self._audience.with_qos:
            qos = inline_qos[:-SENTINEL_SIZE] + self._endpoint_qos
        sequence = self.last + 1
        pieces = payload if isinstance(payload, tuple) else (payload,)
        sample = Sample(sequence, pieces, stamp, qos, key, instance, last)
        whole = sample.size + len(qos) <= settings.fragment_size
        if not whole and settings.fragment_size + len(qos) > MAX_SUBMESSAGE - FRAGMENT_HEAD:
            raise ValueError(f"inline QoS of {len(qos)} bytes do not fit beside a fragment")
        if to is not None:
            sample.to = split_guid(to)
            if sample.to not in self._proxies:
                raise ValueError(f"reader {to.hex()} is not matched")
        keeper = self._keeper
        if self._audience.reliable or keeper.retains or self._unsent or (self._audience.routes and not whole):
            if not keeper.add(sample, self.sent, now):
                self.due = min(self.due, keeper.patience_ends())
                return None
            if sample.expires < self.due:
                self.due = sample.expires
        self.last = sequence
        if not self._audience.routes:
            self.sent = sequence
        elif self._unsent or not whole or (self._window.out >= self._window.end and self._paces(sample)):
            self._unsent.append(sequence)
            self._pump(now)
        else:
            self._transmit(sample, now)
        if last and not self._lagging:
            self._keeper.release(self.sent, now)
        return sequence

    @property
    def rests(self) -> bool:
        """Whether everybody has everything, and nothing is kept for those who come late."""
        return not self._lagging and not self._unsent and not self._keeper.retains

    @property
    def changes(self) -> int:
        """Counts the comings, goings and moves of readers."""
        return self._audience.changes

    def give(self) -> int:
        """The number of a sample that is given to all readers by hand. Only while it `rests`."""
        self.last = self.sent = sequence = self.last + 1
        for proxy in self._proxies.values():
            proxy.acked = sequence
        return sequence

    def take_back(self, sequence: int) -> bool:
        """A sample that was given by hand was refused and is to go the common way; False when it is not the last."""
        if self.last != sequence:
            return False
        self.last = self.sent = sequence - 1
        for proxy in self._proxies.values():
            proxy.acked = sequence - 1
        return True

    def on_acknack(self, event: AckNack, now: int) -> None:
        """A reader says what it has and what it misses (8.4.7.5). Others' and old ones are ignored."""
        proxy = self._proxies.get((event.source, event.reader))
        if proxy is None or not proxy.reliable:
            return
        if not newer(event.count, proxy.count):
            self._begin_anew(proxy, event)
            return
        is_first, proxy.count = proxy.count is None, event.count
        acked = min(event.base - 1, self.sent)
        progress = acked > proxy.acked
        if progress:
            self._advance(proxy, acked, now)
        answered = missed = False
        if event.missing:
            answered, missed = self._repairs.want(proxy, event, self._lowest(), self.sent, now)
        if missed:
            self._lost(now)
        if answered:
            self._repair_soon(proxy, now)
        elif not event.final and proxy.patient:
            self._repairs.waiting[proxy] = None
            self._repair_soon(proxy, now)
        elif not event.final:
            # One that is not final asks for an answer. The answer must not ask back when nothing has changed:
            # two such sides would not come to rest.
            self._beats.send(proxy, self.sent, final=proxy in self._idle or not (progress or is_first))
        if progress:
            if not self._lagging:
                self._window.completed(now)
            elif self._window.awaits:
                self._window.acknowledged(self.acknowledged, now)
            self._adapt()
            if self._unsent:
                self._pump(now)
            self._keeper.release(self.sent, now)

    def _begin_anew(self, proxy: ReaderProxy, event: AckNack) -> None:
        """An old count counts where a reader has forgotten us, has met us again, and asks what there is."""
        if event.base <= 1 and not event.missing and not event.final and event.count != proxy.count:
            proxy.count, proxy.fragment_count = event.count, None
            self._beats.send(proxy, self.sent, final=proxy in self._idle)

    def on_nack_frag(self, event: NackFrag, now: int) -> None:
        """A reader misses fragments of a sample (8.3.7.10)."""
        proxy = self._proxies.get((event.source, event.reader))
        if proxy is None or not proxy.reliable or not newer(event.count, proxy.fragment_count):
            return
        proxy.fragment_count = event.count
        if proxy.acked < event.sequence <= self.sent:
            if self._repairs.want_fragments(proxy, event):
                self._lost(now)
            self._repair_soon(proxy, now)

    def assert_liveliness(self, now: int) -> None:
        """Say that a writer with manual liveliness is alive (8.3.7.5: HEARTBEAT with the liveliness flag)."""
        beat = self._beats.for_all(self.sent, final=True, alive=True)
        for place in self._audience.routes:
            self._send([beat], None, place)

    def tick(self, now: int) -> int | None:
        """Do what is due at `now`; returns the new `deadline`."""
        self._pump(now)
        self._repair(now)
        expires = self._keeper.expire(now)
        if self._beat_at <= now:
            self._beat(now)
        self._keeper.retry(self.sent, now)
        self.due = min(self._beat_at, expires, self._repair_at, self._keeper.patience_ends())
        if self._unsent:
            self.due = min(self.due, now + self.settings.pace)
        return self.deadline

    # --- Sending -----------------------------------------------------------------------------------------

    def _transmit(self, sample: Sample, now: int) -> None:
        """Send a sample that fits a datagram to everybody."""
        if sample.to is not None:
            self._transmit_to(sample, now)
            return
        self.sent = sample.sequence
        submessages = [sample.stamp, *data_of(sample, ENTITYID_UNKNOWN, self._entity)]
        if self._audience.reliable:
            submessages += self._expect_and_ask(sample.size, now)
        send = self._send
        for place in self._audience.routes:
            send(submessages, None, place)

    def _transmit_to(self, sample: Sample, now: int) -> None:
        """Send a sample that fits a datagram to the one it is for, and tell the others not to wait for it."""
        self.sent = sample.sequence
        beat = self._expect_and_ask(sample.size, now)
        proxy = self._proxies.get(sample.to) if sample.to else None
        if proxy is not None:
            submessages = [sample.stamp, *data_of(sample, proxy.entity, self._entity), *beat]
            for place in proxy.places:
                self._send(submessages, proxy.prefix, place)
        self._skip(sample, beat)

    def _skip(self, sample: Sample, beat: list[bytes]) -> None:
        """Tell all but the one a sample is for that it is not for them."""
        everybody = [info_dst(EVERYBODY), *beat] if beat else []
        for place, submessages in skips_of(sample, self._proxies.values(), self._entity):
            self._send(submessages + everybody, None, place)

    def _pump(self, now: int) -> None:
        """Send what waits, as far as the allowance goes."""
        unsent = self._unsent
        if not unsent:
            return
        size = self.settings.fragment_size
        while unsent:
            # One that has begun to leave is finished even when newer ones have pushed it out: else a writer that
            # keeps one sample and is quicker than its allowance would never finish any.
            sample = self._leaving or self._history.get(unsent[0])
            if sample is None:
                self.sent = unsent[0]
            elif not self._cursor and not self._may_begin(sample, now):
                return
            elif sample.size + len(sample.inline_qos) <= size:
                self._transmit(sample, now)
            else:
                self._leaving = sample
                if not self._pump_fragments(sample, now):
                    return
            self._leaving = None
            self._cursor = 0
            del unsent[0]
        if not self._lagging:
            self._keeper.release(self.sent, now)

    def _pump_fragments(self, sample: Sample, now: int) -> bool:
        """Send what has not been sent of a large sample; False when the allowance is used up before its end."""
        reader, prefix, places = ENTITYID_UNKNOWN, None, self._audience.routes
        if sample.to is not None:
            proxy = self._proxies.get(sample.to)
            reader, prefix = sample.to[1], sample.to[0]
            places = proxy.places if proxy is not None else ()
        window, size = self._window, self.settings.fragment_size
        total = fragments_of(sample.size, size)
        while self._cursor < total:
            if not (self._audience.reliable and window.out < window.end):
                if not self._may_send(now):
                    return False
                self._allowance.spend(size * len(places))
            self._cursor += 1
            content = fragment_of(sample, self._cursor, size, reader, self._entity)
            submessages = [sample.stamp, content]
            if self._cursor == total:
                self.sent = sample.sequence
                if self._audience.reliable:
                    self._expect(now)
                    submessages.append(self._ask(now))
            window.out += size
            for place in places:
                self._send(submessages, prefix, place)
        if sample.to is not None:
            self._skip(sample, [])
        return True

    def _repair(self, now: int) -> None:
        """Send again what readers want, to them alone, as far as the allowance goes."""
        repairs = self._repairs
        if not repairs.waiting:
            self._repair_at = NEVER
            return
        self._beats.ask_together(repairs.run(now, self._asking_heartbeat), self.sent)
        self._repair_at = now + self.settings.pace if repairs.waiting else NEVER
        self.due = min(self.due, self._repair_at)

    def _repair_soon(self, proxy: ReaderProxy, now: int) -> None:
        """Send what a reader wants; with what others are about to want, if they are served together."""
        together = self.settings.together
        if together:
            self._repair_at = min(self._repair_at, next_slot(now, together) if proxy.patient else now)
            self.due = min(self.due, self._repair_at)
        else:
            self._repair(now)

    def _paces(self, sample: Sample) -> bool:
        """Whether the window counts for a sample.

        Small ones of a writer that keeps few had better leave at once, for newer ones would push them out.
        """
        return bool(self._audience.reliable) and (self._history.depth is None or sample.size >= LARGE)

    def _may_begin(self, sample: Sample, now: int) -> bool:
        """Whether one more sample may leave: as reliable readers keep up."""
        if not self._paces(sample):
            return True
        wait = self._window.waits(now, self.settings.hold_off)
        if wait:
            self.due = min(self.due, now + wait)
        return not wait

    def _may_send(self, now: int) -> bool:
        """Whether the allowance is not used up; if it is, `tick` is needed after `pace`."""
        if self._allowance.allows(now):
            return True
        self.due = min(self.due, now + self.settings.pace)
        return False

    # --- Heartbeats --------------------------------------------------------------------------------------

    def _expect_and_ask(self, size: int, now: int) -> list[bytes]:
        """A sample of `size` bytes leaves: if reliable readers get it, acknowledgement may be asked for with it."""
        if not self._audience.reliable:
            return []
        if self._idle:
            self._expect(now)
        self._unasked += 1
        window = self._window
        window.out += size + OVERHEAD
        if now >= self._ask_at or self._unasked >= self._ask_every or window.out >= window.ask:
            return [self._ask(now)]
        return []

    def _ask(self, now: int) -> bytes:
        """A heartbeat for everybody that asks for acknowledgement, to go with a sample."""
        self._unasked = 0
        self._window.asked(self.sent, now)
        self._ask_at = now + self.settings.heartbeat_period // 2
        return self._beats.for_all(self.sent)

    def _asking_heartbeat(self, proxy: ReaderProxy) -> bytes:
        return self._beats.for_one(proxy, self.sent)

    def _beat(self, now: int) -> None:
        """Ask lagging readers for acknowledgement whose time has come."""
        due = [proxy for proxy in self._lagging if proxy.due <= now]
        for proxy in due:
            proxy.interval = min(proxy.interval * 2, self.settings.heartbeat_slowest)
            proxy.due = now + proxy.interval
        self._beats.ask([proxy for proxy in due if not proxy.patient], self.sent)
        self._beats.ask_together([proxy for proxy in due if proxy.patient], self.sent)
        self._beat_at = min((proxy.due for proxy in self._lagging), default=NEVER)

    # --- Readers -----------------------------------------------------------------------------------------

    def _expect(self, now: int) -> None:
        """Something was sent: the readers that had everything lag now."""
        if self._idle:
            for proxy in self._idle:
                self._now_lags(proxy, now)
            self._idle.clear()

    def _now_lags(self, proxy: ReaderProxy, now: int) -> None:
        proxy.since = now
        proxy.interval = self.settings.heartbeat_period
        proxy.due = now + proxy.interval
        self._lagging[proxy] = None
        self._beat_at = min(self._beat_at, proxy.due)
        self.due = min(self.due, proxy.due)

    def _lags_no_more(self, proxy: ReaderProxy) -> None:
        self._lagging.pop(proxy, None)
        if not self._lagging:
            self._beat_at = NEVER

    def _advance(self, proxy: ReaderProxy, acked: int, now: int) -> None:
        """A reader has more than before."""
        if proxy.aside:
            proxy.aside = False
            self._tell(Problem.READER_RETURNED, proxy, max(0, self._lowest() - 1 - proxy.acked))
        proxy.acked = acked
        for number in [number for number in proxy.wanted if number <= acked]:
            del proxy.wanted[number]
        if acked == self.sent:
            self._lags_no_more(proxy)
            self._repairs.drop(proxy)
            proxy.due = NEVER
            self._idle[proxy] = None
        else:
            self._now_lags(proxy, now)

    def _lost(self, now: int) -> None:
        """Readers miss something: send less at once."""
        self._window.lost(now, self.settings.hold_off)
        self._adapt()

    def _adapt(self) -> None:
        """What may leave beside the window goes by what the readers have shown to take."""
        self._allowance.burst = min(self.settings.burst, max(self._window.size, WINDOW_LEAST))

    def _lowest(self) -> int:
        return self._keeper.lowest(self.sent)

    def _tell(self, problem: Problem, proxy: ReaderProxy, number: int) -> None:
        if self._report is not None:
            self._report(problem, proxy.guid, number)
