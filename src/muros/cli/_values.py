"""Messages as text and back: YAML and CSV as `ros2 topic echo` writes them, YAML as `ros2 topic pub` reads it."""

from __future__ import annotations

from array import array
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from typing import Any, Final

import yaml

from muros import interfaces
from muros.cli._tool import CommandError
from muros.interfaces import FieldType, Kind, MessageBase

__all__ = [
    "Look",
    "Stamp",
    "fill",
    "hex_dump",
    "pick",
    "read_documents",
    "read_yaml",
    "to_csv",
    "to_plain",
    "to_yaml",
]

TRUNCATE_LENGTH: Final = 128
"""Elements of an array, or characters of a string, that are shown unless more are asked for."""

WIDTH: Final = 2**31 - 1
"""Columns of YAML: a string is never folded."""

HEADER: Final = "std_msgs/msg/Header"
TIME: Final = "builtin_interfaces/msg/Time"

_SEQUENCES: Final = (list, tuple, array, bytes, bytearray, memoryview)

Stamp = Callable[[int], None]
"""Sets a time of a message (ns since 1970) before it is sent."""

# The C loader and dumper are several times faster; they are there wherever PyYAML came as a wheel.
_Dumper: Any = getattr(yaml, "CSafeDumper", yaml.SafeDumper)
_Loader: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(frozen=True, slots=True)
class Look:
    """How much of a message is shown. `truncate` None means everything."""

    truncate: int | None = TRUNCATE_LENGTH
    no_arrays: bool = False
    no_strings: bool = False
    flow: bool = False


# ---- to text ----


def to_yaml(value: Any, look: Look) -> str:
    """A message (or a field of one) as YAML, ending with a line end."""
    return dump(to_plain(value, look), look.flow)


def dump(plain: Any, flow: bool = False) -> str:
    """Plain values as YAML in the layout of ROS 2."""
    text: str = yaml.dump(
        plain, Dumper=_Dumper, allow_unicode=True, width=WIDTH, default_flow_style=flow, sort_keys=False
    )
    return text.removesuffix("...\n")  # the end mark that YAML puts behind a bare value


def to_plain(value: Any, look: Look, kind: str = "") -> Any:
    """A message as dictionaries, lists, numbers and strings; `kind` is the field's type in IDL notation."""
    if isinstance(value, MessageBase):
        return {
            name: to_plain(getattr(value, slot), look, kind)
            for slot, (name, kind) in zip(value.__slots__, value._FIELDS.items(), strict=True)
        }
    if isinstance(value, str):
        if look.no_strings:
            return f"<string length: <{len(value)}>>"
        return value if _fits(value, look) else value[: look.truncate] + "..."
    if isinstance(value, _SEQUENCES):
        if look.no_arrays and kind:
            return _abbreviation(kind, len(value))
        shown = value if _fits(value, look) else value[: look.truncate]
        items = list(shown) if not isinstance(shown, list) else shown
        if items and isinstance(items[0], MessageBase | str):
            items = [to_plain(item, look) for item in items]
        return items if len(shown) == len(value) else [*items, "..."]
    return value


def to_csv(value: Any, look: Look, kind: str = "") -> str:
    """A message as values with commas between, all levels in one line."""
    if isinstance(value, MessageBase):
        fields = zip(value.__slots__, value._FIELDS.values(), strict=True)
        return ",".join(to_csv(getattr(value, slot), look, kind) for slot, kind in fields)
    if isinstance(value, _SEQUENCES):
        if look.no_arrays and kind:
            return _abbreviation(kind, len(value))
        shown = value if _fits(value, look) else value[: look.truncate]
        items = [to_csv(item, look) for item in shown]
        return ",".join(items if len(shown) == len(value) else [*items, "..."])
    return str(to_plain(value, look))


def pick(message: Any, path: str) -> Any:
    """The part of a message that `path` names, as `pose.position.x` or `ranges[3]`. CommandError if there is none."""
    value = message
    for step in path.replace("[", ".[").split("."):
        if not step:
            continue
        try:
            if step.startswith("["):
                value = value[int(step[1:].rstrip("]"))]
            else:
                value = getattr(value, _attribute(value, step))
        except (AttributeError, IndexError, TypeError, ValueError, KeyError):
            raise CommandError(f"--field {path}: {_no_step(value, step)}") from None
    return value


def _attribute(message: Any, field: str) -> str:
    """The Python attribute of a field. KeyError if the message has no such field."""
    return str(dict(zip(message._FIELDS, message.__slots__, strict=True))[field])


def hex_dump(data: bytes, most: int | None) -> str:
    """Bytes for reading: offset, 16 in hex, the same as text; at most `most` of them (None = all)."""
    shown = bytes(data if most is None else data[:most])
    lines = []
    for at in range(0, len(shown), 16):
        row = shown[at : at + 16]
        text = "".join(chr(b) if 32 <= b < 127 else "." for b in row)
        lines.append(f"{at:08x}  {row[:8].hex(' '):<23}  {row[8:].hex(' '):<23}  |{text}|\n")
    if len(shown) < len(data):
        lines.append(f"... {len(data)} bytes in all\n")
    return "".join(lines)


def _fits(value: Sequence[Any] | memoryview, look: Look) -> bool:
    return look.truncate is None or len(value) <= look.truncate


def _abbreviation(kind: str, count: int) -> str:
    """What stands for an array: "<sequence type: float, length: 360>", "<array type: double[9]>"."""
    if not kind.startswith("sequence<"):
        base, _, size = kind.rpartition("[")
        return f"<array type: {_full(base)}[{size}>"
    base, comma, bound = kind.removeprefix("sequence<").removesuffix(">").partition(", ")
    return f"<sequence type: {_full(base)}{f'[{bound}]' if comma else ''}, length: {count}>"


def _full(base: str) -> str:
    return base.replace("/", "/msg/") if base.count("/") == 1 else base


def _no_step(value: Any, step: str) -> str:
    if step.startswith("["):
        return f"there is no element {step}"
    if isinstance(value, MessageBase):
        return f"{value.TYPE} has no field {step!r}{_close(step, value._FIELDS)}"
    return f"there is no field {step!r} in {type(value).__name__}"


# ---- from text ----


def read_yaml(text: str) -> Any:
    """What YAML text says. CommandError with the place of the mistake if it is none."""
    documents = read_documents(text)
    if len(documents) > 1:
        raise CommandError("the values are several documents; a file with them is taken by --yaml-file")
    return documents[0] if documents else None


def read_documents(text: str) -> list[Any]:
    """What each document of YAML text says, empty ones left out. CommandError as for one."""
    try:
        return [values for values in yaml.load_all(text, Loader=_Loader) if values is not None]
    except yaml.YAMLError as error:
        mark = getattr(error, "problem_mark", None)
        place = f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        problem = getattr(error, "problem", None) or str(error).splitlines()[0]
        raise CommandError(f"the values are no YAML{place}: {problem}") from None
    except (ValueError, RecursionError) as error:  # a date such as 2026-13-45, or thousands of brackets
        raise CommandError(f"the values are no YAML: {str(error).splitlines()[0]}") from None


def fill(message: Any, values: Any) -> list[Stamp]:
    """Set the fields of a message to values as YAML has them; returns what sets its times at each sending.

    Fields are given by name, others keep their defaults. `auto` for a header and `now` for a time mean the time of
    sending. A message with one field takes its value without the name. CommandError tells which value does not fit.
    """
    stamps: list[Stamp] = []
    if values is None:
        return stamps
    fields = interfaces.registry().message(message.TYPE).fields
    if not isinstance(values, dict) and len(fields) == 1:
        values = {fields[0].name: values}
    _fill(message, values, "", stamps)
    return stamps


def _fill(message: Any, values: Any, path: str, stamps: list[Stamp]) -> None:
    if not isinstance(values, dict):
        where = f"field {path}" if path else "the values"
        raise CommandError(
            f"{where}: {message.TYPE} needs its fields by name, as in "
            f"'{{{', '.join(f'{name}: ...' for name in message._FIELDS)}}}'"
        )
    types = {f.name: f.type for f in interfaces.registry().message(message.TYPE).fields}
    for name, given in values.items():
        if name not in types:
            raise CommandError(f"{message.TYPE} has no field {str(name)!r}{_close(str(name), types)}")
        if given is None:
            continue
        attribute = _attribute(message, name)
        here = f"{path}.{name}" if path else str(name)
        setattr(message, attribute, _value(types[name], given, here, stamps))


def _value(kind: FieldType, given: Any, path: str, stamps: list[Stamp]) -> Any:
    if kind.kind is not Kind.ONE:
        return _values(kind, given, path, stamps)
    if kind.nested:
        made = interfaces.message(kind.base)()
        if given == "now" and kind.base == TIME:
            stamps.append(lambda now: _set_time(made, now))
        elif given == "auto" and kind.base == HEADER:
            stamps.append(lambda now: _set_time(made.stamp, now))
        else:
            _fill(made, given, path, stamps)
        return made
    return _scalar(kind, given, path)


def _values(kind: FieldType, given: Any, path: str, stamps: list[Stamp]) -> Any:
    one = FieldType(kind.base, kind.nested, string_bound=kind.string_bound)
    octets = kind.base in ("uint8", "byte", "char")
    if octets and isinstance(given, str):
        given = given.encode()
    if not isinstance(given, list | tuple | bytes) or (isinstance(given, bytes) and not octets):
        raise CommandError(f"field {path}: a list is needed for {kind}, not {_shown(given)}")
    if kind.kind is Kind.ARRAY and len(given) != kind.count:
        raise CommandError(f"field {path}: {len(given)} elements, {kind} has {kind.count}")
    if kind.kind is Kind.BOUNDED and len(given) > kind.count:
        raise CommandError(f"field {path}: {len(given)} elements, {kind} has room for {kind.count}")
    if isinstance(given, bytes):
        return given
    items = [_value(one, item, f"{path}[{at}]", stamps) for at, item in enumerate(given)]
    return bytes(items) if octets else items


def _scalar(kind: FieldType, given: Any, path: str) -> Any:
    """One number, string or truth value; YAML says 1e-3, .5 and 0x10 are strings, which are meant as numbers."""
    base = kind.base
    if isinstance(given, list | dict):
        raise CommandError(f"field {path}: one {base} is needed, not {_shown(given)}")
    if base in ("string", "wstring"):
        return given if isinstance(given, str) else _text(given)
    if isinstance(given, bytes) and len(given) == 1:
        given = given[0]
    try:
        if base == "bool":
            if given in (True, False, 0, 1):
                return bool(given)
        elif base in ("float32", "float64"):
            return float(given)
        else:
            number = int(given, 0) if isinstance(given, str) else given
            low, high = _RANGES[base]
            if number == int(number) and low <= number <= high:
                return int(number)
            if number == int(number):
                raise CommandError(f"field {path}: {number} is out of the range of {base}, {low} to {high}")
    except (TypeError, ValueError, OverflowError):
        pass
    raise CommandError(f"field {path}: {_shown(given)} is no {base}")


_RANGES: Final = {
    **{f"int{bits}": (-(1 << bits - 1), (1 << bits - 1) - 1) for bits in (8, 16, 32, 64)},
    **{f"uint{bits}": (0, (1 << bits) - 1) for bits in (8, 16, 32, 64)},
    "byte": (0, 255),
    "char": (0, 255),
}


def _text(given: Any) -> str:
    if isinstance(given, bool):
        return str(given).lower()
    return given.decode("utf-8", "replace") if isinstance(given, bytes) else str(given)


def _set_time(time: Any, now: int) -> None:
    time.sec, time.nanosec = divmod(now, 10**9)


def _shown(given: Any) -> str:
    text = repr(given)
    return text if len(text) <= 60 else text[:57] + "..."


def _close(name: str, known: Any) -> str:
    close = get_close_matches(name, list(known), 1)
    if close:
        return f" (did you mean {close[0]}?)"
    return f" (it has {', '.join(known)})" if 0 < len(known) <= 12 else ""
