"""What a context makes on a space: nodes, publishers, readers, and the two sides of services."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from muros.client.link import CONNECTED
from muros.client.names import dds_type, topic_name
from muros.client.problems import FULL, OFFLINE
from muros.interfaces import CdrError, InterfaceError
from muros.interfaces import message as message_class
from muros.rclc.errors import RclError
from muros.rclc.host.outlet import body as encode
from muros.space import _door
from muros.space._qos import Qos
from muros.space._values import CDR_BE, CDR_LE, Sample, Service, Topic
from muros.space.rclc._problems import ENCODING

if TYPE_CHECKING:
    from muros.client._types import Message, OnData, Outgoing
    from muros.client.services import OnReply, OnRequest
    from muros.space.rclc._middleware import SpaceMiddleware

__all__ = ["LONGEST_NAME", "Node", "Publisher", "Reader", "Receiver", "Replier", "Requester"]

LONGEST_NAME: Final = 255
"""Longest name of a topic, type or node, in characters: that of ROS 2's middlewares."""

READER_FULL: Final = "a reliable reader that keeps all is full. Publish less often, or try again."
"""Why a sample was not taken that may be taken later."""

_AT_ONCE: Final = 64
"""Samples that one reader hands on before the others have their turn."""


class Node:
    """A node: a participant of the space."""

    def __init__(self, context: SpaceMiddleware, name: str, namespace: str, domain: int) -> None:
        full = f"{namespace.rstrip('/')}/{name}"
        topic_name("", full, "", LONGEST_NAME)  # complains now about what cannot be
        self.context = context
        try:
            self.participant = context.ground.space.participant(
                name, namespace=namespace, domain=domain, enclave=context.enclave
            )
        except _door.SpaceError as error:  # there is no network for this domain
            raise RclError(str(error)) from None

    def destroy(self) -> None:
        """Takes it out of the space, with everything made on it."""
        context = self.context
        with context.ground.lock:
            self.participant.close()
            if self in context.nodes:
                context.nodes.remove(self)


class _Entity:
    """What all of them have in common. `name` is that in DDS, of a service that in ROS."""

    def __init__(self, node: Node, name: str, type_name: str) -> None:
        node.context.be_open()
        if node.participant.closed:
            raise RclError(f"node {node.participant.owner} was destroyed; make a new one")
        self.node = node
        self.name = name
        self.type_name = type_name
        self.entity: Any = None
        self.context = node.context
        self._lock = node.context.ground.lock
        self._refused = 0

    def destroy(self) -> None:
        """Takes it out of the space."""
        with self._lock:
            self.entity.close()

    def refuse(self, code: int, size: int, why: str) -> bool:
        """Something was not taken: says so the 1st, 2nd, 4th, 8th... time. False."""
        self._refused += 1
        if self._refused & (self._refused - 1) == 0:
            self.context.problem(code, f"{size} B of {self.name} dropped: {why}")
        return False

    def gone(self) -> str:
        """Why nothing can be sent, empty if it can."""
        if not self.entity.closed:
            return ""
        return "the context is closed." if self.context.closed else "it was destroyed."


class Publisher(_Entity):
    """Writes messages."""

    entity: _door.Writer

    def __init__(self, node: Node, topic: str, type_name: str, qos: Qos) -> None:
        super().__init__(node, topic, type_name)
        self.entity = node.participant.writer(_topic(topic, type_name), qos)

    def publish(self, message: Outgoing, /) -> bool:
        """Sends a message; False when it was not taken."""
        return self.write_bytes(encode(message))

    @property
    def matched(self) -> int:
        """Readers that get what is published."""
        with self._lock:
            return len(self.entity.matched)

    @property
    def acknowledged(self) -> bool:
        """Whether all that was published has reached every reliable reader."""
        with self._lock:
            return self.entity.closed or self.entity.acknowledged

    def offer(self, message: Outgoing, /) -> bool | None:
        """``publish``, but None, in place of a problem, where there may be room for the message later."""
        why = self._write(encode(message))
        return None if why == READER_FULL else not why

    def write_bytes(self, data: bytes) -> bool:
        """Sends a sample that is serialised already."""
        why = self._write(data)
        return not why or self.refuse(FULL if why == READER_FULL else OFFLINE, len(data), why)

    def _write(self, data: bytes) -> str:
        """Sends a sample; why it was not taken, empty if it was."""
        with self._lock:
            why = self.gone()
            if why:
                return why
            if not self.entity.write(data):
                return READER_FULL
            if self.context.state != CONNECTED:
                self.context.be_spun(self.name)
        return ""


class Receiver(_Entity):
    """What takes things out of the space. `callback` is given them by `hand_on`."""

    callback: Any

    announced = False
    """Whether the context knows already that there is something to hand on."""

    @property
    def taker(self) -> Any:
        """What takes what comes, the callback; it may be exchanged."""
        return self.callback

    @taker.setter
    def taker(self, taker: Any) -> None:
        self.callback = taker

    def hand_on(self) -> tuple[int, Exception | None]:
        """Hand on what is there now; how many that were, and what a callback raised."""
        self.announced = False
        failure: Exception | None = None
        for taken in range(_AT_ONCE):
            with self._lock:
                item = self.entity.take()
            if item is None:
                return taken, failure
            try:
                self.deliver(item)
            except Exception as error:
                failure = error
        with self._lock:
            self.came(self)  # the space tells again only after it was empty
        return _AT_ONCE, failure

    def came(self, source: object) -> None:
        """The space has something."""
        if not self.announced:
            self.announced = True
            self.context.announce(self)

    def deliver(self, item: Any) -> None:
        """Give one to the callback."""
        raise NotImplementedError

    def body(self, sample: Sample, type_name: str) -> bytes | None:
        """The sample's body as little-endian CDR; None if it cannot be had."""
        if sample.representation == CDR_LE:
            return sample.data
        why = f"its representation 0x{sample.representation:04X} is not read here, only classic CDR"
        if sample.representation == CDR_BE:
            try:
                data: bytes = message_class(type_name).deserialize(sample.data, big_endian=True).serialize()
                return data
            except (InterfaceError, CdrError) as error:
                why = str(error)
        self.refuse(ENCODING, len(sample.data), why)
        return None


class Reader(Receiver):
    """Reads messages."""

    entity: _door.Reader

    def __init__(self, node: Node, topic: str, type_name: str, qos: Qos, on_data: OnData | None) -> None:
        super().__init__(node, topic, type_name)
        self.callback = on_data
        self.entity = node.participant.reader(
            _topic(topic, type_name), qos, None if on_data is None else self.came
        )

    def deliver(self, item: Sample) -> None:
        """Give a sample to the callback."""
        data = self.body(item, self.type_name)
        if data is not None:
            self.callback(data, 0, len(data))


class Requester(Receiver):
    """Asks a service. `callback(number, buf, off, n)` gets the replies."""

    entity: _door.Requester

    def __init__(self, node: Node, name: str, type_name: str, qos: Qos, on_reply: OnReply) -> None:
        super().__init__(node, name, type_name)
        self.callback = on_reply
        self.entity = node.participant.requester(_service(name, type_name), qos, on_data=self.came)

    @property
    def servers(self) -> int:
        """Servers that a request goes to."""
        with self._lock:
            return self.entity.servers

    def room(self) -> bool:
        """Whether a request that is sent now can go out: one without a server waits for it in the space."""
        return not self.entity.closed

    def send(self, request: Message, /) -> int:
        """Sends a request; its number, 0 when it was not taken."""
        data = encode(request)
        with self._lock:
            why = self.gone()
            if not why:
                return self.entity.send(data)
        self.refuse(OFFLINE, len(data), why)
        return 0

    def deliver(self, item: Any) -> None:
        """Give a reply to the callback."""
        data = self.body(item.sample, self.type_name + "_Response")
        if data is not None:
            self.callback(item.sequence, data, 0, len(data))


class Replier(Receiver):
    """Answers a service. `callback(identity, buf, off, n)` gets the requests."""

    entity: _door.Replier

    def __init__(self, node: Node, name: str, type_name: str, qos: Qos, on_request: OnRequest) -> None:
        super().__init__(node, name, type_name)
        self.callback = on_request
        self.entity = node.participant.replier(_service(name, type_name), qos, on_data=self.came)

    def room(self) -> bool:
        """Whether an answer can go out now."""
        return True

    def reply(self, identity: bytes, reply: Message, /) -> bool:
        """Answers the request of that identity; False when who asked is gone."""
        data = encode(reply)
        with self._lock:
            why = self.gone()
            if not why:
                return self.entity.reply(identity, data)
        return self.refuse(OFFLINE, len(data), why)

    def deliver(self, item: Any) -> None:
        """Give a request to the callback."""
        data = self.body(item.sample, self.type_name + "_Request")
        if data is not None:
            self.callback(item.identity, data, 0, len(data))


def _topic(name: str, type_name: str) -> Topic:
    return Topic(name, dds_type(type_name, "", LONGEST_NAME))


def _service(name: str, type_name: str) -> Service:
    return Service(
        name,
        topic_name("rq", name, "Request", LONGEST_NAME),
        topic_name("rr", name, "Reply", LONGEST_NAME),
        dds_type(type_name, "_Request", LONGEST_NAME),
        dds_type(type_name, "_Response", LONGEST_NAME),
    )
