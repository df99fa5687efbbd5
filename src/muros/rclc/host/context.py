"""rclc on hosts: what boards have, and checks of what is asked for. Wrong use is said at once, in one line.

Errors are TypeErrors and ValueErrors whose ``code`` is the return code of the C library. Boards have no room for this.
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from importlib import import_module
from time import time_ns
from typing import TYPE_CHECKING, Any, TypeVar

from muros.client.hosts import Session
from muros.client.names import topic_name
from muros.client.qos import profile
from muros.rclc import compositions, contexts
from muros.rclc import context as context_
from muros.rclc import node as node_
from muros.rclc.errors import InvalidNameError, RclError
from muros.rclc.host import logger as host_logger
from muros.rclc.host import remapping
from muros.rclc.host.checks import (
    INVALID_ARGUMENT,
    NODE_INVALID_NAMESPACE,
    SERVICE_NAME_INVALID,
    TOPIC_NAME_INVALID,
    WrongTypeError,
    WrongValueError,
    be_callable,
    be_message,
    be_period,
    be_qos,
    be_service,
    be_text,
    invalid,
    is_token,
)
from muros.rclc.host.entities import Client, Publisher, Service
from muros.rclc.host.handles import Subscription, Timer, ticks
from muros.rclc.host.middleware import _engines, open_url
from muros.rclc.host.remapping import RosArguments
from muros.rclc.host.waiting import spin_until

if TYPE_CHECKING:
    from typing import Unpack

    from muros.client._types import SessionOptions
    from muros.client.qos import Qos
    from muros.rclc.goals import Goal
    from muros.rclc.host.actions import ActionClient, ActionServer
    from muros.rclc.host.clock import Clock
    from muros.rclc.host.events import Event, Events
    from muros.rclc.host.graph import Graph
    from muros.rclc.host.parameters import Parameters
    from muros.rclc.host.sharing import Sharing
    from muros.rclc.lifecycle import Lifecycle
    from muros.rclc.logger import Logger
    from muros.rclc.memory import Rules

Made = TypeVar("Made", "Client", "Service", "Subscription")

_LARGEST_DOMAIN = 232
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

    sharing: Sharing | None = None
    """What stands before the middleware when several threads run the context, see ``groups``."""

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
        self.arguments = RosArguments.parse(getattr(sys, "argv", ())[1:] if args is None else args)
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
            try:
                way = Session(way, client_key, **options)
            except (TypeError, ValueError) as error:
                error.code = INVALID_ARGUMENT  # type: ignore[union-attr]  # rooms below know no return codes
                raise
        elif client_key is not None or options:
            name = next(iter(options), "client_key")
            raise WrongTypeError(f"{name} belongs to the session: Context(Session(transport, {name}=...))")
        if isinstance(way, str) and way.split(":")[0] in _engines:
            way = open_url(way, domain_id or 0)
        elif isinstance(way, str) or hasattr(way, "graph"):
            way = import_module("muros.space.rclc").open_way(way, domain_id)
            domain_id = way.domain
            way.enclave = self.arguments.enclave or "/"
        super().__init__(way, None, domain_id or 0)
        self.clock = ticks
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

    def wait_connected(self, timeout: float | None = None) -> bool:
        """Waits until the agent is there and has made everything; straight in a space that is at once.

        At most ``timeout`` seconds (None: for ever, or until it is closed); whether it is. No callback runs meanwhile.
        """
        return spin_until(
            self, lambda: self.state == "CONNECTED" and not getattr(self.middleware, "pending", 0), timeout
        )

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
            node_.begin_in(self, context, name, namespace)
        except InvalidNameError as error:
            if is_token(name):
                error.code = NODE_INVALID_NAMESPACE
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
        be_qos(qos)
        return Publisher(self, node_.publisher(self, kind, topic, qos), kind, topic)

    def subscription(
        self,
        kind: Any,
        topic: str,
        callback: Callable[[Any], object] | None,
        qos: str | Qos = "default",
        memory: Rules | None = None,
    ) -> Subscription:
        """A subscription; an executor calls ``callback(message)``. ``memory`` bounds what messages take."""
        be_message(kind)
        be_qos(qos)
        if callback is not None:  # an executor may give one
            be_callable(callback, "the callback of a subscription")
        name = self._topic(topic)
        made = self._subscription(kind, callback, qos)
        made.topic = topic
        deliver = _taker(made, memory, kind).deliver
        return self._join(
            made, self.context.middleware.reader(self.participant, name, kind.TYPE, qos, deliver)
        )

    def timer(self, period: float, callback: Callable[[], object], autostart: bool = True) -> Timer:
        """A timer; an executor calls ``callback()`` every ``period`` seconds."""
        be_period(period)
        be_callable(callback, "the callback of a timer")
        made = Timer(self.context, period, callback, autostart)
        made.home = self.entities
        return node_._join(self, made)

    def service(
        self,
        kind: Any,
        name: str,
        callback: Callable[[Any], Any],
        qos: str | Qos = "services",
        memory: Rules | None = None,
    ) -> Service:
        """A server of a service; ``callback(request)`` returns the response, or None to answer later.

        ``memory`` bounds what requests take.
        """
        be_service(kind)
        be_qos(qos)
        be_callable(callback, "the callback of a service")
        full = self._resolve(name)
        made = self._service(kind, callback, qos)
        made.name = full
        deliver = _taker(made, memory, kind.Request).deliver
        self._join(made, self.context.middleware.replier(self.participant, full, kind.TYPE, deliver, qos))
        self.context.services[made.name] = made
        return made

    def client(
        self, kind: Any, name: str, qos: str | Qos = "services", memory: Rules | None = None
    ) -> Client:
        """A client of a service; ``memory`` bounds what responses take."""
        be_service(kind)
        be_qos(qos)
        full = self._resolve(name)
        made = Client(self.context, kind)
        made.name = full
        made.node = self
        deliver = _taker(made, memory, kind.Response).deliver
        return self._join(
            made, self.context.middleware.requester(self.participant, full, kind.TYPE, deliver, qos)
        )

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
        """Makes this a managed node; see ``muros.rclc.compositions.lifecycle``. Its events bear the system's time."""
        given = (on_configure, on_activate, on_deactivate, on_cleanup, on_shutdown, on_error, time)
        for callback in given:
            if callback is not None:
                be_callable(callback, "a callback of a lifecycle")
        return compositions.lifecycle(self, *given[:-1], services, time or host_logger.system_time)

    def parameters(
        self,
        max: int = 0,
        notify: bool = True,
        undeclared: bool = False,
        low_memory: bool = False,
        longest: int = 0,
        memory: Rules | None = None,
    ) -> Parameters:
        """The parameters of the node; see ``muros.rclc.compositions.parameters``.

        Any number, of any length, unless told else.

        Raises RclError for a node that has some already.
        """
        if self._resolve("~/get_parameters") in self.context.services:
            raise RclError(f"node {self.name!r} has parameters already: keep what parameters() gave")
        from muros.rclc.host.parameter_files import kind
        from muros.rclc.host.parameters import Parameters

        options = (max, notify, undeclared, low_memory, longest, kind, time_ns, memory)
        made = self.__dict__["_parameters"] = Parameters(self, *options)
        if "_clock" in self.__dict__:
            self.clock.follow(made)
        return made

    def on_events(self, entity: Publisher | Subscription, **callbacks: Callable[[Event], object]) -> Events:
        """Has an executor call ``callback(event)`` when something becomes of a publisher or subscription of ours.

        ``deadline_missed``, ``message_lost``, and straight in a data space or through the agent of muros ``matched``,
        ``incompatible_qos`` and ``liveliness_lost``; that another agent does not tell of those is a problem that is
        told. ``destroy()`` of the handle ends it.
        """
        from muros.rclc.host.events import make

        return make(self, entity, callbacks)

    @property
    def graph(self) -> Graph:
        """The graph as this node sees it, from when it is first used: nodes, topics, services, and waiting for them."""
        made: Graph | None = self.__dict__.get("_graph")
        if made is None:
            from muros.rclc.host.graph import Graph

            made = self.__dict__["_graph"] = Graph(self)
        return made

    @property
    def clock(self) -> Clock:
        """The clock of the node, made when it is first used: the system's, or /clock's with ``use_sim_time``."""
        made: Clock | None = self.__dict__.get("_clock")
        if made is None:
            from muros.rclc.host.clock import Clock

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
        memory: Rules | None = None,
    ) -> ActionServer:
        """A server of an action; see ``muros.rclc.compositions.action_server``. Stamps are of the computer's clock."""
        from muros.rclc.host.actions import make_server

        functions = (on_execute, on_goal, on_cancel, on_accepted)
        return make_server(self, kind, name, functions, (goals, results, result_timeout), clock, memory)

    def action_client(
        self, kind: Any, name: str, goals: int = 0, memory: Rules | None = None
    ) -> ActionClient:
        """A client of an action; see ``muros.rclc.compositions.action_client``."""
        from muros.rclc.host.actions import make_client

        return make_client(self, kind, name, goals, memory)

    def logger(
        self,
        level: int | str | None = None,
        time: Callable[[], tuple[int, int]] | None = None,
        show: Callable[[str], object] | None = host_logger.show_on_stderr,
        services: bool = False,
    ) -> Logger:
        """A logger to /rosout, see ``muros.rclc.compositions.logger``: ``level`` by name, and shown on standard error.

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

    def _subscription(
        self, kind: Any, callback: Callable[[Any], object] | None, qos: str | Qos
    ) -> Subscription:
        if not profile(qos).lifespan:
            return Subscription(self.context, kind, callback, qos)
        from muros.rclc.host.expiry import ExpiringSubscription

        return ExpiringSubscription(self.context, kind, callback, qos)

    def _service(self, kind: Any, callback: Callable[[Any], Any], qos: str | Qos) -> Service:
        if not profile(qos).lifespan:
            return Service(self.context, kind, callback)
        from muros.rclc.host.expiry import ExpiringService

        return ExpiringService(self.context, kind, callback, qos)

    def _join(self, handle: Made, entity: Any) -> Made:
        """Gives a handle what the middleware has made for it; from now on executors run it."""
        handle.home = self.entities
        handle.entity = entity
        return node_._join(self, handle)

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


def _taker(handle: Made, memory: Rules | None, kind: Any) -> Any:
    """What takes samples for a handle: with ``memory`` what bounds them, which are of ``kind``."""
    if memory is None:
        return handle
    if not hasattr(memory, "guard"):
        raise WrongTypeError(f"memory is Rules(...), not {memory!r}")
    return memory.guard(handle, kind)
