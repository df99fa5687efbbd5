"""What a session reports to ``on_problem(code, text)``, in words."""

from muros.compat import const

SESSION = const(1)
OUT_OF_STEP = const(2)
ENTITY = const(3)
READ = const(4)
NO_ANSWER = const(5)
TOO_LARGE = const(6)
OFFLINE = const(7)
FULL = const(8)

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


def text(code: int, value: int, name: str) -> str:
    """The problem ``code`` in words; ``value`` is a status or a number of bytes, ``name`` the entity's."""
    if code == SESSION:
        return "the agent refuses the session: " + _status(value)
    if code == OUT_OF_STEP:
        return "the agent's streams began again behind our back: connecting anew"
    if code == ENTITY:
        return "the agent refuses " + name + ": " + _status(value)
    if code == READ:
        return "the agent refuses to read " + name + ": " + _status(value)
    if code == NO_ANSWER:
        return "the agent does not answer requests to create entities; asking again"
    if code == TOO_LARGE:
        return "%d B of %s dropped: more than the MTU holds; publish reliably or raise it" % (value, name)
    if code == OFFLINE:
        return "%d B of %s dropped: no session, or the entity is not there" % (value, name)
    return "%d B of %s dropped: the window is full; publish less often or set queue" % (value, name)


def _status(value: int) -> str:
    i = value - _ERROR
    return "%s (0x%02x)" % (_STATUS[i] if 0 <= i < len(_STATUS) else "unknown status", value)
