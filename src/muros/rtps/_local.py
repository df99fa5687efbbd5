"""Writers and readers of a participant, as its owner sees them."""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

from muros.rtps._constants import StatusInfo
from muros.rtps._discovery_data import EndpointData
from muros.rtps._parameters import Parameters
from muros.rtps._qos import EndpointQos
from muros.rtps._values import EntityId, Guid

__all__ = ["LocalReader", "LocalWriter", "OnSample", "Received"]


class Received(NamedTuple):
    """A sample that has come, or news of an instance of a topic with a key."""

    writer: Guid
    sequence: int
    payload: bytes
    """Begins with its encapsulation; padding may follow. Empty when the instance is named by its key hash only."""
    source_time: int | None
    """When it was written, ns since 1970; None = not said."""
    inline_qos: Parameters | None
    status: StatusInfo | int = 0
    """Whether the instance was disposed or unregistered; always 0 on topics without a key."""
    instance: bytes = b""
    """Key hash of the instance, 16 bytes, where the writer sends it; empty = not said, or no key."""
    expires: int | None = None
    """When the sample's lifespan ends, on the clock of `now`, counted from its arrival; None = never."""


OnSample: TypeAlias = Callable[[Received], bool | None]
"""Takes a sample. False refuses it for now: it, and what is behind it, waits until `LocalReader.resume`.

Called while the datagram is handled: may write with any writer and close anything, but must not raise.
"""


class LocalWriter:
    """A writer of ours. Made by `ParticipantCore.writer`."""

    guid: Guid
    entity: EntityId
    data: EndpointData
    """What others are told of it."""

    @property
    def qos(self) -> EndpointQos:
        """As given when it was made."""
        raise NotImplementedError

    @property
    def matched(self) -> tuple[Guid, ...]:
        """Readers it writes to."""
        raise NotImplementedError

    @property
    def last(self) -> int:
        """Sequence number of the last sample written."""
        raise NotImplementedError

    @property
    def acknowledged(self) -> bool:
        """Whether all reliable readers have everything written so far."""
        raise NotImplementedError

    def write(
        self,
        payload: bytes,
        now: int,
        *,
        source_time: int | None = None,
        inline_qos: bytes = b"",
        to: Guid | None = None,
        instance: bytes = b"",
    ) -> int:
        """Write a sample (encapsulation included); its sequence number, or 0 when there is no room now (keep all):
        `on_room` is called when writing is worth trying again.

        source_time: ns since 1970. inline_qos: a little-endian parameter list (`muros.rtps.inline_qos`).
        to: only this matched reader gets it (the others learn that it is not for them). instance: key hash of 16
        bytes, for a topic with a key. ValueError: `to` is not matched, the inline QoS are too large, or the writer
        is closed.
        """
        raise NotImplementedError

    def dispose(
        self,
        instance: bytes,
        now: int,
        *,
        key: bytes = b"",
        source_time: int | None = None,
        unregister: bool = False,
    ) -> int:
        """The instance is no more. key: its serialized key, where known. unregister: nor will it be written again."""
        raise NotImplementedError

    def unregister(
        self, instance: bytes, now: int, *, key: bytes = b"", source_time: int | None = None
    ) -> int:
        """The instance will not be written by this writer any more."""
        raise NotImplementedError

    def assert_liveliness(self, now: int) -> None:
        """The writer is alive (manual liveliness). Writing says so, too."""
        raise NotImplementedError

    def close(self, now: int) -> None:
        """Take it away; others are told. Closing twice is allowed."""
        raise NotImplementedError


class LocalReader:
    """A reader of ours. Made by `ParticipantCore.reader`."""

    guid: Guid
    entity: EntityId
    data: EndpointData

    @property
    def qos(self) -> EndpointQos:
        """As given when it was made."""
        raise NotImplementedError

    @property
    def matched(self) -> tuple[Guid, ...]:
        """Writers it reads from."""
        raise NotImplementedError

    def resume(self, now: int) -> None:
        """Offer again what was refused."""
        raise NotImplementedError

    def close(self, now: int) -> None:
        """Take it away; others are told. Closing twice is allowed."""
        raise NotImplementedError


OnRoom: TypeAlias = Callable[[], object]
