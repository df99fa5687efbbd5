"""The command `muros node`: who is in the graph. Words, options and output are those of `ros2 node`."""

from __future__ import annotations

import argparse
from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

from muros.cli._names import full_name, is_hidden, ros_services, ros_topics
from muros.cli._tool import CommandError, Tool
from muros.cli.topic import command, unknown

if TYPE_CHECKING:
    from muros.space import Endpoint, ParticipantInfo

__all__ = ["info", "list_nodes", "nodes_of", "register"]

FEEDBACK = "/_action/feedback"
"""What the topic of an action's feedback ends with: who writes it serves the action, who reads it uses it."""

MESSAGE = "_FeedbackMessage"


def register(subparsers: Any) -> None:
    """Adds `node` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("node", help="list and show nodes")
    words = parser.add_subparsers(required=True, metavar="list | info")
    listing = command(words, "list", list_nodes, "list the nodes")
    listing.add_argument("-a", "--all", action="store_true", help="those that begin with '_' too")
    listing.add_argument(
        "-c", "--count-nodes", "--count", action="store_true", help="only how many there are"
    )
    about = command(words, "info", info, "show what a node writes, reads, serves and asks")
    about.add_argument("node_name", metavar="NODE")
    about.add_argument("--include-hidden", action="store_true", help="hidden topics and services too")


def nodes_of(tool: Tool) -> list[ParticipantInfo]:
    """The nodes of others, by full name."""
    own = tool.participant.gid
    nodes = [n for n in tool.graph.nodes if n.domain == tool.domain and n.gid != own]
    return sorted(nodes, key=lambda node: node.full_name)


async def list_nodes(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros node list`."""
    await tool.discover()
    names = [n.full_name for n in nodes_of(tool) if arguments.all or not is_hidden(n.name)]
    if arguments.count_nodes:
        tool.print(len(names))
        return
    if twice := sorted({name for name in names if names.count(name) > 1}):
        tool.say(f"several nodes have one name, which may confuse others: {', '.join(twice)}")
    for name in names:
        tool.print(name)


async def info(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros node info`."""
    name = full_name(arguments.node_name, "node")
    await tool.discover()
    known = [node.full_name for node in nodes_of(tool)]
    if name not in known:
        raise CommandError(unknown("node", name, known, tool.domain))
    if known.count(name) > 1:
        tool.say(f"{known.count(name)} nodes are called {name}: this is what they have together")
    tool.print(name)
    for title, things in _sections(tool, name):
        tool.print(f"  {title}:")
        shown = [(n, types) for n, types in things if arguments.include_hidden or not is_hidden(n)]
        for thing, types in shown:
            tool.print(f"    {thing}: {', '.join(types)}")
        if not shown:
            tool.print()


def _sections(tool: Tool, node: str) -> Iterable[tuple[str, list[tuple[str, tuple[str, ...]]]]]:
    """Titles, and the names and types that stand under them."""

    def has(endpoints: Iterable[Endpoint]) -> bool:
        return any(e.participant.name and e.participant.full_name == node for e in endpoints)

    topics, services = ros_topics(tool), ros_services(tool)
    writes = [(t.name, t.types) for t in topics if has(t.writers)]
    reads = [(t.name, t.types) for t in topics if has(t.readers)]
    yield "Subscribers", reads
    yield "Publishers", writes
    yield "Service Servers", [(s.name, s.types) for s in services if has(s.servers)]
    yield "Service Clients", [(s.name, s.types) for s in services if has(s.clients)]
    yield "Action Servers", _actions(writes)
    yield "Action Clients", _actions(reads)


def _actions(topics: list[tuple[str, tuple[str, ...]]]) -> list[tuple[str, tuple[str, ...]]]:
    return [
        (name.removesuffix(FEEDBACK), tuple(t.removesuffix(MESSAGE) for t in types))
        for name, types in topics
        if name.endswith(FEEDBACK)
    ]
