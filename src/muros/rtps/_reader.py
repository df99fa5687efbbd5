"""The receiving side of a topic: a stateful reader, best effort or reliable (DDSI-RTPS 2.3, 8.4.10 to 8.4.12).

Theory of operation. Each matched writer has a proxy. From a best-effort one a sample is delivered if it is newer
than all before. From a reliable one samples are delivered in order, each once: `expected` is the next one; what
comes too early waits, within a `window` of numbers and `memory` bytes, and what lies outside is dropped, for it
will be asked for again. GAPs and the first number of a HEARTBEAT move `expected` over what shall not or can not
come any more. A HEARTBEAT is answered by an ACKNACK that says what is missing, and NACK_FRAG for samples of which
fragments are there. What was asked for is not asked for again before `hold_off`, unless some of it has come.

Some writers send heartbeats only every few seconds, so the reader does not wait for them where it knows better:
what has been overtaken by later samples, and fragments that have stopped coming, are asked for after `hold_off`;
and what does not come after all is asked for again, less and less often.

A reader that has just met a writer knows nothing of it: it says so with an ACKNACK of its own accord, repeated
until a HEARTBEAT comes.

The receiver of samples may refuse one (`deliver` returns False): it waits, and nothing behind it is acknowledged,
so that a writer that keeps all stops, until `resume`.
"""

from collections.abc import Iterable
from typing import Final, Protocol

from muros.rtps._endpoint import NEVER, Place, Problem, Report, Send, first_count, newer, next_slot
from muros.rtps._fragments import FRAGMENT_COST, Assembly, fragments_of
from muros.rtps._parameters import key_hash_of
from muros.rtps._settings import READER_DEFAULTS, ReaderSettings
from muros.rtps._values import EntityId, Guid, GuidPrefix, split_guid
from muros.rtps._wire import MAX_SET, Data, DataFrag, Gap, Heartbeat, HeartbeatFrag, acknack, nack_frag
from muros.rtps._writer_proxy import WriterProxy

__all__ = ["Deliver", "ReaderCore"]

SAMPLE_COST: Final = 500
"""Bytes of memory that a waiting sample takes besides its payload."""

NACK_FRAGS_MOST: Final = 8
"""Incomplete samples whose fragments are asked for at once."""

PATIENT_HELLOS: Final = 3
"""A patient writer is given the time to speak first in which others would be asked so often."""

ASSEMBLIES_MOST: Final = 8
"""Samples of one best-effort writer put together at the same time."""


class Deliver(Protocol):
    """Takes a sample: False refuses it for now, until `ReaderCore.resume`.

    Called from within the core: must not raise, and not call the core.
    """

    def __call__(self, writer: Guid, sample: Data, /) -> bool:
        """`sample` is the DATA submessage, or what one would have been that came in fragments."""


class ReaderCore:
    """One reader. Calls with `now` (ns, monotonic) may change `deadline`; look at it afterwards.

    guid: the reader's GUID. send: takes what is to be sent, deliver: what has arrived; both are called from within
    the methods. reliable: nothing of reliable writers may be lost. report: told of `Problem`s.

    Events must come from `parse_untrusted` and be meant for this reader; those of unknown writers are ignored.
    """

    __slots__ = (
        "_deliver", "_entity", "_proxies", "_report", "_send", "_timed", "arrived", "due", "guid", "rejected",
        "reliable", "settings",
    )  # fmt: skip

    def __init__(
        self,
        guid: Guid,
        send: Send,
        deliver: Deliver,
        *,
        reliable: bool = True,
        settings: ReaderSettings = READER_DEFAULTS,
        report: Report | None = None,
    ) -> None:
        self.guid: Final = guid
        self.reliable: Final = reliable
        self.settings: Final = settings
        self._entity = split_guid(guid)[1]
        self._send = send
        self._deliver = deliver
        self._report = report
        self._proxies: dict[tuple[GuidPrefix, EntityId], WriterProxy] = {}
        self._timed: dict[WriterProxy, None] = {}  # those that wait for a time
        self.rejected = 0
        """Samples for which the resource limits had no room. Reliable ones come again."""
        self.arrived = 0
        """When the sample came that is being delivered."""
        self.due = NEVER
        """When `tick` is needed next, `NEVER` = not before something else happens."""

    @property
    def deadline(self) -> int | None:
        """When `tick` is needed next; None = not before something else happens."""
        return None if self.due == NEVER else self.due

    @property
    def writers(self) -> tuple[WriterProxy, ...]:
        """The matched writers."""
        return tuple(self._proxies.values())

    @property
    def held(self) -> int:
        """Bytes of memory taken by samples that are not delivered yet."""
        return sum(proxy.held for proxy in self._proxies.values())

    def match_writer(
        self,
        writer: Guid,
        places: Iterable[Place],
        now: int,
        *,
        reliable: bool,
        hello_base: int = 1,
        patient: bool = False,
        known: int = 0,
    ) -> None:
        """Samples of this writer are wanted from now on (8.4.10.1); what is said to it goes to each of `places`.

        hello_base: where the numbers begin in the ACKNACK that asks for nothing but a HEARTBEAT. patient: the writer
        sends one by itself, and may be answered together with others (`ReaderSettings.together`). known: samples up
        to this one are here already. For a writer that is matched already only the places are changed; it is then
        asked anew what it has.
        """
        key = split_guid(writer)
        proxy = self._proxies.get(key)
        if proxy is not None:
            before, proxy.places = proxy.places, tuple(places)
            if proxy.reliable and proxy.places != before:
                proxy.hellos = 0
                self._hello(proxy, now)
            return
        proxy = self._proxies[key] = WriterProxy(*key, tuple(places), self.reliable and reliable)
        proxy.hello_base = hello_base
        proxy.sent_count = proxy.sent_fragment_count = first_count(now)
        proxy.patient = patient and self.settings.together > 0
        if proxy.reliable and known:
            proxy.expected = known + 1
            proxy.last = known
            self._send_to(proxy, [self._acknack(proxy, [], final=True)])
        elif proxy.reliable and proxy.patient:
            proxy.hellos = min(PATIENT_HELLOS, self.settings.hellos)
            proxy.hello_at = now + (self.settings.hello_period << proxy.hellos)
            self._wake(proxy, proxy.hello_at)
        elif proxy.reliable:
            self._hello(proxy, now)

    def known_from(self, writer: Guid) -> int:
        """Everything up to this sample of a reliable writer was delivered and nothing waits; 0 = nothing is sure."""
        proxy = self._proxies.get(split_guid(writer))
        if proxy is None or not proxy.reliable or proxy.paused or proxy.pending or proxy.count is None:
            return 0
        return proxy.expected - 1

    def next_of(self, writer: Guid) -> int:
        """The sample that is delivered next of a matched writer."""
        return self._proxies[split_guid(writer)].expected

    def unmatch_writer(self, writer: Guid) -> None:
        """The writer has gone or no longer fits; what had come too early is dropped."""
        proxy = self._proxies.pop(split_guid(writer), None)
        if proxy is not None:
            self._timed.pop(proxy, None)
            if proxy.pending:
                self._tell(Problem.SAMPLES_LOST, proxy, len(proxy.pending))
            proxy.pending.clear()
            proxy.came.clear()
            proxy.assemblies.clear()
            proxy.irrelevant.clear()
            proxy.held = 0

    def on_data(self, event: Data, now: int) -> None:
        """A sample has come (8.4.12.2)."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None:
            return
        number = event.sequence
        if not proxy.reliable:
            if number >= proxy.expected:
                self.arrived = now
                self._deliver_newer(proxy, event)
        elif number == proxy.expected and not proxy.paused:
            if proxy.assemblies:
                self._forget_assembly(proxy, number)
            if number <= proxy.asked_to:
                proxy.progress = True
            self.arrived = now
            if self._deliver(proxy.guid, event):
                proxy.expected = number + 1
                if proxy.pending or proxy.irrelevant:
                    self._advance(proxy)
            else:
                self._refused(proxy, event, now)
        else:
            self._take_early(proxy, event, now)

    def awaits(self, writer: Guid, sequence: int) -> bool:
        """Whether this sample of a writer may be given by hand: it is the next one, and nothing waits."""
        proxy = self._proxies.get(split_guid(writer))
        if proxy is None or proxy.paused or proxy.assemblies:
            return False
        return proxy.expected == sequence or (not proxy.reliable and proxy.expected < sequence)

    def give(self, event: Data, now: int) -> bool:
        """Deliver a sample that it awaits; False = it was refused, and is not here."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None:
            return True  # its writer has gone meanwhile
        self.arrived = now
        if not self._deliver(proxy.guid, event):
            return False
        proxy.expected = event.sequence + 1
        return True

    def pass_by(self, writer: Guid, sequence: int) -> None:
        """A sample that it awaits is for somebody else."""
        proxy = self._proxies.get(split_guid(writer))
        if proxy is not None:
            proxy.expected = sequence + 1

    def on_data_frag(self, event: DataFrag, now: int) -> None:
        """Fragments of a sample have come (8.4.14.1)."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None:
            return
        number = event.sequence
        if number < proxy.expected or number in proxy.pending or number in proxy.irrelevant:
            return
        if proxy.reliable and number >= proxy.expected + self.settings.window:
            return
        assembly = proxy.assemblies.get(number)
        if assembly is None:
            total = fragments_of(event.sample_size, event.fragment_size)
            if event.sample_size + total * FRAGMENT_COST > self.settings.memory:
                self._refuse(proxy, event)
                return
            assembly = proxy.assemblies[number] = Assembly(event, now)
            if proxy.reliable:
                self._overtaken(proxy, number - 1, now)
            else:
                self._limit_assemblies(proxy)
                self._wake(proxy, now + self.settings.assembly_time)
        elif not assembly.fits(event):
            self._tell(Problem.INCONSISTENT, proxy, 1)
            return
        proxy.held += assembly.add(event)
        proxy.fragment_at = now
        if number <= proxy.asked_to:
            proxy.progress = True
        if assembly.complete():
            self._forget_assembly(proxy, number)
            self.on_data(assembly.sample(), now)
        elif proxy.held > self.settings.memory:
            self._make_room(proxy)

    def on_heartbeat(self, event: Heartbeat, now: int) -> None:
        """A reliable writer says what it has (8.4.12.2)."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None or not proxy.reliable or not newer(event.count, proxy.count):
            return
        is_first, proxy.count = proxy.count is None, event.count
        proxy.hello_at = NEVER
        if event.first > proxy.expected:
            if is_first:
                proxy.skip = max(proxy.skip, event.first)  # gone before this reader came
            else:
                proxy.floor = max(proxy.floor, event.first)
            self._advance(proxy)
        proxy.last = max(proxy.last, event.last)
        proxy.owes |= not event.final
        if proxy.expected <= proxy.last or proxy.owes:
            self._answer_soon(proxy, now)

    def on_heartbeat_frag(self, event: HeartbeatFrag, now: int) -> None:
        """A reliable writer says which fragments of a sample it has sent (8.3.7.6)."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None or not proxy.reliable or not newer(event.count, proxy.fragment_count):
            return
        proxy.fragment_count = event.count
        number = event.sequence
        if not proxy.expected <= number < proxy.expected + self.settings.window:
            return
        if number in proxy.pending or number in proxy.irrelevant:
            return
        assembly = proxy.assemblies.get(number)
        if assembly is not None:
            missing = assembly.missing(MAX_SET, event.last_fragment)
        else:
            missing = list(range(1, min(event.last_fragment, MAX_SET) + 1))
        if missing:
            self._send_to(proxy, [self._nack_frag(proxy, number, missing)])

    def on_gap(self, event: Gap, now: int) -> None:
        """Samples that shall not be waited for (8.4.12.2)."""
        proxy = self._proxies.get((event.source, event.writer))
        if proxy is None or not proxy.reliable:
            return
        expected = proxy.expected
        end = expected + self.settings.window
        if event.start <= expected < event.base:
            proxy.skip = max(proxy.skip, event.base)
        elif event.start < end:
            proxy.irrelevant.update(range(max(event.start, expected), min(event.base, end)))
        proxy.irrelevant.update(number for number in event.numbers if expected <= number < end)
        proxy.irrelevant -= proxy.pending.keys()
        for number in proxy.irrelevant & proxy.assemblies.keys():
            self._forget_assembly(proxy, number)
        if event.start <= proxy.asked_to:
            proxy.progress = True
        self._advance(proxy)

    def resume(self, now: int) -> None:
        """Offer samples that were refused once more, and tell their writers what there is room for."""
        for proxy in tuple(self._proxies.values()):
            if proxy.paused:
                before = proxy.expected
                proxy.paused = False
                self._advance(proxy)
                if proxy.expected > before:
                    proxy.owes = True
                    self._answer(proxy, now)

    def tick(self, now: int) -> int | None:
        """Do what is due at `now`; returns the new `deadline`."""
        self.due = NEVER
        for proxy in tuple(self._timed):
            if proxy.hello_at <= now:
                self._hello(proxy, now)
            if proxy.answer_at <= now:
                self._answer(proxy, now)
            stale = NEVER
            if proxy.assemblies and not proxy.reliable:
                stale = self._drop_stale(proxy, now)
            at = min(proxy.hello_at, proxy.answer_at, stale)
            if at < NEVER:
                self.due = min(self.due, at)
            else:
                self._timed.pop(proxy, None)
        return self.deadline

    # --- Delivering --------------------------------------------------------------------------------------

    def _deliver_newer(self, proxy: WriterProxy, event: Data) -> None:
        """Best effort: what is older than this will not be delivered any more, and what is refused is lost."""
        proxy.expected = event.sequence + 1
        for number in [number for number in proxy.assemblies if number <= event.sequence]:
            self._forget_assembly(proxy, number)
        if not self._deliver(proxy.guid, event):
            self._tell(Problem.SAMPLES_LOST, proxy, 1)

    def _take_early(self, proxy: WriterProxy, event: Data, now: int) -> None:
        """Keep a sample that is not the next to deliver, unless it was delivered or there is no place for it."""
        number = event.sequence
        if not proxy.expected < number < proxy.expected + self.settings.window:
            return
        if number in proxy.pending or number in proxy.irrelevant:
            return
        self._forget_assembly(proxy, number)
        if number <= proxy.asked_to:
            proxy.progress = True
        if self._has_room(proxy, event):
            self._hold(proxy, event, now)
            if proxy.held > self.settings.memory:
                self._make_room(proxy)
        self._overtaken(proxy, number, now)

    def _refused(self, proxy: WriterProxy, event: Data, now: int) -> None:
        """The receiver has no room for the next sample: it waits, if need be instead of one that came early."""
        if not self._has_room(proxy, event):
            if not proxy.pending:
                self._overtaken(
                    proxy, event.sequence, now
                )  # others' samples have all the room: it has to come again
                return
            self._drop(proxy, max(proxy.pending))
        self._hold(proxy, event, now)
        proxy.paused = True

    def _has_room(self, proxy: WriterProxy, event: Data) -> bool:
        """Whether the resource limits have room for one more sample that waits; count and tell if not."""
        limit, limit_of_one = self.settings.limit, self.settings.limit_of_one
        if not limit and not limit_of_one:
            return True
        waiting = [sample for each in self._proxies.values() for sample in each.pending.values()]
        if limit and len(waiting) >= limit:
            problem = Problem.SAMPLES_FULL
        else:
            instance = key_hash_of(event.inline_qos)
            if not limit_of_one or sum(key_hash_of(w.inline_qos) == instance for w in waiting) < limit_of_one:
                return True
            problem, limit = Problem.INSTANCE_FULL, limit_of_one
        self.rejected += 1
        self._tell(problem, proxy, limit)
        return False

    def _hold(self, proxy: WriterProxy, event: Data, now: int) -> None:
        proxy.pending[event.sequence] = event
        proxy.came[event.sequence] = now
        proxy.held += len(event.payload) + SAMPLE_COST

    def _drop(self, proxy: WriterProxy, number: int) -> None:
        """Let go of a sample that waits; it will be asked for again."""
        sample = proxy.pending.pop(number)
        del proxy.came[number]
        proxy.held -= len(sample.payload) + SAMPLE_COST

    def _advance(self, proxy: WriterProxy) -> None:
        """Deliver what has become next, and pass over what will not come."""
        pending, irrelevant, lost = proxy.pending, proxy.irrelevant, 0
        while not proxy.paused:
            number = proxy.expected
            sample = pending.get(number)
            if sample is not None:
                self.arrived = proxy.came[number]
                if not self._deliver(proxy.guid, sample):
                    proxy.paused = True
                    break
                if pending.pop(number, None) is None:
                    break  # the writer was taken away meanwhile
                del proxy.came[number]
                proxy.held -= len(sample.payload) + SAMPLE_COST
                proxy.expected = number + 1
            elif number in irrelevant:
                irrelevant.remove(number)
                proxy.expected = number + 1
            elif number < proxy.skip:
                proxy.expected = number + 1 if pending else proxy.skip
            elif number < proxy.floor:
                proxy.expected = number + 1 if pending else proxy.floor
                lost += proxy.expected - number
                lost -= sum(number < n < proxy.expected for n in irrelevant)
            else:
                break
        expected = proxy.expected
        if irrelevant and not pending:
            irrelevant -= {number for number in irrelevant if number < expected}
        for number in [number for number in proxy.assemblies if number < expected]:
            self._forget_assembly(proxy, number)
        if lost:
            self._tell(Problem.SAMPLES_LOST, proxy, lost)

    def _forget_assembly(self, proxy: WriterProxy, number: int) -> None:
        assembly = proxy.assemblies.pop(number, None)
        if assembly is not None:
            proxy.held -= assembly.cost

    def _make_room(self, proxy: WriterProxy) -> None:
        """Too much memory is taken: drop what will be needed last; it will be asked for again."""
        dropped = 0
        while proxy.held > self.settings.memory and (
            numbers := proxy.pending.keys() | proxy.assemblies.keys()
        ):
            number = max(numbers) if proxy.reliable else min(numbers)
            if number == proxy.expected and proxy.reliable:
                break
            before = proxy.held
            self._forget_assembly(proxy, number)
            if number in proxy.pending:
                self._drop(proxy, number)
            dropped += before - proxy.held
        if dropped:
            self._tell(Problem.MEMORY_FULL, proxy, dropped)

    def _refuse(self, proxy: WriterProxy, event: DataFrag) -> None:
        """A sample is too large: do without it."""
        self._tell(Problem.SAMPLE_TOO_LARGE, proxy, event.sample_size)
        if proxy.reliable:
            proxy.irrelevant.add(event.sequence)
            self._advance(proxy)
        else:
            proxy.expected = event.sequence + 1

    def _limit_assemblies(self, proxy: WriterProxy) -> None:
        """Best effort: the oldest incomplete samples make way for new ones."""
        dropped = 0
        while len(proxy.assemblies) > ASSEMBLIES_MOST:
            self._forget_assembly(proxy, min(proxy.assemblies))
            dropped += 1
        if dropped:
            self._tell(Problem.INCOMPLETE, proxy, dropped)

    def _drop_stale(self, proxy: WriterProxy, now: int) -> int:
        """Best effort: drop samples whose fragments have stopped coming; returns when to look again."""
        oldest = now - self.settings.assembly_time
        stale = [number for number, assembly in proxy.assemblies.items() if assembly.since <= oldest]
        for number in stale:
            self._forget_assembly(proxy, number)
        if stale:
            self._tell(Problem.INCOMPLETE, proxy, len(stale))
        since = min((assembly.since for assembly in proxy.assemblies.values()), default=NEVER)
        return min(NEVER, since + self.settings.assembly_time)

    # --- Answering ---------------------------------------------------------------------------------------

    def _hello(self, proxy: WriterProxy, now: int) -> None:
        """Tell a writer of which nothing is known that somebody is here."""
        proxy.hello_at = NEVER
        if proxy.hellos == self.settings.hellos:
            return
        proxy.hello_at = now + (self.settings.hello_period << proxy.hellos)
        self._wake(proxy, proxy.hello_at)
        proxy.hellos += 1
        base = proxy.hello_base if proxy.count is None else proxy.expected
        self._send_to(proxy, [self._acknack(proxy, [], final=False, base=base)])

    def _answer_soon(self, proxy: WriterProxy, now: int) -> None:
        at = now + self.settings.response_delay
        if proxy.patient:
            at = next_slot(at, self.settings.together)
        if proxy.asked_to >= proxy.expected and not proxy.progress:
            at = max(at, proxy.asked_at + self.settings.hold_off)
        if at <= now:
            self._answer(proxy, now)
        else:
            self._answer_at(proxy, at)

    def _overtaken(self, proxy: WriterProxy, last: int, now: int) -> None:
        """Everything up to `last` has been sent, and something of it may be missing."""
        proxy.last = max(proxy.last, last)
        if proxy.progress or proxy.asked_to < proxy.expected:  # else it was asked for, and will be again
            self._answer_at(proxy, now + self.settings.hold_off)

    def _answer_at(self, proxy: WriterProxy, at: int) -> None:
        if at < proxy.answer_at:
            proxy.answer_at = at
            self._wake(proxy, at)

    def _answer(self, proxy: WriterProxy, now: int) -> None:
        """Say what is there, what is missing, and of which samples fragments are missing (8.3.7.1, 8.3.7.10)."""
        proxy.answer_at = NEVER
        hold_off = self.settings.hold_off
        if proxy.assemblies and (latest := max(proxy.assemblies)) > proxy.last:
            if now - proxy.fragment_at >= hold_off:
                proxy.last = latest  # no more fragments are on their way
            else:
                self._answer_at(proxy, proxy.fragment_at + hold_off)
        expected, pending, irrelevant, assemblies = (
            proxy.expected, proxy.pending, proxy.irrelevant, proxy.assemblies,
        )  # fmt: skip
        end = min(
            proxy.last + 1, expected + min(MAX_SET, self.settings.window, self.settings.limit or MAX_SET)
        )
        wanted = [n for n in range(expected, end) if n not in pending and n not in irrelevant]
        if not wanted and not proxy.owes:
            return
        proxy.owes = False
        missing = [number for number in wanted if number not in assemblies]
        partial = [number for number in wanted if number in assemblies][:NACK_FRAGS_MOST]
        submessages = [self._acknack(proxy, missing, final=not wanted)]
        submessages += [self._nack_frag(proxy, n, assemblies[n].missing(MAX_SET)) for n in partial]
        if wanted:
            proxy.asks = 0 if proxy.progress or proxy.asked_to < expected else proxy.asks + 1
            proxy.asked_at = now
            proxy.asked_to = wanted[-1]
            proxy.progress = False
            if proxy.asks < self.settings.asks:
                self._answer_at(proxy, now + min(2 * hold_off << proxy.asks, self.settings.slowest))
        self._send_to(proxy, submessages)

    def _acknack(
        self, proxy: WriterProxy, missing: list[int], *, final: bool, base: int | None = None
    ) -> bytes:
        proxy.sent_count = proxy.sent_count + 1 & 0xFFFFFFFF
        first = proxy.expected if base is None else base
        return acknack(self._entity, proxy.entity, first, missing, proxy.sent_count, final=final)

    def _nack_frag(self, proxy: WriterProxy, number: int, missing: list[int]) -> bytes:
        proxy.sent_fragment_count = proxy.sent_fragment_count + 1 & 0xFFFFFFFF
        return nack_frag(self._entity, proxy.entity, number, missing[0], missing, proxy.sent_fragment_count)

    def _send_to(self, proxy: WriterProxy, submessages: list[bytes]) -> None:
        for place in proxy.places:
            self._send(submessages, proxy.prefix, place)

    def _wake(self, proxy: WriterProxy, at: int) -> None:
        self._timed[proxy] = None
        self.due = min(self.due, at)

    def _tell(self, problem: Problem, proxy: WriterProxy, number: int) -> None:
        if self._report is not None:
            self._report(problem, proxy.guid, number)
