"""What a session reports to ``on_problem(code, text)``, in few words. Hosts have more, see ``reasons``."""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.client.session import Session

SESSION = const(1)
OUT_OF_STEP = const(2)
ENTITY = const(3)
READ = const(4)
NO_ANSWER = const(5)
TOO_LARGE = const(6)
OFFLINE = const(7)
FULL = const(8)
_UNREACHABLE = const(9)

_TEXTS = (
    "the agent refuses the session: {2}",
    "the agent's streams began again behind our back: connecting anew",
    "the agent refuses {0}: {2}",
    "the agent refuses to read {0}: {2}",
    "the agent does not answer requests to create entities; asking again",
    "{1} B of {0} dropped: more than the MTU holds; publish reliably or raise it",
    "{1} B of {0} dropped: no session, or the writer is not there",
    "{1} B of {0} dropped: window or queue full",
    "no way to the agent: {0}",
    "{1} B dropped: more than largest",
)
_ERROR = const(0x80)
_STATUS = (
    "DDS error",
    "mismatch",
    "already exists",
    "denied",
    "unknown reference",
    "invalid data",
    "incompatible version",
    "no resources",
)


def tell(session: "Session", code: int, value: int, what: "Any") -> None:
    """Tells ``on_problem``, but why there is no way to the agent only when that changes; arguments as for ``text``."""
    said = text(code, value, what)
    if code == _UNREACHABLE:
        if said == session.trouble:
            return
        session.trouble = said
    session.on_problem(code, said)  # type: ignore[misc]


def text(code: int, value: int, what: "Any") -> str:
    """The problem ``code`` in words.

    ``value`` is a status or a number of bytes; ``what`` a writer, the name of another entity, or an OSError.
    """
    return _TEXTS[code - 1].format(getattr(what, "name", what), value, status(value))


def status(value: int) -> str:
    """A status of the agent in words."""
    i = value - _ERROR
    return "%s (0x%02x)" % (_STATUS[i] if 0 <= i < len(_STATUS) else "unknown status", value)
