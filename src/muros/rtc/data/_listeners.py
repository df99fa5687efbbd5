"""What listeners of a data port are told, and what they may answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from enum import Enum, IntFlag
from typing import Any, Final, TypeAlias

from muros.rtc.listeners import Listeners

__all__ = [
    "Changes",
    "ConnectorEvent",
    "ConnectorInfo",
    "DataEvent",
    "DataListeners",
    "changed_by",
]


class DataEvent(Enum):
    """Moments at which a value is at hand. Listeners are called with the `ConnectorInfo` and the value."""

    ON_BUFFER_WRITE = "ON_BUFFER_WRITE"
    """It stands in the buffer."""
    ON_BUFFER_FULL = "ON_BUFFER_FULL"
    """The buffer did not take it."""
    ON_BUFFER_WRITE_TIMEOUT = "ON_BUFFER_WRITE_TIMEOUT"
    """There was no room for it in time."""
    ON_BUFFER_OVERWRITE = "ON_BUFFER_OVERWRITE"
    """It was taken, and the oldest value lost for it."""
    ON_BUFFER_READ = "ON_BUFFER_READ"
    """It was taken out of the buffer."""
    ON_SEND = "ON_SEND"
    """The OutPort is about to send it."""
    ON_RECEIVED = "ON_RECEIVED"
    """The InPort has got it; at the OutPort: the InPort has taken it."""
    ON_RECEIVER_FULL = "ON_RECEIVER_FULL"
    ON_RECEIVER_TIMEOUT = "ON_RECEIVER_TIMEOUT"
    ON_RECEIVER_ERROR = "ON_RECEIVER_ERROR"

    __hash__ = object.__hash__  # looked up with every value: Enum's own is slow


class ConnectorEvent(Enum):
    """Moments at which there is no value. Listeners are called with the `ConnectorInfo`."""

    ON_BUFFER_EMPTY = "ON_BUFFER_EMPTY"
    ON_BUFFER_READ_TIMEOUT = "ON_BUFFER_READ_TIMEOUT"
    ON_SENDER_EMPTY = "ON_SENDER_EMPTY"
    ON_SENDER_TIMEOUT = "ON_SENDER_TIMEOUT"
    ON_SENDER_ERROR = "ON_SENDER_ERROR"
    ON_CONNECT = "ON_CONNECT"
    ON_DISCONNECT = "ON_DISCONNECT"


class Changes(IntFlag):
    """What a listener of a `DataEvent` answers. None is NO_CHANGE.

    DATA_CHANGED: the value it was given, which it has changed, replaces what is sent on or stored. With a new value,
    answer the pair `(Changes.DATA_CHANGED, value)`.
    """

    NO_CHANGE = 0
    INFO_CHANGED = 1
    DATA_CHANGED = 2
    BOTH_CHANGED = 3


def changed_by(answer: object, value: object) -> tuple[bool, object]:
    """What a listener's answer says: whether `value` has changed, and what it is now."""
    if isinstance(answer, tuple) and len(answer) == 2:
        answer, value = answer
    return isinstance(answer, int) and bool(answer & Changes.DATA_CHANGED), value


@dataclass(slots=True)
class ConnectorInfo:
    """A connection as listeners see it."""

    name: str
    connector_id: str
    ports: tuple[object, ...]
    properties: dict[str, str] = field(default_factory=dict)
    """What holds for this side, without `dataport.`."""


DataCallback: TypeAlias = "Callable[[ConnectorInfo, Any], object]"


class DataListeners:
    """The listeners of one data port; they live as long as the port, over all its connections.

    `on_error(event, error)` hears of one that raised.
    """

    def __init__(self, on_error: Callable[[DataEvent | ConnectorEvent, Exception], object]) -> None:
        self._on_error: Final = on_error
        self._data: Final = Listeners[DataEvent](on_error)
        self._connector: Final = Listeners[ConnectorEvent](on_error)
        self.hears_values = False
        """Whether anybody listens to any `DataEvent`: asked with every value."""
        self.callbacks: dict[DataEvent, tuple[DataCallback, ...]] = {}
        """Who listens to which; another dict after each change."""

    def add(
        self, event: DataEvent | ConnectorEvent, callback: Callable[..., object]
    ) -> Callable[..., object]:
        """Tell `callback` of `event` from now on. Returns it."""
        if not isinstance(event, DataEvent):
            return self._connector.add(event, callback)
        self._data.add(event, callback)
        self._note()
        return callback

    def remove(self, event: DataEvent | ConnectorEvent, callback: Callable[..., object]) -> bool:
        """Tell `callback` no longer. False where it was not there."""
        if not isinstance(event, DataEvent):
            return self._connector.remove(event, callback)
        removed = self._data.remove(event, callback)
        self._note()
        return removed

    def failed(self, event: DataEvent, error: Exception) -> None:
        """A callback has raised."""
        self._on_error(event, error)

    def tell(self, event: ConnectorEvent, info: ConnectorInfo) -> None:
        """Tell who listens."""
        self._connector.tell(event, info)

    def _note(self) -> None:
        self.callbacks = {event: heard for event in DataEvent if (heard := self._data.of(event))}
        self.hears_values = bool(self.callbacks)
