"""The message with which a client asks for a session: CREATE_CLIENT (DDS-XRCE 1.0, 7.8.2.1 and 8.3.5.1)."""

from struct import pack

from muros.compat import const

_SESSION_NONE = const(0x80)


def hello(session_id: int, key: bytes, mtu: int, attempt: "bytes | None", hard_liveliness: int) -> bytes:
    """The whole message.

    ``attempt`` becomes the property ``muros_id``, by which an agent tells a repetition from a new beginning.
    ``hard_liveliness`` in ms, up to 999999, becomes the property ``uxr_hl``.
    """
    body = b"XRCE\1\0\1\x0f" + key + bytes((session_id,))
    properties = []
    if hard_liveliness:
        properties.append(("uxr_hl", "%06d" % hard_liveliness))
    if attempt:
        properties.append(("muros_id", "%02x%02x%02x%02x" % (attempt[0], attempt[1], attempt[2], attempt[3])))
    if properties:
        body += b"\1\0\0" + pack("<I", len(properties))
        for pair in properties:
            for text in pair:
                body += bytes(-len(body) & 3) + pack("<I", len(text) + 1) + text.encode() + b"\0"
        body += bytes(len(body) & 1)
    else:
        body += b"\0"
    body += pack("<H", mtu)
    head = b"\x80\0\0\0" if session_id >= _SESSION_NONE else b"\0\0\0\0" + key
    return head + pack("<BBH", 0, 1, len(body)) + body
