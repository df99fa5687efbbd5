"""Parameters of a node on hosts: what is declared takes the value that the command line or the program gives it."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

from muros.rclc import parameter_making, parameter_rules, parameters
from muros.rclc.host.checks import WrongTypeError, be_callable, be_text
from muros.rclc.host.parameter_files import fitting, kind
from muros.rclc.parameter_errors import ParameterTypeError
from muros.rclc.parameter_values import TYPES, kind_of

if TYPE_CHECKING:
    from muros.rclc.host.context import Node
    from muros.rclc.memory import Rules
    from muros.rclc.parameters import Parameter

__all__ = ["Parameters"]


class Parameters(parameters.Parameters):
    """Made by ``Node.parameters``; see ``muros.rclc.parameters.Parameters``.

    ``given`` are values for what is declared.
    """

    on_applied: Callable[[], object] | None = None
    """Called after something may have changed."""

    def __init__(
        self,
        node: Node,
        max: int,
        notify: bool,
        undeclared: bool,
        low_memory: bool,
        longest: int,
        kind: Callable[[str], Any] = kind,
        clock: Callable[[], int] | None = None,
        memory: Rules | None = None,
    ) -> None:
        super().__init__(node, max, notify, undeclared, low_memory, longest, kind, clock, memory)
        self.given: dict[str, Any] = dict(node.overrides)

    def declare(
        self,
        name: str,
        value: Any,
        range: tuple[Any, ...] | None = None,
        description: str = "",
        constraints: str = "",
        read_only: bool = False,
        type: int = 0,
        ignore_given: bool = False,
    ) -> Any:
        """Declares a parameter and gives its value back: the one that is given for it, unless that is ignored.

        See ``muros.rclc.parameter_making.declare``. Raises ParameterTypeError for a value given that is of another
        type, ParameterRejectedError for one that is out of range.
        """
        if name in self.given and not ignore_given:
            value = self._fitting(name, kind_of(value, type) or type)
        declared = parameter_making.declare(
            self, name, value, range, description, constraints, read_only, type
        )
        self._applied()
        return declared

    def declare_given(self) -> list[str]:
        """Declares whatever a value is given for and nothing was declared; its names."""
        names = [name for name in sorted(self.given) if name not in self.known]
        for name in names:
            self.declare(name, self.given[name])
        return names

    def get(self, name: str) -> Any:
        """The value of a parameter. ParameterNotDeclaredError for an unknown one."""
        be_text(name, "the name of a parameter")
        return super().get(name)

    def on_change(self, callback: Callable[[Parameter | None, Parameter | None], object] | None) -> None:
        """Has ``callback(old, new)`` decide on each change; see ``muros.rclc.parameters.Parameters.on_change``."""
        if callback is not None:
            be_callable(callback, "the callback of a change")
        super().on_change(callback)

    def update(self, values: dict[str, Any]) -> None:
        """Sets several parameters of ours at once: all or none. A ParameterError says what stands against it."""
        if not isinstance(values, Mapping):
            raise WrongTypeError(f"parameters are set by a dict of names and values, not {values!r}")
        for name in values:
            be_text(name, "the name of a parameter")
        parameter_rules.update(self, values)
        self._applied()

    def _set(self, request: Any) -> Any:
        try:
            return super()._set(request)
        finally:
            self._applied()

    def _set_atomically(self, request: Any) -> Any:
        try:
            return super()._set_atomically(request)
        finally:
            self._applied()

    def _fitting(self, name: str, wanted: int) -> Any:
        """The value that is given, as one of the type that is declared."""
        value = fitting(self.given[name], wanted)
        if wanted and kind_of(value, wanted) != wanted:
            raise ParameterTypeError(
                f"parameter {name!r} of {self.full_name} is declared as {TYPES[wanted]}, and {value!r} is given for it"
            )
        return value

    def _applied(self) -> None:
        if self.on_applied is not None:
            self.on_applied()
