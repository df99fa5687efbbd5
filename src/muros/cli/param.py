"""The command `muros param`: parameters of nodes. Words, options and output are those of `ros2 param`."""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import time
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

from muros import interfaces
from muros.cli._names import full_name, is_hidden, ros_services, service_of
from muros.cli._tool import CommandError, Tool, positive
from muros.cli.node import nodes_of
from muros.cli.topic import command, unknown
from muros.rclc import ParameterError
from muros.rclc.host import parameter_files
from muros.rclc.parameter_values import TYPES, is_type, kind_of, put, take

__all__ = ["delete", "describe", "dump", "get", "list_parameters", "load", "register", "set_parameter"]

TIMEOUT: Final = 5.0
"""Seconds that a node may take to answer."""

LIST: Final = "list_parameters"

_LABELS: Final = {
    1: "Boolean value is:",
    2: "Integer value is:",
    3: "Double value is:",
    4: "String value is:",
    5: "Byte values are:",
    6: "Boolean values are:",
    7: "Integer values are:",
    8: "Double values are:",
    9: "String values are:",
}


def register(subparsers: Any) -> None:
    """Adds `param` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("param", help="list, show and set parameters of nodes")
    words = parser.add_subparsers(required=True, metavar="list | get | set | delete | describe | dump | load")
    listing = _command(words, "list", list_parameters, "list the parameters of nodes", node="?")
    listing.add_argument(
        "--param-prefixes", nargs="+", default=[], metavar="P", help="only those below these"
    )
    listing.add_argument("--param-type", action="store_true", help="with the type of each")
    listing.add_argument("--filter", metavar="REGEX", help="only names that match")
    value = _command(words, "get", get, "print the value of a parameter")
    value.add_argument("parameter_name", metavar="NAME")
    value.add_argument("--hide-type", action="store_true", help="the value only")
    setting = _command(words, "set", set_parameter, "set parameters")
    setting.add_argument("words", nargs="+", metavar="NAME VALUE", help="one or more pairs")
    setting.add_argument("--atomic", action="store_true", help="all of them, or none")
    going = _command(words, "delete", delete, "take a parameter away")
    going.add_argument("parameter_name", metavar="NAME")
    about = _command(words, "describe", describe, "show what is known of parameters")
    about.add_argument("parameter_names", nargs="+", metavar="NAME")
    _command(words, "dump", dump, "print all parameters of a node as YAML")
    loading = _command(words, "load", load, "set parameters of a node as a YAML file says")
    loading.add_argument("parameter_file", metavar="FILE", type=Path)
    loading.add_argument("--no-use-wildcard", action="store_true", help="not what is said for all nodes")
    loading.add_argument("--use-wildcard", action="store_true", help=argparse.SUPPRESS)


async def list_parameters(tool: Tool, arguments: argparse.Namespace) -> int:
    """`muros param list`."""
    import re

    try:
        wanted = re.compile(arguments.filter or "")
    except re.error as error:
        raise CommandError(f"--filter {arguments.filter}: {error}", 2) from None
    if arguments.node_name:
        nodes = [await _node(tool, arguments)]
    else:
        await tool.discover()
        served = {service.name for service in ros_services(tool) if service.servers}
        nodes = [
            node.full_name
            for node in nodes_of(tool)
            if (arguments.include_hidden_nodes or not is_hidden(node.name))
            and f"{node.full_name}/{LIST}" in served
        ]
    status = 0
    names: list[list[str] | CommandError] = await asyncio.gather(
        *(_names(tool, node, arguments) for node in nodes), return_exceptions=True
    )  # type: ignore[assignment]
    for node, found in zip(nodes, names, strict=True):
        if isinstance(found, CommandError):
            if arguments.node_name:
                raise found
            tool.say(found)
            status = 1
            continue
        if isinstance(found, BaseException):
            raise found
        if not arguments.node_name:
            tool.print(f"{node}:")
        found = sorted(name for name in found if wanted.search(name))
        kinds: dict[str, str] = {}
        if arguments.param_type and found:
            answer = await _ask(
                tool, node, "DescribeParameters", "describe_parameters", arguments, names=found
            )
            kinds = {d.name: _type_name(d.type) for d in answer.descriptors}
        for name in found:
            tool.print(
                f"  {name}" + (f" (type: {kinds.get(name, 'not set')})" if arguments.param_type else "")
            )
    return status


async def get(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros param get`."""
    node = await _node(tool, arguments)
    name = arguments.parameter_name
    answer = await _ask(tool, node, "GetParameters", "get_parameters", arguments, names=[name])
    if not answer.values:
        raise CommandError(await _not_set(tool, node, name, arguments))
    value = answer.values[0]
    if not is_type(value.type):
        raise CommandError(f"Unknown parameter type '{value.type}' for parameter '{name}'")
    if not value.type:
        tool.print("Parameter not set.")
        return
    shown = list(take(value)) if value.type >= 5 else take(value)
    tool.print(shown if arguments.hide_type else f"{_LABELS[value.type]} {shown}")


async def set_parameter(tool: Tool, arguments: argparse.Namespace) -> int:
    """`muros param set`."""
    words = arguments.words
    if len(words) % 2:
        raise CommandError(f"parameters come as pairs of a name and a value; there are {len(words)} words", 2)
    pairs = [(words[i], _guess(words[i + 1])) for i in range(0, len(words), 2)]
    node = await _node(tool, arguments)
    known = await _types(tool, node, arguments) if any(value == [] for _, value in pairs) else {}
    results = await _set(tool, node, pairs, arguments, arguments.atomic, known)
    status = 0
    several = len(pairs) > 1
    for (name, _), result in zip(pairs, results, strict=False):
        start = f"{name}: " if several and not arguments.atomic else ""
        what = "parameters atomically" if arguments.atomic else "parameter"
        if result.successful:
            tool.print(start + _remark(f"Set {what} successful", result))
        else:
            tool.say(start + _remark(f"Setting {what} failed", result))
            status = 1
    return status


async def delete(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros param delete`."""
    node = await _node(tool, arguments)
    (result,) = await _set(tool, node, [(arguments.parameter_name, None)], arguments)
    if not result.successful:
        raise CommandError(_remark("Deleting parameter failed", result))
    tool.print(_remark("Deleted parameter successfully", result))


async def describe(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros param describe`."""
    node = await _node(tool, arguments)
    names = arguments.parameter_names
    answer = await _ask(tool, node, "DescribeParameters", "describe_parameters", arguments, names=names)
    if not answer.descriptors:
        raise CommandError(await _not_set(tool, node, ", ".join(names), arguments))
    for found in answer.descriptors:
        tool.print(f"Parameter name: {found.name}")
        tool.print(f"  Type: {_type_name(found.type)}")
        if found.description:
            tool.print(f"  Description: {found.description}")
        tool.print("  Constraints:")
        if found.read_only:
            tool.print("    Read only: true")
        for span in [*found.floating_point_range, *found.integer_range][:1]:
            tool.print(f"    Min value: {span.from_value}")
            tool.print(f"    Max value: {span.to_value}")
            if span.step:
                tool.print(f"    Step: {span.step}")
        if found.additional_constraints:
            tool.print(f"    Additional constraints: {found.additional_constraints}")


async def dump(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros param dump`."""
    node = await _node(tool, arguments)
    names = await _names(tool, node, arguments)
    values: list[Any] = []
    if names:
        answer = await _ask(tool, node, "GetParameters", "get_parameters", arguments, names=names)
        values = [take(value) for value in answer.values]
    if len(values) != len(names):
        raise CommandError(f"{node} lists {len(names)} parameters and gives {len(values)} values: try again")
    tool.print(parameter_files.write(node, dict(zip(names, values, strict=True))))


async def load(tool: Tool, arguments: argparse.Namespace) -> int:
    """`muros param load`."""
    text = arguments.parameter_file.read_text(encoding="utf-8")
    node = await _node(tool, arguments)
    try:
        values = parameter_files.read(
            text, node, not arguments.no_use_wildcard, str(arguments.parameter_file)
        )
    except ParameterError as error:
        raise CommandError(str(error)) from None
    known = await _types(tool, node, arguments)
    values = {name: parameter_files.fitting(value, known.get(name, 0)) for name, value in values.items()}
    results = await _set(tool, node, list(values.items()), arguments, known=known)
    status = 0
    for name, result in zip(values, results, strict=False):
        if result.successful:
            tool.print(_remark(f"Set parameter {name} successful", result))
        else:
            tool.say(_remark(f"Set parameter {name} failed", result))
            status = 1
    return status


def _command(words: Any, name: str, function: Any, about: str, node: str | None = None) -> Any:
    """A sub-command that asks a node."""
    parser = command(words, name, function, about)
    parser.add_argument("node_name", metavar="NODE", nargs=node)
    parser.add_argument(
        "-a",
        "--all",
        "--include-hidden-nodes",
        dest="include_hidden_nodes",
        action="store_true",
        help="nodes that begin with '_' too",
    )
    parser.add_argument(
        "--timeout", type=positive, default=1.0, metavar="S", help="wait so long for the node (1)"
    )
    parser.add_argument(
        "--service-timeout",
        type=positive,
        default=TIMEOUT,
        metavar="S",
        help=f"wait so long for an answer ({TIMEOUT:g})",
    )
    return parser


async def _node(tool: Tool, arguments: argparse.Namespace) -> str:
    """The full name of the node that is asked, which is there. CommandError if it is not."""
    name = full_name(arguments.node_name, "node")

    def there(_: object = None) -> bool:
        return any(node.full_name == name for node in nodes_of(tool))

    await tool.discover(until=there)
    if not there() and not await tool.wait_for(there, arguments.timeout):
        raise CommandError(
            f"Node not found: {unknown('node', name, [n.full_name for n in nodes_of(tool)], tool.domain)}"
        )
    return name


async def _ask(
    tool: Tool, node: str, kind: str, suffix: str, arguments: argparse.Namespace, **fields: Any
) -> Any:
    """Asks one of a node's services. CommandError when it is not there, or does not answer in time."""
    from muros.space import PRESETS

    made = interfaces.service(f"rcl_interfaces/srv/{kind}")
    name = f"{node}/{suffix}"
    answers: asyncio.Queue[tuple[int, bytes]] = asyncio.Queue()
    requester = tool.participant.requester(
        service_of(name, made.TYPE),
        PRESETS["parameters"],
        lambda number, data: answers.put_nowait((number, data)),
    )
    try:
        if not await tool.wait_for(lambda _: requester.servers > 0, arguments.service_timeout):
            raise CommandError(f"{node} has no parameters: nobody serves {name} in domain {tool.domain}")
        number = requester.send(made.Request(**fields).serialize(), source_time=time.time_ns())
        async with asyncio.timeout(arguments.service_timeout):
            while True:
                found, data = await answers.get()
                if found == number:
                    return made.Response.deserialize(data)
    except TimeoutError:
        raise CommandError(f"no answer from {name} within {arguments.service_timeout:g} s") from None
    finally:
        with contextlib.suppress(Exception):
            requester.close()


async def _names(tool: Tool, node: str, arguments: argparse.Namespace) -> list[str]:
    prefixes = getattr(arguments, "param_prefixes", [])
    answer = await _ask(tool, node, "ListParameters", LIST, arguments, prefixes=prefixes)
    return list(answer.result.names)


async def _types(tool: Tool, node: str, arguments: argparse.Namespace) -> dict[str, int]:
    """The types of a node's parameters."""
    names = await _names(tool, node, arguments)
    if not names:
        return {}
    answer = await _ask(tool, node, "GetParameterTypes", "get_parameter_types", arguments, names=names)
    return dict(zip(names, answer.types, strict=False))


async def _set(
    tool: Tool,
    node: str,
    pairs: list[tuple[str, Any]],
    arguments: argparse.Namespace,
    atomic: bool = False,
    known: Mapping[str, int] = MappingProxyType({}),
) -> list[Any]:
    """The results of setting parameters, None deletes one. `known` are types, for lists without a value."""
    value, parameter = (
        interfaces.message(f"rcl_interfaces/msg/{n}") for n in ("ParameterValue", "Parameter")
    )
    parameters = []
    for name, what in pairs:
        kind = kind_of(what, known.get(name, 0))
        if what is not None and not kind:
            raise CommandError(f"parameter {name} cannot be {what!r}: a list has values of one type")
        parameters.append(parameter(name=name, value=put(value(), kind, what)))
    if atomic:
        answer = await _ask(
            tool,
            node,
            "SetParametersAtomically",
            "set_parameters_atomically",
            arguments,
            parameters=parameters,
        )
        return [answer.result]
    answer = await _ask(tool, node, "SetParameters", "set_parameters", arguments, parameters=parameters)
    if len(answer.results) != len(pairs):
        raise CommandError(f"{node} answers for {len(answer.results)} parameters of {len(pairs)}")
    return list(answer.results)


async def _not_set(tool: Tool, node: str, asked: str, arguments: argparse.Namespace) -> str:
    """That a parameter is not there, and which are."""
    from difflib import get_close_matches

    names = await _names(tool, node, arguments)
    close = get_close_matches(asked, names, 1)
    return f"Parameter not set: {node} has no {asked}" + (f"; did you mean {close[0]}?" if close else "")


def _guess(text: str) -> Any:
    """The value that a word stands for: as YAML, and a text if that is nothing a parameter can be."""
    import yaml

    try:
        value = yaml.safe_load(text)
    except yaml.YAMLError:
        return text
    return value if value == [] or kind_of(value) else text


def _type_name(kind: int) -> str:
    return TYPES[kind] if is_type(kind) else f"unknown ({kind})"


def _remark(text: str, result: Any) -> str:
    return f"{text}: {result.reason}" if result.reason else text
