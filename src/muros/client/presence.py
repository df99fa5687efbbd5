"""Is there an agent? A question without a session (DDS-XRCE 1.0, 8.3.5.3: GET_INFO)."""

from muros.compat import const, ticks_diff, ticks_ms

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client._types import Transport
    from muros.xrce._types import Buffer

_ATTEMPTS = const(1)
_TIMEOUT = const(1000)
_QUESTION = b"\x80\0\0\0\x02\x01\x08\0\0\x0a\xff\xfd\x02\0\0\0"
_INFO = const(6)


def ping(transport: "Transport", attempts: int = _ATTEMPTS, timeout: int = _TIMEOUT) -> bool:
    """Whether an agent answers over ``transport`` to one of ``attempts`` questions, each within ``timeout`` ms.

    Opens the transport and leaves it open. What else comes in meanwhile is dropped: a transport that a session uses
    is asked with ``Session.ping``.
    """
    answers: "list[int]" = []

    def hear(buf: "Buffer", off: int, n: int) -> None:
        at = off + 8 if n >= 8 and buf[off] < 0x80 else off + 4
        if n >= at - off + 10 and buf[at] == _INFO and buf[at + 4] == 0 and buf[at + 5] == 10:
            answers.append(n)

    for _ in range(attempts):
        start = ticks_ms()
        left = timeout
        asked = False
        while left > 0:
            try:
                if transport.open():
                    if not asked:
                        transport.send(_QUESTION, 0, len(_QUESTION))
                        asked = True
                    transport.wait(left)
                    transport.receive(hear)
                    if answers:
                        return True
                else:
                    transport.wait(10)
            except OSError:
                break
            left = timeout - ticks_diff(ticks_ms(), start)
    return False
