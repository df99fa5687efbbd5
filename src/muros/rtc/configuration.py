"""Configuration sets of a component, and the parameters that are bound to them (SDO Configuration).

A set is texts by name. The active one's texts become values only at the moments the component permits (`update`):
while it changes state, and between two cycles. So a parameter never changes in the middle of an action.

What was set waits until its set is activated: `set_values`, `add` and `remove` mark the configuration as changed and
not in force; `activate` puts it into force; `update` then takes the values over.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import Enum
from typing import Any, Final, Generic, TypeVar

from muros.rtc.codes import RtcError
from muros.rtc.listeners import Listeners

__all__ = [
    "DEFAULT_SET",
    "ActivationError",
    "ConfigEvent",
    "Configuration",
    "ConfigurationError",
    "ConfigurationSet",
    "EmptyIdError",
    "FullError",
    "NotAvailableError",
    "Parameter",
    "UnknownSetError",
    "converter_of",
]

DEFAULT_SET: Final = "default"
"""The set that every component has."""

HIDDEN: Final = "_"
"""Sets whose names begin so are remarks for editors (`__widget__`, `__constraints__`); they cannot be activated."""

SIZE_LIMIT: Final = 4 << 20
"""Characters of all sets together that can be set from outside; each set and each parameter counts as 100 more."""

ENTRY_SIZE: Final = 100

T = TypeVar("T")


class ConfigurationError(RtcError):
    """Something was asked of a configuration that it cannot do."""


class EmptyIdError(ConfigurationError):
    """A set was named by an empty text (SDOPackage::InvalidParameter)."""


class UnknownSetError(ConfigurationError):
    """There is no set of that name (SDOPackage::InternalError)."""


class ActivationError(ConfigurationError):
    """The set cannot be activated: it is hidden or unknown (SDOPackage::InternalError)."""


class FullError(ConfigurationError):
    """More is to be stored than a configuration takes (SDOPackage::InternalError)."""


class NotAvailableError(ConfigurationError):
    """What is asked for is not in force at the moment (SDOPackage::NotAvailable)."""


class ConfigEvent(Enum):
    """What listeners of a configuration hear of, with what they are called with."""

    UPDATE_CONFIG_PARAM = "ON_UPDATE_CONFIG_PARAM"  # name, text
    SET_CONFIG_SET = "ON_SET_CONFIG_SET"  # the set as given
    ADD_CONFIG_SET = "ON_ADD_CONFIG_SET"  # the set
    UPDATE_CONFIG_SET = "ON_UPDATE_CONFIG_SET"  # its id
    REMOVE_CONFIG_SET = "ON_REMOVE_CONFIG_SET"  # its id
    ACTIVATE_CONFIG_SET = "ON_ACTIVATE_CONFIG_SET"  # its id


@dataclass(slots=True)
class ConfigurationSet:
    """Texts by parameter name, under an id."""

    id: str
    description: str = ""
    values: dict[str, str] = field(default_factory=dict)

    def copy(self) -> ConfigurationSet:
        """One that may be changed without this one changing."""
        return ConfigurationSet(self.id, self.description, dict(self.values))

    @property
    def size(self) -> int:
        """What it counts for in the configuration's limit."""
        texts = sum(ENTRY_SIZE + len(name) + len(text) for name, text in self.values.items())
        return ENTRY_SIZE + len(self.id) + len(self.description) + texts


class Parameter(Generic[T]):
    """A value bound to a name: what the active set's text was last converted to."""

    def __init__(
        self,
        name: str,
        default: str,
        convert: Callable[[str], T],
        assign: Callable[[T], object] | None = None,
    ) -> None:
        self.name: Final = name
        self.default: Final = default
        """The text that counts where the set has none, or one that cannot be converted."""
        self._convert = convert
        self._assign = assign
        self.text = default
        """The text last taken over, also where it could not be converted."""
        self.value: T = convert(default)
        if assign is not None:
            assign(self.value)

    def converted(self, text: str) -> tuple[T, Exception | None]:
        """The value of a text, or the default's with the error of a text that cannot be converted."""
        try:
            return self._convert(text), None
        except Exception as error:  # whatever a user's conversion raises
            return self._convert(self.default), error

    def take(self, text: str, value: T) -> None:
        """Take a text over, with what it was converted to."""
        self.text, self.value = text, value
        if self._assign is not None:
            self._assign(value)


class Configuration:
    """The configuration sets of a component.

    `sets` are those it is made with, by id; `default` is added where it is missing. `on_bad_text(parameter, error)`
    hears of texts that could not be converted, `on_error` of listeners that raise.
    """

    def __init__(
        self,
        sets: Mapping[str, Mapping[str, str]] | None = None,
        *,
        active: str = "",
        size_limit: int = SIZE_LIMIT,
        on_bad_text: Callable[[Parameter[Any], Exception], object] = lambda parameter, error: None,
        on_error: Callable[[ConfigEvent, Exception], object] = lambda event, error: None,
    ) -> None:
        self._sets = {id_: ConfigurationSet(id_, "", dict(values)) for id_, values in (sets or {}).items()}
        self._sets.setdefault(DEFAULT_SET, ConfigurationSet(DEFAULT_SET))
        self._added: set[str] = set()
        self._size_limit: Final = size_limit
        self._active = active if active in self._sets and not active.startswith(HIDDEN) else DEFAULT_SET
        self._changed = True  # the first values are taken over by the first update
        self._in_force = True
        self._updating = False
        self._parameters: dict[str, Parameter[Any]] = {}
        self._on_bad_text = on_bad_text
        self._lock = threading.RLock()
        self.listeners: Final = Listeners[ConfigEvent](on_error)

    @property
    def active_id(self) -> str:
        """The id of the set whose values count."""
        return self._active

    @property
    def parameters(self) -> tuple[Parameter[Any], ...]:
        """What is bound, in the order of binding."""
        return tuple(self._parameters.values())

    def bind(
        self,
        name: str,
        default: str,
        convert: Callable[[str], T],
        assign: Callable[[T], object] | None = None,
    ) -> Parameter[T]:
        """Bind a parameter: its value is `default` converted, until `update` finds a text of the active set.

        `assign` is called with every value. Raises ConfigurationError where the name is taken or the default cannot
        be converted.
        """
        if name in self._parameters:
            raise ConfigurationError(f"parameter {name!r} is bound already: bind each name once")
        try:
            parameter = Parameter(name, default, convert, assign)
        except Exception as error:
            raise ConfigurationError(
                f"parameter {name!r}: its default {default!r} cannot be converted: {error}"
            ) from error
        with self._lock:
            self._parameters[name] = parameter
            self._sets[DEFAULT_SET].values.setdefault(name, default)
        return parameter

    def sets(self) -> tuple[ConfigurationSet, ...]:
        """Copies of all sets, hidden ones too."""
        with self._lock:
            return tuple(one.copy() for one in self._sets.values())

    def get(self, id_: str) -> ConfigurationSet:
        """A copy of one set. Raises EmptyIdError, UnknownSetError."""
        with self._lock:
            return self._known(id_).copy()

    def active(self) -> ConfigurationSet:
        """A copy of the active set. Raises NotAvailableError while what was set has not been activated."""
        with self._lock:
            if not self._in_force:
                raise NotAvailableError(
                    "values were set and their set has not been activated since: activate one"
                )
            return self._sets[self._active].copy()

    def set_values(self, given: ConfigurationSet) -> bool:
        """Store the texts of `given` in the set of its id; parameters that nobody bound are stored, too.

        They come into force by `activate`. False where there is no such set. Raises EmptyIdError, FullError.
        """
        with self._lock:
            _check_id(given.id)
            standing = self._sets.get(given.id)
            if standing is None:
                return False
            self._make_sure_of_room(given)
            if given.description:
                standing.description = given.description
            standing.values.update(given.values)
            self._set_aside()
        self.listeners.tell(ConfigEvent.SET_CONFIG_SET, given)
        return True

    def add(self, given: ConfigurationSet) -> bool:
        """Add a set; False where one of that id stands. Raises EmptyIdError, FullError."""
        with self._lock:
            _check_id(given.id)
            if given.id in self._sets:
                return False
            self._make_sure_of_room(given)
            self._sets[given.id] = given.copy()
            self._added.add(given.id)
            self._set_aside()
        self.listeners.tell(ConfigEvent.ADD_CONFIG_SET, given)
        return True

    def remove(self, id_: str) -> bool:
        """Remove a set that was added at run time; False for the active one and all others. Raises EmptyIdError."""
        with self._lock:
            _check_id(id_)
            if id_ == self._active or id_ not in self._added:
                return False
            self._added.discard(id_)
            del self._sets[id_]
            self._set_aside()
        self.listeners.tell(ConfigEvent.REMOVE_CONFIG_SET, id_)
        return True

    def activate(self, id_: str) -> None:
        """Put a set into force: the next `update` takes its values over. Raises EmptyIdError, ActivationError."""
        with self._lock:
            _check_id(id_)
            if id_.startswith(HIDDEN):
                raise ActivationError(
                    f"the set {id_!r} is hidden: it holds remarks for editors and cannot be activated"
                )
            if id_ not in self._sets:
                raise ActivationError(
                    f"there is no configuration set {id_!r}; there are {', '.join(self._visible())}"
                )
            self._active = id_
            self._changed = True
            self._in_force = True
        self.listeners.tell(ConfigEvent.ACTIVATE_CONFIG_SET, id_)

    def update(self) -> bool:
        """Take the active set's values over where something changed: only at a moment the component permits.

        Returns whether there was anything to take over. No lock is held while texts are converted and assigned: where
        several threads update, one does, and the others go on; what is changed meanwhile is for the next update.
        """
        if not self._changed or not self._in_force:  # every cycle comes here
            return False
        with self._lock:
            if self._updating or not self._changed or not self._in_force:
                return False
            self._changed = False
            self._updating = True
            active = self._active
            texts = self._sets[active].values
            due = [
                (parameter, text)
                for parameter in self._parameters.values()
                if (text := texts.get(parameter.name)) is not None and text != parameter.text
            ]
        try:
            taken = [(parameter, text, *parameter.converted(text)) for parameter, text in due]
            for parameter, text, value, _ in taken:
                parameter.take(text, value)
        finally:
            self._updating = False
        for parameter, text, _, failure in taken:
            if failure is not None:
                self._on_bad_text(parameter, failure)
            self.listeners.tell(ConfigEvent.UPDATE_CONFIG_PARAM, parameter.name, text)
        if taken:
            self.listeners.tell(ConfigEvent.UPDATE_CONFIG_SET, active)
        return bool(taken)

    def _make_sure_of_room(self, given: ConfigurationSet) -> None:
        if sum(one.size for one in self._sets.values()) + given.size > self._size_limit:
            raise FullError(
                f"configuration set {given.id[:80]!r}: all sets together would have more than {self._size_limit} "
                "characters; remove sets that nobody needs"
            )

    def _set_aside(self) -> None:
        self._changed = True
        self._in_force = False

    def _known(self, id_: str) -> ConfigurationSet:
        _check_id(id_)
        if id_ not in self._sets:
            raise UnknownSetError(
                f"there is no configuration set {id_!r}; there are {', '.join(self._visible())}"
            )
        return self._sets[id_]

    def _visible(self) -> list[str]:
        return [id_ for id_ in self._sets if not id_.startswith(HIDDEN)]


TRUE: Final = frozenset({"1", "true", "yes", "on"})
FALSE: Final = frozenset({"0", "false", "no", "off", ""})


def to_bool(text: str) -> bool:
    """1, true, yes, on and 0, false, no, off in any case. Raises ValueError for others."""
    word = text.strip().lower()
    if word not in TRUE and word not in FALSE:
        raise ValueError(f"{text!r} is neither true nor false")
    return word in TRUE


def converter_of(value: object) -> Callable[[str], Any]:
    """The conversion that gives values of `value`'s type: bool, int, float, str, and lists of them (comma separated).

    A list's elements have the type of its first; an empty list gives texts. Raises ConfigurationError for others.
    """
    if isinstance(value, bool):
        return to_bool
    if isinstance(value, int):
        return int
    if isinstance(value, float):
        return float
    if isinstance(value, str):
        return str
    if isinstance(value, (list, tuple)):
        element = converter_of(value[0]) if value else str
        make = type(value)

        def convert(text: str) -> Any:
            return make(element(item.strip()) for item in text.split(",")) if text.strip() else make()

        return convert
    raise ConfigurationError(
        f"no conversion for a parameter of type {type(value).__name__}: give one (convert=...) that takes the text"
    )


def _check_id(id_: str) -> None:
    if not id_:
        raise EmptyIdError("the id of the configuration set is empty")
