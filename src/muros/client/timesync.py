"""The agent's clock, as seen from here. How it is asked and compared boards borrow, see ``exchange``.

Time is two integers, seconds and nanoseconds: a board's numbers are too short for one.
"""

from muros.compat import const, lending, ticks_diff, ticks_us

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client import exchange
    from muros.client.session import Session
    from muros.xrce._types import Buffer

_TIMESTAMP_REPLY = const(15)
_KEPT = const(8)
_DRIFT = const(100)  # parts per million
_MILLION = const(1_000_000)
_BILLION = const(1_000_000_000)


class TimeSync:
    """Keeps the agent's time. ``request`` asks for it, ``time`` tells it.

    ``kept`` is the number of exchanges of which the best counts, ``drift`` how far our oscillator may be off, in
    parts per million. ``round_trip`` is that of the exchange that counts, in microseconds, or -1 before the first.
    """

    if TYPE_CHECKING:
        request = exchange.request
        error = exchange.error
        reply = exchange.reply
    else:
        lends = "muros.client.exchange"
        __getattr__ = lending

    def __init__(self, session: "Session", kept: int = _KEPT, drift: int = _DRIFT) -> None:
        self.session = session
        self.drift = drift
        self.round_trip = -1
        self._kept = kept
        self._exchanges: "list[tuple[int, int, int, int]]" = []  # round trip, tick, seconds, nanoseconds
        self._best: "tuple[int, int, int, int]" = (0, 0, 0, 0)
        self._asked: "int | None" = None  # the tick of the request that is open
        session.objects[-_TIMESTAMP_REPLY] = self._on_reply

    def synchronized(self) -> bool:
        """Whether the agent has answered yet."""
        return self.round_trip >= 0

    def time(self, now: "int | None" = None) -> "tuple[int, int]":
        """The agent's time as (seconds since 1970, nanoseconds) at the tick ``now``; (0, 0) before it is known."""
        if self.round_trip < 0:
            return (0, 0)
        if now is None:
            now = ticks_us()
        _, tick, seconds, nanoseconds = self._best
        passed = ticks_diff(now, tick)
        nanoseconds += passed % _MILLION * 1000
        seconds += passed // _MILLION
        if nanoseconds >= _BILLION:
            return (seconds + 1, nanoseconds - _BILLION)
        return (seconds, nanoseconds)

    def _on_reply(self, buf: "Buffer", off: int, n: int, now: "int | None" = None) -> None:
        if now is None:
            now = ticks_us()  # before ``exchange`` is loaded
        self.reply(buf, off, n, now)
