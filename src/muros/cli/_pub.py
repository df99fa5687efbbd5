"""`muros topic pub`: publishes messages given as YAML, once, some times, or until it is stopped."""

from __future__ import annotations

import argparse
import asyncio
import sys
import time
from pathlib import Path
from typing import Any, Final

from muros import interfaces
from muros.cli._echo import tell_of_mismatches
from muros.cli._learn import make_known
from muros.cli._names import full_name, learn_types, required_class, ros_topic
from muros.cli._qos import chosen_qos
from muros.cli._tool import CommandError, Tool
from muros.cli._values import Stamp, fill, read_documents, read_yaml
from muros.space import Topic, Writer

__all__ = ["publish", "values_text"]

REMARK_PERIOD: Final = 1.0
"""Seconds between two remarks that nobody listens yet."""

DELIVERY_TIME: Final = 5.0
"""Seconds that the last samples may take to reach reliable subscribers."""

Prepared = tuple[Any, list[Stamp]]


async def publish(tool: Tool, arguments: argparse.Namespace) -> None:
    """Publish as the arguments say."""
    learn_types(arguments)
    name = full_name(arguments.topic_name)
    type_name = "/".join(interfaces.split_type(arguments.message_type))
    if not interfaces.known(type_name):
        await tool.discover(until=lambda _: ros_topic(tool, name) is not None)
        await make_known(tool, name, type_name)
    made = required_class(type_name)
    messages = _messages(made, arguments)
    try:
        qos = chosen_qos(arguments)
    except ValueError as error:
        raise CommandError(str(error), 2) from None
    times = 1 if arguments.once else arguments.times
    wanted = arguments.wait_matching_subscriptions
    if wanted is None:
        wanted = 1 if times else 0
    if arguments.max_wait_time_secs is not None and not wanted:
        raise CommandError("--max-wait-time-secs needs -w N with N above 0", 2)

    topic = Topic(interfaces.dds_topic(name), interfaces.dds_type_name(made.TYPE))
    writer = tool.participant.writer(topic, qos)
    tell_of_mismatches(tool, writer.gid)
    await _wait_for_readers(tool, writer, wanted, arguments.max_wait_time_secs)
    _tell_of_other_types(tool, name, made.TYPE)
    tool.print("publisher: beginning loop")
    await _loop(tool, writer, messages, arguments, times)
    await asyncio.sleep(arguments.keep_alive)
    await _delivered(writer)


def values_text(arguments: argparse.Namespace) -> str:
    """The YAML of the command line or of standard input. CommandError if both are there."""
    if not arguments.stdin:
        return arguments.values or "{}"
    if arguments.values is not None:
        raise CommandError("give the values either as words or by --stdin", 2)
    return sys.stdin.read()


def _messages(made: type[Any], arguments: argparse.Namespace) -> list[Prepared]:
    """The messages to publish in turn, each with what sets its times."""
    if arguments.yaml_file is None:
        return [_prepared(made, read_yaml(values_text(arguments)))]
    if arguments.values is not None or arguments.stdin:
        raise CommandError("give the values either as words, by --stdin or by --yaml-file", 2)
    try:
        text = Path(arguments.yaml_file).read_text()
    except UnicodeDecodeError:
        raise CommandError(f"{arguments.yaml_file}: this is no text") from None
    try:
        documents = read_documents(text)
    except CommandError as error:
        raise CommandError(f"{arguments.yaml_file}: {error}") from None
    if not documents:
        raise CommandError(f"{arguments.yaml_file}: there are no values in it")
    return [_prepared(made, values) for values in documents]


def _prepared(made: type[Any], values: Any) -> Prepared:
    message = made()
    stamps = fill(message, values)
    message.serialize()  # says now, not later, what does not fit
    return message, stamps


async def _wait_for_readers(tool: Tool, writer: Writer, wanted: int, timeout: float | None) -> None:
    end = None if timeout is None else time.monotonic() + timeout
    told = 0.0
    while len(writer.matched) < wanted:
        now = time.monotonic()
        if end is not None and now >= end:
            raise CommandError(f"timed out: {len(writer.matched)} of {wanted} subscriptions matched")
        if now - told >= REMARK_PERIOD:
            tool.print(f"Waiting for at least {wanted} matching subscription(s)...")
            told = now
        left = REMARK_PERIOD if end is None else min(REMARK_PERIOD, end - now)
        await tool.wait_for(lambda _: len(writer.matched) >= wanted, left)


async def _loop(
    tool: Tool, writer: Writer, messages: list[Prepared], arguments: argparse.Namespace, times: int
) -> None:
    """Publish on a schedule that does not drift; after a stall it goes on at its rate, without a burst."""
    period = 1.0 / arguments.rate
    room = asyncio.Event()
    writer.on_room = room.set
    due = time.monotonic()
    count = 0
    while not times or count < times:
        if (late := time.monotonic() - due) < 0:
            await asyncio.sleep(-late)
        elif late > max(1.0, 2 * period):
            due = time.monotonic()
        elif count % 64 == 0:
            await asyncio.sleep(0)  # rates beyond what the loop can keep: sockets and signals come first
        due += period
        message, stamps = messages[count % len(messages)]
        now = time.time_ns()
        for stamp in stamps:
            stamp(now)
        count += 1
        if arguments.print and count % arguments.print == 0:
            tool.print(f"publishing #{count}: {message!r}\n")
        data = message.serialize()
        room.clear()
        while not writer.write(data, source_time=now):
            await room.wait()
            room.clear()


async def _delivered(writer: Writer) -> None:
    """Wait until reliable subscribers have got everything; not for ever."""
    end = time.monotonic() + DELIVERY_TIME
    while not writer.acknowledged and time.monotonic() < end:
        await asyncio.sleep(0.02)


def _tell_of_other_types(tool: Tool, name: str, type_name: str) -> None:
    topic = ros_topic(tool, name)
    others = [t for t in topic.types if t != type_name] if topic else []
    if others:
        tool.say(f"{name} is {', '.join(others)} for others: they will not hear {type_name}")
