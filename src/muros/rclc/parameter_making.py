"""How parameters are made, described, listed and taken away. Boards borrow this."""

from muros.compat import borrow, const
from muros.rclc.parameter_rules import busy, tell, unknown, within
from muros.rclc.parameter_values import TYPES, is_type, kept, kind_of
from muros.rclc.parameters import Parameter

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from collections.abc import Callable, Iterable
    from typing import Any

    from muros.rclc.context import Node
    from muros.rclc.memory import Rules
    from muros.rclc.parameters import Parameters

_INTEGER = const(2)
_DOUBLE = const(3)
_BYTES = const(5)


def begin(
    self: "Parameters",
    node: "Node",
    max: int,
    notify: bool,
    undeclared: bool,
    low_memory: bool,
    longest: int,
    kind: "Callable[[str], Any] | None",
    clock: "Callable[[], int] | None",
    memory: "Rules | None" = None,
) -> None:
    """Sets them up; arguments as for ``Node.parameters``. What cannot be made leaves nothing behind."""
    self.node = node
    self.full_name = (node.namespace if node.namespace != "/" else "") + "/" + node.name
    self.max = max
    self.longest = longest
    self.undeclared = undeclared
    self.low_memory = low_memory
    self.known = {}
    self.handles = []
    self.kind = find if kind is None else kind
    self.clock = clock
    services = (
        ("GetParameters", "get_parameters", self._get),
        ("GetParameterTypes", "get_parameter_types", self._types),
        ("SetParameters", "set_parameters", self._set),
        ("SetParametersAtomically", "set_parameters_atomically", self._set_atomically),
        ("ListParameters", "list_parameters", self._list),
        ("DescribeParameters", "describe_parameters", self._describe),
    )
    kinds = [self.kind("srv/" + name) for name, _, _ in services]
    bounds: "list[Rules | None]" = [None] * len(kinds)
    if memory is not None:
        requests = [kind.Request for kind in kinds]
        bounds = borrow("muros.rclc.memory_plan").divide(memory, "a server of parameters", requests)
    try:
        for i in range(len(kinds)):
            _, suffix, answer = services[i]
            made = node.service(kinds[i], "~/" + suffix, answer, "parameters", bounds[i])
            self.handles.append(made)
        if notify:
            self.events = node.publisher(self.kind("msg/ParameterEvent"), "/parameter_events", "parameters")
    except Exception:
        destroy(self)
        raise


def find(name: str) -> "Any":
    """A type of rcl_interfaces, where they are modules."""
    package, short = name.split("/")
    return getattr(__import__("rcl_interfaces." + package, None, None, (short,)), short)


def declare(
    self: "Parameters",
    name: str,
    value: "Any",
    range: "tuple[Any, ...] | None" = None,
    description: str = "",
    constraints: str = "",
    read_only: bool = False,
    type: int = 0,
) -> "Any":
    """Declares a parameter and gives its value back. ``type`` says of an empty list what it is a list of.

    ``range`` is (least, largest) or (least, largest, step), of integers for an int and of numbers for a float.
    ``constraints`` are further words for people. ``read_only`` keeps others from setting it.

    Raises ParameterError for a name that is taken, CapacityError beyond ``max``, InvalidParameterError for what can be
    no parameter, ParameterRejectedError for a value out of range, ParameterMemoryError for words in the low-memory
    profile.
    """
    from muros.rclc.parameter_errors import InvalidParameterError, ParameterError, ParameterRejectedError

    busy(self)
    if not isinstance(name, str) or not name:
        raise InvalidParameterError("the name of a parameter is a text, not %r" % (name,))
    _be_short(self, name, "the name of a parameter")
    if name in self.known:
        raise ParameterError("%s has a parameter %r already" % (self.full_name, name))
    if self.max and len(self.known) >= self.max:
        from muros.rclc.errors import CapacityError

        raise CapacityError(
            "%s is full: %d parameters. Make room with node.parameters(max=%d)."
            % (self.full_name, self.max, self.max + 1)
        )
    kind = kind_of(value, type) or (type if type == _BYTES and value == [] else 0)
    if kind == 0 or not is_type(type) or (type and kind != type):
        raise InvalidParameterError(
            "parameter %r cannot be %r: a value is a bool, int, float, str, bytes, or a list of one of these; "
            "say with type= what an empty list is" % (name, value)
        )
    made = Parameter(name, kind, kept(kind, value))
    if read_only:
        made.read_only = True
    if range is not None:
        made.range = _range(made, range)
        if not within(made, value):
            raise ParameterRejectedError(
                "parameter %r cannot be %r: that is not in its range %r" % (name, value, made.range)
            )
    _describe(self, made, description, constraints)
    self.known[name] = made
    if self.node.context.state == "CONNECTED":  # before, there is nobody who could hear of it
        tell(self, [[made], [], []])
    return made.value


def undeclare(self: "Parameters", name: str) -> None:
    """Takes a parameter away; nobody is asked. ParameterNotDeclaredError for an unknown one."""
    busy(self)
    found = self.known.get(name)
    if found is None:
        unknown(self, name)
        return
    del self.known[name]
    tell(self, [[], [], [found]])


def constrain(
    self: "Parameters",
    name: str,
    range: "tuple[Any, ...] | None" = None,
    description: "str | None" = None,
    constraints: "str | None" = None,
    read_only: "bool | None" = None,
) -> None:
    """Says more of a declared parameter; arguments and errors as for ``declare``, None leaves a thing as it is."""
    busy(self)
    found = self.known.get(name)
    if found is None:
        unknown(self, name)
        return
    if range is not None:
        found.range = _range(found, range)
    if read_only is not None:
        found.read_only = read_only
    _describe(
        self,
        found,
        found.description if description is None else description,
        found.constraints if constraints is None else constraints,
    )


def describe(self: "Parameters", name: str) -> "Parameter":
    """All that is known of a parameter. ParameterNotDeclaredError for an unknown one."""
    if name not in self.known:
        unknown(self, name)
    return self.known[name]


def list_(self: "Parameters", prefixes: "Iterable[str]" = (), depth: int = 0) -> "list[str]":
    """The names of all parameters, sorted: those that are a prefix or lie below one, as deep as ``depth`` dots.

    Names below a prefix are counted from it. ``depth`` 0 goes all the way down.
    """
    prefixes = list(prefixes)
    return [name for name in sorted(self.known) if _listed(name, prefixes, depth)]


def destroy(self: "Parameters") -> None:
    """Takes the services and the publisher away."""
    made = list(self.handles)
    if self.events is not None:
        made.append(self.events)  # type: ignore[arg-type]
    for entity in made:
        if entity in self.node.entities:
            self.node.entities.remove(entity)
        entity.destroy()
    self.handles = []
    self.events = None


def _listed(name: str, prefixes: "list[str]", depth: int) -> bool:
    if not prefixes:
        return depth == 0 or name.count(".") < depth
    for prefix in prefixes:
        if name == prefix:
            return True
        below = name.startswith(prefix + ".")
        if below and (depth == 0 or name[len(prefix) + 1 :].count(".") < depth):
            return True
    return False


def _range(parameter: "Parameter", range: "tuple[Any, ...]") -> "tuple[Any, Any, Any]":
    """A range with its step, in numbers of the parameter's type."""
    from muros.rclc.parameter_errors import InvalidParameterError

    kinds = [kind_of(number) for number in range]
    fits = {_INTEGER: (_INTEGER,), _DOUBLE: (_INTEGER, _DOUBLE)}.get(parameter.type, ())
    if len(kinds) not in (2, 3) or [kind for kind in kinds if kind not in fits]:
        raise InvalidParameterError(
            "parameter %r is of type %s, which has no range %r: give (least, largest) or (least, largest, step)"
            % (parameter.name, TYPES[parameter.type], range)
        )
    least, largest = range[:2]
    step = range[2] if len(range) == 3 else 0
    if not least <= largest or not step >= 0 or (step and least - least != 0):
        raise InvalidParameterError(
            "the range %r of parameter %r goes backwards, or its steps begin nowhere"
            % (range, parameter.name)
        )
    if parameter.type == _DOUBLE:
        return float(least), float(largest), float(step)
    return least, largest, step


def _describe(self: "Parameters", parameter: "Parameter", description: str, constraints: str) -> None:
    """Keeps words for people. ParameterMemoryError in the low-memory profile."""
    if (description or constraints) and self.low_memory:
        from muros.rclc.parameter_errors import ParameterMemoryError

        raise ParameterMemoryError(
            "parameter %r is not described: there are no descriptions with low_memory" % parameter.name
        )
    for text in (description, constraints):
        _be_short(self, text, "what is said of a parameter")
    if description != parameter.description:
        parameter.description = description
    if constraints != parameter.constraints:
        parameter.constraints = constraints


def _be_short(self: "Parameters", text: str, what: str) -> None:
    if self.longest and len(text) > self.longest:
        from muros.rclc.parameter_errors import ParameterError

        raise ParameterError(
            "%r is too long: %s has at most %d characters, see node.parameters(longest=)"
            % (text, what, self.longest)
        )
