"""Boards in a data space: each is a node of the ROS 2 graph, its messages converted between ROS 1 and CDR.

Topics of boards are reliable where the other side is. A subscription begins as its writers are, and becomes best effort
when a writer appears that is; one that is latched in ROS 1 (`/tf_static`) is transient local here.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, NamedTuple

from muros import interfaces
from muros.interfaces import CdrError, Converter, InterfaceError
from muros.rosserial.server._door import (
    LATCHED,
    READ_DEPTH,
    BodyError,
    NamedService,
    OnData,
    OnReply,
    RefusedError,
)
from muros.rosserial.server._node_parameters import PARAMETER_KINDS, NodeParameters
from muros.rosserial.server._parameters import plain_name
from muros.space import (
    CDR_LE,
    ClosedError,
    Durability,
    Incompatible,
    Participant,
    Qos,
    Reader,
    Reliability,
    Request,
    Role,
    Service,
    Space,
    Topic,
)

__all__ = ["SpaceNode", "SpaceWorld"]

_LEVELS = (10, 20, 30, 40, 50)
"""Levels of rcl_interfaces/msg/Log for those of rosserial."""
_USE_SIM_TIME = "use_sim_time"
_STATUS = ("OK", "WARN", "ERROR")


class SpaceWorld:
    """A data space as boards meet it.

    ``wall`` gives the wall clock in ns. ``remap`` renames topics and services, by the names that boards say.
    ``parameters(node)`` gives the first parameters of a node by its full name. ``depth``: messages kept for readers.
    ``later(call)`` has a function called soon, outside whatever happens now.
    """

    def __init__(
        self,
        space: Space,
        *,
        wall: Callable[[], int],
        later: Callable[[Callable[[], object]], object],
        remap: Mapping[str, str] | None = None,
        parameters: Callable[[str], Mapping[str, Any]] | None = None,
        depth: int = 1000,
        domain: int | None = None,
    ) -> None:
        self.space = space
        self.depth = depth
        self.later = later
        self.time = wall
        self._domain = domain
        self._remap = dict(remap or {})
        self._parameters = parameters
        self._nodes: list[SpaceNode] = []
        self._unwatch = space.graph.watch(self._on_graph)

    def warm(self) -> None:
        """Reads what the first board would have to wait for: the definitions of the standard types."""
        interfaces.converter("std_msgs/String")
        interfaces.message("rcl_interfaces/msg/Log")
        for kind in PARAMETER_KINDS:
            interfaces.service(f"rcl_interfaces/srv/{kind}")

    def node(self, name: str, owner: str) -> SpaceNode:
        """A node for a board."""
        namespace, _, base = name.rpartition("/")
        try:
            participant = self.space.participant(
                interfaces.check_node_name(base),
                namespace=interfaces.check_namespace(namespace),
                domain=self._domain,
                owner=owner,
            )
        except InterfaceError as error:
            raise RefusedError(str(error), "Give it another name: --name") from None
        given = self._parameters(name) if self._parameters is not None else {}
        made = SpaceNode(self, participant, dict(given))
        self._nodes.append(made)
        return made

    def close(self) -> None:
        """Watches no more; the nodes are their boards' to close."""
        self._unwatch()

    def expand(self, name: str, participant: Participant, what: str) -> str:
        """The full name of a board's topic or service. Raises RefusedError for one that ROS 2 does not allow."""
        meant = self._remap.get(name, name)
        if meant.startswith("~") and not meant.startswith("~/"):
            meant = "~/" + meant[1:]
        try:
            return interfaces.expand_name(meant, participant.name, participant.namespace, what)
        except InterfaceError as error:
            raise RefusedError(str(error), f"Give it another name: --remap {name}:=NEW_NAME") from None

    def forget(self, node: SpaceNode) -> None:
        """A node was closed."""
        self._nodes.remove(node)

    def _on_graph(self, event: object) -> None:
        if isinstance(event, Incompatible):
            for node in self._nodes:
                for subscriber in node.subscribers:
                    if subscriber.reader.gid == event.reader.gid:
                        self.later(partial(subscriber.relax, event.writer.qos))


class SpaceNode:
    """A board as a node of the graph."""

    def __init__(self, world: SpaceWorld, participant: Participant, parameters: dict[str, Any]) -> None:
        self.world = world
        self.participant = participant
        self.subscribers: list[_Subscriber] = []
        self._namespace = participant.namespace.rstrip("/")
        self.full_name = f"{self._namespace}/{participant.name}"
        self._clock: Reader | None = None
        self._simulated = 0
        given = {_USE_SIM_TIME: False, **parameters}
        self._values = NodeParameters(participant, given, world.time, self._follow_clock)
        self._follow_clock()
        self._log_type = interfaces.message("rcl_interfaces/msg/Log")
        self._rosout = participant.writer(
            Topic(interfaces.dds_topic("/rosout"), interfaces.dds_type_name("rcl_interfaces/msg/Log")),
            Qos.preset("rosout_default"),
        )
        self._diagnostics = participant.writer(
            Topic(
                interfaces.dds_topic("/diagnostics"),
                interfaces.dds_type_name("diagnostic_msgs/msg/DiagnosticArray"),
            ),
            Qos.preset("default"),
        )

    def publisher(self, name: str, type_name: str, md5: str) -> _Publisher:
        """A board's publisher."""
        full, converter = self._topic(name, type_name, md5)
        return _Publisher(self, full, converter)

    def subscriber(self, name: str, type_name: str, md5: str, on_data: OnData) -> _Subscriber:
        """A board's subscriber."""
        full, converter = self._topic(name, type_name, md5)
        return _Subscriber(self, full, converter, on_data)

    def caller(self, service: NamedService, on_reply: OnReply) -> _Caller:
        """A board's service client."""
        return _Caller(self, self._service(service), on_reply)

    def server(self, service: NamedService, on_data: OnData) -> _Server:
        """A board's service."""
        return _Server(self, self._service(service), on_data)

    def time(self) -> int:
        """The node's time in ns: the wall clock's, or that of /clock with the parameter use_sim_time."""
        return self.world.time() if self._clock is None else self._simulated

    def log(self, level: int, text: str) -> None:
        """A board's log goes to /rosout, as that of any node."""
        now = self.time()
        message = self._log_type(
            level=_LEVELS[min(level, len(_LEVELS) - 1)],
            name=self.full_name.strip("/").replace("/", "."),
            msg=text,
        )
        message.stamp.sec, message.stamp.nanosec = divmod(now, 1_000_000_000)
        self._rosout.write(message.serialize())

    def parameter(self, name: str) -> Any:
        """A parameter of the node."""
        return self._values.get(plain_name(name, self.full_name))

    def diagnose(self, text: str, level: int, values: dict[str, str]) -> None:
        """How the board is, if somebody listens."""
        if not self._diagnostics.matched:
            return
        pair = interfaces.message("diagnostic_msgs/msg/KeyValue")
        status = interfaces.message("diagnostic_msgs/msg/DiagnosticStatus")(
            level=level,
            name=f"{self.full_name.strip('/')}: rosserial",
            message=text,
            hardware_id=self.participant.owner.removeprefix("board "),
            values=[pair(key=key, value=value) for key, value in values.items()],
        )
        array = interfaces.message("diagnostic_msgs/msg/DiagnosticArray")(status=[status])
        array.header.stamp.sec, array.header.stamp.nanosec = divmod(self.time(), 1_000_000_000)
        self._diagnostics.write(array.serialize())

    def close(self) -> None:
        """The node leaves the graph."""
        self.world.forget(self)
        self.participant.close()

    def _follow_clock(self) -> None:
        """Goes by /clock, or no more, as the parameter says; a simulation's time is 0 until something has come."""
        simulated = self._values.get(_USE_SIM_TIME) is True
        if simulated and self._clock is None:
            kind = "rosgraph_msgs/msg/Clock"
            self._simulated = 0
            self._clock = self.participant.reader(
                Topic(interfaces.dds_topic("/clock"), interfaces.dds_type_name(kind)),
                Qos(Reliability.BEST_EFFORT, depth=1),
                partial(self._on_clock, interfaces.message(kind)),
            )
        elif not simulated and self._clock is not None:
            self._clock.close()
            self._clock = None

    def _on_clock(self, kind: Any, reader: Reader) -> None:
        while (sample := reader.take()) is not None:
            try:
                now = kind.deserialize(sample.data).clock
            except CdrError:
                continue
            self._simulated = now.sec * 1_000_000_000 + now.nanosec

    def _topic(self, name: str, type_name: str, md5: str) -> tuple[str, Converter]:
        full = self.world.expand(name, self.participant, "topic")
        try:
            return full, interfaces.converter(type_name, md5)
        except InterfaceError as error:
            raise _unknown(error, type_name) from None

    def _service(self, named: NamedService) -> _ServiceIn:
        full = self.world.expand(named.name, self.participant, "service")
        try:
            found = interfaces.service_converter(named.type_name, named.request_md5, named.response_md5)
        except InterfaceError as error:
            raise _unknown(error, named.type_name) from None
        service = Service(
            full,
            interfaces.dds_request_topic(full),
            interfaces.dds_reply_topic(full),
            interfaces.dds_type_name(f"{found.ros2_type}_Request"),
            interfaces.dds_type_name(f"{found.ros2_type}_Response"),
        )
        return _ServiceIn(service, found.request, found.response)


class _ServiceIn(NamedTuple):
    """A service in the graph, and what converts its halves."""

    service: Service
    request: Converter
    response: Converter


class _Converted:
    """The shape of messages that are converted."""

    def __init__(self, converter: Converter, *others: Converter) -> None:
        self.size = converter.ros1_size
        self.least_size = converter.least_size
        self.drift = next((each.drift for each in (converter, *others) if each.drift), "")


class _Publisher(_Converted):
    def __init__(self, node: SpaceNode, full: str, converter: Converter) -> None:
        super().__init__(converter)
        self._convert = converter.to_cdr
        durability = Durability.TRANSIENT_LOCAL if full in LATCHED else Durability.VOLATILE
        self._writer = node.participant.writer(
            Topic(interfaces.dds_topic(full), interfaces.dds_type_name(converter.ros2_type)),
            Qos(depth=node.world.depth, durability=durability),
        )
        self._write = self._writer.write

    def publish(self, body: bytes) -> None:
        try:
            cdr = self._convert(body)
        except CdrError as error:
            raise BodyError(str(error)) from None
        self._write(cdr)

    def close(self) -> None:
        self._writer.close()


class _Subscriber(_Converted):
    def __init__(self, node: SpaceNode, full: str, converter: Converter, on_data: OnData) -> None:
        super().__init__(converter)
        self._node = node
        self._convert = converter.to_ros1
        self._on_data = on_data
        self._seq = 0
        self._topic = Topic(interfaces.dds_topic(full), interfaces.dds_type_name(converter.ros2_type))
        writers = [
            each.qos
            for each in node.world.space.graph.writers
            if each.topic == self._topic.name
            and each.role is Role.WRITER
            and each.participant.domain == node.participant.domain
        ]
        latched = full in LATCHED or (
            bool(writers) and all(qos.durability >= Durability.TRANSIENT_LOCAL for qos in writers)
        )
        self._qos = Qos(
            Reliability.BEST_EFFORT
            if any(qos.reliability < Reliability.RELIABLE for qos in writers)
            else Reliability.RELIABLE,
            Durability.TRANSIENT_LOCAL if latched else Durability.VOLATILE,
            depth=READ_DEPTH,
        )
        self.reader = self._read()
        node.subscribers.append(self)

    def take(self) -> bytes | None:
        sample = self.reader.take()
        if sample is None:
            return None
        if sample.representation != CDR_LE:
            raise BodyError("it is not in little-endian CDR, and only that is converted")
        self._seq = (self._seq + 1) & 0xFFFFFFFF
        try:
            return self._convert(sample.data, self._seq)
        except CdrError as error:
            raise BodyError(str(error)) from None

    @property
    def latched(self) -> bool:
        return self._qos.durability > Durability.VOLATILE

    def forget(self) -> None:
        if not self.latched:
            while self.reader.take() is not None:
                pass

    def relax(self, offered: Qos) -> None:
        """Asks for no more than a writer offers; does nothing once it is closed."""
        if self not in self._node.subscribers:
            return
        wanted = self._qos.replace(
            reliability=min(self._qos.reliability, offered.reliability),
            durability=min(self._qos.durability, offered.durability),
        )
        if wanted != self._qos:
            self._qos = wanted
            self.reader.close()
            self.reader = self._read()

    def close(self) -> None:
        self._node.subscribers.remove(self)
        self.reader.close()

    def _read(self) -> Reader:
        return self._node.participant.reader(self._topic, self._qos, lambda reader: self._on_data())


class _Caller(_Converted):
    def __init__(self, node: SpaceNode, its: _ServiceIn, on_reply: OnReply) -> None:
        super().__init__(its.response, its.request)
        self._to_cdr = its.request.to_cdr
        self._to_ros1 = its.response.to_ros1
        self._on_reply = on_reply
        self._requester = node.participant.requester(its.service, Qos.preset("services_default"), self._reply)

    @property
    def ready(self) -> bool:
        return self._requester.servers > 0

    def call(self, body: bytes) -> int:
        try:
            cdr = self._to_cdr(body)
        except CdrError as error:
            raise BodyError(str(error)) from None
        return self._requester.send(cdr)

    def close(self) -> None:
        self._requester.close()

    def _reply(self, number: int, data: bytes) -> None:
        try:
            body = self._to_ros1(data)
        except CdrError:
            return  # an answer that is none: the board waits for one that is
        self._on_reply(number, body)


class _Server(_Converted):
    def __init__(self, node: SpaceNode, its: _ServiceIn, on_data: OnData) -> None:
        super().__init__(its.request, its.response)
        self._to_cdr = its.response.to_cdr
        self._to_ros1 = its.request.to_ros1
        self._replier = node.participant.replier(
            its.service, Qos.preset("services_default"), on_data=lambda replier: on_data()
        )

    def take(self) -> tuple[Any, bytes] | None:
        taken: Request | None = self._replier.take()
        if taken is None:
            return None
        try:
            return taken.identity, self._to_ros1(taken.data)
        except CdrError as error:
            raise BodyError(str(error)) from None

    def answer(self, request: Any, body: bytes) -> None:
        try:
            cdr = self._to_cdr(body)
        except CdrError as error:
            raise BodyError(str(error)) from None
        try:
            self._replier.reply(request, cdr)
        except ClosedError:
            return

    def fail(self, request: Any, text: str) -> None:
        """Services of ROS 2 have no way to say so."""

    def close(self) -> None:
        self._replier.close()


def _unknown(error: InterfaceError, type_name: str) -> RefusedError:
    package = type_name.partition("/")[0]
    if package not in interfaces.packages():
        return RefusedError(
            f"there is no package {package}: {error}",
            f"Name the folder that has {package}/msg: --types FOLDER",
        )
    return RefusedError(
        str(error), "Generate the firmware's message headers from the definitions of ROS 1 Noetic"
    )
