"""The command `muros action`: actions of the graph. Words, options and output are those of `ros2 action`."""

from __future__ import annotations

import argparse
import asyncio
import time
import uuid
from collections.abc import Callable
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final, NamedTuple

from muros import interfaces
from muros.cli._listing import add_count, find_named, print_found, print_lines
from muros.cli._names import (
    add_type_options,
    full_name,
    is_hidden,
    learn_types,
    node_name,
    ros_topic,
    ros_topics,
    service_of,
)
from muros.cli._tool import CommandError, Tool, positive
from muros.cli.topic import command

if TYPE_CHECKING:
    from muros.space import Endpoint, Requester, Sample

__all__ = ["find_actions", "info", "list_actions", "print_type", "register", "send_goal"]

STATUS: Final = "/_action/status"
FEEDBACK: Final = "/_action/feedback"
MESSAGE: Final = "_FeedbackMessage"
"""What the name of the type of an action's feedback ends with."""

STATES: Final = ("UNKNOWN", "ACCEPTED", "EXECUTING", "CANCELING", "SUCCEEDED", "CANCELED", "ABORTED")
CANCEL_TIME: Final = 5.0
"""Seconds that a server has to agree to cancel and then to end."""

REFUSALS: Final = {
    1: "the server refuses to cancel it",
    2: "the server does not know it",
    3: "it has ended already",
}


class RosAction(NamedTuple):
    """An action: its types, who serves it and who uses it."""

    name: str
    types: tuple[str, ...]
    servers: tuple[tuple[str, str], ...]
    """Full names of nodes with the types they have."""
    clients: tuple[tuple[str, str], ...]


def register(subparsers: Any) -> None:
    """Adds `action` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("action", help="list actions and send goals to them")
    words = parser.add_subparsers(required=True, metavar="list | info | type | find | send_goal")
    listing = command(words, "list", list_actions, "list the actions that somebody serves or uses")
    listing.add_argument("-t", "--show-types", action="store_true", help="with the type of each")
    add_count(listing, "--count-actions")
    about = command(words, "info", info, "show who serves and uses an action")
    about.add_argument("action_name", metavar="ACTION")
    about.add_argument("-t", "--show-types", action="store_true", help="with the type that each node has")
    add_count(about, "--count")
    kind = command(words, "type", print_type, "print the type of an action")
    kind.add_argument("action_name", metavar="ACTION")
    find = command(words, "find", find_actions, "list the actions of a type")
    find.add_argument("action_type", metavar="TYPE")
    add_count(find, "--count-actions")
    send = command(words, "send_goal", send_goal, "send a goal and see it through; Ctrl-C cancels it")
    send.add_argument("action_name", metavar="ACTION")
    send.add_argument("action_type", metavar="TYPE")
    send.add_argument("values", metavar="VALUES", nargs="?", help="the goal in YAML, as '{order: 10}'")
    send.add_argument("--stdin", action="store_true", help="read the values from standard input")
    send.add_argument("-f", "--feedback", action="store_true", help="print the feedback as it comes")
    send.add_argument(
        "--timeout",
        type=positive,
        metavar="S",
        help="give up after S seconds without a server, an answer or a result, and cancel the goal",
    )
    add_type_options(send)


async def list_actions(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros action list`."""
    await tool.discover()
    found = [action for action in _actions(tool) if not is_hidden(action.name)]
    print_found(tool, found, count=arguments.count, types=arguments.show_types)


async def info(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros action info`."""
    action = await _known(tool, arguments.action_name)
    tool.print(f"Action: {action.name}")
    for word, nodes in (("clients", action.clients), ("servers", action.servers)):
        tool.print(f"Action {word}: {len(nodes)}")
        for node, kind in () if arguments.count else nodes:
            tool.print(f"    {node}" + (f" [{kind}]" if arguments.show_types else ""))


async def print_type(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros action type`."""
    for kind in (await _known(tool, arguments.action_name)).types:
        tool.print(kind)


async def find_actions(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros action find`."""
    wanted = "/".join(interfaces.split_type(arguments.action_type, "action"))
    await tool.discover()
    names = [action.name for action in _actions(tool) if wanted in action.types]
    print_lines(tool, names, count=arguments.count)


async def send_goal(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros action send_goal`."""
    from muros.cli._pub import values_text
    from muros.cli._values import fill, read_yaml

    learn_types(arguments)
    name = full_name(arguments.action_name, "action")
    kind = _class(arguments.action_type)
    goal = kind.Goal()
    for stamp in fill(goal, read_yaml(values_text(arguments))):
        stamp(time.time_ns())
    goal.serialize()
    asker = _Asker(tool, name, kind, arguments.timeout)
    sending = _Sending(asker, arguments.feedback)
    tool.print("Waiting for an action server to become available...")
    await asker.meet()
    try:
        await sending.see_through(goal)
    except BaseException:
        with suppress(CommandError):
            await asyncio.shield(asyncio.ensure_future(sending.cancel()))
        raise


class _Asker:
    """The services of one action, called one after the other."""

    def __init__(self, tool: Tool, name: str, kind: Any, timeout: float | None) -> None:
        from muros.space import PRESETS

        self.tool = tool
        self.name = name
        self.kind = kind
        self.timeout = timeout
        self.cancelling = interfaces.service("action_msgs/srv/CancelGoal")
        self._answers: asyncio.Queue[tuple[str, int, bytes]] = asyncio.Queue()
        self._kept: dict[tuple[str, int], bytes] = {}
        qos = PRESETS["services_default"]

        def requester(word: str, type_name: str) -> Requester:
            service = service_of(f"{name}/_action/{word}", type_name)
            return tool.participant.requester(
                service, qos, lambda number, data: self._answers.put_nowait((word, number, data))
            )

        self._requesters = {
            word: requester(word, made.TYPE)
            for word, made in (
                ("send_goal", kind.SendGoal),
                ("cancel_goal", self.cancelling),
                ("get_result", kind.GetResult),
            )
        }

    async def meet(self) -> None:
        """Wait for a server of all three services."""

        def there(_: object = None) -> bool:
            return all(requester.servers > 0 for requester in self._requesters.values())

        await self.tool.discover(until=there)
        if not there() and not await self.tool.wait_for(there, self.timeout):
            raise CommandError(f"nobody serves {self.name} in domain {self.tool.domain}")

    async def ask(self, word: str, request: Any, response: Any, timeout: float | None = None) -> Any:
        """Ask one of the services and wait for the answer."""
        limit = timeout or self.timeout
        end = None if limit is None else time.monotonic() + limit
        number = self._requesters[word].send(request.serialize(), source_time=time.time_ns())
        while (word, number) not in self._kept:
            try:
                left = None if end is None else max(0.0, end - time.monotonic())
                service, found, data = await asyncio.wait_for(self._answers.get(), left)
            except TimeoutError:
                raise CommandError(f"no answer from {self.name}/_action/{word} within {limit:g} s") from None
            self._kept[service, found] = data
        return response.deserialize(self._kept.pop((word, number)))


class _Sending:
    """One goal from its sending to its end."""

    def __init__(self, asker: _Asker, feedback: bool) -> None:
        from muros.cli._names import required_class
        from muros.space import Qos, Topic

        self._asker = asker
        self._print = asker.tool.print
        self._id = uuid.uuid4().bytes
        self._accepted = False
        self._over = False
        self._early: list[str] | None = []
        """Feedback that came before the answer to the goal; None once that is printed."""
        if feedback:
            message = required_class(asker.kind.FeedbackMessage.TYPE)
            self._message = message
            self._topic = asker.tool.subscribe(
                Topic(
                    interfaces.dds_topic(asker.name + FEEDBACK),
                    interfaces.dds_type_name(asker.kind.FeedbackMessage.TYPE),
                ),
                Qos(depth=100),
                self._hear,
            )

    async def see_through(self, goal: Any) -> None:
        """Send the goal and print what becomes of it."""
        kind = self._asker.kind
        self._print(f"Sending goal:\n     {_yaml(goal)}")
        request = kind.SendGoal.Request(goal=goal)
        request.goal_id.uuid = self._id
        self._accepted = True  # from now on there may be something to cancel
        try:
            answer = await self._asker.ask("send_goal", request, kind.SendGoal.Response)
        except CommandError:
            self._accepted = False
            raise
        self._accepted = answer.accepted
        if not answer.accepted:
            self._print("Goal was rejected.")
            return
        self._print(f"Goal accepted with ID: {self._id.hex()}\n")
        early, self._early = self._early or [], None
        for text in early:
            self._print(text)
        await self.result()

    async def result(self, timeout: float | None = None) -> None:
        """Wait for the result and print it."""
        kind = self._asker.kind
        wanted = kind.GetResult.Request()
        wanted.goal_id.uuid = self._id
        answer = await self._asker.ask("get_result", wanted, kind.GetResult.Response, timeout)
        self._over = True
        self._print(f"Result:\n    {_yaml(answer.result)}")
        state = STATES[answer.status] if 0 <= answer.status < len(STATES) else answer.status
        self._print(f"Goal finished with status: {state}")

    async def cancel(self) -> None:
        """Cancel the goal if it has not ended. CommandError if that is refused."""
        if not self._accepted or self._over:
            return
        asker = self._asker
        self._print("Canceling goal...")
        request = asker.cancelling.Request()
        request.goal_info.goal_id.uuid = self._id
        answer = await asker.ask("cancel_goal", request, asker.cancelling.Response, CANCEL_TIME)
        if self._id not in [bytes(goal.goal_id.uuid) for goal in answer.goals_canceling]:
            why = REFUSALS.get(answer.return_code, f"code {answer.return_code}")
            asker.tool.say(f"the goal was not canceled: {why}")
            return
        self._print("Goal canceled.")

    def _hear(self, sample: Sample) -> None:
        message = self._message.deserialize(sample.data)
        if bytes(message.goal_id.uuid) == self._id and not self._over:
            text = f"Feedback:\n    {_yaml(message.feedback)}"
            if self._early is None:
                self._print(text)
            else:
                self._early.append(text)


def _yaml(message: Any) -> str:
    from muros.cli._values import Look, to_yaml

    return to_yaml(message, Look(truncate=None))


def _class(type_name: str) -> Any:
    full = interfaces.split_type(type_name, "action")
    if full.kind != "action":
        raise CommandError(f"{type_name} is no action: those are called package/action/Type", 2)
    return interfaces.action("/".join(full))


def _actions(tool: Tool) -> list[RosAction]:
    """The actions of others, by name: those whose states or feedback somebody writes or reads."""
    names = {
        topic.name.removesuffix(suffix)
        for topic in ros_topics(tool)
        for suffix in (STATUS, FEEDBACK)
        if topic.name.endswith(suffix)
    }
    return [_action(tool, name) for name in sorted(names)]


def _action(tool: Tool, name: str) -> RosAction:
    feedback = ros_topic(tool, name + FEEDBACK)
    types = [kind.removesuffix(MESSAGE) for kind in feedback.types] if feedback else []

    def nodes(endpoints: Callable[[Any], tuple[Endpoint, ...]]) -> tuple[tuple[str, str], ...]:
        found = {
            (node_name(endpoint.participant), types[0] if len(types) == 1 else _type(endpoint))
            for endpoint in (endpoints(feedback) if feedback else ())
        }
        return tuple(sorted(found))

    return RosAction(name, tuple(types), nodes(lambda t: t.writers), nodes(lambda t: t.readers))


def _type(endpoint: Endpoint) -> str:
    from muros.cli._names import ros_type

    return ros_type(endpoint.type_name).removesuffix(MESSAGE)


async def _known(tool: Tool, asked: str) -> RosAction:
    name = full_name(asked, "action")
    await tool.discover()
    return find_named(tool, "action", name, _actions(tool))
