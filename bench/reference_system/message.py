"""The message of the reference system: 4096 bytes that carry the history of a sample, an entry for each node passed.

It is a class of its own beside the generated ones, for most of it is empty: only the entries there are get encoded.
"""

import struct
from collections.abc import Iterable
from typing import Final, NamedTuple

__all__ = ["CAPACITY", "NAME_SIZE", "SIZE", "Entry", "Message"]

SIZE: Final = 4096
CAPACITY: Final = 63
"""Entries that fit."""
NAME_SIZE: Final = 48
"""Bytes of a name, with a zero at its end."""

_ENTRY = struct.Struct(f"<QII{NAME_SIZE}s")
_COUNT = struct.Struct("<Q")


class Entry(NamedTuple):
    """That a sample passed a node: when its callback began (ns), its how-manieth output that was, what it missed."""

    name: str
    stamp: int
    sequence: int
    missed: int


class Message:
    """A sample with the entries of the nodes it has passed, at most `CAPACITY`."""

    TYPE = "reference_interfaces/msg/Message4kb"

    def __init__(self, entries: Iterable[Entry] = ()) -> None:
        self.entries = list(entries)

    def add(self, entry: Entry) -> None:
        """Appends an entry, its name cut to fit; in a full message it has no place."""
        if len(self.entries) < CAPACITY:
            self.entries.append(entry._replace(name=entry.name[: NAME_SIZE - 1]))

    def merge(self, other: "Message") -> None:
        """Appends the entries of another message whose nodes are not here yet."""
        known = {entry.name for entry in self.entries}
        for entry in other.entries:
            if entry.name not in known:
                self.add(entry)

    def find(self, name: str) -> Entry | None:
        """The entry of a node."""
        return next((entry for entry in self.entries if entry.name == name), None)

    def size(self) -> int:
        """Bytes of it on the wire."""
        return SIZE

    def serialize(self) -> bytes:
        """It as CDR."""
        buf = bytearray(SIZE)
        self.write(buf, 0)
        return bytes(buf)

    def write(self, buf: bytearray, off: int) -> int:
        """Puts it into a buffer; the offset behind it."""
        _COUNT.pack_into(buf, off, len(self.entries))
        at = off + _COUNT.size
        for name, stamp, sequence, missed in self.entries:
            _ENTRY.pack_into(buf, at, stamp, sequence, missed, name.encode()[: NAME_SIZE - 1])
            at += _ENTRY.size
        return off + SIZE

    def read(self, buf: bytes, off: int, n: int) -> None:
        """Takes it from a buffer. ValueError for what is no such message."""
        if n < SIZE:
            raise ValueError(f"{n} B are no message of {SIZE} B")
        count = _COUNT.unpack_from(buf, off)[0]
        if count > CAPACITY:
            raise ValueError(f"{count} entries, where at most {CAPACITY} fit")
        at = off + _COUNT.size
        self.entries = []
        for _ in range(count):
            stamp, sequence, missed, name = _ENTRY.unpack_from(buf, at)
            self.entries.append(
                Entry(name.partition(b"\0")[0].decode(errors="replace"), stamp, sequence, missed)
            )
            at += _ENTRY.size
