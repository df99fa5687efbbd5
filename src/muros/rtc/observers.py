"""Observers of a component: tools that want to be told what becomes of it (ComponentObserver).

    observer = Observer(send, ObserverOptions.from_properties(texts, Dialect.OPENRTM), Dialect.OPENRTM)
    watch(component, observer)          # muros.rtc.status: what happens becomes kinds and hints
    ... observer.close()

`Outbox` is what is to be told, without clock and thread; `Observer` has the thread that tells it. A component never
waits for who observes it: what does not fit the queue is dropped, oldest first, and counted; one that fails several
times in a row is told nothing any more.
"""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Final

from muros.findings import Finding, Severity
from muros.rtc.properties import is_yes, seconds_of, split_list

__all__ = ["CAPACITY", "Dialect", "Observer", "ObserverOptions", "Outbox", "StatusKind"]

CAPACITY: Final = 256
"""Messages that wait for one observer at most."""

FAILURES: Final = 3
"""Messages in a row that an observer does not take before it counts as gone."""

HEARTBEAT_INTERVAL: Final = 1.0
"""Seconds."""

DATA_INTERVAL: Final = 0.1
"""Seconds between two messages of one port that values go through it."""

LEAST_INTERVAL: Final = 0.01
"""Seconds: what is asked for below that counts as that."""


class StatusKind(Enum):
    """What a message is about, by the names of the IDL."""

    COMPONENT_PROFILE = "COMPONENT_PROFILE"
    RTC_STATUS = "RTC_STATUS"
    EC_STATUS = "EC_STATUS"
    PORT_PROFILE = "PORT_PROFILE"
    CONFIGURATION = "CONFIGURATION"
    HEARTBEAT = "HEARTBEAT"
    RTC_HEARTBEAT = "RTC_HEARTBEAT"
    EC_HEARTBEAT = "EC_HEARTBEAT"
    FSM_PROFILE = "FSM_PROFILE"
    FSM_STATUS = "FSM_STATUS"
    FSM_STRUCTURE = "FSM_STRUCTURE"


_HEARTBEATS: Final = frozenset({StatusKind.HEARTBEAT, StatusKind.RTC_HEARTBEAT, StatusKind.EC_HEARTBEAT})
_COMMON: Final = frozenset(
    {
        StatusKind.COMPONENT_PROFILE,
        StatusKind.RTC_STATUS,
        StatusKind.EC_STATUS,
        StatusKind.PORT_PROFILE,
        StatusKind.CONFIGURATION,
    }
)


class Dialect(Enum):
    """The two interfaces of observers, by repository id. Their kinds differ."""

    OPENRTM = "IDL:OpenRTM/ComponentObserver:1.0"
    """RTSystemEditor's, and OpenRTM-aist's own."""
    RTC = "IDL:omg.org/RTC/ComponentObserver:1.0"
    """rtctree's, and that of FSM components."""

    @property
    def kinds(self) -> frozenset[StatusKind]:
        """What can be said in it."""
        if self is Dialect.OPENRTM:
            return _COMMON | {StatusKind.HEARTBEAT}
        return frozenset(StatusKind) - {StatusKind.HEARTBEAT}


@dataclass(frozen=True, slots=True)
class ObserverOptions:
    """What an observer wants to be told."""

    kinds: frozenset[StatusKind]
    """But for heartbeats."""
    heartbeats: Mapping[StatusKind, float]
    """Seconds between two, by kind."""
    send_interval: float = DATA_INTERVAL
    """Seconds between two messages that an OutPort sends; for each port."""
    receive_interval: float = DATA_INTERVAL

    @classmethod
    def from_properties(cls, texts: Mapping[str, str], dialect: Dialect) -> ObserverOptions:
        """Options of `observed_status: ALL` or a list of kinds, `heartbeat.enable`, `heartbeat.interval`,
        `rtc_heartbeat.*`, `ec_heartbeat.*`, `port_profile.{send,receive}_event.min_interval`.

        Kinds that the dialect lacks are passed over. RtcError for an interval that is none.
        """
        wanted = {word.upper() for word in split_list(texts.get("observed_status", "ALL"))}
        kinds = {kind for kind in dialect.kinds - _HEARTBEATS if "ALL" in wanted or kind.value in wanted}
        return cls(
            frozenset(kinds),
            {
                kind: max(seconds_of(texts, f"{key}.interval", HEARTBEAT_INTERVAL), LEAST_INTERVAL)
                for kind, key in _heartbeat_keys(texts, dialect)
                if is_yes(texts.get(f"{key}.enable", ""))
            },
            seconds_of(texts, "port_profile.send_event.min_interval", DATA_INTERVAL),
            seconds_of(texts, "port_profile.receive_event.min_interval", DATA_INTERVAL),
        )


class Outbox:
    """What waits to be told to one observer, and when its next heartbeat is due. No clock, no thread, no lock."""

    def __init__(
        self, heartbeats: Mapping[StatusKind, float], now: float, *, capacity: int = CAPACITY
    ) -> None:
        self._messages: deque[tuple[StatusKind, str]] = deque()
        self._capacity = capacity
        self._intervals = dict(heartbeats)
        self._due = {kind: now + interval for kind, interval in heartbeats.items()}
        self.dropped = 0
        """Messages that there was no room for."""

    def put(self, kind: StatusKind, hint: str) -> None:
        """Something to tell; for want of room the oldest is dropped."""
        if len(self._messages) >= self._capacity:
            self._messages.popleft()
            self.dropped += 1
        self._messages.append((kind, hint))

    def take(self, now: float) -> tuple[StatusKind, str] | None:
        """What to tell next, a heartbeat that is due before all else; None: nothing at the moment."""
        for kind, moment in self._due.items():
            if moment <= now:
                following = moment + self._intervals[kind]
                self._due[kind] = following if following > now else now + self._intervals[kind]
                return kind, ""
        return self._messages.popleft() if self._messages else None

    @property
    def deadline(self) -> float:
        """When the next heartbeat is due; never, where none is wanted."""
        return min(self._due.values(), default=math.inf)


class Observer:
    """Tells one observer, in a thread of its own.

    `send` calls it and raises where that fails; it may block, but should not for ever. `on_gone` is called once, in
    that thread, when it has failed too often. `who` is what findings call it.
    """

    def __init__(
        self,
        send: Callable[[StatusKind, str], object],
        options: ObserverOptions,
        dialect: Dialect,
        *,
        who: str = "an observer",
        on_gone: Callable[[], object] = lambda: None,
        report: Callable[[Finding], object] = lambda finding: None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self.options: Final = options
        self.dialect: Final = dialect
        self._send = send
        self._who = who
        self._on_gone = on_gone
        self._report = report
        self._clock = clock
        self._changed = threading.Condition()
        self._outbox = Outbox(options.heartbeats, clock())
        self._later: list[tuple[float, Callable[[], object]]] = []
        self._endings: list[Callable[[], object]] = []
        self._thread: threading.Thread | None = None
        self._closed = False
        if options.heartbeats:
            with self._changed:
                self._wake()

    @property
    def is_closed(self) -> bool:
        """Whether it is told nothing any more."""
        return self._closed

    def tell(self, kind: StatusKind, hint: str) -> None:
        """Something has happened. Returns at once; nothing happens where it is not wanted."""
        if kind in self.options.kinds:
            with self._changed:
                if not self._closed:
                    self._outbox.put(kind, hint)
                    self._wake()

    def after(self, seconds: float, action: Callable[[], object]) -> None:
        """Call `action` in the observer's thread, some time from now."""
        with self._changed:
            if not self._closed:
                self._later.append((self._clock() + seconds, action))
                self._wake()

    def at_close(self, action: Callable[[], object]) -> None:
        """Call `action` when it is told nothing any more; at once, if that is so."""
        with self._changed:
            if not self._closed:
                self._endings.append(action)
                return
        action()

    def close(self) -> None:
        """Tell nothing any more. Does not wait for a message that is on its way."""
        with self._changed:
            if self._closed:
                return
            self._closed = True
            endings, self._endings = self._endings, []
            self._changed.notify_all()
        for action in endings:
            action()

    def _wake(self) -> None:
        if self._thread is None:
            self._thread = threading.Thread(target=self._main, name=f"rtc observer {self._who}", daemon=True)
            self._thread.start()
        self._changed.notify_all()

    def _main(self) -> None:
        failures = told_dropped = 0
        while True:
            with self._changed:
                if self._closed:
                    return
                now = self._clock()
                actions = [action for moment, action in self._later if moment <= now]
                self._later = [(moment, action) for moment, action in self._later if moment > now]
                message = self._outbox.take(now)
                dropped = self._outbox.dropped
                if message is None and not actions:
                    deadline = min([self._outbox.deadline, *(moment for moment, _ in self._later)])
                    self._changed.wait(None if deadline == math.inf else max(0.0, deadline - now))
                    continue
            for action in actions:
                action()
            if dropped > told_dropped:
                self._note(
                    "rtc-observer-slow",
                    "{n} message{s} to it dropped",
                    f"it does not take them as fast as they come; {CAPACITY} may wait",
                    new=dropped - told_dropped,
                )
                told_dropped = dropped
            if message is not None:
                try:
                    self._send(*message)
                    failures = 0
                except Exception as error:
                    failures += 1
                    if failures >= FAILURES:
                        self._give_up(error)

    def _give_up(self, error: Exception) -> None:
        self._note(
            "rtc-observer-lost",
            "it is told nothing any more",
            f"{FAILURES} messages in a row failed, the last with {type(error).__name__}: {error}",
            severity=Severity.INFO,
        )
        self.close()
        self._on_gone()

    def _note(
        self, code: str, what: str, why: str, *, new: int = 1, severity: Severity = Severity.WARNING
    ) -> None:
        self._report(Finding(code, self._who, what, why, severity=severity, count=new, new=new))


def _heartbeat_keys(texts: Mapping[str, str], dialect: Dialect) -> tuple[tuple[StatusKind, str], ...]:
    """The keys that say when which heartbeat is sent; `heartbeat.*` alone is the component's in both dialects."""
    if dialect is Dialect.OPENRTM:
        return ((StatusKind.HEARTBEAT, "heartbeat"),)
    own = any(key.startswith("rtc_heartbeat.") for key in texts)
    return (
        (StatusKind.RTC_HEARTBEAT, "rtc_heartbeat" if own else "heartbeat"),
        (StatusKind.EC_HEARTBEAT, "ec_heartbeat"),
    )
