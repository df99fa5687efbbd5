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


def hello(session: "Session") -> bytes:
    """The whole message, which names the attempt until the agent has accepted us.

    With ``properties`` the attempt becomes the property ``muros_id``, by which an agent tells a repetition from a new
    beginning. ``hard_liveliness`` in ms, up to 999999, becomes the property ``uxr_hl``.
    """
    if not session.attempt:
        session.attempt = draw(4)
    properties = []
    if session.hard_liveliness:
        properties.append(("uxr_hl", "%06d" % session.hard_liveliness))
    if session.properties:
        properties.append(("muros_id", "%02x%02x%02x%02x" % tuple(session.attempt)))
    body = b"XRCE\1\0\1\x0f" + session.key + session.head[:1]
    if properties:
        body += b"\1\0\0" + pack("<I", len(properties))
        for pair in properties:
            for text in pair:
                body += bytes(-len(body) & 3) + pack("<I", len(text) + 1) + text.encode() + b"\0"
        body += bytes(len(body) & 1)
    else:
        body += b"\0"
    body += pack("<H", session.mtu)
    head = b"\x80\0\0\0" if session.head[0] >= _SESSION_NONE else b"\0\0\0\0" + session.key
    return head + pack("<BBH", 0, 1, len(body)) + body
