"""How a byte stream is cut into messages: one `Framing` object for each line or connection.

The codecs themselves belong to the protocol (`muros.xrce.framing`); here they get the one shape that the
stream links use, so that another protocol's links differ by their framing only.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Protocol, TypeAlias

from muros.xrce.framing import SerialDeframer, TcpDeframer, serial_frame, tcp_frame

AGENT_ADDRESS = 0
"""Our address on serial lines, by the convention of XRCE peers."""
MESSAGE_BYTES = 65535
"""Longest message: its length is a u16 in both framings."""


NOT_FRAMES = frozenset({"garbage", "wrong-address"})
"""Kinds of `Framing.errors` that are no damaged frames of ours: other bytes, and frames for others."""


class Framing(Protocol):
    """Cuts one byte stream into messages and makes the frames for the way back."""

    def feed_untrusted(self, data: bytes) -> list[tuple[bytes, int]]:
        """Takes bytes in any pieces; returns the messages they complete, each with the peer's number on the line.

        Never raises: damage only moves the counters of `errors`.
        """

    def errors(self) -> Mapping[str, int]:
        """How often each kind of damage has been met so far."""

    def frame(self, message: bytes, peer: int) -> bytes:
        """The bytes that carry ``message`` to ``peer``."""


MakeFraming: TypeAlias = Callable[[], Framing]
"""Makes the framing of a new line or connection."""


class Cutter:
    """A framing, and what is new about its errors."""

    def __init__(self, framing: Framing) -> None:
        self.framing = framing
        self._seen = dict(framing.errors())

    def fresh_errors(self) -> dict[str, int]:
        """The kinds of error that have happened since the last call, with their numbers."""
        errors = self.framing.errors()
        if errors == self._seen:
            return {}
        seen, self._seen = self._seen, dict(errors)
        return {kind: n - seen.get(kind, 0) for kind, n in errors.items() if n != seen.get(kind, 0)}


class SerialFraming:
    """Frames with addresses and a checksum, for lines that several clients may share.

    ``local_address`` is ours; ``capacity`` the longest message taken, in bytes.
    """

    def __init__(self, local_address: int = AGENT_ADDRESS, capacity: int = MESSAGE_BYTES) -> None:
        self._local_address = local_address
        self._deframer = SerialDeframer(local_address, capacity, self._on_frame)
        self._messages: list[tuple[bytes, int]] = []

    def feed_untrusted(self, data: bytes) -> list[tuple[bytes, int]]:
        self._deframer.feed(data, len(data))
        messages, self._messages = self._messages, []
        return messages

    def errors(self) -> Mapping[str, int]:
        deframer = self._deframer
        return {
            "bad-crc": deframer.bad_crc,
            "bad-length": deframer.bad_length,
            "cut": deframer.cut,
            "wrong-address": deframer.wrong_address,
            "garbage": deframer.garbage,
        }

    def frame(self, message: bytes, peer: int) -> bytes:
        return serial_frame(message, self._local_address, peer)

    def _on_frame(self, buf: bytearray, off: int, n: int, source: int) -> None:
        self._messages.append((bytes(memoryview(buf)[off : off + n]), source))


class LengthFraming:
    """A length of 16 bits, little endian, before each message: XRCE over TCP."""

    def __init__(self, capacity: int = MESSAGE_BYTES) -> None:
        self._deframer = TcpDeframer(capacity, self._on_frame)
        self._messages: list[tuple[bytes, int]] = []

    def feed_untrusted(self, data: bytes) -> list[tuple[bytes, int]]:
        self._deframer.feed(data, len(data))
        messages, self._messages = self._messages, []
        return messages

    def errors(self) -> Mapping[str, int]:
        return {"bad-length": self._deframer.bad_length}

    def frame(self, message: bytes, peer: int) -> bytes:
        return tcp_frame(message)

    def _on_frame(self, buf: bytes, off: int, n: int, source: int) -> None:
        self._messages.append((buf[off : off + n], source))
