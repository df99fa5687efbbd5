"""What happens to a component, as kinds and hints for those who observe it.

    RTC_STATUS      ACTIVE:<ec>  INACTIVE:<ec>  ERROR:<ec>  FINALIZE:<ec>
    EC_STATUS       ATTACHED:<ec>  DETACHED:<ec>  RATE_CHANGED:<ec>  STARTUP:<ec>  SHUTDOWN:<ec>
    PORT_PROFILE    ADD:<port>  REMOVE:<port>  CONNECT:<port>  DISCONNECT:<port>  SEND:<port>  RECEIVE:<port>
    CONFIGURATION   UPDATE_CONFIG_PARAM: <set>.<parameter>  SET_CONFIG_SET: <set>  ...

<ec> is the handle of an execution context, <port> the full name. A state is told when it holds: by the context itself
where it is one of this process, by the component's actions where it is one of another.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import Final

from muros.rtc.actions import Action, ComponentEvent
from muros.rtc.codes import LifeCycleState, ReturnCode
from muros.rtc.component import Component
from muros.rtc.configuration import ConfigEvent, ConfigurationSet
from muros.rtc.contexts import ContextEvent, ContextEventKind, ExecutionContext
from muros.rtc.data import DataEvent, DataInPort, DataOutPort
from muros.rtc.observers import Dialect, Observer, StatusKind
from muros.rtc.ports import ConnectEvent, ConnectEventKind, Port

__all__ = ["watch"]

_OK: Final = ReturnCode.RTC_OK

_STATES: Final = {
    LifeCycleState.ACTIVE_STATE: "ACTIVE",
    LifeCycleState.INACTIVE_STATE: "INACTIVE",
    LifeCycleState.ERROR_STATE: "ERROR",
}
_STATE_ACTIONS: Final = {
    Action.ACTIVATED: "ACTIVE",
    Action.DEACTIVATED: "INACTIVE",
    Action.ABORTING: "ERROR",
    Action.RESET: "INACTIVE",
}
_ONLY_IF_OK: Final = frozenset({Action.ACTIVATED, Action.RESET})
_CONTEXT_ACTIONS: Final = {
    Action.STARTUP: "STARTUP",
    Action.SHUTDOWN: "SHUTDOWN",
    Action.RATE_CHANGED: "RATE_CHANGED",
}
_CONNECTIONS: Final = {
    ConnectEventKind.ON_CONNECTED: "CONNECT",
    ConnectEventKind.ON_DISCONNECTED: "DISCONNECT",
}


def watch(component: Component, observer: Observer) -> None:
    """Tell `observer` what becomes of `component` from now on, until it is closed."""
    _Watch(component, observer)


class _Watch:
    """The listeners of one observer at one component."""

    def __init__(self, component: Component, observer: Observer) -> None:
        self._component = component
        self._observer = observer
        self._ports: dict[Port, list[Callable[[], object]]] = {}
        self._contexts: dict[int, Callable[[], None]] = {}
        kinds = observer.options.kinds
        if StatusKind.RTC_STATUS in kinds:
            self._watch_states()
        if StatusKind.EC_STATUS in kinds:
            self._watch_contexts()
        if StatusKind.PORT_PROFILE in kinds:
            self._watch_ports()
        if StatusKind.CONFIGURATION in kinds:
            self._watch_configuration()

    # states

    def _watch_states(self) -> None:
        for action, name in _STATE_ACTIONS.items():
            self._listen(("POST", action), partial(self._action, action, name))
        self._listen(ComponentEvent.FINALIZED, lambda: self._tell(StatusKind.RTC_STATUS, "FINALIZE", "0"))
        for handle, context in enumerate(self._component.owned_contexts):
            self._watch_context(handle, context)
        for context in self._component.participating_contexts:
            self._watch_context(self._component.handle_of(context), context)
        self._listen(ComponentEvent.EC_ATTACHED, self._attached)
        self._listen(ComponentEvent.EC_DETACHED, self._detached)
        self._observer.at_close(self._leave_contexts)

    def _action(self, action: Action, name: str, handle: int, code: ReturnCode) -> None:
        if handle not in self._contexts and (code is _OK or action not in _ONLY_IF_OK):
            self._tell(StatusKind.RTC_STATUS, name, str(handle))

    def _watch_context(self, handle: int, context: object) -> None:
        if isinstance(context, ExecutionContext) and context.is_here:
            self._contexts[handle] = context.on_event(self._context_event)

    def _context_event(self, event: ContextEvent) -> None:
        mine = event.component == self._component.participation
        if event.kind is ContextEventKind.STATE_CHANGED and mine and event.new is not None:
            self._tell(StatusKind.RTC_STATUS, _STATES[event.new], str(event.handle))

    def _attached(self, handle: int) -> None:
        self._watch_context(handle, self._component.context_of(handle))

    def _detached(self, handle: int) -> None:
        self._contexts.pop(handle, lambda: None)()

    def _leave_contexts(self) -> None:
        for handle in tuple(self._contexts):
            self._detached(handle)

    # contexts

    def _watch_contexts(self) -> None:
        for action, name in _CONTEXT_ACTIONS.items():
            self._listen(("POST", action), partial(self._context_action, name))
        for event, name in (
            (ComponentEvent.EC_ATTACHED, "ATTACHED"),
            (ComponentEvent.EC_DETACHED, "DETACHED"),
        ):
            self._listen(event, partial(self._context_action, name))

    def _context_action(self, name: str, handle: int, code: ReturnCode = _OK) -> None:
        self._tell(StatusKind.EC_STATUS, name, str(handle))

    # ports

    def _watch_ports(self) -> None:
        self._listen(ComponentEvent.ADD_PORT, self._port_added)
        self._listen(ComponentEvent.REMOVE_PORT, self._port_removed)
        for port in self._component.ports:
            if isinstance(
                port, Port
            ):  # a composite shows ports of other processes, too: those tell others themselves
                self._watch_port(port)
        self._observer.at_close(self._leave_ports)

    def _port_added(self, port: Port) -> None:
        self._watch_port(port)
        self._tell(StatusKind.PORT_PROFILE, "ADD", port.full_name)

    def _port_removed(self, port: Port) -> None:
        self._leave_port(port)
        self._tell(StatusKind.PORT_PROFILE, "REMOVE", port.full_name)

    def _watch_port(self, port: Port) -> None:
        self._ports[port] = []
        for kind in _CONNECTIONS:
            port.connect_listeners.add(kind, self._connection)
            self._ports[port].append(partial(port.connect_listeners.remove, kind, self._connection))
        options = self._observer.options
        if isinstance(port, DataOutPort):
            self._watch_values(port, DataEvent.ON_SEND, "SEND", options.send_interval)
        elif isinstance(port, DataInPort):
            self._watch_values(port, DataEvent.ON_RECEIVED, "RECEIVE", options.receive_interval)

    def _watch_values(
        self, port: DataInPort[object] | DataOutPort[object], event: DataEvent, name: str, interval: float
    ) -> None:
        """Tell of a value, then look away for `interval`: who listens to values costs the port time."""

        def listen() -> None:
            if port in self._ports and not self._observer.is_closed:
                port.add_listener(event, went)

        def went(*_: object) -> None:
            if interval > 0:
                port.remove_listener(event, went)
                self._observer.after(interval, listen)
            self._tell(StatusKind.PORT_PROFILE, name, port.full_name)

        self._ports[port].append(lambda: port.remove_listener(event, went))
        listen()

    def _connection(self, event: ConnectEvent) -> None:
        if event.code is _OK or event.kind is ConnectEventKind.ON_DISCONNECTED:
            self._tell(StatusKind.PORT_PROFILE, _CONNECTIONS[event.kind], event.port.full_name)

    def _leave_port(self, port: Port) -> None:
        for end in self._ports.pop(port, ()):
            end()

    def _leave_ports(self) -> None:
        for port in tuple(self._ports):
            self._leave_port(port)

    # configuration

    def _watch_configuration(self) -> None:
        configuration = self._component.configuration

        def updated(parameter: str, text: str) -> None:
            self._configured("UPDATE_CONFIG_PARAM", f"{configuration.active_id}.{parameter}")

        def given(name: str, what: ConfigurationSet | str) -> None:
            self._configured(name, what if isinstance(what, str) else what.id)

        for event in ConfigEvent:
            callback: Callable[..., None] = partial(given, event.name)
            if event is ConfigEvent.UPDATE_CONFIG_PARAM:
                callback = updated
            configuration.listeners.add(event, callback)
            self._observer.at_close(partial(configuration.listeners.remove, event, callback))

    def _configured(self, name: str, what: str) -> None:
        # rtctree takes all behind the colon for the name; OpenRTM-aist writes a blank.
        blank = " " if self._observer.dialect is Dialect.OPENRTM else ""
        self._tell(StatusKind.CONFIGURATION, name, blank + what)

    # all

    def _listen(self, point: object, callback: Callable[..., None]) -> None:
        listeners = self._component.listeners
        listeners.add(point, callback)  # type: ignore[arg-type]
        self._observer.at_close(partial(listeners.remove, point, callback))  # type: ignore[arg-type]

    def _tell(self, kind: StatusKind, name: str, what: str) -> None:
        self._observer.tell(kind, f"{name}:{what}")
