"""State machines of components: hierarchical states as classes, events as their methods.

    class Oven(State):
        def on_init(self): self.go(Closed)
        def open(self): ...                     # the events that the machine knows
        def close(self): ...

    class Closed(State, within=Oven, deep_history=True):
        def open(self): self.go(Opened)

    class Opened(State, within=Oven):
        def close(self): self.go(Closed)

An event goes to the innermost state that the machine is in, or else to the nearest state around it that has a method
of its name. What a method asks for with `go` happens when it has returned: states are left from the inside up to the
one that stays, then entered from the outside in; the state gone to is initialised, which may lead further in. One
with deep history, instead of being initialised, goes back to where it was when it was left. Events that states
themselves send follow before others.

Any thread may `post` an event; they wait until `run_events`, which the component calls in its cycle. There is no
clock, and but for the queue no lock: a machine belongs to the thread that runs it. OMG FSM4RTC 1.0, 7.2.
"""

from __future__ import annotations

import threading
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Any, ClassVar, Final, Literal, TypeAlias

from muros.findings import Finding, Severity
from muros.rtc.actions import rtc_name_of
from muros.rtc.codes import RtcError
from muros.rtc.listeners import Listeners

__all__ = ["FsmAction", "FsmError", "FsmEvent", "FsmPoint", "Machine", "State"]

EVENT_LIMIT: Final = 256
"""Events that wait, at most."""

STEP_LIMIT: Final = 1000
"""Events and transitions that may follow from one event before it is taken for an endless loop."""


class FsmError(RtcError):
    """A state machine was asked for what it cannot do; the text says which, where."""


class FsmAction(Enum):
    """What happens to a state; the value is the method's name."""

    INIT = "on_init"
    ENTRY = "on_entry"
    DO = "on_do"
    EXIT = "on_exit"
    STATE_CHANGE = "on_state_change"

    @property
    def rtc_name(self) -> str:
        """The method's name in the RTC specification: `onEntry`."""
        return rtc_name_of(self.value)


class FsmEvent(Enum):
    """What else listeners of a machine hear of."""

    SET_FSM_PROFILE = "SET_FSM_PROFILE"
    GET_FSM_PROFILE = "GET_FSM_PROFILE"
    ADD_FSM_STATE = "ADD_FSM_STATE"
    REMOVE_FSM_STATE = "REMOVE_FSM_STATE"
    ADD_FSM_TRANSITION = "ADD_FSM_TRANSITION"
    REMOVE_FSM_TRANSITION = "REMOVE_FSM_TRANSITION"
    BIND_FSM_EVENT = "BIND_FSM_EVENT"
    UNBIND_FSM_EVENT = "UNBIND_FSM_EVENT"
    SET_FSM_STRUCTURE = "SET_FSM_STRUCTURE"
    GET_FSM_STRUCTURE = "GET_FSM_STRUCTURE"


FsmPoint: TypeAlias = "tuple[Literal['PRE', 'POST'], FsmAction]"
"""What listeners are added for: called with the state's name; STATE_CHANGE with the name of the state that ends, and
after it, that of the one that has begun."""

_METHODS: Final = (FsmAction.INIT, FsmAction.ENTRY, FsmAction.DO, FsmAction.EXIT)


class State:
    """Base of all states. Public methods that a subclass adds are its events.

    A class `Data` inside a state is what it keeps: made when the state is entered, gone when it is left; states
    inside it reach it with `data(Outer)`.
    """

    within: ClassVar[type[State] | None] = None
    deep_history: ClassVar[bool] = False
    Data: ClassVar[type | None] = None
    is_base: ClassVar[bool] = True
    """Written into classes whose methods are no events."""

    def __init_subclass__(
        cls, *, within: type[State] | None = None, deep_history: bool = False, **arguments: Any
    ) -> None:
        super().__init_subclass__(**arguments)
        cls.within = within
        cls.deep_history = deep_history
        for action in _METHODS:  # a state may use the names of the specification
            if action.rtc_name in vars(cls) and action.value not in vars(cls):
                setattr(cls, action.value, vars(cls)[action.rtc_name])

    def __init__(self, machine: Machine) -> None:
        self.machine: Final = machine

    def on_init(self) -> object:
        """The machine has come here and goes no further by itself: `go` to a state inside, if there is one."""
        return None

    def on_entry(self) -> object:
        """The state is entered."""
        return None

    def on_do(self) -> object:
        """A cycle of the component ends in this state."""
        return None

    def on_exit(self) -> object:
        """The state is left."""
        return None

    @property
    def component(self) -> Any:
        """The component that has the machine."""
        return self.machine.component

    def go(self, state: type[State], *arguments: Any) -> None:
        """Go to `state` when this method has returned; `arguments` are for its `Data`."""
        self.machine._pending = (state, arguments)

    def send(self, event: str | Callable[..., Any], *arguments: Any) -> None:
        """Let the machine have an event after this one, before others that wait."""
        self.machine._inner.append((event_name(event), arguments))

    def data(self, state: type[State] | None = None) -> Any:
        """What `state` (this one, if not given) keeps. FsmError where the machine is not in it."""
        return self.machine.data(state or type(self))


for _action in _METHODS:
    setattr(State, _action.rtc_name, getattr(State, _action.value))


def event_name(event: str | Callable[..., Any]) -> str:
    """The name of an event, given as such or as the method that a state has for it."""
    return event if isinstance(event, str) else event.__name__


class Machine:
    """A state machine in the state `top` and in those inside it.

    `report` is given findings; `listeners` hear of what happens (`FsmPoint`, `FsmEvent`).
    """

    def __init__(
        self,
        top: type[State],
        component: Any = None,
        *,
        event_limit: int = EVENT_LIMIT,
        report: Callable[[Finding], object] | None = None,
    ) -> None:
        if top.within is not None:
            raise FsmError(
                f"{top.__name__} lies within {top.within.__name__}: a machine needs the outermost state"
            )
        self.top: Final = top
        self.component = component
        self.report: Callable[[Finding], object] = report or (lambda finding: None)
        self.listeners: Final[Listeners[FsmPoint | FsmEvent]] = Listeners(self._listener_failed)
        self._limit = event_limit
        self._path: list[State] = []
        self._data: dict[type[State], Any] = {}
        self._history: dict[type[State], type[State]] = {}
        self._pending: tuple[type[State], tuple[Any, ...]] | None = None
        self._inner: deque[tuple[str, tuple[Any, ...]]] = deque()
        self._queue: deque[tuple[str, tuple[Any, ...]]] = deque()
        self._lock = threading.Lock()

    # ---- from any thread

    def post(self, event: str | Callable[..., Any], *arguments: Any) -> bool:
        """Let the machine have an event at its next `run_events`. False if too many wait already: it is dropped."""
        with self._lock:
            if len(self._queue) < self._limit:
                self._queue.append((event_name(event), arguments))
                return True
        self._tell(
            "fsm-events-dropped",
            f"event {event_name(event)} is dropped",
            f"{self._limit} events wait already",
            "Activate the component, call run_events in on_execute, or send fewer.",
        )
        return False

    @property
    def current(self) -> type[State] | None:
        """The innermost state that the machine is in; None before it has begun."""
        path = self._path
        return type(path[-1]) if path else None

    # ---- from the thread that runs it

    @property
    def path(self) -> tuple[type[State], ...]:
        """The states that the machine is in, the outermost first."""
        return tuple(type(state) for state in self._path)

    def start(self) -> None:
        """Enter the outermost state, if the machine has not begun."""
        if not self._path:
            self._enter(self.top, ())
            self._initialise()
            self._settle()

    def stop(self) -> None:
        """Leave all states; events that wait are gone, history stays."""
        self._leave_until(0)
        self._inner.clear()
        with self._lock:
            self._queue.clear()

    def run_events(self) -> int:
        """Handle all events that have been posted before this call, then `on_do`. How many they were.

        Raises what the states' methods raise; the events behind that one stay.
        """
        self.start()
        with self._lock:
            waiting = len(self._queue)
        for _ in range(waiting):
            with self._lock:
                if not self._queue:
                    break
                event, arguments = self._queue.popleft()
            self.dispatch(event, *arguments)
        self._act(self._path[-1], FsmAction.DO)
        self._settle()
        return waiting

    def dispatch(self, event: str | Callable[..., Any], *arguments: Any) -> bool:
        """Handle an event now. False where no state that the machine is in knows it: it is counted as a finding."""
        self.start()
        handled = self._handle(event_name(event), arguments)
        self._settle()
        return handled

    def data(self, state: type[State]) -> Any:
        """What a state keeps (`State.Data`). FsmError where the machine is not in it."""
        if state not in self._data:
            raise FsmError(f"the machine is in {self._name()}, not in {state.__name__}: it keeps nothing now")
        return self._data[state]

    def knows(self, event: str) -> bool:
        """Whether the event is one of the outermost state's or of any state's that the machine may be in."""
        return any(is_event(state, event) for state in states_of(self.top))

    # ---- inside

    def _handle(self, event: str, arguments: tuple[Any, ...]) -> bool:
        for state in reversed(self._path):
            if is_event(type(state), event):
                getattr(state, event)(*arguments)
                return True
        self._tell(
            "fsm-event-unknown",
            f"event {event} means nothing in {self._name()}",
            "neither that state nor one around it has a method of this name",
            f"Give {self.top.__name__} a method {event} that does nothing, if it is to be ignored.",
        )
        return False

    def _settle(self) -> None:
        """Do what the last method has asked for, and what follows from that."""
        for _ in range(STEP_LIMIT):
            if self._pending is not None:
                (state, arguments), self._pending = self._pending, None
                self._go(state, arguments)
            elif self._inner:
                event, given = self._inner.popleft()
                self._handle(event, given)
            else:
                return
        self._inner.clear()
        self._pending = None
        raise FsmError(f"in {self._name()} states and events follow each other without end")

    def _go(self, target: type[State], arguments: tuple[Any, ...]) -> None:
        way = _way_to(target)
        if way[0] is not self.top:
            raise FsmError(f"{target.__name__} is no state of the machine of {self.top.__name__}")
        before = self._name()
        self.listeners.tell(("PRE", FsmAction.STATE_CHANGE), before)
        here = self.path
        stays = 0
        while stays < min(len(way) - 1, len(here)) and way[stays] is here[stays]:
            stays += 1
        self._leave_until(stays)
        for state in way[stays:-1]:
            self._enter(state, ())
        self._enter(target, arguments)
        remembered = self._history.get(target)
        if remembered is not None:
            for state in _way_to(remembered)[len(way) :]:
                self._enter(state, ())
        else:
            self._initialise()
        self.listeners.tell(("POST", FsmAction.STATE_CHANGE), before, self._name())

    def _initialise(self) -> None:
        state = self._path[-1]
        self._act(state, FsmAction.INIT)
        if self._pending is not None and type(state) not in _way_to(self._pending[0])[:-1]:
            target, self._pending = self._pending[0], None
            raise FsmError(
                f"on_init of {type(state).__name__} goes to {target.__name__}, which does not lie within it"
            )

    def _enter(self, state: type[State], arguments: tuple[Any, ...]) -> None:
        if state.Data is not None:
            self._data[state] = state.Data(*arguments)
        self._path.append(state(self))
        self._act(self._path[-1], FsmAction.ENTRY)

    def _leave_until(self, depth: int) -> None:
        """Leave states until `depth` of them are left."""
        inner = self.current
        while len(self._path) > depth:
            state = self._path[-1]
            try:
                self._act(state, FsmAction.EXIT)
            finally:
                self._path.pop()
                self._data.pop(type(state), None)
                if type(state).deep_history and inner is not None and inner is not type(state):
                    self._history[type(state)] = inner

    def _act(self, state: State, action: FsmAction) -> None:
        name = type(state).__name__
        self.listeners.tell(("PRE", action), name)
        getattr(state, action.value)()
        self.listeners.tell(("POST", action), name)

    def _name(self) -> str:
        return self.current.__name__ if self.current is not None else "no state"

    def _listener_failed(self, kind: object, error: Exception) -> None:
        self._tell("listener-failed", "a listener failed", f"{type(error).__name__}: {error}")

    def _tell(self, code: str, what: str, why: str, remedy: str = "") -> None:
        who = f"state machine {self.top.__name__}"
        self.report(Finding(code, who, what, why, remedy, Severity.WARNING, self.top.__name__))


def is_event(state: type[State], name: str) -> bool:
    """Whether `name` is an event of `state`: a public method that it adds to what all states have."""
    method = getattr(state, name, None)
    return (
        callable(method)
        and not isinstance(method, type)
        and name[0] != "_"
        and not any(name in vars(base) for base in state.__mro__ if "is_base" in vars(base))
    )


def states_of(top: type[State]) -> list[type[State]]:
    """`top` and all states inside it, each before those inside it."""
    found = [top]
    for state in _all_states(State):
        if state.within is top:
            found += states_of(state)
    return found


def _all_states(base: type[State]) -> list[type[State]]:
    """Classes derived from `base`, in the order of writing."""
    found: dict[type[State], None] = {}
    for cls in base.__subclasses__():
        found[cls] = None
        found.update(dict.fromkeys(_all_states(cls)))
    return list(found)


def _way_to(state: type[State]) -> list[type[State]]:
    """The states around `state`, the outermost first, and itself."""
    way: list[type[State]] = [state]
    while (outer := way[0].within) is not None:
        if outer in way:
            raise FsmError(f"{outer.__name__} lies within itself")
        way.insert(0, outer)
    return way
