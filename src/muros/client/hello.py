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
_LIVELINESS = b"\7\0\0\0uxr_hl\0\0\7\0\0\0%06d\0\0"  # a property, padded for whatever follows
_ATTEMPT = b"\x09\0\0\0muros_id\0\0\0\0\x09\0\0\0%02x%02x%02x%02x\0\0"


def hello(session: "Session") -> bytes:
    """The whole message, which names the attempt until the agent has accepted us.

    With ``properties`` the attempt becomes the property ``muros_id``, by which an agent tells a repetition from a new
    beginning. ``hard_liveliness`` in ms, up to 999999, becomes the property ``uxr_hl``.
    """
    properties = []
    if session.hard_liveliness:
        properties.append(_LIVELINESS % session.hard_liveliness)
    if session.properties:
        session.attempt = session.attempt or draw(4)
        properties.append(_ATTEMPT % tuple(session.attempt))
    body = b"XRCE\1\0\1\x0f" + session.key + session.head[:1]
    if properties:
        body += b"\1\0\0" + pack("<I", len(properties)) + b"".join(properties)
    else:
        body += b"\0"
    body += pack("<H", session.reliable.mtu)
    head = b"\x80\0\0\0" if session.head[0] >= _SESSION_NONE else b"\0\0\0\0" + session.key
    return head + pack("<BBH", 0, 1, len(body)) + body
