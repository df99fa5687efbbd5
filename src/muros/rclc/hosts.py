"""rclc on hosts: what boards have, and checks of what is asked for. Wrong use is said at once, in one line.

Errors are TypeErrors and ValueErrors whose ``code`` is the return code of the C library. Boards have no room for this.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from muros.client import reasons
from muros.client.hosts import Session
from muros.client.names import topic_name
from muros.client.qos import profile
from muros.rclc import client as client_
from muros.rclc import context as context_
from muros.rclc import contexts, handles, host_logger
from muros.rclc import executor as executor_
from muros.rclc import guard as guard_
from muros.rclc import node as node_
from muros.rclc import service as service_
from muros.rclc import subscription as subscription_
from muros.rclc.errors import InvalidNameError, RclError
from muros.rclc.middleware import _engines, open_url

if TYPE_CHECKING:
    from muros.client.qos import Qos
    from muros.rclc._types import Publisher as AnyPublisher
    from muros.rclc.action_hosts import ActionClient, ActionServer
    from muros.rclc.goals import Goal
    from muros.rclc.lifecycle import Lifecycle
    from muros.rclc.logger import Logger
    from muros.rclc.parameters import Parameters
    from muros.rclc.timer import Timer
    from muros.xrce._types import Buffer

MALFORMED = 12
"""The code with which a subscription tells ``on_problem`` of its first malformed sample."""

Made = TypeVar("Made", "Client", "Service", "Subscription")

_INVALID_ARGUMENT = 11
_TOPIC_NAME_INVALID = 103
_SERVICE_NAME_INVALID = 104
_LARGEST_DOMAIN = 232
_DEPTH = 1000
"""Messages that wait in a subscription that keeps all."""
_LONGEST_NAME = 59  # characters of a topic in DDS: agents take no more


class WrongTypeError(TypeError):
    """Something of another kind was expected."""

    code = _INVALID_ARGUMENT


class WrongValueError(ValueError):
    """A value that makes no sense."""

    code = _INVALID_ARGUMENT


class Context(context_.Context):
    """A way into the ROS graph: a transport to an agent, a session of your own making, a URL, or a data space.

    ``Context(Udp("192.168.1.10"))``, ``Context(Session(Udp("192.168.1.10"), queue=8))`` go through an agent;
    ``client_key`` is for a session that is made here, a random one if it is None. ``Context("dds:")`` is straight in
    the ROS 2 graph, ``Context("local:")`` in a space of this process, ``Context(space)`` or ``Context(space=...)`` in
    a space of your own making; further schemes may be registered with ``muros.rclc.register``. ``domain_id`` None is
    0 through an agent, else the domain of the URL or the space.

    Raises TypeError and ValueError, RclError for a space that cannot be had.
    """

    def __init__(
        self,
        way: Any = None,
        client_key: int | bytes | None = None,
        domain_id: int | None = None,
        *,
        space: Any = None,
    ) -> None:
        if domain_id is not None and not (isinstance(domain_id, int) and 0 <= domain_id <= _LARGEST_DOMAIN):
            raise WrongValueError(f"domain_id is {domain_id!r}: it must be from 0 to {_LARGEST_DOMAIN}")
        if space is not None:
            if way is not None:
                raise WrongTypeError("Context takes a transport or a space, not both")
            way = space
        if isinstance(way, type) or not (
            isinstance(way, str) or hasattr(way, "participant") or hasattr(way, "receive")
        ):
            raise WrongTypeError(f"Context needs a transport such as Udp('192.168.1.10', 8888), not {way!r}")
        if hasattr(way, "receive") and not hasattr(way, "participant"):
            way = Session(way, client_key)
        elif client_key is not None:
            raise WrongTypeError("client_key belongs to the session: Context(Session(transport, client_key))")
        if isinstance(way, str) and way.split(":")[0] in _engines:
            way = open_url(way, domain_id or 0)
        elif isinstance(way, str) or hasattr(way, "graph"):
            way = import_module("muros.space.rclc").open_way(way, domain_id)
            domain_id = way.domain
        super().__init__(way, None, domain_id or 0)
        self.services: dict[str, Service] = {}

    def node(self, name: str, namespace: str = "") -> Node:
        """A node. Raises InvalidNameError."""
        return Node(self, name, namespace)

    on_state = contexts.on_state
    on_problem = contexts.on_problem
    ping = contexts.ping
    close = contexts.close


class Node(context_.Node):
    """A node of a context; see ``muros.rclc.context.Node``. Raises TypeError and ValueError for what cannot be made."""

    context: Context

    def __init__(self, context: Context, name: str, namespace: str) -> None:
        _be_text(name, "the name of a node")
        _be_text(namespace, "a namespace")
        try:
            node_.begin(self, context, name, namespace)
        except InvalidNameError:
            raise
        except ValueError as error:
            raise InvalidNameError(f"node {error}") from None

    def publisher(self, kind: Any, topic: str, qos: str | Qos = "default") -> Publisher:
        """A publisher: ``publish(message)`` returns whether the message was taken."""
        _be_message(kind)
        return Publisher(node_.publisher(self, kind, topic, qos), kind)

    def subscription(
        self, kind: Any, topic: str, callback: Callable[[Any], object] | None, qos: str | Qos = "default"
    ) -> Subscription:
        """A subscription; an executor calls ``callback(message)``."""
        _be_message(kind)
        if callback is not None:  # an executor may give one
            _be_callable(callback, "the callback of a subscription")
        name = self._topic(topic)
        made = Subscription(self.context, kind, callback, qos)
        made.topic = topic
        reader = self.context.middleware.reader
        return self._join(made, lambda: reader(self.participant, name, kind.TYPE, qos, made.deliver))

    def timer(self, period: float, callback: Callable[[], object], autostart: bool = True) -> Timer:
        """A timer; an executor calls ``callback()`` every ``period`` seconds, to the millisecond."""
        if not isinstance(period, int | float) or not math.isfinite(period) or period < 0:
            raise WrongValueError(
                f"the period of a timer is {period!r}: it must be a number of seconds, at least 0"
            )
        _be_callable(callback, "the callback of a timer")
        return node_.timer(self, period, callback, autostart)

    def service(
        self, kind: Any, name: str, callback: Callable[[Any], Any], qos: str | Qos = "services"
    ) -> Service:
        """A server of a service; ``callback(request)`` returns the response, or None to answer later."""
        _be_service(kind)
        _be_callable(callback, "the callback of a service")
        full = self._resolve(name)
        made = Service(self.context, kind, callback)
        made.name = full
        replier = self.context.middleware.replier
        self._join(made, lambda: replier(self.participant, made.name, kind.TYPE, made.deliver, qos))
        self.context.services[made.name] = made
        return made

    def client(self, kind: Any, name: str, qos: str | Qos = "services") -> Client:
        """A client of a service."""
        _be_service(kind)
        full = self._resolve(name)
        made = Client(self.context, kind)
        made.name = full
        requester = self.context.middleware.requester
        return self._join(made, lambda: requester(self.participant, made.name, kind.TYPE, made.deliver, qos))

    def lifecycle(
        self,
        on_configure: Callable[[], object] | None = None,
        on_activate: Callable[[], object] | None = None,
        on_deactivate: Callable[[], object] | None = None,
        on_cleanup: Callable[[], object] | None = None,
        on_shutdown: Callable[[], object] | None = None,
        on_error: Callable[[], object] | None = None,
        services: bool = True,
        time: Callable[[], tuple[int, int]] | None = None,
    ) -> Lifecycle:
        """Makes this a managed node; see ``muros.rclc.node.lifecycle``. Its events bear the system's time."""
        given = (on_configure, on_activate, on_deactivate, on_cleanup, on_shutdown, on_error, time)
        for callback in given:
            if callback is not None:
                _be_callable(callback, "a callback of a lifecycle")
        return node_.lifecycle(self, *given[:-1], services, time or host_logger.system_time)

    def parameters(
        self,
        max: int = 0,
        notify: bool = True,
        undeclared: bool = False,
        low_memory: bool = False,
        longest: int = 0,
    ) -> Parameters:
        """The parameters of the node; see ``muros.rclc.node.parameters``. Any number, of any length, unless told else.

        Raises RclError for a node that has some already.
        """
        if self._resolve("~/get_parameters") in self.context.services:
            raise RclError(f"node {self.name!r} has parameters already: keep what parameters() gave")
        from muros.rclc.parameter_files import kind
        from muros.rclc.parameters import Parameters

        return Parameters(self, max, notify, undeclared, low_memory, longest, kind, time.time_ns)

    def action_server(
        self,
        kind: Any,
        name: str,
        on_execute: Callable[[Goal], Any] | None = None,
        on_goal: Callable[[Any], object] | None = None,
        on_cancel: Callable[[Goal], object] | None = None,
        on_accepted: Callable[[Goal], object] | None = None,
        goals: int = 100,
        results: int = 100,
        result_timeout: float = 10.0,
        clock: Callable[[], tuple[int, int]] | None = None,
    ) -> ActionServer:
        """A server of an action; see ``muros.rclc.node.action_server``. Stamps are of the computer's clock."""
        from muros.rclc.action_hosts import make_server

        functions = (on_execute, on_goal, on_cancel, on_accepted)
        return make_server(self, kind, name, functions, (goals, results, result_timeout), clock)

    def action_client(self, kind: Any, name: str, goals: int = 0) -> ActionClient:
        """A client of an action, with at most ``goals`` on their way (0: any number)."""
        from muros.rclc.action_hosts import make_client

        return make_client(self, kind, name, goals)

    def logger(
        self,
        level: int | str = "info",
        time: Callable[[], tuple[int, int]] | None = None,
        show: Callable[[str], object] | None = host_logger.show_on_stderr,
    ) -> Logger:
        """A logger to /rosout, see ``muros.rclc.node.logger``: ``level`` by name, and shown on standard error.

        Raises ValueError for a level that there is not.
        """
        for function in (time, show):
            if function is not None:
                _be_callable(function, "time or show of a logger")
        return host_logger.make(self, level, time, show)

    @property
    def log(self) -> Logger:
        """The logger of the node, made when it is first used: ``node.log.info(text)``."""
        made = self.__dict__.get("_log")
        if made is None:
            made = self.__dict__["_log"] = self.logger()
        return made

    def _join(self, handle: Made, make: Callable[[], Any]) -> Made:
        """Gives a handle its entity; one that cannot be made leaves nothing behind."""
        try:
            handle.entity = make()
        except Exception:
            self.context.handles.remove(handle)
            raise
        self.entities.append(handle)
        return handle

    def _topic(self, name: str) -> str:
        longest = getattr(self.context.middleware, "longest_name", _LONGEST_NAME)
        try:
            return topic_name("rt", self._resolve(name), "", longest)
        except ValueError as error:
            raise _invalid(error, _TOPIC_NAME_INVALID) from None

    def _resolve(self, name: str) -> str:
        _be_text(name, "the name of a topic or service")
        try:
            return node_._resolve(self, name)
        except ValueError as error:
            raise _invalid(error, _SERVICE_NAME_INVALID) from None


class Publisher:
    """Made by ``Node.publisher``. Everything but ``publish`` is that of the middleware's writer."""

    def __init__(self, writer: AnyPublisher, kind: Any) -> None:
        self._writer = writer
        self._kind = kind

    def publish(self, message: Any) -> bool:
        """Sends a message; False when it was not taken. Raises TypeError for one of another type."""
        if not isinstance(message, self._kind) and not _fits(message, self._kind):
            raise _other(message, self._kind, "publish")
        return self._writer.publish(message)

    def destroy(self) -> None:
        """Takes it away."""
        self._writer.destroy()

    def __getattr__(self, name: str) -> Any:
        return getattr(self._writer, name)


class Subscription(subscription_.Subscription):
    """Made by ``Node.subscription``; its first malformed sample is a problem that is told."""

    topic = ""

    def __init__(
        self, context: context_.Context, kind: Any, callback: Callable[[Any], object] | None, qos: str | Qos
    ) -> None:
        super().__init__(context, kind, callback)
        self.depth = profile(qos).depth or _DEPTH
        self._kind = kind
        self._waiting: list[Any] = []

    def take(self) -> Any:
        """The oldest message that waits, or None."""
        return self._waiting.pop(0) if self._waiting else None

    def ready(self, now: int) -> bool:
        """Whether a message waits."""
        return len(self._waiting) > 0

    def deliver(self, buf: Buffer, off: int, n: int) -> None:
        """Takes a sample of the middleware."""
        if len(self._waiting) >= self.depth:
            if self.eager:
                self.run(0)
            else:
                self._waiting.pop(0)
                self.lost += 1
        message = self._kind()
        try:
            message.read(buf, off, n)
        except ValueError:
            self.malformed += 1
            self._tell(n)
        else:
            self._waiting.append(message)

    def _tell(self, n: int) -> None:
        """Tells of the first malformed sample."""
        if self.malformed == 1:
            said = (
                f"a sample of {n} B on {self.topic!r} is no {self._kind.TYPE} and was dropped. "
                "Does somebody publish another type there?"
            )
            tell = self.context.middleware.on_problem
            if tell is None:
                reasons.say(said)
            else:
                tell(MALFORMED, said)


class Service(service_.Service):
    """Made by ``Node.service``; see ``muros.rclc.service.Service``."""

    name = ""
    context: Context

    def reply(self, identity: bytes, response: Any) -> None:
        """Answers a request. Raises TypeError for what is no response of this service."""
        if not _fits(response, self._kind.Response):
            raise WrongTypeError(
                f"service {self.name!r} was answered with {response!r}. Its callback returns "
                f"{_called(self._kind)}.Response(...), or None to answer later."
            )
        super().reply(identity, response)

    def destroy(self) -> None:
        """Takes it away."""
        self.context.services.pop(self.name, None)
        handles.destroy(self)


class Client(client_.Client):
    """Made by ``Node.client``; see ``muros.rclc.client.Client``."""

    name = ""
    context: Context

    def send(
        self, request: Any, on_reply: Callable[[Any], object], timeout: float = client_._TIMEOUT
    ) -> bool:
        """Sends a request; an executor calls ``on_reply(response)``, with None after ``timeout`` seconds.

        False when the request was not taken. Raises TypeError for a request of another type.
        """
        if not _fits(request, self._kind.Request):
            raise _other(request, self._kind.Request, "send")
        _be_callable(on_reply, "on_reply")
        return super().send(request, on_reply, timeout)

    def call(self, request: Any, timeout: float = client_._TIMEOUT) -> Any:
        """Sends a request and waits for its response; None when it does not come within ``timeout`` seconds.

        Not for callbacks, nor for a service of the same context: those run in an executor, where ``send`` belongs.
        Raises RclError for the latter.
        """
        if self.name in self.context.services:
            raise RclError(
                f"service {self.name!r} is served by this very context, which does not run during call(). "
                "Use send(request, on_reply) and an executor."
            )
        return handles.call(self, request, timeout)


class GuardCondition(guard_.GuardCondition):
    """See ``muros.rclc.guard.GuardCondition``."""

    context: Context

    def trigger(self) -> None:
        """Makes it ready, from any thread.

        An executor that waits straight in a data space wakes at once; one that waits for an agent within the time
        until it would look again by itself, at most ``keepalive``.
        """
        super().trigger()
        wake = getattr(self.context.middleware, "wake", None)
        if wake is not None:
            wake()


class Executor(executor_.Executor):
    """Runs the handles of a context; see ``muros.rclc.executor.Executor``.

    Ctrl-C ends ``spin`` and ``spin_period``: they take leave of the graph and return.
    """

    def __init__(
        self,
        context: context_.Context,
        handles: int = 0,
        trigger: Callable[[list[Any]], bool] | None = None,
    ) -> None:
        if not isinstance(context, context_.Context):
            raise WrongTypeError(f"Executor needs a context, not {context!r}")
        if not isinstance(handles, int) or handles < 0:
            raise WrongValueError(
                f"handles is {handles!r}: it must be how many may be added, or 0 for any number"
            )
        if trigger is not None:
            _be_callable(trigger, "trigger")
        super().__init__(context, handles, trigger)

    def add(self, handle: Any, callback: Callable[..., object] | None = None) -> None:
        """Runs a handle from now on, behind those added before; with ``callback`` in place of its own.

        Raises CapacityError when the executor is full.
        """
        if isinstance(handle, type) or not (hasattr(handle, "ready") and hasattr(handle, "run")):
            raise WrongTypeError(
                f"an executor cannot run {handle!r}: add subscriptions, timers, services, clients, guard conditions"
            )
        if callback is not None:
            _be_callable(callback, "the callback of a handle")
        handles.add(self, handle, callback)

    def spin(self) -> None:
        """Runs until the context is closed or Ctrl-C is pressed."""
        try:
            super().spin()
        except KeyboardInterrupt:
            self.context.close()

    def spin_period(self, period: float) -> None:
        """Makes one pass each ``period`` seconds, until the context is closed or Ctrl-C is pressed."""
        if not isinstance(period, int | float) or not 0 < period < math.inf:
            raise WrongValueError(f"period is {period!r}: it must be a number of seconds above 0")
        try:
            handles.spin_period(self, period)
        except KeyboardInterrupt:
            self.context.close()


def _be_text(name: Any, what: str) -> None:
    if not isinstance(name, str):
        raise WrongTypeError(f"{what} is a str, not {name!r}")


def _be_callable(callback: Any, what: str) -> None:
    if not callable(callback):
        raise WrongTypeError(f"{what} is a function, not {callback!r}")


def _be_message(kind: Any) -> None:
    if isinstance(kind, type) and hasattr(kind, "TYPE"):
        if hasattr(kind, "write"):
            return
        raise WrongTypeError(f"{kind.TYPE} is no message: topics carry messages such as std_msgs/msg/Int32")
    raise _no_class(kind, "a message class such as std_msgs.msg.Int32")


def _be_service(kind: Any) -> None:
    if isinstance(kind, type) and hasattr(kind, "TYPE"):
        if hasattr(kind, "Request") and hasattr(kind, "Response"):
            return
        raise WrongTypeError(f"{kind.TYPE} is no service such as example_interfaces/srv/AddTwoInts")
    raise _no_class(kind, "a service class such as example_interfaces.srv.AddTwoInts")


def _no_class(kind: Any, wanted: str) -> WrongTypeError:
    if hasattr(kind, "TYPE"):
        return WrongTypeError(f"give {wanted}: the class {_called(type(kind))} itself, not an object of it")
    return WrongTypeError(f"give {wanted}, not {kind!r}")


def _fits(message: Any, kind: Any) -> bool:
    """Whether a message is of a type, by whatever class, or a sample without type that is serialised already."""
    if isinstance(message, type):
        return False
    if hasattr(message, "TYPE"):
        return bool(message.TYPE == kind.TYPE)
    return callable(getattr(message, "size", None))


def _other(message: Any, kind: Any, verb: str) -> WrongTypeError:
    got = message.TYPE if hasattr(message, "TYPE") else repr(message)
    return WrongTypeError(f"{verb} takes {kind.TYPE} here, not {got}")


def _called(kind: Any) -> str:
    name: str = kind.__name__
    return name


def _invalid(error: ValueError, code: int) -> InvalidNameError:
    """The same error as one about names, with a code of its own."""
    made = InvalidNameError(str(error))
    made.code = code
    return made
