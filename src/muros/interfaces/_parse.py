"""The parser of ``.msg``, ``.srv`` and ``.action`` files.

A definition is read line by line: a comment runs from ``#`` to the end of the line unless it stands inside quotes;
``type name`` is a field, ``type name value`` a field with a default, ``type NAME=value`` a constant; ``---`` parts
request from response, or goal, result and feedback. Definitions of ROS 1 are understood as well (``time``,
``duration``, ``Header``, unquoted string constants).

Whatever is wrong raises :class:`InterfaceError` of the form ``my_msgs/msg/Probe.msg:7: unknown type 'flaot32' (did
you mean float32?)``. Whether nested types exist is found out by the registry, which knows the other definitions.
"""

from __future__ import annotations

import re
from difflib import get_close_matches
from typing import NoReturn

from muros.interfaces._model import (
    PRIMITIVES,
    Action,
    Constant,
    Definition,
    Field,
    FieldType,
    InterfaceError,
    Kind,
    Message,
    Service,
    Value,
    make_action,
    make_service,
)
from muros.interfaces._names import split_type

MAX_TEXT = 1 << 20
"""Longest definition file that is read, in characters."""

MAX_ARRAY = 1 << 24
"""Most elements of a fixed array."""

_LINE = re.compile(
    r"(?P<base>[A-Za-z][\w/]*)\s*(?:<=\s*(?P<bound>\w+))?\s*(?P<array>\[[^\]]*\])?\s+(?P<name>\w+)\s*(?P<rest>.*)\Z",
    re.ASCII,
)
_NUMBER = re.compile(r"[0-9]{1,10}\Z")
_NAME = re.compile(r"[A-Za-z](?:_?[A-Za-z0-9])*\Z")
_ARRAY = re.compile(r"\[\s*(<=)?\s*(\w*)\s*\]\Z")
_NESTED = re.compile(r"(?:[a-z][a-z0-9_]*/(?:(?:msg|srv|action)/)?)?[A-Z][A-Za-z0-9_]*\Z")
_ESCAPE = re.compile(r"\\(.)")
_ROS1 = {
    "time": "builtin_interfaces/msg/Time",
    "duration": "builtin_interfaces/msg/Duration",
    "Header": "std_msgs/msg/Header",
}


def parse(text: str, name: str, origin: str = "") -> Definition:
    """The definition of the given full name (``package/msg/Type``; its kind says how the text is divided).

    ``origin`` names the file in errors. Raises :class:`InterfaceError`.
    """
    match split_type(name).kind:
        case "msg":
            return parse_message(text, name, origin)
        case "srv":
            return parse_service(text, name, origin)
        case _:
            return parse_action(text, name, origin)


def parse_message(text: str, name: str, origin: str = "") -> Message:
    """A message from the text of a ``.msg`` file. Raises :class:`InterfaceError`."""
    (section,) = _sections(text, origin or name, 1)
    return _message(section, name, origin, text)


def parse_service(text: str, name: str, origin: str = "") -> Service:
    """A service from the text of a ``.srv`` file. Raises :class:`InterfaceError`."""
    request, response = _sections(text, origin or name, 2)
    return make_service(
        name,
        _message(request, f"{name}_Request", origin),
        _message(response, f"{name}_Response", origin),
        text,
        origin,
    )


def parse_action(text: str, name: str, origin: str = "") -> Action:
    """An action from the text of a ``.action`` file. Raises :class:`InterfaceError`."""
    goal, result, feedback = _sections(text, origin or name, 3)
    return make_action(
        name,
        _message(goal, f"{name}_Goal", origin),
        _message(result, f"{name}_Result", origin),
        _message(feedback, f"{name}_Feedback", origin),
        text,
        origin,
    )


class _Line:
    """One line under the parser's finger: what is in it and where it stands."""

    def __init__(self, text: str, where: str) -> None:
        self.text = text
        self.where = where

    def fail(self, problem: str) -> NoReturn:
        raise InterfaceError(f"{self.where}: {problem}")


_Section = list[tuple[int, str]]


def _sections(text: str, where: str, count: int) -> list[_Section]:
    """The lines of each part with their numbers, parted at ``---``."""
    if len(text) > MAX_TEXT:
        raise InterfaceError(
            f"{where}: {len(text)} characters, more than the {MAX_TEXT} a definition may have"
        )
    sections: list[_Section] = [[]]
    for number, line in enumerate(text.lstrip("\ufeff").split("\n"), 1):
        if line.strip() == "---":
            sections.append([])
            if len(sections) > count:
                raise InterfaceError(f"{where}:{number}: one '---' too many, {count - 1} belong here")
        else:
            sections[-1].append((number, line))
    if len(sections) < count:
        missing = count - len(sections)
        raise InterfaceError(f"{where}: {missing} separator line{'s' * (missing > 1)} '---' missing")
    return sections


def _message(section: _Section, name: str, origin: str, text: str = "") -> Message:
    fields: list[Field] = []
    constants: list[Constant] = []
    taken: set[str] = set()
    for number, raw in section:
        line = _Line(_uncommented(raw).strip(), f"{origin or name}:{number}")
        if not line.text:
            continue
        match = _LINE.match(line.text)
        if not match:
            line.fail(
                f"cannot read {line.text!r}: write 'type name', 'type name default' or 'type NAME=value'"
            )
        field_name, rest = match["name"], match["rest"]
        if not _NAME.match(field_name):
            line.fail(f"bad name {field_name!r}: use letters, digits and single '_' between them")
        if field_name in taken:
            line.fail(f"{field_name!r} is defined twice")
        taken.add(field_name)
        field_type = _field_type(
            line, match["base"], match["bound"], match["array"], split_type(name).package
        )
        if rest.startswith("="):
            constants.append(_constant(line, field_type, field_name, rest[1:].strip(), raw))
        else:
            default = _default(line, field_type, rest) if rest else None
            fields.append(Field(field_name, field_type, default, number))
    return Message(name, tuple(fields), tuple(constants), text, origin)


def _uncommented(line: str) -> str:
    """The line without its comment; a ``#`` inside quotes belongs to the value."""
    if "#" not in line:
        return line
    quote = ""
    previous = ""
    for at, char in enumerate(line):
        if quote:
            if char == quote and previous != "\\":
                quote = ""
        elif char in "\"'" and (previous in "=[, \t") and previous:
            quote = char if line.find(char, at + 1) > 0 else ""
        elif char == "#":
            return line[:at]
        previous = char
    return line


def _field_type(line: _Line, base: str, bound: str | None, array: str | None, package: str) -> FieldType:
    nested = False
    if base in _ROS1:
        base, nested = _ROS1[base], True
    elif base not in PRIMITIVES:
        if not _NESTED.match(base):
            near = get_close_matches(base, [*PRIMITIVES, *_ROS1], 1)
            line.fail(f"unknown type {base!r}" + (f" (did you mean {near[0]}?)" if near else ""))
        base = "/".join(split_type(base if "/" in base else f"{package}/{base}"))
        nested = True
    string_bound = 0
    if bound is not None:
        if base not in ("string", "wstring"):
            line.fail(
                f"only strings are bounded by '<=' here; for a bounded sequence write {base}[<={bound}]"
            )
        string_bound = _positive(line, bound, "bound")
    if array is None:
        return FieldType(base, nested, Kind.ONE, 0, string_bound)
    match = _ARRAY.match(array)
    if not match or (match[1] and not match[2]):
        line.fail(f"cannot read {array!r}: write [], [5] or [<=5]")
    if not match[2]:
        return FieldType(base, nested, Kind.SEQUENCE, 0, string_bound)
    count = _positive(line, match[2], "size")
    if not match[1] and count > MAX_ARRAY:
        line.fail(f"an array of {count} elements: at most {MAX_ARRAY} are allowed; use a sequence")
    return FieldType(base, nested, Kind.BOUNDED if match[1] else Kind.ARRAY, count, string_bound)


def _positive(line: _Line, text: str, what: str) -> int:
    value = int(text) if _NUMBER.match(text) else 0
    if not 0 < value < 1 << 32:
        line.fail(f"bad {what} {text!r}: it must be a number from 1 to 4294967295")
    return value


def _constant(line: _Line, field_type: FieldType, name: str, text: str, raw: str) -> Constant:
    if field_type.nested or field_type.kind is not Kind.ONE:
        line.fail(f"constant {name!r} of type {field_type}: constants are of primitive types")
    if field_type.base == "string" and text[:1] not in ('"', "'"):
        text = raw.partition("=")[
            2
        ].strip()  # unquoted strings of ROS 1 run to the end of the line, '#' included
        return Constant(name, field_type.base, text, text)
    if not text:
        line.fail(f"constant {name!r} has no value")
    value = _scalar(line, field_type, text)
    return Constant(name, field_type.base, value, text)


def _default(line: _Line, field_type: FieldType, text: str) -> Value:
    if field_type.nested:
        line.fail(f"unexpected {text!r}: a field of type {field_type} has no default")
    if field_type.kind is Kind.ONE:
        return _scalar(line, field_type, text)
    if not (text.startswith("[") and text.endswith("]")):
        line.fail(f"default {text!r} of {field_type}: write [value, value]")
    values = [_scalar(line, field_type, item) for item in _items(line, text[1:-1])]
    if field_type.kind is Kind.ARRAY and len(values) != field_type.count:
        line.fail(f"default of {field_type} has {len(values)} values, {field_type.count} needed")
    if field_type.kind is Kind.BOUNDED and len(values) > field_type.count:
        line.fail(f"default of {field_type} has {len(values)} values, at most {field_type.count} allowed")
    return values  # type: ignore[return-value]


def _items(line: _Line, text: str) -> list[str]:
    """The comma-separated items of an array default; commas inside quotes belong to the item."""
    items, quote, start = [], "", 0
    for at, char in enumerate(text):
        if quote:
            quote = "" if char == quote and text[at - 1] != "\\" else quote
        elif char in "\"'":
            quote = char
        elif char == ",":
            items.append(text[start:at].strip())
            start = at + 1
    if quote:
        line.fail(f"a quote {quote} is never closed")
    last = text[start:].strip()
    if last or items:
        items.append(last)
    return items


def _scalar(line: _Line, field_type: FieldType, text: str) -> bool | int | float | str:
    base = field_type.base
    kind = PRIMITIVES[base]
    if not kind.size:
        value = _string(line, text)
        if field_type.string_bound and len(value) > field_type.string_bound:
            line.fail(
                f"{text} is longer than the {field_type.string_bound} characters of {base}<={field_type.string_bound}"
            )
        return value
    if base == "bool":
        if text.lower() not in ("true", "false", "1", "0"):
            line.fail(f"{text!r} is no bool: write true or false")
        return text.lower() in ("true", "1")
    try:
        if not kind.high:
            return float(text)
        number = int(text, 0)
    except ValueError:
        line.fail(f"{text!r} is no {base}")
    if not kind.low <= number <= kind.high:
        line.fail(f"{number} does not fit {base} ({kind.low} to {kind.high})")
    return number


def _string(line: _Line, text: str) -> str:
    quote = text[:1]
    if quote not in ('"', "'"):
        return text
    if len(text) < 2 or text[-1] != quote:
        line.fail(f"the string {text} is not closed by {quote}")
    inner = text[1:-1]
    if re.search(r"(?<!\\)(?:\\\\)*" + quote, inner):
        line.fail(f"a {quote} inside the string {text}: write \\{quote}")
    return _ESCAPE.sub(lambda m: {"n": "\n", "t": "\t", "r": "\r"}.get(m[1], m[1]), inner)
