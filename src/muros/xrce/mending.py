"""What mends streams: messages that come early, holes, repetitions, submessages that have to wait. See ``streams``.

A reliable receiver handles messages in order and keeps those that came early, within its window; ``missing`` is the
bitmap of its ACKNACK. Memory is taken for messages that came early only, and while they wait: on most lines none does.
The answer to a hole repeats with every message that arrives behind it, so a message that was sent again is not sent
once more within ``_HOLD_OFF`` ms.

A board borrows this when the first message is lost, and keeps it for as long as its session lasts: where one is lost
there will be more.
"""

from muros.compat import const, ticks_diff
from muros.xrce.session import number_at, tell

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.xrce._types import Buffer, Send
    from muros.xrce.session import SessionCore
    from muros.xrce.streams import Input, Output

_ACKNACK = const(10)
_BITS = const(16)
_TORN = const(-1)
_HOLD_OFF = const(20)


def take(session: "SessionCore", stream: "Input", ahead: int, buf: "Buffer", off: int, n: int) -> None:
    """Takes a message of a reliable stream that is not simply the next one."""
    if not accept(stream, ahead, buf, off, n):
        acknowledge(session, stream)
    elif stream.busy or stream.expected in stream.early or session.take_next(stream, buf, off, n):
        go_on(session, stream)


def go_on(session: "SessionCore", stream: "Input") -> None:
    """Handles what is kept and in order now, and acknowledges. What a submessage sets off may lead back here; the outer
    call goes on then."""
    while not stream.busy and stream.expected in stream.early:
        number = stream.expected
        buf = stream.early[number]
        if not session.take_next(stream, buf, 0, len(buf)):
            return
        stream.early.pop(number, None)
    acknowledge(session, stream)


def acknowledge(session: "SessionCore", stream: "Input") -> None:
    """Says what is expected and what is missing."""
    bitmap = missing(stream)
    tell(session, _ACKNACK, stream.stream_id, stream.expected, bitmap >> 8 | (bitmap & 255) << 8)


def heartbeat(session: "SessionCore", stream: "Input", buf: "Buffer", at: int) -> None:
    """Takes a HEARTBEAT that tells something new."""
    announce(stream, number_at(buf, at, 0), number_at(buf, at, 2))
    go_on(session, stream)


def accept(stream: "Input", ahead: int, buf: "Buffer", off: int, n: int) -> bool:
    """Whether the message ``ahead`` of the expected one is to be handled now.

    One that came early is kept, and what comes under its number afterwards is not; others are dropped. What is longer
    than the MTU or the heap is sent again.
    """
    if ahead >= stream.window:
        return False
    if ahead >= stream.known:
        stream.known = ahead + 1
    number = stream.expected + ahead & 0xFFFF
    if ahead and n <= stream.mtu and number not in stream.early:
        try:
            stream.early[number] = bytes(memoryview(buf)[off : off + n])
        except MemoryError:
            pass
    return ahead == 0


def announce(stream: "Input", first: int, last: int) -> None:
    """The peer keeps the messages ``first`` to ``last`` and has given up what came before."""
    count = first - stream.expected & 0xFFFF
    if 0 < count < 0x8000:
        stream.expected = first
        stream.known = max(stream.known - count, 0)
        for number in list(stream.early):
            if number - first & 0x8000:
                del stream.early[number]
        if stream.fragments is not None:
            stream.fragments.limit = _TORN
    count = last + 1 - stream.expected & 0xFFFF
    if stream.known < count < 0x8000:
        stream.known = count


def missing(stream: "Input") -> int:
    """The bitmap of an ACKNACK: bit i set when ``expected + i`` is known to exist and not here."""
    bitmap = (1 << min(stream.known, _BITS)) - 1
    for number in stream.early:
        bitmap &= ~(1 << (number - stream.expected & 0xFFFF))
    return bitmap


def resend(stream: "Output", bitmap: int, send: "Send", now: int) -> None:
    """Sends again what the ``bitmap`` of an ACKNACK asks for, bit 0 being the first unacknowledged message."""
    if ticks_diff(now, stream._again_at) >= _HOLD_OFF:
        stream._again = 0
    number = stream.first
    bit = 1
    while bit <= bitmap and number != stream.sent:
        if bitmap & bit & ~stream._again:
            stream._again |= bit
            stream._again_at = now
            stream.resends += 1
            stream.transmit(number, number + 1 & 0xFFFF, send)
        number = number + 1 & 0xFFFF
        bit <<= 1
