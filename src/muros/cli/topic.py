"""The command `muros topic`: what moves in the graph. Words, options and output are those of `ros2 topic`.

Here are the words and what can be read off the graph; `_echo`, `_pub` and `_rates` have what moves samples.
"""

from __future__ import annotations

import argparse
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Any

from muros.cli._names import RosTopic, add_type_options, full_name, is_hidden, ros_topics
from muros.cli._tool import CommandError, Tool, add_space_options, positive, run_command

if TYPE_CHECKING:
    from muros.space import Endpoint

Command = Callable[[Tool, argparse.Namespace], Awaitable[int | None]]

ENDLESS = 10_000
"""Samples over which hz and delay take their averages, unless told otherwise."""

BARE = "_CREATED_BY_BARE_DDS_APP_"
"""What ROS 2 calls the node of an endpoint that belongs to none."""


def register(subparsers: Any) -> None:
    """Adds `topic` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("topic", help="list, show, publish and measure topics")
    words = parser.add_subparsers(
        required=True, metavar="list | info | type | find | echo | pub | hz | bw | delay"
    )
    listing = command(words, "list", list_topics, "list the topics that somebody writes or reads")
    listing.add_argument("-t", "--show-types", action="store_true", help="with the type of each")
    listing.add_argument(
        "-c", "--count-topics", "--count", action="store_true", help="only how many there are"
    )
    listing.add_argument(
        "-a", "--include-hidden-topics", "--all", action="store_true", help="those that begin with '_' too"
    )
    listing.add_argument("-v", "--verbose", action="store_true", help="with types and numbers of endpoints")
    listing.add_argument("--dds", action="store_true", help="names as in DDS, topics that are not ROS's too")

    about = command(words, "info", topic_info, "show who writes and reads a topic")
    about.add_argument("topic_name", metavar="TOPIC")
    about.add_argument("-v", "--verbose", action="store_true", help="with node, gid and QoS of each endpoint")
    about.add_argument("--dds", action="store_true", help="TOPIC is a name of DDS")

    kind = command(words, "type", topic_type, "print the type of a topic")
    kind.add_argument("topic_name", metavar="TOPIC")

    find = command(words, "find", find_topics, "list the topics of a type")
    find.add_argument("topic_type", metavar="TYPE")
    find.add_argument("-c", "--count-topics", action="store_true", help="only how many there are")
    find.add_argument("-a", "--include-hidden-topics", action="store_true", help="hidden topics too")

    _add_echo(words)
    _add_pub(words)
    _add_rates(words)


def command(words: Any, name: str, function: Command, about: str) -> argparse.ArgumentParser:
    """A sub-command that runs a coroutine in a space."""
    parser: argparse.ArgumentParser = words.add_parser(name, help=about, description=f"{about.capitalize()}.")
    parser.set_defaults(run=lambda arguments: run_command(arguments, function), command=function)
    add_space_options(parser)
    return parser


# ---- what the graph tells ----


async def list_topics(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros topic list`."""
    await tool.discover()
    topics = [
        topic
        for topic in ros_topics(tool, plain_dds=arguments.dds)
        if arguments.dds or arguments.include_hidden_topics or not is_hidden(topic.name)
    ]
    if arguments.count_topics:
        tool.print(len(topics))
    elif arguments.verbose:
        for title, word, side in (
            ("Published", "publisher", "writers"),
            ("Subscribed", "subscriber", "readers"),
        ):
            tool.print(f"{title} topics:")
            for topic in topics:
                if count := len(getattr(topic, side)):
                    plural = "s" if count > 1 else ""
                    tool.print(f" * {topic.name} [{', '.join(topic.types)}] {count} {word}{plural}")
            tool.print()
    else:
        for topic in topics:
            tool.print(topic.name + (f" [{', '.join(topic.types)}]" if arguments.show_types else ""))


async def topic_info(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros topic info`."""
    topic = await known_topic(tool, arguments.topic_name, plain_dds=arguments.dds)
    end = "\n\n" if arguments.verbose else "\n"
    types = topic.types[0] if len(topic.types) == 1 else str(list(topic.types))
    tool.print(f"Type: {types}", end)
    for word, endpoints in (("Publisher", topic.writers), ("Subscription", topic.readers)):
        tool.print(f"{word} count: {len(endpoints)}", end)
        if arguments.verbose:
            for endpoint in endpoints:
                tool.print(endpoint_text(endpoint, word.upper(), topic, tool), end)
    for line in mismatch_lines(tool, topic.dds_name):
        tool.say(line)


async def topic_type(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros topic type`."""
    topic = await known_topic(tool, arguments.topic_name)
    for name in topic.types:
        tool.print(name)


async def find_topics(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros topic find`."""
    from muros.interfaces import split_type

    wanted = "/".join(split_type(arguments.topic_type))
    await tool.discover()
    topics = [t.name for t in ros_topics(tool) if wanted in t.types]
    topics = [name for name in topics if arguments.include_hidden_topics or not is_hidden(name)]
    for line in [len(topics)] if arguments.count_topics else topics:
        tool.print(line)


async def known_topic(tool: Tool, name: str, *, plain_dds: bool = False) -> RosTopic:
    """The topic of that name when discovery has settled. CommandError if there is none."""
    wanted = name if plain_dds else full_name(name)
    await tool.discover()
    topics = ros_topics(tool, plain_dds=plain_dds)
    for topic in topics:
        if topic.name == wanted:
            return topic
    raise CommandError(unknown("topic", wanted, [t.name for t in topics], tool.domain))


def unknown(what: str, name: str, known: list[str], domain: int) -> str:
    """The line that says that something is not there, with the most likely cause."""
    from difflib import get_close_matches

    if not known:
        return f"Unknown {what} '{name}': there is none at all in domain {domain}; see muros doctor"
    close = get_close_matches(name, known, 1)
    hint = f"did you mean {close[0]}?" if close else f"see muros {what} list"
    return f"Unknown {what} '{name}': {hint}"


def endpoint_text(endpoint: Endpoint, kind: str, topic: RosTopic, tool: Tool) -> str:
    """One endpoint in the words of `ros2 topic info -v`."""
    from muros.cli._names import ros_type
    from muros.space import History

    qos, owner = endpoint.qos, endpoint.participant
    history = qos.history.name if qos.history != History.KEEP_LAST else f"KEEP_LAST ({qos.depth})"
    if not tool.space.url.startswith("local:"):
        history = "UNKNOWN"  # DDS does not announce it: what is known of others is its default
    return "\n".join(
        [
            f"Node name: {owner.name or BARE}",
            f"Node namespace: {owner.namespace if owner.name else BARE}",
            f"Topic type: {ros_type(endpoint.type_name)}",
            f"Topic type hash: {endpoint.type_hash or 'INVALID'}",
            f"Endpoint type: {kind}",
            f"GID: {endpoint.gid.hex('.')}",
            "QoS profile:",
            f"  Reliability: {qos.reliability.name}",
            f"  History (Depth): {history}",
            f"  Durability: {qos.durability.name}",
            f"  Lifespan: {_period(qos.lifespan)}",
            f"  Deadline: {_period(qos.deadline)}",
            f"  Liveliness: {qos.liveliness.name}",
            f"  Liveliness lease duration: {_period(qos.lease)}",
        ]
    )


def mismatch_lines(tool: Tool, dds_name: str) -> list[str]:
    """One line for each pair on a topic whose QoS does not fit."""
    topic = tool.graph.topic(dds_name, tool.domain)
    if topic is None:
        return []
    return [
        f"{i.writer.participant.full_name} does not reach {i.reader.participant.full_name}: "
        + "; ".join(i.reasons)
        for i in topic.incompatible
    ]


def _period(ns: int) -> str:
    return f"{ns} nanoseconds" if ns else "Infinite"


# ---- the words that move samples ----


def _add_echo(words: Any) -> None:
    async def echo(tool: Tool, arguments: argparse.Namespace) -> None:
        from muros.cli._echo import echo

        await echo(tool, arguments)

    parser = command(words, "echo", echo, "print what is published")
    parser.add_argument("topic_name", metavar="TOPIC")
    parser.add_argument("message_type", nargs="?", metavar="TYPE", help="needed when nobody publishes yet")
    parser.add_argument("--once", action="store_true", help="print one sample and end")
    parser.add_argument("--times", type=int, metavar="N", help="print N samples and end")
    parser.add_argument("--timeout", type=positive, metavar="S", help="end after S seconds")
    parser.add_argument("--field", metavar="PATH", help="only this part, as pose.position or ranges[0]")
    parser.add_argument(
        "--csv", action="store_true", help="values with commas between, a line for each sample"
    )
    parser.add_argument("--flow-style", action="store_true", help="YAML in one line")
    parser.add_argument(
        "-f", "--full-length", action="store_true", help="long arrays and strings to their end"
    )
    parser.add_argument("-l", "--truncate-length", type=int, default=128, metavar="N", help="else N elements")
    parser.add_argument("--no-arr", action="store_true", help="arrays by type and length only")
    parser.add_argument("--no-str", action="store_true", help="strings by length only")
    parser.add_argument("--raw", action="store_true", help="bytes instead of values")
    parser.add_argument(
        "--filter", dest="filter_expr", metavar="EXPR", help="only where EXPR of the sample m is true"
    )
    parser.add_argument("-i", "--include-message-info", action="store_true", help="with times and numbers")
    parser.add_argument("--no-lost-messages", action="store_true", help="do not tell of lost samples")
    parser.add_argument("--lost-messages", action="store_true", help=argparse.SUPPRESS)
    add_type_options(parser)
    _add_qos(parser, "sensor_data")


def _add_pub(words: Any) -> None:
    async def publish(tool: Tool, arguments: argparse.Namespace) -> None:
        from muros.cli._pub import publish

        await publish(tool, arguments)

    parser = command(words, "pub", publish, "publish a message, once or at a rate")
    parser.add_argument("topic_name", metavar="TOPIC")
    parser.add_argument("message_type", metavar="TYPE", help="std_msgs/msg/String, or short std_msgs/String")
    parser.add_argument(
        "values", nargs="?", metavar="VALUES", help="YAML: '{data: hello}'; stamps may be now, headers auto"
    )
    parser.add_argument("--yaml-file", metavar="FILE", help="read the values there; --- divides messages")
    parser.add_argument("--stdin", action="store_true", help="read the values from standard input")
    parser.add_argument("-r", "--rate", type=positive, default=1.0, metavar="HZ", help="default: 1")
    parser.add_argument("-p", "--print", type=int, default=1, metavar="N", help="tell of every Nth (0: none)")
    often = parser.add_mutually_exclusive_group()
    often.add_argument("-1", "--once", action="store_true", help="publish once and end")
    often.add_argument("-t", "--times", type=int, default=0, metavar="N", help="publish N times and end")
    parser.add_argument(
        "-w",
        "--wait-matching-subscriptions",
        type=int,
        metavar="N",
        help="begin when there are N subscriptions (default: 1 with --once and --times, else 0)",
    )
    parser.add_argument("--max-wait-time-secs", type=positive, metavar="S", help="but wait S seconds at most")
    parser.add_argument(
        "--keep-alive", type=float, default=0.1, metavar="S", help="stay S seconds after the last (0.1)"
    )
    parser.add_argument("-n", "--node-name", dest="own_name", metavar="NAME", help="publish as this node")
    add_type_options(parser)
    _add_qos(parser, "default")


def _add_rates(words: Any) -> None:
    def measuring(name: str) -> Command:
        async def measure(tool: Tool, arguments: argparse.Namespace) -> None:
            from muros.cli import _rates

            await _rates.measure(name, tool, arguments)

        return measure

    for name, about, window in (
        ("hz", "measure how often samples come", ENDLESS),
        ("bw", "measure how many bytes come", 100),
        ("delay", "measure how old samples are, by the stamp in their header", ENDLESS),
    ):
        parser = command(words, name, measuring(name), about)
        parser.add_argument("topic_name", nargs="+" if name == "hz" else 1, metavar="TOPIC")
        parser.add_argument(
            "-w", "--window", type=int, default=window, metavar="N", help=f"average over N ({window})"
        )
        parser.add_argument("--times", type=int, metavar="N", help="end after N results")
        if name == "hz":
            parser.add_argument(
                "--filter", dest="filter_expr", metavar="EXPR", help="only where EXPR of m is true"
            )
            parser.add_argument("--wall-time", action="store_true", help=argparse.SUPPRESS)
        add_type_options(parser)
        _add_qos(parser, "sensor_data")


def _add_qos(parser: argparse.ArgumentParser, default: str) -> None:
    from muros.cli._qos import add_qos_options

    add_qos_options(parser, default)
