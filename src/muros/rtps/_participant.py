"""One participant of this process."""

from collections.abc import Callable

from muros.rtps._discovery_data import EndpointData, ParticipantData
from muros.rtps._local import LocalReader, LocalWriter, OnSample
from muros.rtps._news import Mismatch, ParticipantEvent
from muros.rtps._qos import EndpointQos
from muros.rtps._settings import ReaderSettings, WriterSettings
from muros.rtps._values import EntityId, Guid, GuidPrefix

__all__ = ["ParticipantCore"]


class ParticipantCore:
    """One participant of this process. Made by `DomainCore.participant`."""

    prefix: GuidPrefix
    guid: Guid
    domain: int
    data: ParticipantData
    """What others are told of it."""
    on_event: Callable[[ParticipantEvent], object] | None

    @property
    def participants(self) -> tuple[ParticipantData, ...]:
        """All others that are there, those of this process included."""
        raise NotImplementedError

    @property
    def endpoints(self) -> tuple[EndpointData, ...]:
        """All writers and readers of others."""
        raise NotImplementedError

    def endpoint(self, guid: Guid) -> EndpointData | None:
        """The writer or reader of somebody else with this GUID."""
        raise NotImplementedError

    def on_topic(self, topic: str) -> tuple[EndpointData, ...]:
        """The writers and readers of others with this topic."""
        raise NotImplementedError

    @property
    def writers(self) -> tuple[LocalWriter, ...]:
        """Its own."""
        raise NotImplementedError

    @property
    def readers(self) -> tuple[LocalReader, ...]:
        """Its own."""
        raise NotImplementedError

    def mismatches(self, local: Guid) -> dict[Guid, tuple[Mismatch, ...]]:
        """Those of others that have the topic of this writer or reader of ours but do not match, and why."""
        raise NotImplementedError

    def writer(
        self,
        topic: str,
        type_name: str,
        qos: EndpointQos,
        *,
        now: int,
        entity: EntityId | None = None,
        keyed: bool = False,
        user_data: bytes = b"",
        last: int = 0,
        settings: WriterSettings | None = None,
        on_room: Callable[[], object] | None = None,
    ) -> LocalWriter:
        """A new writer.

        entity: its entity id, with the kind of a user's writer (0x..02 with a key, 0x..03 without); None = the next
        free one. keyed: whether the topic has a key, where `entity` does not say. last: the sequence number of the
        last sample that an earlier life of the same GUID wrote. on_room: called when a refused sample is worth
        trying again. ValueError: the id is in use or no writer's, or the participant is closed.
        """
        raise NotImplementedError

    def reader(
        self,
        topic: str,
        type_name: str,
        qos: EndpointQos,
        on_sample: OnSample,
        *,
        now: int,
        entity: EntityId | None = None,
        keyed: bool = False,
        user_data: bytes = b"",
        settings: ReaderSettings | None = None,
        expects_inline_qos: bool = False,
    ) -> LocalReader:
        """A new reader; as `writer` (kinds of readers: 0x..07 with a key, 0x..04 without)."""
        raise NotImplementedError

    def set_user_data(self, user_data: bytes, now: int) -> None:
        """Tell others different user data."""
        raise NotImplementedError

    def assert_liveliness(self, now: int) -> None:
        """The participant, and so its writers with MANUAL_BY_PARTICIPANT liveliness, are alive."""
        raise NotImplementedError

    def close(self, now: int) -> None:
        """Take it away with all it has; others are told. Closing twice is allowed."""
        raise NotImplementedError
