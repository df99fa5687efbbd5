"""Several worlds at once: a board that is a node of the ROS 2 graph and of a ROS 1 graph at the same time.

What a board publishes goes to all of them, what it reads comes from any; its services are called from any, and its own
calls go to the first that has a server. An endpoint that one world refuses is in the others all the same.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any, TypeVar

from muros.rosserial.server._door import (
    BodyError,
    Caller,
    NamedService,
    Node,
    OnData,
    OnReply,
    Publisher,
    RefusedError,
    Server,
    Shape,
    Subscriber,
    World,
)

__all__ = ["Worlds"]

T = TypeVar("T", bound=Shape)
OnRefused = Callable[[str, str, RefusedError], object]
"""Gets whose endpoint it is, which one, and why it is refused in one world while others have it."""


class Worlds:
    """Worlds as one. The first one's time is that of all."""

    def __init__(self, worlds: Sequence[World], on_refused: OnRefused) -> None:
        self.worlds = tuple(worlds)
        self.on_refused = on_refused

    def node(self, name: str, owner: str) -> _Nodes:
        """A node in each world that takes it."""
        nodes: list[Node] = []
        refusals = []
        for world in self.worlds:
            try:
                nodes.append(world.node(name, owner))
            except RefusedError as error:
                refusals.append(error)
        if not nodes:
            raise refusals[0]
        for refusal in refusals:
            self.on_refused(owner, f"node {name}", refusal)
        return _Nodes(nodes, owner, self.on_refused)

    def time(self) -> int:
        """The time of the first world, in ns."""
        return self.worlds[0].time()


class _Nodes:
    """A board in several worlds."""

    def __init__(self, nodes: Sequence[Node], owner: str, on_refused: OnRefused) -> None:
        self._nodes = nodes
        self._owner = owner
        self._on_refused = on_refused

    def publisher(self, name: str, type_name: str, md5: str) -> _Publishers:
        """A publisher in each."""
        made = self._each(f"publisher {name}", lambda node, i: node.publisher(name, type_name, md5))
        return _Publishers(list(made.values()))

    def subscriber(self, name: str, type_name: str, md5: str, on_data: OnData) -> _Subscribers:
        """A subscriber in each."""
        made = self._each(
            f"subscriber {name}", lambda node, i: node.subscriber(name, type_name, md5, on_data)
        )
        return _Subscribers(list(made.values()))

    def caller(self, service: NamedService, on_reply: OnReply) -> _Callers:
        """A service client in each."""
        n = len(self._nodes)

        def make(node: Node, i: int) -> Caller:
            return node.caller(service, lambda number, body: on_reply(number * n + i, body))

        return _Callers(self._each(f"service client {service.name}", make), n)

    def server(self, service: NamedService, on_data: OnData) -> _Servers:
        """A service in each."""
        made = self._each(f"service server {service.name}", lambda node, i: node.server(service, on_data))
        return _Servers(list(made.values()))

    def time(self) -> int:
        """The time of the first, in ns."""
        return self._nodes[0].time()

    def log(self, level: int, text: str) -> None:
        """Everybody hears it."""
        for node in self._nodes:
            node.log(level, text)

    def parameter(self, name: str) -> Any:
        """The value of the first world that has it."""
        for node in self._nodes:
            value = node.parameter(name)
            if value is not None:
                return value
        return None

    def diagnose(self, text: str, level: int, values: dict[str, str]) -> None:
        """Everybody is told."""
        for node in self._nodes:
            node.diagnose(text, level, values)

    def close(self) -> None:
        """It leaves all."""
        for node in self._nodes:
            node.close()

    def _each(self, what: str, make: Callable[[Node, int], T]) -> dict[int, T]:
        made: dict[int, T] = {}
        refusals = []
        for i, node in enumerate(self._nodes):
            try:
                made[i] = make(node, i)
            except RefusedError as error:
                refusals.append(error)
        if not made:
            raise refusals[0]
        for refusal in refusals:
            self._on_refused(self._owner, what, refusal)
        return made


class _Shapes:
    """What is known of messages, where several know."""

    def __init__(self, parts: Sequence[Shape]) -> None:
        self.size = parts[0].size
        self.least_size = max(part.least_size for part in parts)
        self.drift = next((part.drift for part in parts if part.drift), "")


class _Publishers(_Shapes):
    def __init__(self, parts: Sequence[Publisher]) -> None:
        super().__init__(parts)
        self._parts = parts

    def publish(self, body: bytes) -> None:
        failure: BodyError | None = None
        for part in self._parts:
            try:
                part.publish(body)
            except BodyError as error:
                failure = error
        if failure is not None:
            raise failure

    def close(self) -> None:
        for part in self._parts:
            part.close()


class _Subscribers(_Shapes):
    def __init__(self, parts: Sequence[Subscriber]) -> None:
        super().__init__(parts)
        self._parts = parts
        self._turn = 0

    def take(self) -> bytes | None:
        for _ in self._parts:
            self._turn = (self._turn + 1) % len(self._parts)
            body = self._parts[self._turn].take()
            if body is not None:
                return body
        return None

    @property
    def latched(self) -> bool:
        return any(part.latched for part in self._parts)

    def forget(self) -> None:
        for part in self._parts:
            part.forget()

    def close(self) -> None:
        for part in self._parts:
            part.close()


class _Callers(_Shapes):
    def __init__(self, parts: dict[int, Caller], n: int) -> None:
        super().__init__(list(parts.values()))
        self._parts = parts
        self._n = n

    @property
    def ready(self) -> bool:
        return any(part.ready for part in self._parts.values())

    def call(self, body: bytes) -> int:
        i, part = next(
            ((i, part) for i, part in self._parts.items() if part.ready), next(iter(self._parts.items()))
        )
        number = part.call(body)
        return number * self._n + i if number else 0

    def close(self) -> None:
        for part in self._parts.values():
            part.close()


class _Servers(_Shapes):
    def __init__(self, parts: Sequence[Server]) -> None:
        super().__init__(parts)
        self._parts = parts
        self._turn = 0

    def take(self) -> tuple[Any, bytes] | None:
        for _ in self._parts:
            self._turn = (self._turn + 1) % len(self._parts)
            taken = self._parts[self._turn].take()
            if taken is not None:
                return (self._turn, taken[0]), taken[1]
        return None

    def answer(self, request: Any, body: bytes) -> None:
        self._parts[request[0]].answer(request[1], body)

    def fail(self, request: Any, text: str) -> None:
        self._parts[request[0]].fail(request[1], text)

    def close(self) -> None:
        for part in self._parts:
            part.close()
