"""The type model: what a ``.msg``, ``.srv`` or ``.action`` definition says, free of any notation or codec."""

from __future__ import annotations

import keyword
from collections.abc import Iterator
from dataclasses import dataclass, field
from enum import Enum
from typing import NamedTuple

Value = bool | int | float | str | list[bool] | list[int] | list[float] | list[str]
"""A constant's or default's value."""


class InterfaceError(ValueError):
    """A definition is missing or wrong; the message says where and what to do.

    The only exception this package raises for a bad name, an unknown type or a bad line in a definition file.
    """


class Kind(Enum):
    """How often a field's element occurs."""

    ONE = "one"
    ARRAY = "array"  # exactly `count` elements
    BOUNDED = "bounded"  # at most `count` elements
    SEQUENCE = "sequence"  # any number


class Primitive(NamedTuple):
    """One primitive type of the ROS interface language."""

    code: str  # `struct` and `array` type code, "" for strings
    size: int  # bytes on the wire, 0 for strings
    type_id: int  # type_description_interfaces/msg/FieldType, scalar
    idl: str  # name in get_fields_and_field_types
    low: int = 0  # range of integers
    high: int = 0


PRIMITIVES: dict[str, Primitive] = {
    "bool": Primitive("?", 1, 15, "boolean", 0, 1),
    "byte": Primitive("B", 1, 16, "octet", 0, 255),
    "char": Primitive("B", 1, 3, "uint8", 0, 255),  # ROS 2 maps char of a .msg to uint8
    "int8": Primitive("b", 1, 2, "int8", -(1 << 7), (1 << 7) - 1),
    "uint8": Primitive("B", 1, 3, "uint8", 0, (1 << 8) - 1),
    "int16": Primitive("h", 2, 4, "int16", -(1 << 15), (1 << 15) - 1),
    "uint16": Primitive("H", 2, 5, "uint16", 0, (1 << 16) - 1),
    "int32": Primitive("i", 4, 6, "int32", -(1 << 31), (1 << 31) - 1),
    "uint32": Primitive("I", 4, 7, "uint32", 0, (1 << 32) - 1),
    "int64": Primitive("q", 8, 8, "int64", -(1 << 63), (1 << 63) - 1),
    "uint64": Primitive("Q", 8, 9, "uint64", 0, (1 << 64) - 1),
    "float32": Primitive("f", 4, 10, "float"),
    "float64": Primitive("d", 8, 11, "double"),
    "string": Primitive("", 0, 17, "string"),
    "wstring": Primitive("", 0, 18, "wstring"),
}

DUMMY_FIELD = "structure_needs_at_least_one_member"
"""The uint8 that ROS 2 puts into a message without fields, since IDL allows no empty struct."""

RESERVED = frozenset(
    {"TYPE", "deserialize", "get_fields_and_field_types", "read", "self", "serialize", "size", "write"}
)
"""Names that generated classes need for themselves."""


def attribute(name: str) -> str:
    """The Python attribute of a field or constant: its name, with ``_`` behind if Python or muros needs it."""
    return name + "_" if keyword.iskeyword(name) or name in RESERVED else name


@dataclass(frozen=True, slots=True)
class FieldType:
    """The type of one field. ``base`` is a primitive's name or the full name of a message (``nested``)."""

    base: str
    nested: bool = False
    kind: Kind = Kind.ONE
    count: int = 0  # elements of an array, upper bound of a bounded sequence
    string_bound: int = 0  # longest string in characters, 0: unbounded

    def __str__(self) -> str:
        """In the notation of a ``.msg`` file, nested types as ``package/Type``."""
        base = self.base.replace("/msg/", "/") if self.nested else self.base
        return base + (f"<={self.string_bound}" if self.string_bound else "") + self.suffix()

    def suffix(self) -> str:
        """The array part in the notation of a ``.msg`` file."""
        sizes = {Kind.ONE: "", Kind.ARRAY: f"[{self.count}]", Kind.BOUNDED: f"[<={self.count}]"}
        return sizes.get(self.kind, "[]")


@dataclass(frozen=True, slots=True)
class Field:
    """One field of a message; ``line`` counts from 1 in the file the message came from, 0 if there is none."""

    name: str
    type: FieldType
    default: Value | None = None
    line: int = 0


@dataclass(frozen=True, slots=True)
class Constant:
    """One constant of a message; ``text`` is its value as written, which the ROS 1 md5 sum covers."""

    name: str
    base: str
    value: bool | int | float | str
    text: str


@dataclass(frozen=True, slots=True)
class Message:
    """A message definition; ``name`` is full (``package/msg/Type``), ``origin`` is the file it was read from."""

    name: str
    fields: tuple[Field, ...]
    constants: tuple[Constant, ...] = ()
    text: str = field(default="", compare=False, repr=False)
    origin: str = field(default="", compare=False)

    @property
    def package(self) -> str:
        return self.name.partition("/")[0]

    def messages(self) -> Iterator[Message]:
        """This message itself; services and actions yield all of their messages."""
        yield self


@dataclass(frozen=True, slots=True)
class Service:
    """A service definition with the event message that ROS 2 derives from it."""

    name: str
    request: Message
    response: Message
    event: Message
    text: str = field(default="", compare=False, repr=False)
    origin: str = field(default="", compare=False)

    def messages(self) -> Iterator[Message]:
        yield from (self.request, self.response, self.event)


@dataclass(frozen=True, slots=True)
class Action:
    """An action definition with the two services and the message that ROS 2 derives from it."""

    name: str
    goal: Message
    result: Message
    feedback: Message
    send_goal: Service
    get_result: Service
    feedback_message: Message
    text: str = field(default="", compare=False, repr=False)
    origin: str = field(default="", compare=False)

    def messages(self) -> Iterator[Message]:
        yield from (self.goal, self.result, self.feedback)
        yield from self.send_goal.messages()
        yield from self.get_result.messages()
        yield self.feedback_message


Definition = Message | Service | Action


def make_service(name: str, request: Message, response: Message, text: str = "", origin: str = "") -> Service:
    """The service of a request and a response, its ``_Event`` message included."""
    event = Message(
        f"{name}_Event",
        (
            Field("info", _nested("service_msgs/msg/ServiceEventInfo")),
            Field("request", FieldType(request.name, True, Kind.BOUNDED, 1)),
            Field("response", FieldType(response.name, True, Kind.BOUNDED, 1)),
        ),
        origin=origin,
    )
    return Service(name, request, response, event, text, origin)


def make_action(
    name: str, goal: Message, result: Message, feedback: Message, text: str = "", origin: str = ""
) -> Action:
    """The action of a goal, a result and a feedback, with the services and the message derived from them."""
    goal_id = Field("goal_id", _nested("unique_identifier_msgs/msg/UUID"))
    stamp = Field("stamp", _nested("builtin_interfaces/msg/Time"))
    sent, got = f"{name}_SendGoal", f"{name}_GetResult"

    def message(full: str, *fields: Field) -> Message:
        return Message(full, fields, origin=origin)

    send_goal = make_service(
        sent,
        message(f"{sent}_Request", goal_id, Field("goal", _nested(goal.name))),
        message(f"{sent}_Response", Field("accepted", FieldType("bool")), stamp),
        origin=origin,
    )
    get_result = make_service(
        got,
        message(f"{got}_Request", goal_id),
        message(f"{got}_Response", Field("status", FieldType("int8")), Field("result", _nested(result.name))),
        origin=origin,
    )
    feedback_message = message(f"{name}_FeedbackMessage", goal_id, Field("feedback", _nested(feedback.name)))
    return Action(name, goal, result, feedback, send_goal, get_result, feedback_message, text, origin)


def _nested(name: str) -> FieldType:
    return FieldType(name, nested=True)
