"""Commands that look into the graph, run in a local space that the test has filled."""

import argparse
import asyncio
import io
import shlex
from collections.abc import Awaitable, Callable
from contextlib import suppress
from importlib import import_module
from types import TracebackType
from typing import NamedTuple, Self

from muros import interfaces
from muros.cli import COMMANDS
from muros.cli._names import service_of
from muros.cli._tool import CommandError, Tool
from muros.space import Participant, Qos, Reader, Replier, Topic, Writer, open_space

SPIN_TIME = 0.02


class Done(NamedTuple):
    """How a command ended: what it printed, what it said besides, and the error it would have told."""

    out: str
    err: str
    error: str
    status: int


def parse(line: str) -> argparse.Namespace:
    """The arguments of a command line, without the word `muros`."""
    words = shlex.split(line)
    parser = argparse.ArgumentParser(prog="muros")
    import_module(COMMANDS[words[0]][0]).register(parser.add_subparsers())
    return parser.parse_args(words)


def ros(topic: str, type_name: str) -> Topic:
    """A topic by its ROS names."""
    return Topic(interfaces.dds_topic(topic), interfaces.dds_type_name(type_name))


class Running:
    """A command that runs beside the test."""

    def __init__(self, scene: "Scene", line: str) -> None:
        self.out, self.err = io.StringIO(), io.StringIO()
        arguments = parse(line)
        tool = Tool(
            scene.space,
            spin_time=SPIN_TIME,
            node_name=getattr(arguments, "own_name", None) or "_muros_test",
            out=self.out,
            err=self.err,
        )
        self.tool = tool
        self.task = asyncio.ensure_future(arguments.command(tool, arguments))

    async def end(self) -> Done:
        """Wait until it has ended."""
        error, status = "", 0
        try:
            async with asyncio.timeout(20):
                status = await self.task or 0
        except (CommandError, interfaces.InterfaceError, interfaces.CdrError) as raised:
            error, status = str(raised), getattr(raised, "status", 1)
        if self.tool._participant is not None:
            self.tool._participant.close()
        return Done(self.out.getvalue(), self.err.getvalue(), error, status)

    async def stop(self) -> Done:
        """End it as Ctrl-C does."""
        self.task.cancel()
        with suppress(asyncio.CancelledError):
            await self.task
        if self.tool._participant is not None:
            self.tool._participant.close()
        return Done(self.out.getvalue(), self.err.getvalue(), "", 130)


class Scene:
    """A local space with nodes in it, and commands that look at them."""

    def __init__(self) -> None:
        self.space = open_space("local:")
        self.nodes: dict[str, Participant] = {}

    def node(self, full_name: str) -> Participant:
        """The node of that name, made when first named."""
        if full_name not in self.nodes:
            namespace, _, name = full_name.rpartition("/")
            self.nodes[full_name] = self.space.participant(name, namespace=namespace or "/")
        return self.nodes[full_name]

    def writer(
        self, node: str, topic: str, type_name: str, qos: str = "default", **changes: object
    ) -> Writer:
        """A writer of a node."""
        return self.node(node).writer(ros(topic, type_name), Qos.preset(qos).replace(**changes))

    def reader(
        self, node: str, topic: str, type_name: str, qos: str = "default", **changes: object
    ) -> Reader:
        """A reader of a node."""
        return self.node(node).reader(ros(topic, type_name), Qos.preset(qos).replace(depth=1000, **changes))

    def server(self, node: str, name: str, type_name: str, answer: Callable[[object], object]) -> Replier:
        """A service whose answers a function makes."""
        made = interfaces.service(type_name)

        def on_request(identity: bytes, data: bytes) -> None:
            replier.reply(identity, answer(made.Request.deserialize(data)).serialize())  # type: ignore[attr-defined]

        replier = self.node(node).replier(
            service_of(name, type_name), Qos.preset("services_default"), on_request
        )
        return replier

    def start(self, line: str) -> Running:
        """Begin a command."""
        return Running(self, line)

    async def muros(self, line: str) -> Done:
        """Run a command to its end."""
        return await self.start(line).end()

    async def until(self, condition: Callable[[], object]) -> None:
        """Let the loop run until something holds; the limit is that of the test."""
        async with asyncio.timeout(20):
            while not condition():
                await asyncio.sleep(0.002)

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.space.close()


def play(scenario: Callable[[Scene], Awaitable[None]]) -> None:
    """Run a scenario in a scene of its own."""

    async def main() -> None:
        with Scene() as scene:
            scene.space.attach(asyncio.get_running_loop())
            await scenario(scene)

    asyncio.run(main())
