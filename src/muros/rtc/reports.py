"""Findings of a process in which many threads notice things: one ledger behind a lock, and the time of day."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from typing import Final

from muros.findings import Finding, Findings, Severity

__all__ = ["Reporter"]


class Reporter:
    """Takes findings from any thread.

    `findings` is the ledger (see `muros.findings`), `clock` the time in seconds since the epoch.
    """

    def __init__(self, findings: Findings | None = None, *, clock: Callable[[], float] = time.time) -> None:
        self.findings: Final = findings or Findings()
        self._clock = clock
        self._lock = threading.RLock()  # a watcher may report, too

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
        """Count `n` occurrences of what `Findings.report` describes."""
        now = self._clock()
        with self._lock:
            self.findings.report(
                code,
                who=who,
                what=what,
                why=why,
                remedy=remedy,
                now=now,
                subject=subject,
                n=n,
                severity=severity,
            )

    def take(self, finding: Finding) -> None:
        """Count a finding that somebody made as a value."""
        self.report(
            finding.code,
            who=finding.who,
            what=finding.what,
            why=finding.why,
            remedy=finding.remedy,
            subject=finding.subject,
            n=finding.new,
            severity=finding.severity,
        )

    def again(self, code: str, *, who: str, subject: str = "", n: int = 1) -> bool:
        """Count `n` more of one that was reported before; False where it was not."""
        with self._lock:
            return self.findings.again(code, who=who, subject=subject, now=self._clock(), n=n)

    def failed(self, code: str, who: str, what: str, error: BaseException, remedy: str = "") -> None:
        """Somebody's code raised `error`: say so, with the line of code it came from."""
        self.report(
            code,
            who=who,
            what=what,
            why=_origin(error),
            remedy=remedy,
            subject=type(error).__name__,
            severity=Severity.ERROR,
        )

    def on_finding(self, callback: Callable[[Finding], object]) -> Callable[[], None]:
        """Call `callback` with every finding from now on, in the thread that noticed it. Returns what ends it."""
        with self._lock:
            return self.findings.on_finding(callback)

    def tick(self) -> None:
        """Tell the watchers the repeats whose time has come; call it now and then."""
        with self._lock:
            self.findings.tick(self._clock())


def _origin(error: BaseException) -> str:
    trace = error.__traceback__
    while trace is not None and trace.tb_next is not None:
        trace = trace.tb_next
    text = f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
    if trace is None:
        return text
    return f"{text} ({trace.tb_frame.f_code.co_filename}:{trace.tb_lineno})"
