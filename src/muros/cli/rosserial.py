"""`muros rosserial`: boards with rosserial firmware join the ROS 2 graph, and a ROS 1 graph if wanted."""

from __future__ import annotations

import asyncio
import glob
import signal
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Final

from muros import __version__, interfaces
from muros.cli._log import DEBUG, GREEN, INFO, PLAIN, WARNING, YELLOW, Log, Message, MurosStyle
from muros.cli._rosserial_options import Options, WrongUseError, parameters_of, parse, take_settings
from muros.cli._tap import Tap
from muros.findings import Finding, Findings
from muros.interfaces import InterfaceError
from muros.links import Address, Link, LinkError
from muros.rclc.parameter_errors import InvalidParameterError
from muros.ros1 import Ros1Error
from muros.rosserial.server import (
    BAUD,
    NODE_NAME,
    Event,
    Ros1World,
    Server,
    events,
    serial_line,
    tcp_line,
)
from muros.space import SpaceError, open_space

FAILED: Final = 1
WRONG_USE: Final = 2


def run(argv: Sequence[str]) -> int:
    """Serve boards until SIGINT or SIGTERM; returns the exit status."""
    try:
        options = parse(argv)
        for folder in options.types:
            interfaces.add_path(folder)
        first_parameters = parameters_of(options)
    except (WrongUseError, InterfaceError, InvalidParameterError) as error:
        return _fail(error, WRONG_USE)
    try:
        asyncio.run(_serve(options, first_parameters))
    except (LinkError, SpaceError, InterfaceError, Ros1Error, WrongUseError) as error:
        return _fail(error, FAILED)
    return 0


async def _serve(options: Options, parameters: Callable[[str], Mapping[str, Any]]) -> None:
    log = Log(sys.stdout, RosserialStyle(), verbose=options.verbose)
    findings = Findings()
    early: list[Event | Finding | Message] = []
    unwatch = [findings.on_finding(early.append)]
    full = "/".join(
        ["", *filter(None, [options.namespace.strip("/"), (options.name or NODE_NAME).strip("/")])]
    )
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    world: Ros1World | None = None
    if options.ros1 is not None:
        world = Ros1World(options.ros1, findings=findings, clock=time.time, remap=options.remap)
        await world.open()
        take_settings(options, lambda name: world.setting(full, name) if world is not None else None)
    space = None
    try:
        if options.space != "none":
            space = open_space(options.space, findings=findings)
        server = Server(
            space,
            worlds=[] if world is None else [world],
            findings=findings,
            domain=options.domain,
            node_name=full,
            remap=options.remap,
            parameters=parameters,
        )
        unwatch.append(server.on_event(early.append))
        show: list[Callable[[Message], object]] = [early.append]
        links = _add_links(server, options, full, lambda message: show[0](message))
        await server.start()
        try:
            # The banner comes first: only open links know their ports.
            places = []
            if world is not None:
                places.append(f"ROS 1 at {world.master}")
            if space is not None:
                domain = space.domain if options.domain is None else options.domain
                engine = space.url.partition(":")[0]
                places.append(f"domain {domain}" if engine == "dds" else f"{engine} space")
            names = [link.name for link in links]
            log.started(" · ".join([f"muros rosserial {__version__}", *places, *names]), [])
            for end in unwatch:
                end()
            for each in early:
                if isinstance(each, Finding):
                    log.finding(each)
                elif isinstance(each, Message):
                    log.message(each)
                else:
                    log.event(each)
            show[0] = log.message
            server.on_event(log.event)
            server.on_finding(log.finding)
            await stop.wait()
            await server.stop()
        finally:
            server.close()
    finally:
        if space is not None:
            space.close()
        if world is not None:
            await world.close()


def _add_links(server: Server, options: Options, full: str, show: Callable[[Message], object]) -> list[Link]:
    """The lines that are asked for. A single port has the node's name for itself."""

    def on_message(link: Link, incoming: bool, data: bytes, address: Address) -> None:
        show(Message(link.name, link.describe(address), incoming, data))

    def watched(link: Link) -> Link:
        return Tap(link, on_message) if options.verbose >= DEBUG else link

    single = len(options.devices) == 1 and not options.tcp and not glob.has_magic(options.devices[0])
    name = full if single or options.name else None
    links: list[Link] = []
    if options.devices:
        line = watched(serial_line(options.devices, options.baud or BAUD))
        links.append(server.add_link(line, name=name, find_baud=options.baud is None))
    links += [server.add_link(watched(tcp_line(port, options.host)), name=name) for port in options.tcp]
    return links


class RosserialStyle(MurosStyle):
    """`[12:00:01] Setup subscriber on led_out [std_msgs/Byte]`"""

    EVENTS: ClassVar[Mapping[type[Any], tuple[int, str]]] = {
        events.LineUp: (INFO, PLAIN),
        events.LineDown: (WARNING, YELLOW),
        events.BoardHeard: (INFO, PLAIN),
        events.BufferKnown: (INFO, PLAIN),
        events.EndpointSetUp: (INFO, PLAIN),
        events.BoardReady: (INFO, GREEN),
        events.BoardReset: (WARNING, YELLOW),
        events.BoardLost: (WARNING, YELLOW),
        events.BoardBack: (INFO, GREEN),
        events.BoardGone: (INFO, PLAIN),
        events.BoardLog: (INFO, PLAIN),
    }


def _fail(error: Exception, status: int) -> int:
    print(f"muros: {error}", file=sys.stderr)
    return status
