"""The primitives that generated message code calls: checks and conversions between buffers and values.

Board floor: runs on MicroPython and CPython alike. Everything reads and writes a caller's buffer at an offset, in
little-endian XCDR1; integers are put together by shifts, since ``struct.unpack_from`` allocates a tuple on boards.
"""




class CdrError(ValueError):
    """A message does not fit its type: received bytes are short or malformed, or a value cannot be written."""
