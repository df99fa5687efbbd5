"""The agent's clock, as seen from here (DDS-XRCE 1.0, 8.3.5.15 and 8.3.5.16: TIMESTAMP and TIMESTAMP_REPLY).

Theory of operation. A request carries our tick as its stamp and comes back with it, with the agent's time when it
arrived and when it left. The agent's clock was read somewhere between our two ticks; half the round trip (less the
agent's own part) is the most it can be off. Of the last exchanges the one with the shortest round trip is kept: what
delays a message makes its round trip longer. Between exchanges our oscillator runs away by at most ``DRIFT`` parts
per million, which the bound on the error grows with.

Time is two integers, seconds and nanoseconds: a board's numbers are too short for one.

Boards borrow this; functions with ``self`` are methods of ``timesync.TimeSync``.
"""

from struct import pack_into, unpack_from

from muros.compat import const, ticks_diff, ticks_us
from muros.xrce.session import control

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.timesync import TimeSync
    from muros.xrce._types import Buffer

_TIMESTAMP = const(14)
_PAYLOAD = const(12)  # where that of a control message lies
_MILLION = const(1_000_000)
_BILLION = const(1_000_000_000)


def request(self: "TimeSync", now: "int | None" = None) -> None:
    """Asks the agent for its time; ``now`` is the tick in microseconds."""
    if now is None:
        now = ticks_us()
    self._asked = now
    session = self.session
    pack_into("<II", session._control, _PAYLOAD, now // _MILLION, now % _MILLION * 1000)
    control(session, _TIMESTAMP, 8)


def error(self: "TimeSync", now: "int | None" = None) -> int:
    """The most that ``time`` is off, in microseconds; -1 before it is known."""
    if self.round_trip < 0:
        return -1
    if now is None:
        now = ticks_us()
    return _error(self, self._best, now)


def reply(self: "TimeSync", buf: "Buffer", off: int, n: int, now: int) -> None:
    """Takes a TIMESTAMP_REPLY: when it left the agent, when our request came there, our stamp."""
    asked = self._asked
    if asked is None or n < 24:
        return
    seconds, nanoseconds, came, came_ns, stamp, stamp_ns = unpack_from("<6I", buf, off)
    if stamp != asked // _MILLION or stamp_ns != asked % _MILLION * 1000:
        return  # the answer to another request, or one that the network doubled
    self._asked = None
    held = (seconds - came) * _MILLION + (nanoseconds - came_ns) // 1000
    round_trip = ticks_diff(now, asked) - held
    if held < 0 or round_trip < 0 or nanoseconds >= _BILLION:
        return  # the agent's clock was set meanwhile, or this is nonsense
    nanoseconds += round_trip * 500  # it left half a round trip ago
    exchange = (round_trip, now, seconds + nanoseconds // _BILLION, nanoseconds % _BILLION)
    self._exchanges.append(exchange)
    if len(self._exchanges) > self._kept:
        self._exchanges.pop(0)
    for other in self._exchanges:
        if _error(self, other, now) < _error(self, exchange, now):
            exchange = other
    self._best = exchange
    self.round_trip = exchange[0]


def _error(self: "TimeSync", exchange: "tuple[int, int, int, int]", now: int) -> int:
    return (exchange[0] + 1) // 2 + ticks_diff(now, exchange[1]) * self.drift // _MILLION + 1
