"""The command `muros service`: who serves what, and calls. Words, options and output are those of `ros2 service`."""

from __future__ import annotations

import argparse
import asyncio
import time
from typing import Any, Final

from muros import interfaces
from muros.cli._listing import add_count, find_named, print_found, print_lines
from muros.cli._names import (
    RosService,
    add_type_options,
    full_name,
    is_hidden,
    learn_types,
    ros_service,
    ros_services,
    service_of,
    type_of_service,
)
from muros.cli._tool import CommandError, Tool, positive
from muros.cli.topic import command

__all__ = ["call", "find_services", "list_services", "register", "service_types"]

REMARK_PERIOD: Final = 1.0
"""Seconds between two remarks that nobody serves yet."""


def register(subparsers: Any) -> None:
    """Adds `service` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("service", help="list and call services")
    words = parser.add_subparsers(required=True, metavar="list | type | find | info | call")
    listing = command(words, "list", list_services, "list the services that somebody serves or uses")
    listing.add_argument("-t", "--show-types", action="store_true", help="with the type of each")
    add_count(listing, "--count-services")
    listing.add_argument(
        "-a", "--include-hidden-services", action="store_true", help="those that begin with '_' too"
    )
    kind = command(words, "type", service_types, "print the type of a service")
    kind.add_argument("service_name", metavar="SERVICE")
    about = command(words, "info", info, "show who serves and uses a service")
    about.add_argument("service_name", metavar="SERVICE")
    find = command(words, "find", find_services, "list the services of a type")
    find.add_argument("service_type", metavar="TYPE")
    add_count(find, "--count-services")
    find.add_argument("--include-hidden-services", action="store_true", help="hidden services too")
    ask = command(words, "call", call, "call a service and print its answer")
    ask.add_argument("service_name", metavar="SERVICE")
    ask.add_argument(
        "words", nargs="*", metavar="[TYPE] [VALUES]", help="TYPE is needed if several are served"
    )
    ask.add_argument("--stdin", action="store_true", help="read the values from standard input")
    ask.add_argument("-r", "--rate", type=positive, metavar="HZ", help="call again at this rate")
    ask.add_argument("--times", type=int, metavar="N", help="with --rate: end after N calls")
    ask.add_argument(
        "--timeout", type=positive, metavar="S", help="give up after S seconds without an answer"
    )
    add_type_options(ask)


async def list_services(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros service list`."""
    await tool.discover()
    services = [s for s in ros_services(tool) if arguments.include_hidden_services or not is_hidden(s.name)]
    print_found(tool, services, count=arguments.count, types=arguments.show_types)


async def service_types(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros service type`."""
    for name in (await _known_service(tool, arguments.service_name)).types:
        tool.print(name)


async def info(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros service info`."""
    service = await _known_service(tool, arguments.service_name)
    tool.print(f"Type: {service.types[0] if len(service.types) == 1 else list(service.types)}")
    tool.print(f"Clients count: {len(service.clients)}")
    tool.print(f"Services count: {len(service.servers)}")


async def find_services(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros service find`."""
    wanted = "/".join(interfaces.split_type(arguments.service_type, "srv"))
    await tool.discover()
    names = [s.name for s in ros_services(tool) if wanted in s.types]
    names = [name for name in names if arguments.include_hidden_services or not is_hidden(name)]
    print_lines(tool, names, count=arguments.count)


async def call(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros service call`."""
    from muros.cli._pub import values_text
    from muros.cli._values import fill, read_yaml
    from muros.space import PRESETS

    learn_types(arguments)
    name = full_name(arguments.service_name, "service")
    given, arguments.values = _split_words(arguments.words)
    values = read_yaml(values_text(arguments))
    made = type_of_service(given or await _served_type(tool, name, arguments.timeout))
    request = made.Request()
    stamps = fill(request, values)
    request.serialize()

    answers: asyncio.Queue[tuple[int, bytes]] = asyncio.Queue()
    requester = tool.participant.requester(
        service_of(name, made.TYPE),
        PRESETS["services_default"],
        lambda number, data: answers.put_nowait((number, data)),
    )
    await tool.discover(until=lambda _: requester.servers > 0)
    told = False
    end = _end(arguments.timeout)
    while not requester.servers:
        if not told:
            tool.print("waiting for service to become available...")
            told = True
        if end is not None and time.monotonic() >= end:
            raise CommandError(f"nobody serves {name} in domain {tool.domain}")
        await tool.wait_for(lambda _: requester.servers > 0, REMARK_PERIOD if end is None else _left(end))
    done = 0
    while True:
        start = time.monotonic()
        for stamp in stamps:
            stamp(time.time_ns())
        tool.print(f"requester: making request: {request!r}\n")
        number = requester.send(request.serialize(), source_time=time.time_ns())
        data = await _answer(answers, number, name, arguments.timeout)
        tool.print(f"response:\n{made.Response.deserialize(data)!r}\n")
        done += 1
        if arguments.rate is None or (arguments.times is not None and done >= arguments.times):
            return
        await asyncio.sleep(max(0.0, start + 1 / arguments.rate - time.monotonic()))


async def _answer(
    answers: asyncio.Queue[tuple[int, bytes]], number: int, name: str, timeout: float | None
) -> bytes:
    """The answer to that request; later ones to earlier requests (of other servers) are passed over."""
    end = _end(timeout)
    while True:
        try:
            found, data = await asyncio.wait_for(answers.get(), None if end is None else _left(end))
        except TimeoutError:
            raise CommandError(f"no answer from {name} within {timeout:g} s") from None
        if found == number:
            return data


async def _served_type(tool: Tool, name: str, timeout: float | None) -> str:
    """The type that the graph says a service has. CommandError if there is none, or several."""

    def types() -> tuple[str, ...]:
        service = ros_service(tool, name)
        return () if service is None else service.types

    await tool.discover(until=lambda _: bool(types()))
    if not types():
        tool.print("waiting for service to become available...")
        if not await tool.wait_for(lambda _: bool(types()), timeout):
            raise CommandError(f"nobody serves {name} in domain {tool.domain}")
    found = types()
    if len(found) > 1:
        raise CommandError(f"{name} is served with several types: {', '.join(found)}; name the one to call")
    return found[0]


async def _known_service(tool: Tool, asked: str) -> RosService:
    name = full_name(asked, "service")
    await tool.discover()
    return find_named(tool, "service", name, ros_services(tool))


def _split_words(words: list[str]) -> tuple[str | None, str | None]:
    """Type and values; a single word is whatever it looks like."""
    if len(words) > 2:
        raise CommandError("too many words: put the values in one, as in '{a: 1, b: 2}'", 2)
    if len(words) == 2:
        return words[0], words[1]
    if not words:
        return None, None
    try:
        interfaces.split_type(words[0], "srv")
    except interfaces.InterfaceError:
        return None, words[0]
    return words[0], None


def _end(timeout: float | None) -> float | None:
    return None if timeout is None else time.monotonic() + timeout


def _left(end: float) -> float:
    return max(0.0, end - time.monotonic())
