"""Parameters of a node: named values that others may list, read, describe and set.

    params = node.parameters()
    params.declare("gain", 1.0, range=(0.0, 10.0, 0.5), description="loop gain")
    params.on_change(lambda old, new: new is not None and new.value < 5.0)

The values are here. What makes them, judges changes and answers the six services boards borrow, see
``parameter_making``, ``parameter_rules`` and ``parameter_answers``; who asks others is in ``parameter_client``.
"""

from muros.compat import borrow, const, lend

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable
    from typing import Any

    from muros.rclc import parameter_making, parameter_rules
    from muros.rclc._types import Publisher
    from muros.rclc.context import Node
    from muros.rclc.memory import Rules
    from muros.rclc.service import Service


class Parameter:
    """A parameter as it is at one moment.

    ``type`` is a number of rcl_interfaces/msg/ParameterType: 1 bool, 2 int, 3 float, 4 str, 5 bytes, 6 to 9 lists of
    bool, int, float, str. ``range`` is None or (least, largest, step), step 0 for any value between. ``constraints``
    are words for people; nothing is held to them.
    """

    description = ""
    constraints = ""
    read_only = False
    range: "tuple[Any, Any, Any] | None" = None

    def __init__(self, name: str, kind: int, value: "Any") -> None:
        self.name = name
        self.type = kind
        self.value = value


class Parameters:
    """Made by ``Node.parameters``. ``handles`` are its six services, for an executor that things are added to.

    What is not declared, of another type, or refused raises a ParameterError, whose ``code`` is the return code that
    the C library gives. ``lost`` counts events of changes that could not be published.
    """

    changing = False
    lost = 0
    changed: "Callable[[Parameter | None, Parameter | None], object] | None" = None
    events: "Publisher | None" = None

    if TYPE_CHECKING:
        node: Node
        full_name: str
        max: int
        longest: int
        undeclared: bool
        low_memory: bool
        known: "dict[str, Parameter]"
        handles: "list[Service]"
        kind: "Callable[[str], Any]"
        clock: "Callable[[], int] | None"

        declare = parameter_making.declare
        undeclare = parameter_making.undeclare
        constrain = parameter_making.constrain
        describe = parameter_making.describe
        list = parameter_making.list_
        destroy = parameter_making.destroy
        update = parameter_rules.update
    else:

        def __getattr__(self, name):
            if name == "update":
                return lend(self, "muros.rclc.parameter_rules", name)
            return lend(self, "muros.rclc.parameter_making", "list_" if name == "list" else name)

    def __init__(
        self,
        node: "Node",
        max: int,
        notify: bool,
        undeclared: bool,
        low_memory: bool,
        longest: int,
        kind: "Callable[[str], Any] | None" = None,
        clock: "Callable[[], int] | None" = None,
        memory: "Rules | None" = None,
    ) -> None:
        borrow("muros.rclc.parameter_making").begin(
            self, node, max, notify, undeclared, low_memory, longest, kind, clock, memory
        )

    def get(self, name: str) -> "Any":
        """The value of a parameter. ParameterNotDeclaredError for an unknown one."""
        found = self.known.get(name)
        if found is None:
            borrow("muros.rclc.parameter_rules").unknown(self, name)
            return None
        return found.value

    def set(self, name: str, value: "Any") -> None:
        """Sets a parameter of ours, read-only or not; the type stays. A ParameterError says what stands against it."""
        self.update({name: value})

    def on_change(self, callback: "Callable[[Parameter | None, Parameter | None], object] | None") -> None:
        """Has ``callback(old, new)`` decide on each change: what it refuses, by a false value, does not happen.

        ``old`` is None for a parameter that somebody else adds, ``new`` for one that somebody else deletes. The
        callback may read parameters and change none.
        """
        self.changed = callback

    def _get(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").get(self, request)

    def _types(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").types(self, request)

    def _set(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").set_(self, request)

    def _set_atomically(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").set_atomically(self, request)

    def _list(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").list_(self, request)

    def _describe(self, request: "Any") -> "Any":
        return borrow("muros.rclc.parameter_answers").describe(self, request)
