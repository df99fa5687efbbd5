"""Managed nodes: a node that is configured and activated from outside, and can be taken down again the same way.

    lifecycle = node.lifecycle(on_configure=open_sensor, on_activate=start, on_deactivate=stop, on_cleanup=close)
    publisher = lifecycle.publisher(Int32, "depth")          # publishes only while the node is active

The states, transitions and their numbers are those of ROS 2's managed nodes. Transitions are rare: boards borrow what
makes them, see ``lifecycles``. Who moves other nodes has ``lifecycle_client``.
"""

from muros.compat import borrow, const, lending

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc import lifecycles
    from muros.rclc._types import Publisher
    from muros.rclc.context import Node
    from muros.rclc.service import Service

    Callback = Callable[[], object]

_UNCONFIGURED = const(1)
_ACTIVE = const(3)


class Lifecycle:
    """Made by ``Node.lifecycle``. ``configure()``, ``activate()``, ``deactivate()``, ``cleanup()`` and ``shutdown()``
    are what others ask for by service; ``change(transition)`` takes a label or a number.

    Each returns whether the callback succeeded, and raises TransitionError where the state has no such transition.
    A callback that returns False has failed, and the node stays where it was; one that raises leads to ``on_error``.
    ``id`` is the number of the state, ``error`` what a callback raised last. ``services`` are the handles of the five
    services, for executors that do not run everything. ``lost`` counts events that could not be sent.
    """

    if TYPE_CHECKING:
        change = lifecycles.change
        configure = lifecycles.configure
        activate = lifecycles.activate
        deactivate = lifecycles.deactivate
        cleanup = lifecycles.cleanup
        shutdown = lifecycles.shutdown
        publisher = lifecycles.publisher
    else:
        lends = "muros.rclc.lifecycles"
        __getattr__ = lending

    def __init__(
        self,
        node: "Node",
        callbacks: "tuple[Callback | None, ...]",
        time: "Callable[[], tuple[int, int]] | None",
    ) -> None:
        self.node = node
        self.id = _UNCONFIGURED
        self.error: "Exception | None" = None
        self.lost = 0
        self.services: "list[Service]" = []
        self.publishers: "list[ManagedPublisher]" = []
        self.callbacks = callbacks
        self.time = time
        self.events: "Any" = None  # the publisher of transition events

    @property
    def state(self) -> str:
        """The label of the state: unconfigured, inactive, active, finalized, or that of a transition that goes on."""
        label: str = borrow("muros.rclc.lifecycle_states").label(self.id)
        return label

    @property
    def active(self) -> bool:
        """Whether the node is active."""
        return self.id == _ACTIVE

    def asked(self, which: int) -> "Callable[[Any], Any]":
        """The callback of one of the services."""
        return lambda request: borrow("muros.rclc.lifecycle_states").answer(self, which, request)

    def destroy(self) -> None:
        """The node takes its services and publishers away itself."""


class ManagedPublisher:
    """Made by ``Lifecycle.publisher``. While the node is not active nothing is published; ``held`` counts what was not.

    The first message that is held back in a state is told as a problem. ``inner`` is the publisher behind it.
    """

    def __init__(self, lifecycle: Lifecycle, publisher: "Publisher", topic: str) -> None:
        self.lifecycle = lifecycle
        self.topic = topic
        self.held = 0
        self.told = False
        self.inner = publisher

    def publish(self, message: "Any") -> bool:
        """Sends a message; False when it was not taken, or the node is not active."""
        if self.lifecycle.id == _ACTIVE:
            return self.inner.publish(message)
        self.held += 1
        if not self.told:
            self.told = True
            borrow("muros.rclc.lifecycles").tell_held(self)
        return False

    def destroy(self) -> None:
        """Takes it away."""
        if self in self.lifecycle.publishers:
            self.lifecycle.publishers.remove(self)
        self.inner.destroy()
