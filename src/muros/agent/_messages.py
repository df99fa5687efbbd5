"""The few submessages an agent writes and reads itself, as functions from values to bytes and back."""

import struct
from dataclasses import dataclass
from typing import NamedTuple

from muros.xrce._types import Buffer
from muros.xrce.constants import (
    COOKIE,
    DATA,
    INFO,
    KIND_AGENT,
    STATUS,
    STATUS_AGENT,
    STATUS_ERR_INCOMPATIBLE,
    STATUS_ERR_INVALID_DATA,
    STATUS_OK,
    VENDOR,
    VERSION,
)

MAX_PROPERTIES = 32
MAX_PROPERTY = 256
"""Longest name or value of a client's property, in bytes."""

_AGENT = COOKIE + bytes(VERSION) + VENDOR + b"\x00"


class InvalidMessage(ValueError):  # noqa: N818
    """Foreign bytes are not the submessage they claim to be."""


@dataclass(frozen=True, slots=True)
class CreateClient:
    """A CREATE_CLIENT submessage (DDS-XRCE 1.0, 8.3.5.1)."""

    key: bytes
    session_id: int
    mtu: int
    properties: dict[str, str]
    status: int
    """STATUS_OK, or why it cannot be served."""


class ReadSpecification(NamedTuple):
    """What a READ_DATA asks for (DDS-XRCE 1.0, 7.7.9). 0 means no limit; ``max_samples`` 0 cancels."""

    stream_id: int
    data_format: int
    content_filter: str
    max_samples: int
    max_elapsed_time: int
    max_bytes_per_second: int
    min_pace_period: int


class Locator(NamedTuple):
    """Where an agent can be reached: a packed address of 4 or 16 bytes and a port."""

    address: bytes
    port: int


def parse_create_client_untrusted(data: Buffer, at: int, end: int, little_endian: bool) -> CreateClient:
    """The CREATE_CLIENT whose payload begins at ``data[at]``.

    Its length field is not looked at: clients with properties write 16 although the payload is longer. Raises
    InvalidMessage when the message ends too soon.
    """
    order = "<" if little_endian else ">"
    data = memoryview(data)[:end]  # what follows belongs to somebody else
    try:
        cookie, major, _minor, _vendor, key, session_id, has_properties = struct.unpack_from(
            "4sBB2s4sBB", data, at
        )
        at += 14
        properties: dict[str, str] = {}
        if has_properties:
            at = at + 3 & ~3
            (count,) = struct.unpack_from(order + "I", data, at)
            at += 4
            if count > MAX_PROPERTIES:
                raise InvalidMessage(f"{count} properties, at most {MAX_PROPERTIES} are taken")
            for _ in range(count):
                name, at = _string(data, at, end, order)
                properties[name], at = _string(data, at, end, order)
            at = at + 1 & ~1
        if at + 2 > end:
            raise InvalidMessage("it ends before its MTU")
        (mtu,) = struct.unpack_from(order + "H", data, at)
    except struct.error:
        raise InvalidMessage("it is cut short") from None
    status = STATUS_OK
    if cookie != COOKIE or key == b"\0\0\0\0":
        status = STATUS_ERR_INVALID_DATA
    elif major != VERSION[0]:
        status = STATUS_ERR_INCOMPATIBLE
    return CreateClient(key, session_id, mtu, properties, status)


def parse_read_data_untrusted(data: Buffer, at: int, end: int, little_endian: bool) -> ReadSpecification:
    """The read specification at ``data[at]``, behind request id and object id. Raises InvalidMessage."""
    order = "<" if little_endian else ">"
    data = memoryview(data)[:end]  # what follows belongs to somebody else
    try:
        stream_id, data_format, has_filter = struct.unpack_from("BBB", data, at)
        at += 3
        content_filter = ""
        if has_filter:
            content_filter, at = _string(data, at, end, order)
        if at >= end:
            raise InvalidMessage("it is cut short")
        if not data[at]:
            return ReadSpecification(stream_id, data_format, content_filter, 1, 0, 0, 0)
        at = at + 2 & ~1
        if at + 8 > end:
            raise InvalidMessage("it is cut short")
        return ReadSpecification(
            stream_id, data_format, content_filter, *struct.unpack_from(order + "4H", data, at)
        )
    except struct.error:
        raise InvalidMessage("it is cut short") from None


def _string(data: Buffer, at: int, end: int, order: str) -> tuple[str, int]:
    at = at + 3 & ~3
    (n,) = struct.unpack_from(order + "I", data, at)
    at += 4
    if n > MAX_PROPERTY or at + n > end:
        raise InvalidMessage(f"a text of {n} bytes where {max(0, end - at)} are left")
    return bytes(data[at : at + n]).rstrip(b"\0").decode("utf-8", "replace"), at + n


def status_agent(status: int) -> bytes:
    """STATUS_AGENT (8.3.5.5), header and payload."""
    return struct.pack("<BBHBB", STATUS_AGENT, 1, 2 + len(_AGENT), status, 0) + _AGENT


def status(ids: bytes, result: int) -> bytes:
    """STATUS (8.3.5.6); ``ids`` are request id and object id as they came."""
    return struct.pack("<BBH4sBB", STATUS, 1, 6, ids, result, 0)


def data(ids: bytes, body: bytes) -> bytes:
    """DATA (8.3.5.10); a body too long for the length field is marked with length 0."""
    n = len(body) + 4
    return struct.pack("<BBH4s", DATA, 1, n if n < 0x10000 else 0, ids) + body


def info(ids: bytes, implementation_status: int, locators: list[Locator]) -> bytes:
    """INFO (8.3.5.7) about the agent: who it is, that it is there, and where it can be reached."""
    body = bytearray(ids)
    body += bytes((STATUS_OK, implementation_status, 1, KIND_AGENT)) + _AGENT
    body += bytes((1, KIND_AGENT))
    body += b"\0" * (-len(body) % 2) + (1).to_bytes(2, "little")
    body += b"\0" * (-len(body) % 4) + len(locators).to_bytes(4, "little")
    for address, port in locators:
        if len(address) == 4:
            body += b"\x01" + address
            body += b"\0" * (-len(body) % 2) + port.to_bytes(2, "little")
        else:
            body += b"\x02" + address
            body += b"\0" * (-len(body) % 4) + port.to_bytes(4, "little")
    return struct.pack("<BBH", INFO, 1, len(body)) + bytes(body)
