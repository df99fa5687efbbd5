"""CDR of the few messages that the tests exchange, by hand: nothing of muros judges muros."""

import struct
import zlib
from typing import Any

__all__ = ["array", "basic", "basic_value", "goal_info", "pattern", "string", "text_of"]

_BASIC = struct.Struct("<?BBxfdbBhHxxiIqQ")


def string(text: str) -> bytes:
    """std_msgs/msg/String."""
    data = text.encode() + b"\0"
    return struct.pack("<I", len(data)) + data


def text_of(body: bytes) -> str:
    """What a String says."""
    (size,) = struct.unpack_from("<I", body)
    return body[4 : 4 + size - 1].decode()


def pattern(size: int, n: int = 0) -> bytes:
    """The bytes that a peer's `publish_bytes` puts into its message number `n`."""
    data = bytearray((bytes(range(251)) * (size // 251 + 1))[:size])
    data[0] = n % 251
    return bytes(data)


def array(data: bytes) -> bytes:
    """std_msgs/msg/UInt8MultiArray without dimensions."""
    return struct.pack("<III", 0, 0, len(data)) + data


def shown(data: bytes) -> dict[str, Any]:
    """How a peer shows long bytes."""
    return {"size": len(data), "sum": zlib.crc32(data)}


def basic(int32: int = 0, int64: int = 0, text: str = "") -> bytes:
    """Request or response of test_msgs/srv/BasicTypes."""
    return _BASIC.pack(False, 0, 0, 0.0, 0.0, 0, 0, 0, 0, int32, 0, int64, 0) + string(text)


def basic_value(body: bytes) -> tuple[int, int]:
    """int32_value and int64_value of a BasicTypes."""
    values = _BASIC.unpack_from(body)
    return values[9], values[11]


def goal_info(identity: bytes, stamp: tuple[int, int] = (0, 0)) -> bytes:
    """action_msgs/msg/GoalInfo."""
    return identity + struct.pack("<iI", *stamp)


def numbers(values: list[int]) -> bytes:
    """sequence<int32>."""
    return struct.pack(f"<I{len(values)}i", len(values), *values)


def numbers_of(body: bytes, at: int = 0) -> list[int]:
    """A sequence<int32>."""
    (size,) = struct.unpack_from("<I", body, at)
    return list(struct.unpack_from(f"<{size}i", body, at + 4))
