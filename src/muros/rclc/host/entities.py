"""What nodes on hosts make: publishers and both sides of services. They check what they are given."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from muros.client.raw import Raw
from muros.rclc import client as client_
from muros.rclc import handles
from muros.rclc import service as service_
from muros.rclc.errors import RclError
from muros.rclc.host.checks import WrongTypeError, be_callable, called, fits, other
from muros.rclc.host.handles import take_away
from muros.rclc.host.outlet import LOG_TOPIC, body, outlet
from muros.rclc.host.sharing import call_elsewhere, hand_over
from muros.rclc.host.waiting import publish_confirmed, wait_confirmed

if TYPE_CHECKING:
    from muros.rclc._types import Publisher as AnyPublisher
    from muros.rclc.host.context import Context, Node


class Publisher:
    """Made by ``Node.publisher``. What is not here is that of the middleware's writer."""

    session_timeout = 0.0
    """Seconds for which ``publish`` waits until a message is confirmed, unless it is told; 0: it does not wait."""

    def __init__(self, node: Node, writer: AnyPublisher, kind: Any, topic: str) -> None:
        self._node = node
        self._writer = writer
        self._kind = kind
        self.topic = topic

    def publish(self, message: Any, timeout: float | None = None) -> bool:
        """Sends a message; False when it was not taken. Raises TypeError for one of another type.

        It waits for nothing, unless there is a ``timeout`` (None: ``session_timeout``): then so many seconds at most
        until there is room for a reliable message and it is confirmed: by the agent, or straight in a space by every
        reader. False if it is not. Callbacks must not wait.
        """
        if not isinstance(message, self._kind) and not fits(message, self._kind):
            raise other(message, self._kind, "publish")
        if outlet.task is not None and self.topic != LOG_TOPIC:
            return outlet.task.publish(self._writer, message)
        if timeout is None:
            timeout = self.session_timeout
        if timeout:
            return publish_confirmed(self._node.context, self._writer, message, timeout)
        return self._writer.publish(message)

    def count_subscriptions(self) -> int:
        """Those that get what is published: through an agent all of the topic, see ``Node.graph``."""
        matched: int | None = getattr(self._writer, "matched", None)
        return len(self._node.graph.subscriptions(self.topic)) if matched is None else matched

    def wait_for_subscriptions(self, count: int = 1, timeout: float | None = None) -> bool:
        """Waits until there are so many, at most ``timeout`` seconds; whether there are. Not for callbacks."""
        return self._node.graph.spin_until(lambda: self.count_subscriptions() >= count, timeout)

    def write_bytes(self, data: bytes) -> bool:
        """Sends a sample that is serialised already; False when it was not taken."""
        return self.publish(Raw(data))

    def destroy(self) -> None:
        """Takes it away."""
        if self._writer in self._node.entities:
            self._node.entities.remove(self._writer)
        self._writer.destroy()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._writer, name)


class Service(service_.Service):
    """Made by ``Node.service``; see ``muros.rclc.service.Service``."""

    name = ""
    refused = 0  # requests beyond the rules for memory
    home: Any = ()
    context: Context
    session_timeout = 0.0
    """Seconds for which ``reply`` waits until an answer is confirmed; 0: it does not wait."""

    def reply(self, identity: bytes, response: Any) -> None:
        """Answers a request. Raises TypeError for what is no response of this service."""
        if not fits(response, self._kind.Response):
            raise WrongTypeError(
                f"service {self.name!r} was answered with {response!r}. Its callback returns "
                f"{called(self._kind)}.Response(...), or None to answer later."
            )
        if outlet.task is not None:
            answer = Raw(body(response))
            outlet.task.hold(self, lambda: service_.Service.reply(self, identity, answer))
            return
        hand = hand_over(self)
        if hand is not None:
            answer = Raw(body(response))
            hand(lambda: service_.Service.reply(self, identity, answer))
            return
        super().reply(identity, response)
        if self.session_timeout:
            wait_confirmed(self.context, self.entity, self.session_timeout)

    def destroy(self) -> None:
        """Takes it away."""
        self.context.services.pop(self.name, None)
        take_away(self)


class Client(client_.Client):
    """Made by ``Node.client``; see ``muros.rclc.client.Client``."""

    name = ""
    refused = 0  # responses beyond the rules for memory
    home: Any = ()
    context: Context
    node: Node
    destroy = take_away
    session_timeout = 0.0
    """Seconds for which ``send`` waits until a request is confirmed; 0: it does not wait."""

    def service_is_ready(self) -> bool:
        """Whether somebody serves what is asked: through an agent as far as that tells, see ``Node.graph``."""
        servers: int | None = getattr(self.entity, "servers", None)
        return bool(self.node.graph.servers(self.name) if servers is None else servers)

    def wait_for_service(self, timeout: float | None = None) -> bool:
        """Waits until somebody serves what is asked, at most ``timeout`` seconds; whether somebody does.

        The context takes messages meanwhile and no callback runs. Not for callbacks.
        """
        return self.node.graph.spin_until(self.service_is_ready, timeout)

    def send(
        self, request: Any, on_reply: Callable[[Any], object], timeout: float = client_._TIMEOUT
    ) -> bool:
        """Sends a request; an executor calls ``on_reply(response)``, with None after ``timeout`` seconds.

        False when the request was not taken. Raises TypeError for a request of another type.
        """
        if not fits(request, self._kind.Request):
            raise other(request, self._kind.Request, "send")
        be_callable(on_reply, "on_reply")
        if outlet.task is not None:
            asked = Raw(body(request))
            outlet.task.hold(self, lambda: self._ask(asked, on_reply, timeout))
            return True
        hand = hand_over(self)
        if hand is not None:
            asked = Raw(body(request))
            hand(lambda: self._ask(asked, on_reply, timeout))
            return True
        taken = super().send(request, on_reply, timeout)
        if not taken or not self.session_timeout:
            return taken
        return wait_confirmed(self.context, self.entity, self.session_timeout)

    def _ask(self, request: Raw, on_reply: Callable[[Any], object], timeout: float) -> bool:
        """Sends a request that was held back, or comes from another thread; one not taken then has no answer."""
        taken = super().send(request, on_reply, timeout)
        if not taken:
            self._asked.append([0, on_reply, 0, None])
        return taken

    def call(self, request: Any, timeout: float = client_._TIMEOUT) -> Any:
        """Sends a request and waits for its response; None when it does not come within ``timeout`` seconds.

        Not for callbacks, nor for a service of the same context: those run in an executor, where ``send`` belongs.
        Raises RclError for the latter.
        """
        service = self.context.services.get(self.name)
        if service is not None and hand_over(service) is None:
            raise RclError(
                f"service {self.name!r} is served by this very context, which does not run during call(). "
                "Use send(request, on_reply) and an executor."
            )
        if hand_over(self) is None:
            return handles.call(self, request, timeout)
        if not fits(request, self._kind.Request):
            raise other(request, self._kind.Request, "call")
        answers: list[Any] = []

        def begin(done: Callable[[], object]) -> None:
            def take(reply: Any) -> None:
                answers.append(reply)
                done()

            self._ask(asked, take, timeout)

        asked = Raw(body(request))
        call_elsewhere(self, self.entity.room, begin, timeout)
        return answers[0] if answers else None
