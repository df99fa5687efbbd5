"""Types that are not known here, learned from the nodes that use them.

Nodes of ROS 2 (Jazzy and newer) answer the service `get_type_description` with the sources of the types they use.
These are written into a folder of this process and read like any other definitions. A definition is taken only if
its hash is the one that the endpoint announces, so that nobody can give us another one by mistake.
"""

from __future__ import annotations

import asyncio
import atexit
import shutil
import tempfile
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from muros import interfaces
from muros.cdr import CdrError
from muros.cli._names import ros_topic, ros_type, service_of
from muros.interfaces import InterfaceError
from muros.interfaces._hashes import rihs01

if TYPE_CHECKING:
    from muros.cli._tool import Tool
    from muros.space import Endpoint

__all__ = ["learn", "make_known"]

DESCRIBE: Final = "type_description_interfaces/srv/GetTypeDescription"

ANSWER_TIME: Final = 2.0
"""Seconds that a node has to answer."""

MOST_SOURCES: Final = 200
"""Definitions of one answer that are looked at."""

MOST_NODES: Final = 3
"""Nodes that are asked about one type."""


async def make_known(tool: Tool, topic: str, type_name: str) -> None:
    """Learn the type of a topic if it is not known here, or known with another definition than there."""
    hashes = {e.type_hash for e in _users(tool, topic, type_name)}
    if not hashes or _own_hash(type_name) in hashes:
        return
    await tool.discover()  # whose endpoints these are comes to be known later than the endpoints
    await learn(tool, type_name, _users(tool, topic, type_name))


async def learn(tool: Tool, type_name: str, endpoints: Iterable[Endpoint]) -> bool:
    """Ask nodes that use a message type for its definition; whether it is known afterwards."""
    asked: dict[str, str] = {}
    for endpoint in endpoints:
        if endpoint.type_hash and endpoint.participant.name:
            asked.setdefault(endpoint.participant.full_name, endpoint.type_hash)
    for node, type_hash in list(asked.items())[:MOST_NODES]:
        sources = await _ask(tool, node, type_name, type_hash)
        if sources and _take_untrusted(type_name, type_hash, sources):
            tool.say(f"{node} told the definition of {type_name}")
            return True
    return False


def _users(tool: Tool, topic: str, type_name: str) -> list[Endpoint]:
    """The endpoints of a topic that announce the hash of this type."""
    found = ros_topic(tool, topic)
    endpoints = (*found.writers, *found.readers) if found else ()
    return [e for e in endpoints if e.type_hash and ros_type(e.type_name) == type_name]


def _own_hash(type_name: str) -> str:
    """The hash of our definition, empty if we have none that is right."""
    try:
        return interfaces.rihs01(type_name) if interfaces.known(type_name) else ""
    except InterfaceError:
        return ""


async def _ask(tool: Tool, node: str, type_name: str, type_hash: str) -> list[Any]:
    """The sources that a node has of a type, empty if it does not answer."""
    name = f"{node}/get_type_description"
    service = tool.graph.service(name, tool.domain)
    if service is None or not service.servers:
        return []
    made = interfaces.service(DESCRIBE)
    answer: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()

    def on_reply(number: int, data: bytes) -> None:
        if not answer.done():
            answer.set_result(data)

    with tool.participant.requester(service_of(name, DESCRIBE), on_reply=on_reply) as requester:
        requester.send(made.Request(type_name, type_hash, True).serialize())
        try:
            data = await asyncio.wait_for(answer, ANSWER_TIME)
            reply = made.Response.deserialize(data)
        except (TimeoutError, CdrError):
            return []
    return list(reply.type_sources[:MOST_SOURCES]) if reply.successful else []


def _take_untrusted(type_name: str, type_hash: str, sources: Iterable[Any]) -> bool:
    """Add definitions that somebody sent, if the one we want has the hash we know. False if anything is odd."""
    folder = Path(tempfile.mkdtemp(prefix="muros-types-"))
    atexit.register(shutil.rmtree, folder, ignore_errors=True)
    try:
        for source in sources:
            package, kind, name = interfaces.split_type(source.type_name)
            if source.encoding != kind:
                continue
            path = folder / package / kind / f"{name}.{kind}"
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(source.raw_file_contents)
        candidate = interfaces.Registry()
        candidate.add_path(folder)
        if rihs01(candidate, type_name) != type_hash:
            return False
        interfaces.add_path(folder)
    except (InterfaceError, OSError, UnicodeError):
        return False
    return True
