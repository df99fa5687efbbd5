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
_LARGEST = const(10)

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
        if session.trouble is not None and session.trouble[0] == said:
            return
        session.trouble = (said, None)
    if session.on_problem is not None:
        session.on_problem(code, said)


def text(code: int, value: int, what: "Any") -> str:
    """The problem ``code`` in words.

    ``value`` is a status or a number of bytes; ``what`` a writer, the name of another entity, or an OSError.
    """
    if code == SESSION:
        return "the agent refuses the session: " + status(value)
    if code == OUT_OF_STEP:
        return "the agent's streams began again behind our back: connecting anew"
    if code == ENTITY:
        return "the agent refuses %s: %s" % (what, status(value))
    if code == READ:
        return "the agent refuses to read %s: %s" % (what, status(value))
    if code == NO_ANSWER:
        return "the agent does not answer requests to create entities; asking again"
    if code == _UNREACHABLE:
        return "no way to the agent: %s" % what
    if code == _LARGEST:
        return "%d B dropped: more than largest" % value
    if code == TOO_LARGE:
        why = "more than the MTU holds; publish reliably or raise it"
    elif code == OFFLINE:
        why = "no session, or the writer is not there"
    else:
        why = "window or queue full"
    return "%d B of %s dropped: %s" % (value, what.name, why)


def status(value: int) -> str:
    """A status of the agent in words."""
    i = value - _ERROR
    return "%s (0x%02x)" % (_STATUS[i] if 0 <= i < len(_STATUS) else "unknown status", value)
