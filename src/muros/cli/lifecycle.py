"""The command `muros lifecycle`: managed nodes, their states, and moving them.

Words, options and output are those of `ros2 lifecycle`. A node that serves only some of the five services, as those of
the C library do, is asked for what it can answer: nothing here waits for ever.
"""

from __future__ import annotations

import argparse
import asyncio
from typing import Any, Final

from muros.cli._listing import add_count, print_lines
from muros.cli._names import full_name, is_hidden, ros_service, ros_services, service_of, type_of_service
from muros.cli._tool import CommandError, Tool, positive
from muros.cli.topic import command, unknown

__all__ = ["change_state", "get_state", "list_nodes", "list_transitions", "register"]

GET_STATE: Final = "lifecycle_msgs/srv/GetState"
GET_TRANSITIONS: Final = "lifecycle_msgs/srv/GetAvailableTransitions"
CHANGE_STATE: Final = "lifecycle_msgs/srv/ChangeState"

SUFFIX: Final = "/get_state"
"""A node is managed if it serves this."""

TIMEOUT: Final = 5.0
"""Seconds that a node may take to answer what it is and can do."""


def register(subparsers: Any) -> None:
    """Adds `lifecycle` with its own sub-commands to an argparse sub-command table."""
    parser = subparsers.add_parser("lifecycle", help="show and move managed nodes")
    words = parser.add_subparsers(required=True, metavar="nodes | list | get | set")
    nodes = command(words, "nodes", list_nodes, "list the managed nodes")
    nodes.add_argument("-a", "--all", action="store_true", help="those that begin with '_' too")
    add_count(nodes, "--count-nodes")
    listing = command(words, "list", list_transitions, "list the transitions that a node's state has")
    listing.add_argument("node_name", metavar="NODE")
    listing.add_argument("-a", "--all", action="store_true", help="all transitions that the node knows")
    about = command(words, "get", get_state, "print the state of a node, or of all managed nodes")
    about.add_argument("node_name", nargs="?", metavar="NODE")
    move = command(words, "set", change_state, "have a node go through a transition")
    move.add_argument("node_name", metavar="NODE")
    move.add_argument("transition", metavar="TRANSITION", help="its label or number, as `list` shows them")
    about.add_argument(
        "-a", "--include-hidden-nodes", "--all", action="store_true", help="those that begin with '_' too"
    )
    for asking in (listing, move):
        asking.add_argument("--include-hidden-nodes", action="store_true", help=argparse.SUPPRESS)
    for asking in (listing, about, move):
        asking.add_argument(
            "--timeout",
            type=positive,
            metavar="S",
            help=f"give up after S seconds without an answer (default: {TIMEOUT:g}, for the transition of set none)",
        )


async def list_nodes(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros lifecycle nodes`."""
    await tool.discover()
    print_lines(tool, _managed(tool, arguments.all), count=arguments.count)


async def get_state(tool: Tool, arguments: argparse.Namespace) -> int:
    """`muros lifecycle get`."""
    timeout = arguments.timeout or TIMEOUT
    if arguments.node_name is not None:
        state = await _state(tool, await _known(tool, arguments.node_name), timeout)
        tool.print(f"{state.label} [{state.id}]")
        return 0
    await tool.discover()
    status = 0
    for name in _managed(tool, arguments.include_hidden_nodes):
        try:
            state = await _state(tool, name, timeout)
        except CommandError as error:  # the others are asked still
            tool.say(error)
            status = error.status
        else:
            tool.print(f"{name}: {state.label} [{state.id}]")
    return status


async def list_transitions(tool: Tool, arguments: argparse.Namespace) -> None:
    """`muros lifecycle list`."""
    name = await _known(tool, arguments.node_name)
    which = "get_transition_graph" if arguments.all else "get_available_transitions"
    for found in await _transitions(tool, name, which, arguments.timeout or TIMEOUT):
        tool.print(f"- {found.transition.label} [{found.transition.id}]")
        tool.print(f"\tStart: {found.start_state.label}")
        tool.print(f"\tGoal: {found.goal_state.label}")


async def change_state(tool: Tool, arguments: argparse.Namespace) -> int:
    """`muros lifecycle set`."""
    name = await _known(tool, arguments.node_name)
    transitions = [
        found.transition
        for found in await _transitions(tool, name, "get_available_transitions", arguments.timeout or TIMEOUT)
    ]
    wanted = [t for t in transitions if t.label == arguments.transition]
    wanted += [t for t in transitions if str(t.id) == arguments.transition]
    if not wanted:
        lines = "".join(f"\n- {t.label} [{t.id}]" for t in transitions)
        raise CommandError(f"Unknown transition requested, available ones are:{lines or ' none'}")
    request = type_of_service(CHANGE_STATE).Request()
    request.transition.id, request.transition.label = wanted[0].id, wanted[0].label
    response = await _ask(tool, f"{name}/change_state", CHANGE_STATE, request, arguments.timeout)
    if not response.success:
        raise CommandError("Transitioning failed")
    tool.print("Transitioning successful")
    return 0


def _managed(tool: Tool, hidden: bool) -> list[str]:
    """The full names of the managed nodes."""
    return [
        service.name.removesuffix(SUFFIX)
        for service in ros_services(tool)
        if service.servers
        and service.name.endswith(SUFFIX)
        and GET_STATE in service.types
        and (hidden or not is_hidden(service.name))
    ]


async def _known(tool: Tool, asked: str) -> str:
    """The full name of a managed node. CommandError if it is not there, or not managed."""
    name = full_name(asked, "node")
    service = name + SUFFIX

    def served(_: object) -> bool:
        found = ros_service(tool, service)
        return found is not None and bool(found.servers)

    await tool.discover(until=served)
    if served(None):
        return name
    if any(node.full_name == name and node.domain == tool.domain for node in tool.graph.nodes):
        raise CommandError(f"{name} is no managed node: nobody serves {service}")
    raise CommandError(unknown("node", name, _managed(tool, True), tool.domain))


async def _state(tool: Tool, name: str, timeout: float) -> Any:
    """The state of a node: its number and label."""
    response = await _ask(tool, name + SUFFIX, GET_STATE, type_of_service(GET_STATE).Request(), timeout)
    return response.current_state


async def _transitions(tool: Tool, name: str, which: str, timeout: float) -> list[Any]:
    """What one of the two services that list transitions says."""
    request = type_of_service(GET_TRANSITIONS).Request()
    response = await _ask(tool, f"{name}/{which}", GET_TRANSITIONS, request, timeout)
    found: list[Any] = response.available_transitions
    return found


async def _ask(tool: Tool, service: str, type_name: str, request: Any, timeout: float | None) -> Any:
    """The answer of a service. CommandError if there is none in time."""
    from muros.space import PRESETS

    kind = type_of_service(type_name)
    answer: asyncio.Future[bytes] = asyncio.get_running_loop().create_future()

    def on_reply(number: int, data: bytes) -> None:
        if not answer.done():
            answer.set_result(data)

    requester = tool.participant.requester(
        service_of(service, type_name), PRESETS["services_default"], on_reply
    )
    try:
        if not await tool.wait_for(lambda _: requester.servers > 0, timeout):
            raise CommandError(f"nobody serves {service}")
        requester.send(request.serialize())
        data = await asyncio.wait_for(answer, timeout)
    except TimeoutError:
        raise CommandError(f"no answer from {service} within {timeout:g} s") from None
    finally:
        requester.close()
    return kind.Response.deserialize(data)
