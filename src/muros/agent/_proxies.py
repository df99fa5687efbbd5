"""What stands in the data space for the entities of a client: proxies, and the readings they run.

A proxy knows its own kind and its counterpart in the space; the session routes submessages to it by object id.
Deleting a parent leaves its children alive, as clients expect, so a participant stays in the space until its last
endpoint has gone.
"""

from collections.abc import Callable
from typing import Protocol

from muros.agent._calls import Call
from muros.agent._messages import ReadSpecification, data
from muros.space import Participant, Qos, Reader, Replier, Requester, Service, Topic, Writer
from muros.xrce.constants import (
    KIND_DATAREADER,
    KIND_DATAWRITER,
    KIND_PARTICIPANT,
    KIND_PUBLISHER,
    KIND_REPLIER,
    KIND_REQUESTER,
    KIND_TOPIC,
    UNLIMITED_SAMPLES,
)
from muros.xrce.queues import QueuedBestEffortOutput, QueuedReliableOutput
from muros.xrce.representation import Entity

__all__ = [
    "Answered",
    "GroupProxy",
    "ParticipantProxy",
    "Proxy",
    "Readable",
    "ReaderProxy",
    "Reading",
    "ReplierProxy",
    "RequesterProxy",
    "TopicProxy",
    "WriterProxy",
]


class ReadingHost(Protocol):
    """What a reading needs of its session and its agent."""

    @property
    def tick(self) -> int:
        """The current tick in ms."""

    def output(self, stream_id: int) -> QueuedBestEffortOutput | QueuedReliableOutput | None:
        """The output stream, made at need; None for stream 0."""

    def post(self, stream_id: int, submessage: bytes) -> bool:
        """Sends a submessage; False when it does not fit the MTU of a stream that cannot cut it."""

    def wait_for_room(self, reading: "Reading") -> None:
        """Calls ``reading.pump()`` when its stream has room again."""

    def wait_until(self, tick: int, reading: "Reading") -> Call:
        """Calls ``reading.pump()`` at ``tick``, unless the call is given to ``cancel``."""

    def cancel(self, call: Call) -> None:
        """The call is not made."""

    def sample_too_long(self, reading: "Reading", n: int) -> None:
        """A sample of ``n`` bytes was dropped: it fits neither the stream nor the limits."""

    @property
    def reachable(self) -> bool:
        """Whether there is a way to the client now."""

    @property
    def max_sample(self) -> int:
        """Longest sample sent to the client, in bytes."""


class Proxy:
    """An entity of a client. ``detail`` says for people what it is."""

    __slots__ = ("detail", "entity", "object_id", "parent")
    kind = 0

    def __init__(
        self, object_id: int, entity: Entity | None, parent: "ParticipantProxy | None", detail: str
    ) -> None:
        self.object_id = object_id
        self.entity = entity
        self.parent = parent
        self.detail = detail

    def close(self) -> None:
        """Takes it out of the space."""


class ParticipantProxy(Proxy):
    """A participant; one in the space for each of the client's."""

    __slots__ = ("_deleted", "_endpoints", "domain", "participant", "topics")
    kind = KIND_PARTICIPANT

    def __init__(
        self, object_id: int, entity: Entity | None, participant: Participant, domain: int, detail: str
    ) -> None:
        super().__init__(object_id, entity, None, detail)
        self.participant = participant
        self.domain = domain
        self.topics: list[TopicProxy] = []
        self._endpoints = 0
        self._deleted = False

    def adopt(self) -> None:
        """An endpoint was made by it."""
        self._endpoints += 1

    def release(self) -> None:
        """An endpoint of it has gone."""
        self._endpoints -= 1
        if self._deleted and not self._endpoints:
            self.participant.close()

    def close(self) -> None:
        """Takes it out of the space, once its endpoints have gone."""
        self._deleted = True
        if not self._endpoints:
            self.participant.close()


class TopicProxy(Proxy):
    """A topic: a name and a type that endpoints refer to."""

    __slots__ = ("topic",)
    kind = KIND_TOPIC

    def __init__(self, object_id: int, entity: Entity, parent: ParticipantProxy, topic: Topic) -> None:
        super().__init__(object_id, entity, parent, f"{topic.name} ({topic.type_name or 'no type'})")
        self.topic = topic
        parent.topics.append(self)

    def close(self) -> None:
        """Endpoints made with it live on."""
        assert self.parent is not None
        self.parent.topics.remove(self)


class GroupProxy(Proxy):
    """A publisher or subscriber: only a name for the participant behind it."""

    __slots__ = ("kind",)

    def __init__(self, object_id: int, entity: Entity | None, parent: ParticipantProxy, kind: int) -> None:
        super().__init__(object_id, entity, parent, "publisher" if kind == KIND_PUBLISHER else "subscriber")
        self.kind = kind


class WriterProxy(Proxy):
    """A datawriter."""

    __slots__ = ("topic", "writer")
    kind = KIND_DATAWRITER

    def __init__(
        self, object_id: int, entity: Entity, parent: ParticipantProxy, topic: Topic, qos: Qos
    ) -> None:
        super().__init__(object_id, entity, parent, f"writes {topic.name}")
        self.topic = topic
        self.writer: Writer = parent.participant.writer(topic, qos, key=object_id)
        parent.adopt()

    def close(self) -> None:
        """Takes it out of the space."""
        assert self.parent is not None
        self.writer.close()
        self.parent.release()


class Reading:
    """What a READ_DATA started: samples on their way from a source in the space to one stream of the client.

    ``take`` yields the body of the next DATA or None. It goes as fast as the stream takes and the read specification
    (DDS-XRCE 1.0, 7.7.9) allows: a count, a time, bytes a second, a pace. A sample may take more than is left of a
    second's bytes; what it took too much is made up for before the next one, so that a large sample goes too.
    """

    __slots__ = (
        "_deadline",
        "_host",
        "_ids",
        "_next",
        "_pace",
        "_rate",
        "_tokens",
        "_tokens_at",
        "_waking",
        "remaining",
        "stream_id",
        "subject",
        "take",
    )

    def __init__(
        self,
        host: ReadingHost,
        ids: bytes,
        specification: ReadSpecification,
        subject: str,
        take: Callable[[], bytes | None],
    ) -> None:
        self._host = host
        self._ids = ids
        self.stream_id = specification.stream_id
        self.remaining = -1 if specification.max_samples == UNLIMITED_SAMPLES else specification.max_samples
        self.subject = subject
        self.take = take
        self._deadline = (
            host.tick + 1000 * specification.max_elapsed_time if specification.max_elapsed_time else 0
        )
        self._rate = specification.max_bytes_per_second
        self._pace = specification.min_pace_period
        self._tokens = float(self._rate)
        self._tokens_at = self._next = host.tick
        self._waking: Call | None = None

    @property
    def active(self) -> bool:
        """Whether it may still send."""
        return self.remaining != 0

    def stop(self) -> None:
        """Sends no more."""
        self.remaining = 0
        if self._waking is not None:
            self._host.cancel(self._waking)
            self._waking = None

    def pump(self) -> None:
        """Sends what can be sent now, and sees to being called again when more can."""
        host = self._host
        output = host.output(self.stream_id)
        window = output if isinstance(output, QueuedReliableOutput) else None
        while self.remaining and host.reachable:
            now = host.tick
            if self._deadline and now >= self._deadline:
                self.remaining = 0
                return
            if (self._rate or self._pace) and not self._allowed(now):
                return
            if window is not None and window.free() <= 0:
                host.wait_for_room(self)
                return
            body = self.take()
            if body is None:
                return
            if len(body) > host.max_sample or not host.post(self.stream_id, data(self._ids, body)):
                host.sample_too_long(self, len(body))
                continue
            if self.remaining > 0:
                self.remaining -= 1
            if self._rate:
                self._tokens -= len(body)
            if self._pace:
                self._next = now + self._pace

    def _allowed(self, now: int) -> bool:
        if now < self._next:
            self._wait(self._next)
            return False
        rate = self._rate
        if not rate:
            return True
        self._tokens = min(float(rate), self._tokens + (now - self._tokens_at) * rate / 1000)
        self._tokens_at = now
        if self._tokens > 0:
            return True
        self._wait(now + max(1, int(-self._tokens * 1000 / rate) + 1))
        return False

    def _wait(self, tick: int) -> None:
        if self._waking is None or self._waking.function is None:
            self._waking = self._host.wait_until(tick, self)


class Readable(Proxy):
    """A proxy that can be read: it runs at most one reading."""

    __slots__ = ("reading", "topic")

    def __init__(
        self, object_id: int, entity: Entity, parent: ParticipantProxy, topic: Topic, detail: str
    ) -> None:
        super().__init__(object_id, entity, parent, detail)
        self.topic = topic
        self.reading: Reading | None = None
        parent.adopt()

    def take(self) -> bytes | None:
        """The body of the next DATA, None when there is none now."""
        raise NotImplementedError

    def start(self, reading: Reading) -> None:
        """Replaces what was being read by ``reading``."""
        if self.reading is not None:
            self.reading.stop()
        self.reading = reading if reading.active else None
        reading.pump()

    def close(self) -> None:
        """Ends the reading; subclasses leave the space."""
        assert self.parent is not None
        if self.reading is not None:
            self.reading.stop()
            self.reading = None
        self.parent.release()

    def _on_data(self, source: object) -> None:
        if self.reading is not None:
            self.reading.pump()


class Answered(Readable):
    """A datareader that is not in the space: the agent answers it by itself."""

    __slots__ = ()
    kind = KIND_DATAREADER


class ReaderProxy(Readable):
    """A datareader."""

    __slots__ = ("reader",)
    kind = KIND_DATAREADER

    def __init__(
        self, object_id: int, entity: Entity, parent: ParticipantProxy, topic: Topic, qos: Qos
    ) -> None:
        super().__init__(object_id, entity, parent, topic, f"reads {topic.name}")
        try:
            self.reader: Reader = parent.participant.reader(topic, qos, self._on_data, key=object_id)
        except BaseException:
            parent.release()
            raise

    def take(self) -> bytes | None:
        """The next sample's body."""
        sample = self.reader.take()
        return None if sample is None else sample.data

    def close(self) -> None:
        """Takes it out of the space."""
        self.reader.close()
        super().close()


class RequesterProxy(Readable):
    """A client of a service: its requests carry the ids of their WRITE_DATA, which the replies bring back."""

    __slots__ = ("_answered", "_limit", "_outstanding", "_sending", "requester")
    kind = KIND_REQUESTER

    def __init__(
        self, object_id: int, entity: Entity, parent: ParticipantProxy, service: Service, qos: Qos, limit: int
    ) -> None:
        topic = Topic(service.request_topic, service.request_type)
        super().__init__(object_id, entity, parent, topic, f"calls {service.name}")
        self._outstanding: dict[int, bytes] = {}
        self._limit = limit
        self._sending = self._answered = False
        try:
            self.requester: Requester = parent.participant.requester(
                service, qos, on_data=self._on_data, key=object_id
            )
        except BaseException:
            parent.release()
            raise

    def request(self, ids: bytes, body: bytes) -> bool:
        """Sends a request; False when an older one had to be given up for it."""
        room = len(self._outstanding) < self._limit
        if not room:
            del self._outstanding[next(iter(self._outstanding))]
        self._sending, self._answered = True, False
        try:
            number = self.requester.send(body)
        finally:
            self._sending = False
        self._outstanding[number] = ids
        if self._answered and self.reading is not None:
            self.reading.pump()
        return room

    def _on_data(self, source: object) -> None:
        if self._sending:  # a server in this process answers at once, before we know the request's number
            self._answered = True
        else:
            super()._on_data(source)

    def take(self) -> bytes | None:
        """The next reply behind the ids of its request; replies to requests given up are passed over."""
        while True:
            reply = self.requester.take()
            if reply is None:
                return None
            ids = self._outstanding.pop(reply.sequence, None)
            if ids is not None:
                return ids + reply.data

    def close(self) -> None:
        """Takes it out of the space."""
        self.requester.close()
        super().close()


class ReplierProxy(Readable):
    """A service: requests go to the client behind the sample identity that its reply brings back."""

    __slots__ = ("replier",)
    kind = KIND_REPLIER

    def __init__(
        self, object_id: int, entity: Entity, parent: ParticipantProxy, service: Service, qos: Qos
    ) -> None:
        topic = Topic(service.reply_topic, service.reply_type)
        super().__init__(object_id, entity, parent, topic, f"serves {service.name}")
        try:
            self.replier: Replier = parent.participant.replier(
                service, qos, on_data=self._on_data, key=object_id
            )
        except BaseException:
            parent.release()
            raise

    def take(self) -> bytes | None:
        """The next request behind its identity."""
        request = self.replier.take()
        return None if request is None else request.identity + request.data

    def close(self) -> None:
        """Takes it out of the space."""
        self.replier.close()
        super().close()
