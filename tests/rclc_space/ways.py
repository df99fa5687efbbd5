"""Ways into one graph, so that the same program runs through an agent and straight on a space."""

import time
from collections.abc import Callable
from typing import Any, Protocol

from muros.client import Udp
from muros.links import UdpLink
from muros.rclc import Context, Executor, Node
from tests.client.agent_thread import RunningAgent

PATIENCE = 10.0
"""Seconds until something that must come has come."""


class Way(Protocol):
    """Makes contexts that meet."""

    direct: bool
    """Whether there is no agent between."""

    def open(self, domain_id: int | None = None) -> Context:
        """A new context, in the way's own domain or another."""

    def close(self) -> None:
        """Ends what the contexts went through."""


class ThroughAgent:
    """Boards and an agent."""

    direct = False

    def __init__(self) -> None:
        self.link = UdpLink(0, "127.0.0.1")
        self._agent = RunningAgent(self.link)

    def transport(self) -> Udp:
        """A board's way to the agent."""
        return Udp("127.0.0.1", self.link.port)

    def open(self, domain_id: int | None = None) -> Context:
        """A new context, in domain 0 or another."""
        return Context(self.transport(), domain_id=domain_id)

    def close(self) -> None:
        """Stops the agent."""
        self._agent.stop()


class Direct:
    """A space by its URL."""

    direct = True

    def __init__(self, url: str) -> None:
        self.url = url

    def open(self, domain_id: int | None = None) -> Context:
        """A new context, in the URL's domain or another."""
        if domain_id is None:
            return Context(self.url)
        return Context(self.url.partition(":")[0] + ":", domain_id=domain_id)

    def close(self) -> None:
        """The last context closes the space."""


class Stage:
    """Nodes, each in a context of its own, that one thread spins."""

    def __init__(self, way: Way) -> None:
        self.way = way
        self.contexts: list[Context] = []
        self.executors: list[Executor] = []

    def node(self, name: str, namespace: str = "") -> Node:
        """A node in a context of its own, which `until` spins."""
        return self.run(self.way.open()).node(name, namespace)

    def run(self, context: Context) -> Context:
        """Has `until` spin a context, too."""
        self.contexts.append(context)
        self.executors.append(Executor(context))
        return context

    def until(self, condition: Callable[[], Any], every: Callable[[], object] | None = None) -> None:
        """Spins everybody until a condition holds, doing something in between."""
        end = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < end, f"it did not come about within {PATIENCE} s"
            for executor in self.executors:
                executor.spin_some(0.001)
            if every is not None:
                every()

    def publish(self, publisher: Any, message: Any) -> None:
        """Publishes a message, spinning everybody until it is taken."""
        self.until(lambda: publisher.publish(message))

    def meet(self, *entities: Any) -> None:
        """Spins until everybody is connected, and each publisher or client has met somebody."""
        self.until(lambda: all(_ready(context) for context in self.contexts))
        if self.way.direct:
            self.until(lambda: all(_met(entity) for entity in entities))

    def close(self) -> None:
        """Closes every context."""
        for context in self.contexts:
            context.close()
        self.way.close()


def _ready(context: Context) -> bool:
    """Whether everything that was made on a context is there."""
    return context.state == "CONNECTED" and not getattr(context.middleware, "pending", 0)


def _met(entity: Any) -> bool:
    """Whether a publisher has a reader, or a client a server."""
    return bool(entity.entity.entity.servers) if hasattr(entity, "call") else bool(entity.entity.matched)
