"""The methods of nodes, which make what programs use. Boards borrow this.

What takes several entities, as actions and parameters do, is made in ``compositions``.
"""

from muros.client.names import resolve, topic_name
from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any, TypeVar

    from muros.client.qos import Qos
    from muros.rclc._types import Publisher
    from muros.rclc.client import Client
    from muros.rclc.context import Context, Node
    from muros.rclc.executor import Handle
    from muros.rclc.memory import Rules
    from muros.rclc.service import Service
    from muros.rclc.subscription import Subscription
    from muros.rclc.timer import Timer

    Made = TypeVar("Made", bound=Handle)

_ROOT = ("", "/")


def begin_in(self: "Node", context: "Context", name: str, namespace: str) -> None:
    """Sets up a node."""
    _check(name)
    full = name
    self.namespace = "/"
    if namespace not in _ROOT:
        self.namespace = namespace if namespace[0] == "/" else "/" + namespace
        _check(self.namespace[1:])
        full = self.namespace + "/" + name
    self.context = context
    self.name = name
    self.entities = []
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

    handle = Subscription if isinstance(qos, str) else _expiring(Subscription, qos)
    made = handle(self.context, kind, callback)
    taker = memory.guard(made, kind) if memory else made
    made.entity = self.context.middleware.reader(
        self.participant,
        self._topic(topic),
        kind.TYPE,
        qos,
        taker,  # type: ignore[arg-type]  # a session calls its ``deliver``, which saves the heap a bound method
    )
    return _join(self, made)


def timer(self: "Node", period: float, callback: "Callable[[], object]", autostart: bool = True) -> "Timer":
    """A timer; an executor calls ``callback()`` every ``period`` seconds, to the millisecond."""
    from muros.rclc.timer import Timer

    return _join(self, Timer(self.context, period, callback, autostart))


def service(
    self: "Node",
    kind: "Any",
    name: str,
    callback: "Callable[[Any], Any]",
    qos: "str | Qos" = "services",
    memory: "Rules | None" = None,
) -> "Service":
    """A server of a service; ``callback(request)`` returns the response, or None to answer later.

    ``memory`` bounds what requests take.
    """
    from muros.rclc.service import Service

    handle = Service if isinstance(qos, str) else _expiring(Service, qos)
    made = handle(self.context, kind, callback)
    taker = memory.guard(made, kind.Request) if memory else made
    made.entity = self.context.middleware.replier(
        self.participant, self._resolve(name), kind.TYPE, taker.deliver, qos
    )
    return _join(self, made)


def client(
    self: "Node", kind: "Any", name: str, qos: "str | Qos" = "services", memory: "Rules | None" = None
) -> "Client":
    """A client of a service; ``memory`` bounds what responses take."""
    from muros.rclc.client import Client

    made = Client(self.context, kind)
    taker = memory.guard(made, kind.Response) if memory else made
    made.entity = self.context.middleware.requester(
        self.participant, self._resolve(name), kind.TYPE, taker.deliver, qos
    )
    return _join(self, made)


def destroy(self: "Node") -> None:
    """Takes the node and everything made on it away."""
    while self.entities:
        self.entities.pop(0).destroy()
    self.participant.destroy()


def __getattr__(name: str) -> "Any":
    return getattr(borrow("muros.rclc.compositions"), name)


def _expiring(handle: "Any", qos: "Qos") -> "Any":
    """What makes handles of a class, or of the one in its place that drops what is too old for the QoS."""
    if not qos.lifespan:
        return handle
    from muros.rclc.lifespans import expiring

    return expiring(handle, qos.lifespan)


def _join(self: "Node", made: "Made") -> "Made":
    """From now on executors run a handle."""
    self.context.handles.append(made)
    self.entities.append(made)
    return made


def _topic(self: "Node", name: str) -> str:
    return topic_name("rt", self._resolve(name))


def _resolve(self: "Node", name: str) -> str:
    full = resolve(name, self.namespace, self.name)
    _check(full[1:])
    return full


def _check(name: str) -> None:
    """Raises InvalidNameError unless ``name`` and each part of it is made as ROS asks."""
    before = "/"
    for c in name + "/":
        if c > "z" or not (c.isalpha() or c == "_" or (before != "/" and (c == "/" or c.isdigit()))):
            from muros.rclc.errors import InvalidNameError

            raise InvalidNameError(
                "%r: names are made of letters, digits and _, and begin with no digit" % name
            )
        before = c
