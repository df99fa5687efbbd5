"""The methods of nodes that make what takes several entities: managed nodes, parameters, actions, logs.

They belong to those of ``node``; boards borrow them when a program asks for one.
"""

from muros.compat import borrow, const

_WORTH_KNOWING = const(20)  # ROS 2's level "info"
TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc.action_client import ActionClient
    from muros.rclc.action_server import ActionServer
    from muros.rclc.context import Node
    from muros.rclc.goals import Goal
    from muros.rclc.lifecycle import Callback, Lifecycle
    from muros.rclc.logger import Logger
    from muros.rclc.memory import Rules
    from muros.rclc.parameters import Parameters


def lifecycle(
    self: "Node",
    on_configure: "Callback | None" = None,
    on_activate: "Callback | None" = None,
    on_deactivate: "Callback | None" = None,
    on_cleanup: "Callback | None" = None,
    on_shutdown: "Callback | None" = None,
    on_error: "Callback | None" = None,
    services: bool = True,
    time: "Callable[[], tuple[int, int]] | None" = None,
) -> "Lifecycle":
    """Makes this a managed node: others move it from unconfigured to inactive and active, and back.

    The callbacks take nothing. One that returns False has failed: the node stays where it was. One that raises leads
    to ``on_error``, after which the node is unconfigured; without it, or where it fails, finalized. What was raised
    is in ``error`` and told to ``on_problem``. Without ``services`` only this program moves the node. ``time()`` is
    what events are stamped with, (seconds, nanoseconds) such as ``TimeSync.time``: on hosts the system's, else 0.
    Needs the types of lifecycle_msgs, see docs/lifecycle.md. Raises RclError for a node that is a managed one already.
    """
    callbacks = (on_configure, on_activate, on_deactivate, on_cleanup, on_shutdown, on_error)
    made: "Lifecycle" = borrow("muros.rclc.lifecycles").begin(self, callbacks, services, time)
    return made


def parameters(
    self: "Node",
    max: int = 4,
    notify: bool = True,
    undeclared: bool = False,
    low_memory: bool = False,
    longest: int = 49,
    memory: "Rules | None" = None,
) -> "Parameters":
    """The parameters of the node, which others see through six services.

    At most ``max`` (0: any number). ``notify`` publishes changes on /parameter_events, ``undeclared`` lets others add
    parameters, ``longest`` bounds names and descriptions (0: any length). With ``low_memory`` there are no
    descriptions, and one parameter a request. ``memory`` bounds what requests take: ``names``, ``parameters``,
    ``prefixes`` and what lies below. Needs the types of rcl_interfaces, see docs/parameters.md.
    """
    from muros.rclc.parameters import Parameters

    return Parameters(self, max, notify, undeclared, low_memory, longest, memory=memory)


def action_server(
    self: "Node",
    kind: "Any",
    name: str,
    on_execute: "Callable[[Goal], Any] | None" = None,
    on_goal: "Callable[[Any], object] | None" = None,
    on_cancel: "Callable[[Goal], object] | None" = None,
    on_accepted: "Callable[[Goal], object] | None" = None,
    goals: int = 4,
    results: int = 8,
    result_timeout: float = 10.0,
    clock: "Callable[[], tuple[int, int]] | None" = None,
    memory: "Rules | None" = None,
) -> "ActionServer":
    """A server of an action; see docs/actions.md.

    An executor calls ``on_goal(request)`` and takes the goal if that is true; then ``on_accepted(goal)``, or if there
    is none ``on_execute(goal)``, whose result ends the goal; it may be a generator that yields seconds. Goals are
    cancelled when ``on_cancel(goal)`` is true. At most ``goals`` are active; the results of those that have ended are
    kept for ``result_timeout`` seconds, at most ``results``. ``clock`` gives the time (s, ns) for stamps. ``memory``
    bounds what goals take, whose paths begin with ``goal``.
    """
    from muros.rclc.action_server import ActionServer

    made = ActionServer(self.context, name)
    borrow("muros.rclc.actions").make_server(
        made,
        self,
        kind,
        (on_execute, on_goal, on_cancel, on_accepted),
        (goals, results, result_timeout),
        clock,
        None,
        memory,
    )
    return made


def action_client(
    self: "Node", kind: "Any", name: str, goals: int = 0, memory: "Rules | None" = None
) -> "ActionClient":
    """A client of an action, with at most ``goals`` on their way (0: any number); see docs/actions.md.

    ``memory`` bounds what servers say: the paths of its rules begin with ``result`` or ``feedback``, or are
    ``status_list`` and ``goals_canceling``.
    """
    from muros.rclc.action_client import ActionClient

    made = ActionClient(self.context, name)
    borrow("muros.rclc.actions").make_client(made, self, kind, goals, None, memory)
    return made


def logger(
    self: "Node",
    level: "Any" = _WORTH_KNOWING,
    time: "Callable[[], tuple[int, int]] | None" = None,
    show: "Callable[[str], object] | None" = print,
) -> "Logger":
    """A logger to /rosout: ``info(text)`` and the like publish what is of ``level`` at least, and ``show`` it.

    ``level`` is a number of ROS 2, 20 for info; hosts take names too. ``time()`` is what is told as the time,
    (seconds, nanoseconds) such as ``TimeSync.time``: on hosts the system's, else 0. Needs rcl_interfaces/msg/Log.
    """
    from muros.rclc.logger import Logger, begin

    return begin(Logger, self, None, level, time, show)
