"""`muros agent`: reads the command line, opens the links, prints what happens until it is told to stop."""

import asyncio
import signal
import sys
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

from muros import __version__
from muros.agent import Agent, LinkUp
from muros.agent.arguments import AgentOptions, LinkOptions, UsageError, help_text, parse_arguments
from muros.agent.profiles import NamedReferences, Profiles, ProfilesError, ReferenceChain
from muros.cli._log import DEBUG, STYLES, Log, Message, Told
from muros.cli._tap import Tap
from muros.findings import Finding, Findings
from muros.links import (
    LINK_KINDS,
    Address,
    CanLink,
    DiscoveryLink,
    Link,
    LinkError,
    PseudoterminalLink,
    SerialLink,
)
from muros.space import Space, SpaceError, open_space

if TYPE_CHECKING:
    from muros.rosserial.server import Server

FAILED = 1
WRONG_USE = 2


def run(argv: Sequence[str]) -> int:
    """Run the agent until SIGINT or SIGTERM; returns the exit status."""
    try:
        options = parse_arguments(argv)
        if options is None:
            print(help_text())
            return 0
        profiles = _profiles(options)
    except (UsageError, ProfilesError) as error:
        return _fail(error, WRONG_USE)
    for note in (*options.notes, *profiles.notes()):
        _say(f"note: {note}")
    try:
        asyncio.run(_serve(options, profiles))
    except (LinkError, SpaceError) as error:
        return _fail(error, FAILED)
    return 0


def make_links(options: AgentOptions) -> Iterator[tuple[Link, list[Link] | None]]:
    """The links that are asked for, closed; and one discovery link for each port, with the links it announces.

    Those for rosserial are not the agent's, see `make_rosserial`.
    """
    discovery: dict[int, tuple[Link, list[Link]]] = {}
    for asked in options.links:
        if asked.kind == "rosserial":
            continue
        link = _make_link(asked)
        yield link, None
        port = asked.discovery_port
        if port is not None:
            if port not in discovery:
                one = asked.bind if asked.bind and asked.family == 4 and asked.bind != "0.0.0.0" else None
                discovery[port] = DiscoveryLink(port, interface=one), []
            discovery[port][1].append(link)
    yield from discovery.values()


def make_rosserial(options: AgentOptions, space: Space) -> "Server | None":
    """A rosserial server on the agent's space, for the links that ask for one."""
    wanted = [asked for asked in options.links if asked.kind == "rosserial"]
    if not wanted:
        return None
    from muros.rosserial.server import Server, serial_line, tcp_line

    server = Server(space)
    for asked in wanted:
        server.add_link(
            serial_line(asked.devices, asked.baudrate) if asked.devices else tcp_line(asked.port, asked.bind)
        )
    return server


def _make_link(options: LinkOptions) -> Link:
    match options.kind:
        case "serial" | "multiserial":
            return SerialLink(options.devices, options.baudrate)
        case "pseudoterminal":
            return PseudoterminalLink(options.devices[0] if options.devices else None)
        case "canfd":
            return CanLink(options.devices[0])
        case "tcp4" | "tcp6":
            return LINK_KINDS[options.kind](options.port, options.bind, connections=options.connections)
        case kind:
            return LINK_KINDS[kind](options.port, options.bind)


async def _serve(options: AgentOptions, profiles: Profiles) -> None:
    log = Log(sys.stdout, STYLES[options.log_style](), verbose=options.verbose, color=options.color)
    space = _open_space(options)
    agent = Agent(
        space,
        references=ReferenceChain(profiles, NamedReferences()),
        domain=options.domain_override,
        limits=options.limits,
    )

    def on_message(link: Link, incoming: bool, data: bytes, address: Address) -> None:
        log.message(Message(link.name, link.describe(address), incoming, data))

    added: dict[Link, Link] = {}
    for link, announced in make_links(options):
        added[link] = Tap(link, on_message) if options.verbose >= DEBUG else link
        agent.add_link(
            added[link], announces=None if announced is None else [added[each] for each in announced]
        )
    rosserial = make_rosserial(options, space)
    links = [*added, *(rosserial.links if rosserial is not None else [])]
    early: list[Told | Finding] = []
    unwatch = [agent.on_event(early.append), agent.on_finding(early.append)]
    if rosserial is not None:
        unwatch.append(rosserial.on_event(early.append))
    stop = asyncio.Event()
    loop = asyncio.get_running_loop()
    for number in (signal.SIGINT, signal.SIGTERM):
        loop.add_signal_handler(number, stop.set)
    await agent.start()
    try:
        if rosserial is not None:
            await rosserial.start()
        # The banner comes first: only open links know their ports.
        log.started(_banner(space, links), [link.name for link in links])
        for end in unwatch:
            end()
        for each in early:
            if isinstance(each, Finding):
                log.finding(each)
            elif not (isinstance(each, LinkUp) and options.log_style == "muros" and _in_banner(each)):
                log.event(each)
        agent.on_event(log.event)
        if rosserial is not None:
            rosserial.on_event(log.event)
        agent.on_finding(log.finding)
        await stop.wait()
    finally:
        if rosserial is not None:
            await rosserial.stop()
        agent.close()
        space.close()


def _open_space(options: AgentOptions) -> Space:
    if options.ros_distro is None:
        return open_space(options.space, findings=Findings())
    return open_space(options.space, findings=Findings(), ros_distro=options.ros_distro)


def _banner(space: Space, links: Sequence[Link]) -> str:
    engine = space.url.partition(":")[0]
    where = {"dds": f"domain {space.domain}", "cyclonedds": f"domain {space.domain} (Cyclone DDS)"}
    said = where.get(engine, f"{engine} space")
    return " · ".join([f"muros agent {__version__}", said, *(link.name for link in links)])


def _in_banner(event: LinkUp) -> bool:
    return event.detail in ("", event.link)


def _profiles(options: AgentOptions) -> Profiles:
    if options.refs is None:
        return Profiles()
    try:
        return Profiles.load(options.refs)
    except ProfilesError as error:
        if not options.refs_optional:
            raise
        _say(f"{error}; going on without profiles")
        return Profiles()


def _say(text: object) -> None:
    print(f"muros: {text}", file=sys.stderr)


def _fail(error: Exception, status: int) -> int:
    _say(error)
    return status
