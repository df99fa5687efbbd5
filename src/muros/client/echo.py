"""Is the agent there? A question within a session, as the C library asks it (DDS-XRCE 1.0, 8.3.5.3: GET_INFO)."""

from muros.compat import const, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.client.session import Session
    from muros.xrce._types import Buffer

_INFO = const(6)
_REQUEST = const(10)


def ask(session: "Session", timeout: int, clock: "Callable[[], int]") -> bool:
    """Whether the agent answers within ``timeout`` ms of ``clock`` and knows the session, which goes on meanwhile.

    A session that is not connected yet may become so and be asked then.
    """
    ear = _Ear(session)
    session.on_other = ear.hear  # type: ignore[method-assign]
    try:
        asked = False
        start = clock()
        left = timeout
        while left > 0 and not ear.answered:
            session.spin_once(clock())
            if not asked and session.up and not session.login:
                session.ask(_REQUEST)
                asked = True
            if not ear.answered:
                session.wait(min(left, session.deadline(clock())))
            left = timeout - ticks_diff(clock(), start)
    finally:
        del session.on_other
    return ear.answered


class _Ear:
    """Hears what comes for a session, and whether the answer is among it."""

    def __init__(self, session: "Session") -> None:
        self.answered = False
        self._other = session.on_other

    def hear(self, kind: int, buf: "Buffer", off: int, n: int) -> None:
        """Takes a submessage on behalf of the session."""
        if kind == _INFO and n >= 6 and buf[off] == 0 and buf[off + 1] == _REQUEST:
            self.answered = buf[off + 5] > 0
        self._other(kind, buf, off, n)
