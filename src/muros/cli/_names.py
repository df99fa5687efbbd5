"""Names and types between the words of the command line and those of the graph."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any, NamedTuple

from muros import interfaces
from muros.cli._tool import CommandError
from muros.interfaces import InterfaceError

if TYPE_CHECKING:
    from muros.cli._tool import Tool
    from muros.space import Endpoint, ParticipantInfo, Service, ServiceInfo, TopicInfo

__all__ = [
    "RosService", "RosTopic", "add_type_options", "full_name", "is_hidden", "learn_types", "message_class",
    "node_name", "required_class", "ros_service", "ros_services", "ros_topic", "ros_topics", "ros_type",
    "service_of", "service_type", "type_of_service",
]  # fmt: skip


class RosTopic(NamedTuple):
    """A topic under its ROS name (its DDS name if it has none), with the endpoints of others."""

    name: str
    dds_name: str
    types: tuple[str, ...]
    writers: tuple[Endpoint, ...]
    readers: tuple[Endpoint, ...]


class RosService(NamedTuple):
    """A service with its servers (readers of requests) and clients (writers of requests)."""

    name: str
    types: tuple[str, ...]
    servers: tuple[Endpoint, ...]
    clients: tuple[Endpoint, ...]


def add_type_options(parser: argparse.ArgumentParser) -> None:
    """Where types are found that are not standard: `--types FOLDER`."""
    parser.add_argument(
        "--types",
        "--path",
        dest="types",
        action="append",
        default=[],
        metavar="FOLDER",
        help="folder of your definitions (package/msg/MyType.msg); $MUROS_INTERFACES names more",
    )


def learn_types(arguments: argparse.Namespace) -> None:
    """Take in the folders of `--types`. InterfaceError if one has no definitions."""
    for folder in arguments.types:
        interfaces.add_path(folder)


def full_name(name: str, what: str = "topic") -> str:
    """The name with its slash, as `ros2` takes `chatter` for `/chatter`. CommandError if it is none."""
    try:
        return interfaces.expand_name(name, "muros", "/", what)
    except InterfaceError as error:
        raise CommandError(str(error), 2) from None


def is_hidden(name: str) -> bool:
    """Whether a topic, service or node is meant to be left out of lists: a part begins with an underscore."""
    return any(part.startswith("_") for part in name.split("/"))


def ros_type(dds_name: str) -> str:
    """`std_msgs::msg::dds_::String_` -> `std_msgs/msg/String`; other names of types as they are."""
    try:
        return interfaces.ros_type_name(dds_name)
    except InterfaceError:
        return dds_name


def service_type(dds_name: str) -> str:
    """`p::srv::dds_::Add_Request_` -> `p/srv/Add`; other names of types as they are."""
    name = ros_type(dds_name)
    for suffix in ("_Request", "_Response"):
        if name.endswith(suffix):
            return name.removesuffix(suffix)
    return name


def ros_topics(tool: Tool, *, plain_dds: bool = False) -> list[RosTopic]:
    """The topics of others, by name; with `plain_dds` under their DDS names, those that are not of ROS included."""
    found = [_topic(tool, info, plain_dds) for info in tool.graph.topics if info.domain == tool.domain]
    return sorted(topic for topic in found if topic is not None)


def ros_topic(tool: Tool, name: str) -> RosTopic | None:
    """One topic of others by its ROS name, None if there is none; quick in a large graph too."""
    info = tool.graph.topic(interfaces.dds_topic(name), tool.domain)
    return None if info is None else _topic(tool, info, False)


def _topic(tool: Tool, info: TopicInfo, plain_dds: bool) -> RosTopic | None:
    name = info.name if plain_dds else interfaces.ros_topic(info.name)
    writers, readers = tuple(tool.others(info.writers)), tuple(tool.others(info.readers))
    if name is None or not (writers or readers):
        return None
    types = _unique(e.type_name if plain_dds else ros_type(e.type_name) for e in (*writers, *readers))
    return RosTopic(name, info.name, types, writers, readers)


def ros_services(tool: Tool) -> list[RosService]:
    """The services of others, by name."""
    found = [_service(tool, info) for info in tool.graph.services if info.domain == tool.domain]
    return sorted(service for service in found if service is not None)


def ros_service(tool: Tool, name: str) -> RosService | None:
    """One service of others, None if there is none."""
    info = tool.graph.service(name, tool.domain)
    return None if info is None else _service(tool, info)


def _service(tool: Tool, info: ServiceInfo) -> RosService | None:
    servers, clients = tuple(tool.others(info.servers)), tuple(tool.others(info.clients))
    if not (servers or clients):
        return None
    types = _unique(service_type(e.type_name) for e in (*servers, *clients))
    return RosService(info.name, types, servers, clients)


def node_name(participant: ParticipantInfo) -> str:
    """The full name of a node; whoever is none is told by the gid of its participant."""
    return participant.full_name if participant.name else f"(no node) {participant.gid.hex('.')}"


def message_class(type_name: str) -> type[Any] | None:
    """The class of a message type, None if there is no definition of it."""
    try:
        return interfaces.message(type_name) if interfaces.known(type_name) else None
    except InterfaceError:
        return None


def required_class(type_name: str) -> type[Any]:
    """The class of a message type. CommandError says how to make it known."""
    try:
        return interfaces.message(type_name)
    except InterfaceError as error:
        raise _unknown(error, type_name) from None


def type_of_service(type_name: str) -> type[interfaces.ServiceType]:
    """The class of a service type. CommandError says how to make it known."""
    full = interfaces.split_type(type_name, "srv")
    try:
        if full.kind != "srv":
            raise CommandError(f"{type_name} is no service: those are called package/srv/Type", 2)
        return interfaces.service(type_name)
    except InterfaceError as error:
        raise _unknown(error, "/".join(full)) from None


def service_of(name: str, type_name: str) -> Service:
    """A service by its DDS names."""
    from muros.space import Service

    full = "/".join(interfaces.split_type(type_name, "srv"))
    return Service(
        name,
        interfaces.dds_request_topic(name),
        interfaces.dds_reply_topic(name),
        interfaces.dds_type_name(f"{full}_Request"),
        interfaces.dds_type_name(f"{full}_Response"),
    )


def _unknown(error: InterfaceError, type_name: str) -> CommandError:
    """The line for a type without a usable definition; if its whole package is unknown, with what to do."""
    package, _, rest = type_name.partition("/")
    if not rest or package in interfaces.packages():
        return CommandError(str(error))
    return CommandError(
        f"unknown type '{type_name}': say --types FOLDER, where FOLDER holds {package}/{rest}.{rest.partition('/')[0]}"
    )


def _unique(names: Iterable[str]) -> tuple[str, ...]:
    return tuple(sorted(set(names)))
