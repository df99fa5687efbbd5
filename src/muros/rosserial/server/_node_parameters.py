"""The parameters of a board's node: those of any ROS 2 node, with its six services, so that tools see and set them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from muros import interfaces
from muros.rclc.host.parameter_files import kind
from muros.rclc.host.parameters import Parameters
from muros.rclc.parameter_errors import ParameterError
from muros.space import Participant, Qos, Service, Topic, Writer

__all__ = ["PARAMETER_KINDS", "NodeParameters"]

PARAMETER_KINDS = (
    "GetParameters",
    "GetParameterTypes",
    "SetParameters",
    "SetParametersAtomically",
    "ListParameters",
    "DescribeParameters",
)
"""The services of a node's parameters, in rcl_interfaces/srv."""


class NodeParameters:
    """Parameters of a participant. Whoever wants may add some; ``values`` are the first ones.

    ``on_applied`` is called after some of them may have changed.
    """

    def __init__(
        self,
        participant: Participant,
        values: Mapping[str, Any],
        wall: Callable[[], int],
        on_applied: Callable[[], object],
    ) -> None:
        node: Any = _Node(participant)
        self._parameters = Parameters(node, 0, True, True, False, 0, kind, wall)
        self.refused: list[str] = []
        for name, value in values.items():
            try:
                self._parameters.declare(name, value)
            except ParameterError as error:
                self.refused.append(str(error))
        self._parameters.on_applied = on_applied

    def get(self, name: str) -> Any:
        """The value of a parameter; None if there is none."""
        found = self._parameters.known.get(name)
        return None if found is None else found.value


class _Context:
    state = "CONNECTED"


class _Node:
    """What parameters need of a node, on a participant."""

    def __init__(self, participant: Participant) -> None:
        self.name = participant.name
        self.namespace = participant.namespace
        self.context = _Context()
        self.overrides: dict[str, Any] = {}
        self._participant = participant

    def service(
        self, type_: Any, name: str, answer: Callable[[Any], Any], qos: str, memory: object = None
    ) -> _Service:
        """A service of the node; its memory is not bounded."""
        return _Service(self._participant, type_, self._full(name), answer, qos)

    def publisher(self, type_: Any, name: str, qos: str) -> _Publisher:
        """A publisher of the node."""
        topic = Topic(interfaces.dds_topic(name), interfaces.dds_type_name(type_.TYPE))
        return _Publisher(self._participant.writer(topic, Qos.preset("parameter_events")))

    def _full(self, name: str) -> str:
        return interfaces.expand_name(name, self.name, self.namespace, "service")


class _Service:
    def __init__(
        self, participant: Participant, type_: Any, name: str, answer: Callable[[Any], Any], qos: str
    ) -> None:
        self.identity = b""
        self._request = type_.Request
        self._answer = answer
        service = Service(
            name,
            interfaces.dds_request_topic(name),
            interfaces.dds_reply_topic(name),
            interfaces.dds_type_name(f"{type_.TYPE}_Request"),
            interfaces.dds_type_name(f"{type_.TYPE}_Response"),
        )
        self._replier = participant.replier(service, Qos.preset(qos), self._take)

    def reply(self, identity: bytes, response: Any) -> None:
        """Answers the request with this identity."""
        self._replier.reply(identity, response.serialize())

    def destroy(self) -> None:
        """Takes it out of the graph."""
        self._replier.close()

    def _take(self, identity: bytes, data: bytes) -> None:
        try:
            request = self._request.deserialize(data)
        except interfaces.CdrError:
            return  # nobody can know what was asked
        self.identity = identity
        self.reply(identity, self._answer(request))


class _Publisher:
    def __init__(self, writer: Writer) -> None:
        self._writer = writer

    def publish(self, message: Any) -> bool:
        """Publishes an event."""
        return self._writer.write(message.serialize())

    def destroy(self) -> None:
        """Takes it out of the graph."""
        self._writer.close()
