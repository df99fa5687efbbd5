"""The methods of nodes, which make what programs use. Boards borrow this."""

from muros.client.names import resolve, topic_name
from muros.compat import borrow, const

_WORTH_KNOWING = const(20)  # ROS 2's level "info"
TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client.qos import Qos
    from muros.rclc._types import Publisher
    from muros.rclc.action_client import ActionClient
    from muros.rclc.action_server import ActionServer
    from muros.rclc.client import Client
    from muros.rclc.context import Context, Node
    from muros.rclc.goals import Goal
    from muros.rclc.lifecycle import Callback, Lifecycle
    from muros.rclc.logger import Logger
    from muros.rclc.memory import Rules
    from muros.rclc.parameters import Parameters
    from muros.rclc.service import Service
    from muros.rclc.subscription import Subscription
    from muros.rclc.timer import Timer


def begin(self: "Node", context: "Context", name: str, namespace: str) -> None:
    """Sets up a node."""
    if not namespace.startswith("/"):
        namespace = "/" + namespace
    _check(name)
    if namespace != "/":
        _check(namespace[1:])
    self.context = context
    self.name = name
    self.namespace = namespace
    self.entities = []
    full = name if namespace == "/" else namespace + "/" + name
    self.participant = context.middleware.participant(full, context.domain_id)


def publisher(self: "Node", kind: "Any", topic: str, qos: "str | Qos" = "default") -> "Publisher":
    """A publisher: ``publish(message)`` returns whether the message was taken."""
    made = self.context.middleware.writer(self.participant, self._topic(topic), kind.TYPE, qos)
    self.entities.append(made)
    return made


def subscription(
    self: "Node",
    kind: "Any",
    topic: str,
    callback: "Callable[[Any], object] | None",
    qos: "str | Qos" = "default",
    memory: "Rules | None" = None,
) -> "Subscription":
    """A subscription; an executor calls ``callback(message)``.

    On boards there is one message object, which the next message overwrites: copy what is to be kept. ``memory`` bounds
    what messages take, see ``Rules``; without it there is no bound.
    """
    from muros.rclc.subscription import Subscription

    made = Subscription(self.context, kind, callback)
    # A session calls its ``deliver``, which saves the heap a bound method.
    taker: "Any" = made if memory is None else memory.guard(made, kind)
    made.entity = self.context.middleware.reader(self.participant, self._topic(topic), kind.TYPE, qos, taker)
    self.entities.append(made)
    return made


def timer(self: "Node", period: float, callback: "Callable[[], object]", autostart: bool = True) -> "Timer":
    """A timer; an executor calls ``callback()`` every ``period`` seconds, to the millisecond."""
    from muros.rclc.timer import Timer

    made = Timer(self.context, period, callback, autostart)
    self.entities.append(made)
    return made


def service(
    self: "Node", kind: "Any", name: str, callback: "Callable[[Any], Any]", qos: "str | Qos" = "services"
) -> "Service":
    """A server of a service; ``callback(request)`` returns the response, or None to answer later."""
    from muros.rclc.service import Service

    made = Service(self.context, kind, callback)
    made.entity = self.context.middleware.replier(
        self.participant, self._resolve(name), kind.TYPE, made.deliver, qos
    )
    self.entities.append(made)
    return made


def client(self: "Node", kind: "Any", name: str, qos: "str | Qos" = "services") -> "Client":
    """A client of a service."""
    from muros.rclc.client import Client

    made = Client(self.context, kind)
    made.entity = self.context.middleware.requester(
        self.participant, self._resolve(name), kind.TYPE, made.deliver, qos
    )
    self.entities.append(made)
    return made


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
) -> "Parameters":
    """The parameters of the node, which others see through six services.

    At most ``max`` (0: any number). ``notify`` publishes changes on /parameter_events, ``undeclared`` lets others add
    parameters, ``longest`` bounds names and descriptions (0: any length). With ``low_memory`` there are no
    descriptions, and one parameter a request. Needs the types of rcl_interfaces, see docs/parameters.md.
    """
    from muros.rclc.parameters import Parameters

    return Parameters(self, max, notify, undeclared, low_memory, longest)


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
) -> "ActionServer":
    """A server of an action; see docs/actions.md.

    An executor calls ``on_goal(request)`` and takes the goal if that is true; then ``on_accepted(goal)``, or if there
    is none ``on_execute(goal)``, whose result ends the goal; it may be a generator that yields seconds. Goals are
    cancelled when ``on_cancel(goal)`` is true. At most ``goals`` are active; the results of those that have ended are
    kept for ``result_timeout`` seconds, at most ``results``. ``clock`` gives the time (s, ns) for stamps.
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
    )
    return made


def action_client(self: "Node", kind: "Any", name: str, goals: int = 0) -> "ActionClient":
    """A client of an action, with at most ``goals`` on their way (0: any number); see docs/actions.md."""
    from muros.rclc.action_client import ActionClient

    made = ActionClient(self.context, name)
    borrow("muros.rclc.actions").make_client(made, self, kind, goals)
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


def destroy(self: "Node") -> None:
    """Takes the node and everything made on it away."""
    made = self.entities
    self.entities = []
    for entity in made[:]:
        entity.destroy()
    self.participant.destroy()


def _topic(self: "Node", name: str) -> str:
    return topic_name("rt", self._resolve(name))


def _resolve(self: "Node", name: str) -> str:
    full = resolve(name, self.namespace, self.name)
    _check(full[1:])
    return full


def _check(name: str) -> None:
    """Raises InvalidNameError unless ``name`` and each part of it is made as ROS asks."""
    for part in name.split("/"):
        plain = part.replace("_", "a")
        for digit in "0123456789":
            plain = plain.replace(digit, "a")
        if not plain.isalpha() or part[0] in "0123456789" or len(part) != len(part.encode()):
            from muros.rclc.errors import InvalidNameError

            raise InvalidNameError(
                "%r: names are made of letters, digits and _, and begin with no digit" % name
            )
