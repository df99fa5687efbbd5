"""The small values of the wire: GUIDs, locators, times. Everything that crosses a network is made of them."""

import struct
from typing import Final, NamedTuple

__all__ = [
    "INFINITE",
    "EntityId",
    "Guid",
    "GuidPrefix",
    "Locator",
    "duration_from_wire",
    "duration_to_wire",
    "guid_of",
    "split_guid",
    "time_from_wire",
    "time_to_wire",
    "udp4",
]

GuidPrefix = bytes
"""12 bytes that name a participant (DDSI-RTPS 2.3, 9.3.1.1)."""

EntityId = int
"""Names an entity within its participant: the four octets of the wire as a big-endian number (9.3.1.2)."""

Guid = bytes
"""16 bytes: a prefix and an entity id (9.3.1.3)."""

PREFIX_SIZE: Final = 12

INFINITE: Final = 2**63 - 1
"""A duration without end, in ns, as ROS 2 counts it."""

UDP4: Final = 1
UDP6: Final = 2
"""Kinds of locators (DDSI-RTPS 2.3, 9.3.2). Others, such as shared memory, are carried but not understood."""


class Locator(NamedTuple):
    """Where datagrams can be sent (DDSI-RTPS 2.3, 9.3.2)."""

    kind: int
    """`UDP4`, `UDP6`, or a vendor's own."""
    port: int
    address: bytes
    """16 bytes; IPv4 stands in the last four."""

    @property
    def host(self) -> str:
        """The address as text; "" for kinds other than UDP. IPv6 is written out in full, without brackets."""
        if self.kind == UDP4:
            return ".".join(map(str, self.address[12:]))
        if self.kind == UDP6:
            return ":".join(f"{group:x}" for group in struct.unpack(">8H", self.address))
        return ""

    def __str__(self) -> str:
        host = self.host
        if self.kind == UDP6:
            host = f"[{host}]"
        return f"{host or f'kind {self.kind} {self.address.hex()}'}:{self.port}"


def udp4(host: str, port: int) -> Locator:
    """The locator of a dotted IPv4 address. ValueError when `host` is none."""
    octets = host.split(".")
    if len(octets) != 4 or not all(
        octet.isascii() and octet.isdigit() and int(octet) < 256 for octet in octets
    ):
        raise ValueError(f"{host!r} is not a dotted IPv4 address")
    return Locator(UDP4, port, bytes(12) + bytes(map(int, octets)))


def guid_of(prefix: GuidPrefix, entity: EntityId) -> Guid:
    """The GUID of an entity of the participant `prefix`."""
    return prefix + entity.to_bytes(4, "big")


def split_guid(guid: Guid) -> tuple[GuidPrefix, EntityId]:
    """Prefix and entity id of a GUID of 16 bytes."""
    return guid[:PREFIX_SIZE], int.from_bytes(guid[PREFIX_SIZE:], "big")


# Seconds and fractions of 1 / 2**32 s (DDSI-RTPS 2.3, 9.3.2). Both ways are rounded, not cut: a time in ns
# then survives a round trip, for one ns is more than four fractions.

_SECOND: Final = 10**9
_TIME_INVALID: Final = (0xFFFFFFFF, 0xFFFFFFFF)
_DURATION_INFINITE: Final = (0x7FFFFFFF, 0xFFFFFFFF)


def time_to_wire(ns: int) -> tuple[int, int]:
    """Seconds and fraction (both unsigned) of a time in ns since 1970; ValueError outside of 1970..2106."""
    whole, rest = divmod(ns, _SECOND)
    if not 0 <= whole < 0xFFFFFFFF:
        raise ValueError(f"{ns} ns since 1970 does not fit an RTPS time (1970 to 2106)")
    return whole, (rest << 32) // _SECOND + (((rest << 32) % _SECOND) * 2 >= _SECOND)


def time_from_wire(seconds: int, fraction: int) -> int | None:
    """ns since 1970; None for TIME_INVALID."""
    if (seconds, fraction) == _TIME_INVALID:
        return None
    return seconds * _SECOND + (fraction * _SECOND + 0x80000000 >> 32)


def duration_to_wire(ns: int) -> tuple[int, int]:
    """Seconds and fraction of a duration from 0 ns; what is too long for the wire becomes infinite.

    ValueError when `ns` is negative.
    """
    if ns < 0:
        raise ValueError(f"a duration of {ns} ns is negative")
    if ns >= _DURATION_INFINITE[0] * _SECOND:
        return _DURATION_INFINITE
    return time_to_wire(ns)


def duration_from_wire(seconds: int, fraction: int) -> int:
    """ns of a duration; `seconds` may be read signed or unsigned. Negative and infinite ones are `INFINITE`.

    Only what has the largest number of seconds counts as infinite: writers differ in the fraction they send.
    """
    if not 0 <= seconds < _DURATION_INFINITE[0]:
        return INFINITE
    return seconds * _SECOND + (fraction * _SECOND + 0x80000000 >> 32)
