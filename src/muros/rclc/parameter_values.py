"""Values of parameters: their types, and how they lie in messages. Boards borrow this.

Types are the numbers of rcl_interfaces/msg/ParameterType.
"""

from muros.compat import const

TYPE_CHECKING = const(0)
if TYPE_CHECKING:
    from typing import Any

    from muros.rclc.parameters import Parameter

_BOOL = const(1)
_INTEGER = const(2)
_DOUBLE = const(3)
_STRING = const(4)
_BYTES = const(5)
_LAST = const(9)

TYPES = (
    "not set",
    "boolean",
    "integer",
    "double",
    "string",
    "byte array",
    "boolean array",
    "integer array",
    "double array",
    "string array",
)
"""What the command line of ROS 2 calls them."""

FIELDS = (
    "",
    "bool_value",
    "integer_value",
    "double_value",
    "string_value",
    "byte_array_value",
    "bool_array_value",
    "integer_array_value",
    "double_array_value",
    "string_array_value",
)
"""Where a value of each type lies in rcl_interfaces/msg/ParameterValue."""


def kind_of(value: "Any", known: int = 0) -> int:
    """The type of a value, 0 if it can be none. An empty list has the type ``known``, if that is one of lists."""
    if not isinstance(value, (list, tuple)):
        return _plain(value)
    if not value:
        return known if known > _BYTES else 0
    kind = _plain(value[0])
    for item in value:
        if _plain(item) != kind:
            return 0
    return kind + _BYTES if 0 < kind <= _STRING else 0


def kept(kind: int, value: "Any") -> "Any":
    """A value as it is kept: a list, or bytes, of its own."""
    return list(value) if kind > _BYTES else bytes(value) if kind == _BYTES else value


def put(message: "Any", kind: int, value: "Any") -> "Any":
    """Puts a value into a ParameterValue and gives that back."""
    message.type = kind
    if kind:
        setattr(message, FIELDS[kind], value)
    return message


def take(message: "Any") -> "Any":
    """The value in a ParameterValue; None if it has none, or one of an unknown type."""
    kind = message.type
    return kept(kind, getattr(message, FIELDS[kind])) if 0 < kind <= _LAST else None


def is_type(kind: int) -> bool:
    """Whether there is such a type, or it stands for none."""
    return 0 <= kind <= _LAST


def descriptor(message: "Any", parameter: "Parameter", step: "Any") -> "Any":
    """Puts what a parameter is into a ParameterDescriptor; ``step`` is the range's message, if there is one."""
    message.name = parameter.name
    message.type = parameter.type
    message.description = parameter.description
    message.additional_constraints = parameter.constraints
    message.read_only = parameter.read_only
    if parameter.range is not None:
        step.from_value, step.to_value, step.step = parameter.range
        if parameter.type == _DOUBLE:
            message.floating_point_range = [step]
        else:
            message.integer_range = [step]
    return message


def described(message: "Any") -> "Parameter":
    """What a ParameterDescriptor says; the value is not known."""
    from muros.rclc.parameters import Parameter

    made = Parameter(message.name, message.type, None)
    made.description = message.description
    made.constraints = message.additional_constraints
    made.read_only = message.read_only
    for step in list(message.floating_point_range) + list(message.integer_range):
        made.range = (step.from_value, step.to_value, step.step)
    return made


def _plain(value: "Any") -> int:
    """The type of what is no list."""
    if isinstance(value, bool):
        return _BOOL
    if isinstance(value, int):
        return _INTEGER if -(1 << 63) <= value < 1 << 63 else 0
    if isinstance(value, float):
        return _DOUBLE
    if isinstance(value, str):
        return _STRING
    return _BYTES if isinstance(value, (bytes, bytearray)) else 0
