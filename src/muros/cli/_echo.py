"""`muros topic echo`: prints the samples of a topic as YAML, CSV or hex.

Its reader asks for no more than all publishers offer, so that it hears them all; whoever appears later and does not
fit is told of. A type that nobody has told us about is shown as hex.
"""

from __future__ import annotations

import argparse
import asyncio
import time
from collections.abc import Callable
from typing import Any

from muros import interfaces
from muros.cli._learn import make_known
from muros.cli._names import full_name, learn_types, message_class, node_name, ros_topic
from muros.cli._qos import chosen_qos, fitted_qos, has_choice
from muros.cli._tool import CommandError, Tool
from muros.cli._values import Look, dump, hex_dump, pick, to_csv, to_yaml
from muros.space import CDR_BE, CDR_LE, GraphEvent, Incompatible, Qos, Sample, Topic

__all__ = ["echo", "expression", "reader_qos", "type_to_read"]

NAME_TIME = 0.5
"""Seconds after which the node of a new endpoint is known."""

DEPTH = 1000
"""Samples a reader keeps: a burst is printed whole, however long the terminal takes."""


async def echo(tool: Tool, arguments: argparse.Namespace) -> None:
    """Print samples until there were enough of them."""
    learn_types(arguments)
    name = full_name(arguments.topic_name)
    type_name = await type_to_read(tool, name, arguments.message_type)
    if not arguments.raw:
        await make_known(tool, name, type_name)
    printer = _Printer(tool, arguments, name, type_name)
    qos = reader_qos(tool, name, arguments)

    def handle(sample: Sample) -> None:
        if printer.show(sample):
            subscription.finish()

    topic = Topic(interfaces.dds_topic(name), interfaces.dds_type_name(type_name))
    subscription = tool.subscribe(topic, qos, handle)
    reader = subscription.reader
    tell_of_mismatches(tool, reader.gid)
    lost, end = 0, None if arguments.timeout is None else time.monotonic() + arguments.timeout
    while not await subscription.wait(0.2):
        if reader.lost > lost and not arguments.no_lost_messages:
            tool.say(f"{reader.lost - lost} samples of {name} were lost, {reader.lost} so far")
            lost = reader.lost
        if end is not None and time.monotonic() >= end:
            return


async def type_to_read(tool: Tool, name: str, given: str | None) -> str:
    """The type to read a topic with: the one given, else that of the graph, waited for if nobody is there yet."""

    def types() -> tuple[str, ...]:
        topic = ros_topic(tool, name)
        return () if topic is None else topic.types

    def has_writer(_: object) -> bool:
        topic = ros_topic(tool, name)
        return topic is not None and bool(topic.writers)

    await tool.discover(until=has_writer)
    if given is not None:
        type_name = "/".join(interfaces.split_type(given))
        others = [t for t in types() if t != type_name]
        if others:
            tool.say(f"{name} carries {', '.join(types())}; reading it as {type_name}")
        return type_name
    if not types():
        tool.say(f"waiting: topic [{name}] does not appear to be published yet (domain {tool.domain})")
        await tool.wait_for(lambda _: bool(types()))
    found = types()
    if len(found) > 1:
        raise CommandError(f"{name} carries more than one type: {', '.join(found)}; name the one to read")
    try:
        return "/".join(interfaces.split_type(found[0]))
    except interfaces.InterfaceError:
        raise CommandError(f"{name} carries {found[0]}, which is no type of ROS") from None


def reader_qos(tool: Tool, name: str, arguments: argparse.Namespace) -> Qos:
    """The QoS to read a topic with: as chosen, else as much as all its publishers offer. Tells where they differ."""
    try:
        qos = chosen_qos(arguments)
    except ValueError as error:
        raise CommandError(str(error), 2) from None
    if has_choice(arguments):
        return qos
    topic = ros_topic(tool, name)
    fitted, notes = fitted_qos(qos, topic.writers if topic else ())
    for note in notes:
        tool.say(f"{name}: {note}")
    return fitted.replace(depth=max(DEPTH, qos.depth))


def tell_of_mismatches(tool: Tool, gid: bytes) -> None:
    """Tell of everybody, now and later, whose QoS does not fit that of our endpoint."""
    loop = asyncio.get_running_loop()

    def tell(other: bytes, reasons: tuple[str, ...]) -> None:
        endpoint = tool.graph.endpoint(other)
        owner = "somebody who has gone" if endpoint is None else node_name(endpoint.participant)
        tool.say(f"{owner} does not match: {'; '.join(reasons)}; choose with --qos-...")

    def look(event: GraphEvent) -> None:
        if isinstance(event, Incompatible) and gid in (event.reader.gid, event.writer.gid):
            other = event.writer if event.reader.gid == gid else event.reader
            # Whose endpoint it is comes to be known a little later than the endpoint.
            loop.call_later(0.0 if other.participant.name else NAME_TIME, tell, other.gid, event.reasons)

    own = tool.graph.endpoint(gid)
    topic = tool.graph.topic(own.topic, tool.domain) if own else None
    for pair in topic.incompatible if topic else ():
        look(pair)
    tool.graph.watch(look)


def expression(text: str | None) -> Callable[[Any], bool] | None:
    """The test that a Python expression of `m` makes. CommandError if it is none, or fails."""
    if text is None:
        return None
    try:
        code = compile(text, "--filter", "eval")
    except SyntaxError as error:
        raise CommandError(f"--filter {text}: {error.msg}", 2) from None

    def test(m: Any) -> bool:
        try:
            return bool(eval(code, {"m": m}))
        except Exception as error:
            raise CommandError(f"--filter {text}: {type(error).__name__}: {error}") from None

    return test


def decoded(made: type[Any], sample: Sample) -> Any:
    """The message of a sample; CdrError if its bytes do not fit the type."""
    return made.deserialize(sample.data, big_endian=sample.representation == CDR_BE)


class _Printer:
    """Shows samples in the way that the options ask for, and counts them."""

    def __init__(self, tool: Tool, arguments: argparse.Namespace, name: str, type_name: str) -> None:
        self._tool = tool
        self._arguments = arguments
        self._type_name = type_name
        self._made = None if arguments.raw else message_class(type_name)
        self._filter = expression(arguments.filter_expr)
        self._left = 1 if arguments.once else arguments.times
        self._shown = 0
        self._excused = False
        self._look = Look(
            None if arguments.full_length else max(arguments.truncate_length, 0),
            arguments.no_arr,
            arguments.no_str,
            arguments.flow_style,
        )
        if self._made is None and not arguments.raw:
            if arguments.field or arguments.filter_expr or arguments.csv:
                raise CommandError(f"{name} carries {type_name}, {UNKNOWN}")
            tool.say(f"{name} carries {type_name}, {UNKNOWN}; here are its bytes")

    def show(self, sample: Sample) -> bool:
        """Print a sample if it is wanted; True when that was the last one."""
        text = self._text(sample)
        if text is None:
            return False
        self._tool.print(text, end="")
        self._shown += 1
        return self._left is not None and self._shown >= self._left

    def _text(self, sample: Sample) -> str | None:
        arguments = self._arguments
        info = _info(sample, self._shown + 1) if arguments.include_message_info else None
        head = "" if info is None else dump(info) + "---\n"
        if self._made is None:
            return f"{head}{self._bytes(sample)}"
        if sample.representation not in (CDR_LE, CDR_BE):
            self._excuse(f"samples are encoded as 0x{sample.representation:04x}, which is no plain CDR")
            return f"{head}{self._bytes(sample)}"
        try:
            value = decoded(self._made, sample)
        except interfaces.CdrError as error:
            self._excuse(f"{error}; is it another version of {self._type_name}?")
            return f"{head}{self._bytes(sample)}"
        if arguments.field:
            value = pick(value, arguments.field)
        if self._filter is not None and not self._filter(value):
            return None
        if arguments.csv:
            times = "" if info is None else ",".join(str(v) for v in info.values()) + ","
            return f"{times}{to_csv(value, self._look)}\n"
        return f"{head}{to_yaml(value, self._look)}---\n"

    def _bytes(self, sample: Sample) -> str:
        return f"{hex_dump(sample.data, self._look.truncate)}---\n"

    def _excuse(self, why: str) -> None:
        """Say once why there are bytes instead of values."""
        if not self._excused:
            self._excused = True
            self._tool.say(f"{why} Here are the bytes" if why.endswith("?") else f"{why}; here are the bytes")


UNKNOWN = "a type without a definition here: say --types FOLDER (it holds package/msg/Type.msg)"


def _info(sample: Sample, number: int) -> dict[str, int]:
    return {
        "source_timestamp": sample.source_time,
        "received_timestamp": time.time_ns(),
        "publication_sequence_number": sample.sequence,
        "reception_sequence_number": number,
    }
