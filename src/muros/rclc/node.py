"""The methods of nodes, which make what programs use. Boards borrow this.

What takes several entities, as actions and parameters do, is made in ``compositions``.
"""

from muros.client.names import resolve, topic_name
from muros.compat import borrow, const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.client.qos import Qos
    from muros.rclc._types import Publisher
    from muros.rclc.client import Client
    from muros.rclc.context import Context, Node
    from muros.rclc.memory import Rules
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

    def enter(taker: "Any") -> "Any":  # a session calls its ``deliver``, which saves the heap a bound method
        return self.context.middleware.reader(self.participant, self._topic(topic), kind.TYPE, qos, taker)

    lifespan = getattr(qos, "lifespan", 0)
    if lifespan:
        from muros.rclc.lifespans import ExpiringSubscription

        made: "Subscription" = ExpiringSubscription(self.context, kind, callback, lifespan)
    else:
        made = Subscription(self.context, kind, callback)
    _join(self, made, enter, memory, kind)
    return made


def timer(self: "Node", period: float, callback: "Callable[[], object]", autostart: bool = True) -> "Timer":
    """A timer; an executor calls ``callback()`` every ``period`` seconds, to the millisecond."""
    from muros.rclc.timer import Timer

    made = Timer(self.context, period, callback, autostart)
    self.entities.append(made)
    return made


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

    def enter(taker: "Any") -> "Any":
        return self.context.middleware.replier(
            self.participant, self._resolve(name), kind.TYPE, taker.deliver, qos
        )

    lifespan = getattr(qos, "lifespan", 0)
    if lifespan:
        from muros.rclc.lifespans import ExpiringService

        made: "Service" = ExpiringService(self.context, kind, callback, lifespan)
    else:
        made = Service(self.context, kind, callback)
    _join(self, made, enter, memory, kind.Request)
    return made


def client(
    self: "Node", kind: "Any", name: str, qos: "str | Qos" = "services", memory: "Rules | None" = None
) -> "Client":
    """A client of a service; ``memory`` bounds what responses take."""
    from muros.rclc.client import Client

    def enter(taker: "Any") -> "Any":
        return self.context.middleware.requester(
            self.participant, self._resolve(name), kind.TYPE, taker.deliver, qos
        )

    made = Client(self.context, kind)
    _join(self, made, enter, memory, kind.Response)
    return made


def destroy(self: "Node") -> None:
    """Takes the node and everything made on it away."""
    made = self.entities
    self.entities = []
    for entity in made[:]:
        entity.destroy()
    self.participant.destroy()


def __getattr__(name: str) -> "Any":
    return getattr(borrow("muros.rclc.compositions"), name)


def _join(
    self: "Node", made: "Any", enter: "Callable[[Any], Any]", memory: "Rules | None", kind: "Any"
) -> None:
    """Has the middleware make what stands behind a handle; where it cannot, the handle is gone, too."""
    try:
        made.entity = enter(memory.guard(made, kind) if memory else made)
    except Exception:
        made.destroy()
        raise
    self.entities.append(made)


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
