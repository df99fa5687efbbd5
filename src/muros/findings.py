"""Findings: what a process noticed, told so that a person can act on it.

Whoever drops, refuses or cannot match something says so with a *finding*: who, what, why, and what to do.
Findings are values; they are counted by (code, who, subject). The first occurrence is given to the watchers
at once; repeats are only counted, and told as one summary at most every `summary_period`. Memory is bounded:
beyond `capacity` different findings the rest is counted in one entry for each code.

Nothing here reads a clock or does I/O: the time is passed in, and printing is a watcher's business.
"""

import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from enum import Enum
from typing import Final

__all__ = ["Finding", "Findings", "Severity"]

CAPACITY: Final = 1000
"""Different findings remembered."""

MEMORY: Final = 600.0
"""Seconds after which a finding that does not come again makes room for new ones."""

SUMMARY_PERIOD: Final = 10.0
"""Seconds between two summaries of the same finding."""

FOLDED: Final = "others"
"""`who` of the entry that counts, for one code, what did not fit the capacity."""

OTHER_CODE: Final = "other-finding"
"""Code that counts the rest when even the codes are too many to be remembered one by one."""

CODE_CAPACITY: Final = 200
"""Different codes counted by name."""

INDENT: Final = " " * 11
"""The second line of a finding stands under the text that follows a time stamp of the form [12:00:09]."""


class Severity(Enum):
    """How much a finding matters."""

    INFO = "info"
    WARNING = "warning"
    ERROR = "error"


@dataclass(frozen=True, slots=True)
class Finding:
    """One thing noticed, with how often.

    In `what`, `{n}` stands for the number of new occurrences and `{s}` for the plural's "s":
    "{n} sample{s} of rt/scan dropped".
    """

    code: str
    """Short stable slug a program may test for, such as "best-effort-too-big"."""
    who: str
    """Whose matter it is, such as "client 0x1A2B0007". `Findings.forget` goes by it."""
    what: str
    """What happened."""
    why: str = ""
    """The cause."""
    remedy: str = ""
    """What to do about it."""
    severity: Severity = Severity.WARNING
    """How much it matters."""
    subject: str = ""
    """What it is about, such as a topic."""
    count: int = 1
    """Occurrences so far."""
    new: int = 1
    """Occurrences the watchers had not been told of."""
    first: float = 0.0
    """Time of the first occurrence, in seconds of the reporter's clock."""
    last: float = 0.0
    """Time of the last occurrence."""
    since: float | None = None
    """For a summary: when the watchers were last told. None the first time."""

    def format(self, stamp: Callable[[float], str] | None = None) -> str:
        """The finding as one line for what and why, and one for what to do, without a line end.

        Control characters (names may come from foreign bytes) are shown escaped. `stamp` turns seconds into
        the text of a summary's "since"; the default takes them as seconds since the epoch, in local time.
        """
        what = self.what
        since = "" if self.since is None else (stamp or _local_time)(self.since)
        if self.since is not None and "{n}" not in what:
            what += f", {self.new} more since {since}"
        elif self.since is not None:
            what = what.replace("{n}", f"{self.new} more") + f" since {since}"
        else:
            what = what.replace("{n}", str(self.new))
        what = what.replace("{s}", "" if self.new == 1 else "s")
        if self.who not in what:
            what = f"{self.who}: {what}"
        first = f"finding: {what}: {self.why}" if self.why else f"finding: {what}"
        lines = [_sentence(first)]
        if self.remedy:
            lines.append(INDENT + _sentence(self.remedy))
        return "\n".join(lines)


class Findings:
    """Counts findings, summarises repeats, tells watchers.

    `capacity`: different findings remembered. `summary_period`: seconds between two summaries of one finding.
    `memory`: seconds after which one that did not come again makes room for a new one.
    """

    def __init__(
        self, *, capacity: int = CAPACITY, summary_period: float = SUMMARY_PERIOD, memory: float = MEMORY
    ) -> None:
        if capacity < 1 or not summary_period > 0 or not memory > 0:
            raise ValueError("capacity must be at least 1, summary_period and memory more than 0 seconds")
        self.capacity: Final = capacity
        self.summary_period: Final = summary_period
        self.memory: Final = memory
        self._swept = 0.0
        self._entries: dict[str, dict[tuple[str, str], _Entry]] = {}
        self._folded: dict[str, _Entry] = {}
        self._size = 0
        self._forgotten: dict[str, int] = {}
        self._due: dict[_Entry, None] = {}
        self._watchers: dict[object, Callable[[Finding], object]] = {}
        self._outbox: deque[Finding] = deque()
        self._telling = False

    def report(
        self,
        code: str,
        *,
        who: str,
        what: str,
        why: str = "",
        remedy: str = "",
        now: float,
        subject: str = "",
        n: int = 1,
        severity: Severity = Severity.WARNING,
    ) -> None:
        """Count `n` occurrences. The first is told to the watchers at once, repeats by `tick`.

        The texts of the latest occurrence are the ones shown. `now` is in seconds. Never raises for what a
        watcher does.
        """
        if n < 1:
            return
        entry = self._find(code, who, subject)
        if entry is None:
            entry = self._place(code, who, subject, now)
        if entry.who != FOLDED:
            entry.what, entry.why, entry.remedy, entry.severity = what, why, remedy, severity
        self._add(entry, n, now)

    def again(self, code: str, *, who: str, subject: str = "", now: float, n: int = 1) -> bool:
        """Count `n` more of a finding that was reported before: cheap, no texts. False if it was not."""
        entry = self._find(code, who, subject)
        if entry is None:
            return False
        self._add(entry, n, now)
        return True

    def tick(self, now: float) -> float | None:
        """Tell the watchers the repeats whose time has come. Returns when to call again, None = not needed.

        A clock set back is taken as "the time has come".
        """
        due = [e for e in self._due if not e.told <= now < e.told + self.summary_period]
        for entry in due:
            self._tell(entry, now)
        return min(e.told for e in self._due) + self.summary_period if self._due else None

    def flush(self) -> None:
        """Tell the watchers all repeats not told yet, before leaving."""
        for entry in list(self._due):
            self._tell(entry, entry.last)

    def on_finding(self, callback: Callable[[Finding], object]) -> Callable[[], None]:
        """Call `callback` with every finding and summary from now on. Returns a function that ends it.

        A callback that raises harms nobody; its errors are counted under the code "watcher-failed".
        """
        key = object()
        self._watchers[key] = callback

        def cancel() -> None:
            self._watchers.pop(key, None)

        return cancel

    def snapshot(self) -> tuple[Finding, ...]:
        """All findings remembered, oldest first; `new` counts what the watchers do not know yet."""
        entries = [e for group in self._entries.values() for e in group.values()]
        entries += self._folded.values()
        entries.sort(key=lambda e: e.first)
        return tuple(e.value(e.untold, None) for e in entries)

    def counts(self) -> dict[str, int]:
        """Occurrences by code since the start, of those forgotten too."""
        totals = dict(self._forgotten)
        for group in self._entries.values():
            for entry in group.values():
                totals[entry.code] = totals.get(entry.code, 0) + entry.count
        for entry in self._folded.values():
            totals[entry.code] = totals.get(entry.code, 0) + entry.count
        return totals

    def forget(self, who: str) -> None:
        """`who` has gone: drop its findings (untold repeats are told first); `counts` keeps their numbers."""
        for entry in self._entries.pop(who, {}).values():
            self._drop(entry)

    def _drop(self, entry: "_Entry") -> None:
        if entry in self._due:
            self._tell(entry, entry.last)
        self._size -= 1
        code = entry.code
        if code not in self._forgotten and len(self._forgotten) >= CODE_CAPACITY:
            code = OTHER_CODE
        self._forgotten[code] = self._forgotten.get(code, 0) + entry.count

    def _make_room(self, now: float) -> None:
        """Drop what has not come for long; looked for once a second at most, as a flood of new ones may go on."""
        if 0 <= now - self._swept < 1:
            return
        self._swept = now
        for who, group in list(self._entries.items()):
            for key, entry in list(group.items()):
                if entry.last < now - self.memory:
                    del group[key]
                    self._drop(entry)
            if not group:
                del self._entries[who]

    def _find(self, code: str, who: str, subject: str) -> "_Entry | None":
        group = self._entries.get(who)
        return None if group is None else group.get((code, subject))

    def _place(self, code: str, who: str, subject: str, now: float) -> "_Entry":
        """A new entry, or the one that counts for everything of this code that did not fit."""
        if self._size >= self.capacity:
            self._make_room(now)
        if self._size < self.capacity:
            self._size += 1
            entry = _Entry(code, who, subject, now)
            self._entries.setdefault(who, {})[code, subject] = entry
            return entry
        if code not in self._folded and len(self._folded) >= CODE_CAPACITY:
            code = OTHER_CODE
        folded = self._folded.get(code)
        if folded is None:
            folded = self._folded[code] = _Entry(code, FOLDED, "", now)
            folded.what = f"{{n}} finding{{s}} of the kind {code!r} not told one by one"
            folded.why = f"{self.capacity} different findings are remembered already"
            folded.remedy = "Cure the earlier ones first; the numbers by kind stay right"
        return folded

    def _add(self, entry: "_Entry", n: int, now: float) -> None:
        entry.count += n
        entry.untold += n
        entry.last = now
        if entry.count == n:
            self._tell(entry, now)
        elif entry.untold == n:
            self._due[entry] = None

    def _tell(self, entry: "_Entry", now: float) -> None:
        """Hand the entry's untold occurrences to the watchers; from inside a watcher, after it returns."""
        since = entry.told if entry.count > entry.untold else None
        self._outbox.append(entry.value(entry.untold, since))
        entry.untold = 0
        entry.told = now
        self._due.pop(entry, None)
        if self._telling:
            return
        self._telling = True
        try:
            while self._outbox:
                finding = self._outbox.popleft()
                for watcher in tuple(self._watchers.values()):
                    try:
                        watcher(finding)
                    except Exception as error:
                        self._count_watcher_error(watcher, error, finding.last)
        finally:
            self._telling = False

    def _count_watcher_error(
        self, watcher: Callable[[Finding], object], error: Exception, now: float
    ) -> None:
        """Counted like any finding, but told to nobody: the watchers are what failed."""
        code, who = "watcher-failed", "findings"
        entry = self._find(code, who, "") or self._place(code, who, "", now)
        if entry.who != FOLDED:
            entry.what = "{n} finding{s} not shown by a watcher"
            entry.why = f"{getattr(watcher, '__qualname__', 'it')} raised {type(error).__name__}: {error}"
            entry.remedy = "Mend the callback given to on_finding"
            entry.severity = Severity.ERROR
        entry.count += 1
        entry.untold += 1
        entry.last = now


class _Entry:
    """What is remembered of one (code, who, subject)."""

    __slots__ = (
        "code", "count", "first", "last", "remedy", "severity", "subject", "told", "untold",
        "what", "who", "why",
    )  # fmt: skip

    def __init__(self, code: str, who: str, subject: str, now: float) -> None:
        self.code = code
        self.who = who
        self.subject = subject
        self.what = self.why = self.remedy = ""
        self.severity = Severity.WARNING
        self.count = self.untold = 0
        self.first = self.last = self.told = now

    def value(self, new: int, since: float | None) -> Finding:
        return Finding(
            self.code, self.who, self.what, self.why, self.remedy, self.severity, self.subject,
            self.count, new, self.first, self.last, since,
        )  # fmt: skip


def _sentence(text: str) -> str:
    """`text` with control characters escaped and a full stop at its end."""
    shown = "".join(c if c.isprintable() else c.encode("unicode_escape").decode() for c in text)
    return shown if shown.endswith((".", "!", "?")) else shown + "."


def _local_time(seconds: float) -> str:
    return time.strftime("%H:%M:%S", time.localtime(seconds))
