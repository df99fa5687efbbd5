"""The message with which a client asks for a session: CREATE_CLIENT (DDS-XRCE 1.0, 7.8.2.1 and 8.3.5.1).

Boards borrow this.
"""

from struct import pack

from muros.client.chance import draw
from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from muros.client.session import Session

_SESSION_NONE = const(0x80)
_CREATE_FIRST = const(0x0100)  # CREATE_CLIENT and its flags, little endian
_ONE = b"\1\0\0\1\0\0\0"  # so many properties follow
_TWO = b"\1\0\0\2\0\0\0"
_LIVELINESS = b"\7\0\0\0uxr_hl\0\0\7\0\0\0%06d\0\0"  # a property, padded for whatever follows
_ATTEMPT = b"\x09\0\0\0muros_id\0\0\0\0\x09\0\0\0%08x\0\0"


def hello(session: "Session") -> bytes:
    """The whole message, which names the attempt until the agent has accepted us.

    With ``properties`` the attempt becomes the property ``muros_id``, by which an agent tells a repetition from a new
    beginning. ``hard_liveliness`` in ms, up to 999999, becomes the property ``uxr_hl``.
    """
    head = session.head
    body = b"XRCE\1\0\1\x0f" + session.key + head[:1]
    if session.hard_liveliness:
        body += (_TWO if session.properties else _ONE) + _LIVELINESS % session.hard_liveliness
    else:
        body += _ONE if session.properties else b"\0"
    if session.properties:
        session.attempt = session.attempt or draw()
        body += _ATTEMPT % session.attempt
    body += pack("<H", session.reliable.mtu)
    return pack("<I", head[0] & _SESSION_NONE) + head[4:] + pack("<HH", _CREATE_FIRST, len(body)) + body
