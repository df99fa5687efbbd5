"""Is the agent there? A question within a session, as the C library asks it (DDS-XRCE 1.0, 8.3.5.3: GET_INFO)."""

from muros.compat import const, ticks_diff

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable

    from muros.client.session import Session
    from muros.xrce._types import Buffer

_INFO = const(6)
_REQUEST = const(10)


def question(session: "Session") -> None:
    """Sends the question."""
    watching, session._ping = session._ping, _REQUEST
    session.ask()
    session._ping = watching


def ask(
    session: "Session",
    timeout: int,
    clock: "Callable[[], int]",
    send: "Callable[[Session], object]" = question,
) -> bool:
    """Whether the agent answers within ``timeout`` ms of ``clock`` and knows the session, which goes on meanwhile.

    A session that is not connected yet may become so and be asked then, with ``send(session)``.
    """
    answers: "list[int]" = []

    def hear(buf: "Buffer", off: int, n: int) -> None:
        if n >= 6 and buf[off] == 0 and buf[off + 1] == _REQUEST and buf[off + 5]:
            answers.append(n)

    session.objects[-_INFO] = hear
    try:
        asked = False
        start = clock()
        left = timeout
        while left > 0 and not answers:
            session.spin_once(clock())
            if not asked and session.up and not session.away:
                send(session)
                asked = True
            if not answers:
                session.wait(min(left, session.deadline(clock())))
            left = timeout - ticks_diff(clock(), start)
    finally:
        del session.objects[-_INFO]
    return len(answers) > 0
