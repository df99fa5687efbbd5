"""What all parts of one space share, whatever its engine: clock, timers, limits, findings, and the order of callbacks.

Callbacks never run one inside another. Whoever has something to tell puts a task into `queue`; the outermost
`write` (or `tick`) drains it. So two entities that write in each other's callbacks take turns instead of
recursing, and after `callbacks` of them the rest is left to the next tick, so that the caller's event loop
breathes. Graph events and first findings are `notices`: told at the end of the call that made them.
"""

from collections import deque
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from typing import Final, Protocol

from muros.findings import Findings, Severity
from muros.space._graph import GraphEvent
from muros.space._loop import LoopDriver
from muros.space._timers import Timers

__all__ = ["Core", "Engine", "Limits", "Task"]

SECOND: Final = 10**9
"""Nanoseconds."""

ROUNDING: Final = 1000
"""ns by which times in seconds (of findings) may be wrong: a tick that is a little early would come again at once."""


@dataclass(frozen=True, slots=True)
class Limits:
    """Bounds of a space."""

    resource_limit: int = 5000
    """Samples one reader, one writer's history or one client's waiting requests hold at most."""
    max_blocking_time: int = 100_000_000
    """A writer is refused at most this long, ns (the default of DDS 1.4, 2.2.3.14: 100 ms)."""
    request_wait: int = 5 * SECOND
    """A request waits this long for a server, ns."""
    callbacks: int = 1000
    """Callbacks run in one go before the event loop gets a breath."""

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            if not isinstance(getattr(self, name), int):
                raise TypeError(f"{name} is {getattr(self, name)!r}; it must be a whole number")
        for name in ("resource_limit", "callbacks"):
            if getattr(self, name) < 1:
                raise ValueError(f"{name} is {getattr(self, name)}; it must be at least 1")
        for name in ("max_blocking_time", "request_wait"):
            if getattr(self, name) < 0:
                raise ValueError(f"{name} is {getattr(self, name)} ns; it must not be negative")


class Task(Protocol):
    """Something that has a callback to call."""

    def run(self) -> None:
        """Call it. Must not raise."""


class Engine(Protocol):
    """What an engine does with time, besides timers and callbacks."""

    def run(self) -> None:
        """Do what is due."""

    def next(self) -> int | None:
        """When `run` has something to do, by the clock; None = not by itself."""


class Core:
    """The shared part of one space."""

    def __init__(
        self, clock: Callable[[], int], findings: Findings, limits: Limits, engine: Engine | None = None
    ) -> None:
        self.clock = clock
        self.findings = findings
        self.limits = limits
        self.engine = engine
        self.timers = Timers(clock, self.need)
        self.queue: deque[Task] = deque()
        self.draining = False
        self.notices: deque[Callable[[], None]] = deque()
        self.watchers: dict[object, Callable[[GraphEvent], object]] = {}
        self.on_wake: Callable[[], object] | None = None
        self.driver = LoopDriver(self.tick, clock)
        self._untold: dict[tuple[str, str, str], int] = {}
        self._settling = False
        self._promised: int | None = None
        self._ticking = False

    def drain(self) -> None:
        """Run the tasks, unless somebody further out does already."""
        if self.draining:
            return
        self.draining = True
        queue, left = self.queue, self.limits.callbacks
        try:
            while queue and left:
                left -= 1
                queue.popleft().run()
        finally:
            self.draining = False
        if queue:
            self.need(self.clock())

    @contextmanager
    def hushed(self) -> Iterator[None]:
        """What is to be told from within is told by `tick`: of an entity whose making has not returned yet."""
        before, self.draining = self.draining, True
        try:
            yield
        finally:
            self.draining = before
        self.poke()

    def post(self, task: Task) -> None:
        """Run `task` when the call that goes on now is over; if none drains the queue, at the next tick."""
        self.queue.append(task)
        self.poke()

    def poke(self) -> None:
        """Tasks may have been queued outside of a delivery: have them run soon."""
        if self.queue and not self.draining:
            self.need(self.clock())

    def count(self, code: str, who: str, subject: str, tell: Callable[[int], None], n: int = 1) -> None:
        """Count a finding from inside a delivery: cheap for the many, `tell(n)` reports the first ones later."""
        key = (code, who, subject)
        if key in self._untold:
            self._untold[key] += n
        elif not self.findings.again(code, who=who, subject=subject, now=self.seconds(), n=n):
            self._untold[key] = n
            self.queue.append(_FirstReport(self._untold, key, tell))

    def tick(self) -> int | None:
        """Timers, then tasks, then the findings' summaries. Returns the next time for it."""
        self._ticking = True
        try:
            self.timers.run()
            if self.engine is not None:
                self.engine.run()
            self.drain()
            self.settle()
            summary = self.findings.tick(self.seconds())
        finally:
            self._ticking = False
        times = [] if summary is None else [max(int(summary * SECOND), self.clock()) + ROUNDING]
        if (timer := self.timers.next()) is not None:
            times.append(timer)
        if self.engine is not None and (due := self.engine.next()) is not None:
            times.append(due)
        if self.queue:
            times.append(self.clock())
        self._promised = min(times, default=None)
        return self._promised

    def need(self, when: int) -> None:
        """`tick` is needed at `when` (ns of the clock): wake the owner if it was told a later time."""
        if self._ticking or (self._promised is not None and self._promised <= when):
            return
        self._promised = when
        self.driver.wake()
        if self.on_wake is not None:
            self.call("space", self.on_wake)

    def settle(self) -> None:
        """Tell what is to be told, unless somebody further out does already."""
        if self._settling:
            return
        self._settling = True
        try:
            while self.notices:
                self.notices.popleft()()
        finally:
            self._settling = False

    def tell(self, event: GraphEvent) -> None:
        """Give an event to the watchers of the graph, at the end of the call that goes on now."""
        self.notices.append(partial(self._tell, event))

    def _tell(self, event: GraphEvent) -> None:
        for watcher in tuple(self.watchers.values()):
            self.call("graph", watcher, event)

    def call(self, who: str, callback: Callable[..., object], *args: object) -> None:
        """Call a user's callback; if it raises, that is a finding."""
        try:
            callback(*args)
        except Exception as error:
            self.failed(who, callback, error)

    def failed(self, who: str, callback: Callable[..., object], error: Exception) -> None:
        """A user's callback has raised."""
        name = getattr(callback, "__qualname__", type(callback).__qualname__)
        trace = error.__traceback__
        while trace is not None and trace.tb_next is not None:
            trace = trace.tb_next
        where = f" ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})" if trace is not None else ""
        self.report(
            "callback-failed",
            who=who,
            subject=name,
            what=f"{{n}} call{{s}} of {name} by {who} failed",
            why=f"{type(error).__name__}: {error}{where}",
            remedy="Mend the callback. Everything else goes on",
            severity=Severity.ERROR,
        )

    def seconds(self) -> float:
        """The clock as findings want it."""
        return self.clock() / SECOND

    def report(
        self,
        code: str,
        *,
        who: str,
        what: str,
        why: str = "",
        remedy: str = "",
        subject: str = "",
        n: int = 1,
        severity: Severity = Severity.WARNING,
    ) -> None:
        """A finding of now."""
        self.findings.report(
            code,
            who=who,
            what=what,
            why=why,
            remedy=remedy,
            now=self.seconds(),
            subject=subject,
            n=n,
            severity=severity,
        )


class _FirstReport:
    """Tells of something that was only counted, when nothing is being delivered."""

    __slots__ = ("_key", "_tell", "_untold")

    def __init__(
        self, untold: dict[tuple[str, str, str], int], key: tuple[str, str, str], tell: Callable[[int], None]
    ) -> None:
        self._untold = untold
        self._key = key
        self._tell = tell

    def run(self) -> None:
        self._tell(self._untold.pop(self._key))
