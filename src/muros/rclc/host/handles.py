"""What executors of hosts run: subscriptions, timers and guard conditions that say more and measure finer.

Ticks are milliseconds with fractions here: nothing but differences are made of them.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.client import reasons
from muros.client.qos import profile
from muros.rclc import guard as guard_
from muros.rclc import handles
from muros.rclc import subscription as subscription_
from muros.rclc import timer as timer_
from muros.rclc.host.checks import WrongTypeError, be_callable, be_period

if TYPE_CHECKING:
    from muros.client.qos import Qos
    from muros.rclc.context import Context
    from muros.xrce._types import Buffer

MALFORMED = 12
"""The code with which a subscription tells ``on_problem`` of its first malformed sample."""

_DEPTH = 1000
"""Messages that wait in a subscription that keeps all."""


def ticks() -> int:
    """Milliseconds of the steady clock, to the microsecond."""
    return time.monotonic_ns() / 1e6  # type: ignore[return-value]  # boards count whole ones


def take_away(self: Any) -> None:
    """Takes a handle away, with all that waits, and from what its node has made."""
    if self in self.home:
        self.home.remove(self)
    handles.destroy(self)


class Subscription(subscription_.Subscription):
    """Made by ``Node.subscription``; its first malformed sample is a problem that is told."""

    topic = ""
    refused = 0  # samples beyond the rules for memory
    home: Any = ()  # what its node has made
    destroy = take_away

    def __init__(
        self, context: Context, kind: Any, callback: Callable[[Any], object] | None, qos: str | Qos
    ) -> None:
        super().__init__(context, kind, callback)
        self.depth = profile(qos).depth or _DEPTH
        self._kind = kind
        self._waiting: list[Any] = []

    def take(self) -> Any:
        """The oldest message that waits, or None."""
        return self._waiting.pop(0) if self._waiting else None

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        return len(self._waiting) > 0

    def run(self, now: int) -> None:
        """Takes a message, or None when nothing waits, and calls the callback."""
        message = self._waiting.pop(0) if self._waiting else None
        if self.callback is not None:
            self.callback(message)

    def deliver(self, buf: Buffer, off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        message = self._kind()
        try:
            message.read(buf, off, n)
        except ValueError:
            self.malformed += 1
            self._tell(n)
            return
        self._waiting.append(message)
        if len(self._waiting) > self.depth:
            if self.eager:
                self._run_early()
            else:
                self._waiting.pop(0)
                self.lost += 1

    def _run_early(self) -> None:
        try:
            self.run(0)
        except Exception as error:
            error.raised_by = self  # type: ignore[attr-defined]  # for the executor, which the middleware gives it to
            raise

    def _tell(self, n: int) -> None:
        """Tells of the first malformed sample."""
        if self.malformed == 1:
            tell_problem(
                self.context,
                MALFORMED,
                f"a sample of {n} B on {self.topic!r} is no {self._kind.TYPE} and was dropped. "
                "Does somebody publish another type there?",
            )


class Timer(timer_.Timer):
    """Made by ``Node.timer``; see ``muros.rclc.timer.Timer``. Its period is exact, not rounded to milliseconds.

    ``since`` is in ms, with fractions.
    """

    home: Any = ()
    destroy = take_away

    def __init__(
        self, context: Context, period: float, callback: Callable[[], object], autostart: bool
    ) -> None:
        super().__init__(context, 0, callback, autostart)
        self.exchange_period(period)
        self._next = self._last + self.period

    def exchange_period(self, period: float) -> float:
        """Sets the period in seconds, used from the next call on; returns the old one. ValueError for what is none."""
        be_period(period)
        old = self.period / 1000
        self.period = period * 1000  # type: ignore[assignment]  # boards count whole ones
        return old


class GuardCondition(guard_.GuardCondition):
    """See ``muros.rclc.guard.GuardCondition``."""

    def __init__(self, context: Context, callback: Callable[[], object]) -> None:
        if not hasattr(context, "handles"):
            raise WrongTypeError(f"GuardCondition needs a context, not {context!r}")
        be_callable(callback, "the callback of a guard condition")
        super().__init__(context, callback)

    def trigger(self) -> None:
        """Makes it ready, from any thread.

        An executor that waits wakes at once; where a transport of your own has it wait, within 10 ms from the second
        time on.
        """
        super().trigger()
        wake = getattr(self.context.middleware, "wake", None)
        if wake is not None:
            wake()


def tell_problem(context: Context, code: int, text: str) -> None:
    """Tells ``on_problem``, or whoever reads standard error."""
    tell = context.middleware.on_problem
    if tell is None:
        reasons.say(text)
    else:
        tell(code, text)


def describe(handle: Any) -> str:
    """Whose callback it is: "on_laser, the callback of subscription 'laser'"."""
    callback = getattr(handle, "callback", None)
    called = getattr(callback, "__qualname__", None) or type(callback).__qualname__
    called = called.rpartition("<locals>.")[2]
    name = getattr(handle, "topic", None) or getattr(handle, "name", None)
    what = type(handle).__name__.lower()
    if what == "timer":
        what = f"the timer of {handle.period:g} ms"
    elif what == "guardcondition":
        what = "a guard condition"
    else:
        what = {"actionserver": "action server", "actionclient": "action client"}.get(what, what)
    where = f"{what} {name!r}" if name else what
    return f"a callback of {where}" if callback is None else f"{called}, the callback of {where}"
