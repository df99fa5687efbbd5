"""rclc on hosts: what boards have, and checks of what is asked for. Wrong use is said at once, in one line.

Errors are TypeErrors and ValueErrors whose ``code`` is the return code of the C library. Boards have no room for this.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from typing import TYPE_CHECKING, Any, TypeVar

from muros.client import reasons
from muros.client.hosts import Session
from muros.client.names import topic_name
from muros.client.qos import profile
from muros.rclc import client as client_
from muros.rclc import context as context_
from muros.rclc import contexts, handles, host_logger, remapping
from muros.rclc import executor as executor_
from muros.rclc import guard as guard_
from muros.rclc import node as node_
from muros.rclc import service as service_
from muros.rclc import subscription as subscription_
from muros.rclc.errors import InvalidNameError, RclError
from muros.rclc.host_checks import (
    SERVICE_NAME_INVALID,
    TOPIC_NAME_INVALID,
    WrongTypeError,
    WrongValueError,
    be_callable,
    be_message,
    be_service,
    be_text,
    called,
    fits,
    invalid,
    other,
)
from muros.rclc.middleware import _engines, open_url
from muros.rclc.remapping import RosArguments

if TYPE_CHECKING:
    from typing import Unpack

    from muros.client._types import SessionOptions
    from muros.client.qos import Qos
    from muros.rclc._types import Publisher as AnyPublisher
    from muros.rclc.action_hosts import ActionClient, ActionServer
    from muros.rclc.goals import Goal
    from muros.rclc.host_clock import Clock
    from muros.rclc.host_parameters import Parameters
    from muros.rclc.lifecycle import Lifecycle
    from muros.rclc.logger import Logger
    from muros.rclc.timer import Timer
    from muros.xrce._types import Buffer

MALFORMED = 12
"""The code with which a subscription tells ``on_problem`` of its first malformed sample."""

Made = TypeVar("Made", "Client", "Service", "Subscription")

_LARGEST_DOMAIN = 232
_DEPTH = 1000
"""Messages that wait in a subscription that keeps all."""
_LONGEST_NAME = 59  # characters of a topic in DDS: agents take no more


class Context(context_.Context):
    """A way into the ROS graph: a transport to an agent, a session of your own making, a URL, or a data space.

    ``Context(Udp("192.168.1.10"))`` goes through an agent, ``Context("dds:")`` straight into the ROS 2 graph,
    ``Context("local:")`` into a space of this process, ``Context(space)`` or ``Context(space=...)`` into one of your
    own; further schemes may be registered with ``muros.rclc.register``. ``domain_id`` None is 0 through an agent, else
    the domain of the URL or the space.

    ``client_key`` (a random one if it is None) and ``options`` are those of the ``Session`` that is made here:
    ``Context(Udp("192.168.1.10"), queue=8, creation_timeout=500)``; one that you made, ``Context(Session(...))``, has
    its own. ``args`` is a command line whose part behind ``--ros-args`` counts, None that of the program; what
    remains of it is in ``arguments.others``.

    Raises TypeError and ValueError, RclError for a space that cannot be had.
    """

    arguments: RosArguments

    def __init__(
        self,
        way: Any = None,
        client_key: int | bytes | None = None,
        domain_id: int | None = None,
        *,
        space: Any = None,
        args: Sequence[str] | None = None,
        **options: Unpack[SessionOptions],
    ) -> None:
        self.arguments = RosArguments.parse(sys.argv[1:] if args is None else args)
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
            way = Session(way, client_key, **options)
        elif client_key is not None or options:
            name = next(iter(options), "client_key")
            raise WrongTypeError(f"{name} belongs to the session: Context(Session(transport, {name}=...))")
        if isinstance(way, str) and way.split(":")[0] in _engines:
            way = open_url(way, domain_id or 0)
        elif isinstance(way, str) or hasattr(way, "graph"):
            way = import_module("muros.space.rclc").open_way(way, domain_id)
            domain_id = way.domain
        super().__init__(way, None, domain_id or 0)
        self.services: dict[str, Service] = {}

    def node(
        self,
        name: str,
        namespace: str = "",
        *,
        remap: Mapping[str, str] | Iterable[str] = (),
        parameters: Mapping[str, Any] | None = None,
        use_arguments: bool = True,
    ) -> Node:
        """A node. ``remap`` has rules of its own, ``{"chatter": "/talk", "__ns": "/lab"}`` or ``["chatter:=/talk"]``.

        ``parameters`` are values for what the node declares, in place of the defaults. Both go before what the command
        line says, which ``use_arguments`` False leaves out. Raises InvalidNameError, ArgumentsError for no rule.
        """
        return Node(self, name, namespace, remap, parameters, use_arguments)

    on_state = contexts.on_state
    on_problem = contexts.on_problem
    ping = contexts.ping
    close = contexts.close


class Node(context_.Node):
    """A node of a context; see ``muros.rclc.context.Node``. Raises TypeError and ValueError for what cannot be made.

    ``rules`` are those by which its names are remapped, ``overrides`` the values for parameters that it may declare.
    """

    context: Context

    def __init__(
        self,
        context: Context,
        name: str,
        namespace: str,
        remap: Mapping[str, str] | Iterable[str] = (),
        parameters: Mapping[str, Any] | None = None,
        use_arguments: bool = True,
    ) -> None:
        be_text(name, "the name of a node")
        be_text(namespace, "a namespace")
        arguments = context.arguments if use_arguments else RosArguments()
        self.rules = (*remapping.rules_of(remap), *arguments.rules)
        name, namespace = remapping.remap_node(name, namespace, self.rules)
        try:
            node_.begin(self, context, name, namespace)
        except InvalidNameError:
            raise
        except ValueError as error:
            raise InvalidNameError(f"node {error}") from None
        self.overrides = {**arguments.parameters(self.full_name), **(parameters or {})}

    @property
    def full_name(self) -> str:
        """Namespace and name: "/greenhouse/thermometer"."""
        return f"{self.namespace.rstrip('/')}/{self.name}"

    def publisher(self, kind: Any, topic: str, qos: str | Qos = "default") -> Publisher:
        """A publisher: ``publish(message)`` returns whether the message was taken."""
        be_message(kind)
        return Publisher(node_.publisher(self, kind, topic, qos), kind)

    def subscription(
        self, kind: Any, topic: str, callback: Callable[[Any], object] | None, qos: str | Qos = "default"
    ) -> Subscription:
        """A subscription; an executor calls ``callback(message)``."""
        be_message(kind)
        if callback is not None:  # an executor may give one
            be_callable(callback, "the callback of a subscription")
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
        be_callable(callback, "the callback of a timer")
        return node_.timer(self, period, callback, autostart)

    def service(
        self, kind: Any, name: str, callback: Callable[[Any], Any], qos: str | Qos = "services"
    ) -> Service:
        """A server of a service; ``callback(request)`` returns the response, or None to answer later."""
        be_service(kind)
        be_callable(callback, "the callback of a service")
        full = self._resolve(name)
        made = Service(self.context, kind, callback)
        made.name = full
        replier = self.context.middleware.replier
        self._join(made, lambda: replier(self.participant, made.name, kind.TYPE, made.deliver, qos))
        self.context.services[made.name] = made
        return made

    def client(self, kind: Any, name: str, qos: str | Qos = "services") -> Client:
        """A client of a service."""
        be_service(kind)
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
                be_callable(callback, "a callback of a lifecycle")
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
        from muros.rclc.host_parameters import Parameters

        made = self.__dict__["_parameters"] = Parameters(self, max, notify, undeclared, low_memory, longest)
        if "_clock" in self.__dict__:
            self.clock.follow(made)
        return made

    @property
    def clock(self) -> Clock:
        """The clock of the node, made when it is first used: the system's, or /clock's with ``use_sim_time``."""
        made: Clock | None = self.__dict__.get("_clock")
        if made is None:
            from muros.rclc.host_clock import Clock

            made = self.__dict__["_clock"] = Clock(self)
            made.follow(self.__dict__.get("_parameters"))
        return made

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
        level: int | str | None = None,
        time: Callable[[], tuple[int, int]] | None = None,
        show: Callable[[str], object] | None = host_logger.show_on_stderr,
        services: bool = False,
    ) -> Logger:
        """A logger to /rosout, see ``muros.rclc.node.logger``: ``level`` by name, and shown on standard error.

        ``level`` None is what ``--log-level`` says, else "info". With ``services`` others may ask for the level and set
        it: ``~/get_logger_levels``, ``~/set_logger_levels``. Raises ValueError for a level that there is not.
        """
        for function in (time, show):
            if function is not None:
                be_callable(function, "time or show of a logger")
        return host_logger.make(self, level, time, show, services)

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
            return topic_name("rt", self.resolve_topic(name), "", longest)
        except ValueError as error:
            raise invalid(error, TOPIC_NAME_INVALID) from None

    def _resolve(self, name: str) -> str:
        try:
            return self.resolve_service(name)
        except ValueError as error:
            raise invalid(error, SERVICE_NAME_INVALID) from None

    def resolve_topic(self, name: str) -> str:
        """The full name of a topic, remapped. Raises InvalidNameError."""
        return self._full(name, "topic")

    def resolve_service(self, name: str) -> str:
        """The full name of a service, remapped. Raises InvalidNameError."""
        return self._full(name, "service")

    def _full(self, name: str, kind: str) -> str:
        be_text(name, "the name of a topic or service")
        full = node_._resolve(self, name)
        return remapping.remap(full, kind, self.name, self.namespace, self.rules) if self.rules else full


class Publisher:
    """Made by ``Node.publisher``. Everything but ``publish`` is that of the middleware's writer."""

    def __init__(self, writer: AnyPublisher, kind: Any) -> None:
        self._writer = writer
        self._kind = kind

    def publish(self, message: Any) -> bool:
        """Sends a message; False when it was not taken. Raises TypeError for one of another type."""
        if not isinstance(message, self._kind) and not fits(message, self._kind):
            raise other(message, self._kind, "publish")
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
        if not fits(response, self._kind.Response):
            raise WrongTypeError(
                f"service {self.name!r} was answered with {response!r}. Its callback returns "
                f"{called(self._kind)}.Response(...), or None to answer later."
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
        if not fits(request, self._kind.Request):
            raise other(request, self._kind.Request, "send")
        be_callable(on_reply, "on_reply")
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
            be_callable(trigger, "trigger")
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
            be_callable(callback, "the callback of a handle")
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
