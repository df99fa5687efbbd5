"""ROS 1 message classes for programs that play a board, on hosts made at run time, for boards written as files.

A class has the fields that ROS 1 defines, ``seq`` of headers among them; a ``time`` or ``duration`` is a tuple of
seconds and nanoseconds; an array of ``uint8`` or ``char`` is bytes. It has ``TYPE``, ``MD5``, ``size()``,
``write(buf, off)`` and ``read(buf, off, end)``, as :mod:`muros.rosserial.node_handle` wants them.
"""

from __future__ import annotations

import linecache
import os
from collections.abc import Iterable, Iterator
from itertools import groupby
from pathlib import Path
from threading import RLock
from typing import Any, ClassVar, NamedTuple

from muros.interfaces import (
    InterfaceError,
    Kind,
    known,
    registry,
    ros1_definition,
    ros1_name,
    ros2_message,
    ros2_service,
)
from muros.interfaces import Message as Definition
from muros.interfaces._model import PRIMITIVES, attribute

__all__ = ["BOARD_PACKAGE", "Service", "message", "service", "write"]

BOARD_PACKAGE = "ros1"
"""The package that :func:`write` makes: programs say ``from ros1.std_msgs import String``."""

_lock = RLock()
_made: dict[tuple[int, str], type[Any]] = {}


class Service:
    """The base of services."""

    TYPE: ClassVar[str]
    Request: ClassVar[type[Any]]
    Response: ClassVar[type[Any]]


def message(ros1_type: str) -> type[Any]:
    """The class of a message, ``std_msgs/String``, or of half a service; always the same one.

    Raises :class:`muros.interfaces.InterfaceError` if there is no such type.
    """
    key = _key(ros1_type)
    with _lock:
        if key not in _made:
            source = _source(ros1_type)
            space: dict[str, Any] = {"__name__": f"{BOARD_PACKAGE}.{ros1_type.partition('/')[0]}"}
            for nested in source.nested:
                space[_reference(nested, ros1_type)] = message(nested)
            text = _IMPORTS + source.text
            filename = f"<muros ROS 1 {ros1_type}>"
            linecache.cache[filename] = (len(text), None, text.splitlines(keepends=True), filename)
            exec(compile(text, filename, "exec", dont_inherit=True), space)
            _made[key] = space[_short(ros1_type)]
        return _made[key]


def service(ros1_type: str) -> type[Service]:
    """The class of a service, ``std_srvs/SetBool``, with ``.Request`` and ``.Response``; always the same one."""
    key = _key(f"{ros1_type} service")
    with _lock:
        if key not in _made:
            halves = {half: message(f"{ros1_type}_{half}") for half in _HALVES}
            _made[key] = type(ros1_type.rpartition("/")[2], (Service,), {"TYPE": ros1_type, **halves})
        return _made[key]


def write(ros1_types: Iterable[str], folder: str | os.PathLike[str]) -> list[Path]:
    """Writes a package ``ros1`` with the classes of messages and services for a board; returns the files, sorted.

    A type is in the module of its package: ``from ros1.std_msgs import String``. Raises InterfaceError, OSError.
    """
    modules: dict[str, _Module] = {}
    for name in ros1_types:
        _add(name, modules)
    root = Path(folder) / BOARD_PACKAGE
    root.mkdir(parents=True, exist_ok=True)
    written = [root / "__init__.py"]
    written[0].write_text('"""ROS 1 messages."""\n', encoding="utf-8")
    for package, module in modules.items():
        path = root / f"{package}.py"
        path.write_text(module.text(package), encoding="utf-8")
        written.append(path)
    return sorted(written)


def _key(name: str) -> tuple[int, str]:
    """What is made once is made anew when the user's folders change."""
    return hash(frozenset(registry().user_files().items())), name


# ---- one class ----


class _Source(NamedTuple):
    text: str
    nested: tuple[str, ...]


_IMPORTS = """\
from struct import pack_into, unpack_from
from muros.rosserial.fields import Message, exactly, need, read_count, read_text, text_size, write_count, write_text
"""
_TIMES = {"builtin_interfaces/msg/Time": "II", "builtin_interfaces/msg/Duration": "ii"}
_HALVES = ("Request", "Response")


class _Field(NamedTuple):
    """A field as the generator sees it."""

    name: str
    code: str  # `struct` codes of one element, "" for texts and messages
    size: int  # bytes of one element, 0 if they differ
    nested: str  # the type of a message
    refer: str  # what its class is called
    length: int  # elements of an array, 0: any number, -1: no array
    true: bool  # of bools

    @property
    def numbers(self) -> bool:
        return bool(self.code) and len(self.code) == 1


def _source(ros1_type: str) -> _Source:
    """The source of a class; nested messages are known by their identifiers."""
    definition, md5 = ros1_definition(ros1_type)
    fields = _fields(definition, ros1_type)
    nested = tuple(dict.fromkeys(field.nested for field in fields if field.nested))
    name = _short(ros1_type)
    lines = [f"class {name}(Message):", f'    """{ros1_type}"""', ""]
    lines += [f'    TYPE = "{ros1_type}"', f'    MD5 = "{md5}"']
    lines += [f"    {attribute(c.name)} = {c.value!r}" for c in definition.constants]
    lines += ["", *_init(fields), "", *_size(fields), "", *_write(fields), "", *_read(fields)]
    return _Source("\n".join(lines) + "\n", nested)


def _fields(definition: Definition, ros1_type: str) -> list[_Field]:
    found = []
    for field in definition.fields:
        kind = field.type
        count = {Kind.ONE: -1, Kind.ARRAY: kind.count}.get(kind.kind, 0)
        name, nested, refer, code, size = attribute(field.name), "", "", "", 0
        if kind.base in _TIMES:
            code, size = _TIMES[kind.base], 8
        elif kind.nested:
            nested = ros1_name(kind.base)
            refer = _reference(nested, ros1_type)
        elif kind.base == "wstring":
            raise InterfaceError(f"{definition.name}.{field.name}: ROS 1 has no wstring")
        else:
            primitive = PRIMITIVES[kind.base]
            code, size = primitive.code.replace("?", "B"), primitive.size
            if kind.base == "byte":
                code = "b"
        found.append(_Field(name, code, size, nested, refer, count, kind.base == "bool"))
    return found


def _default(field: _Field) -> tuple[str, str]:
    """The default of an argument, and what stands for None."""
    if field.length < 0:
        if field.nested:
            return "None", f"{field.refer}()"
        if not field.code:
            return '""', ""
        if not field.numbers:
            return "(0, 0)", ""
        return ("False" if field.true else "0.0" if field.code in "fd" else "0"), ""
    if field.code == "B" and not field.true:
        return (f"bytes({field.length})" if field.length else 'b""'), ""
    if not field.length:
        return "None", "[]"
    if field.nested:
        return "None", f"[{field.refer}() for _ in range({field.length})]"
    one = _default(field._replace(length=-1))[0]
    return "None", f"[{one}] * {field.length}"


def _init(fields: list[_Field]) -> list[str]:
    arguments, lines = ["self"], []
    for field in fields:
        default, make = _default(field)
        arguments.append(f"{field.name}={default}")
        value = f"{make} if {field.name} is None else {field.name}" if make else field.name
        lines.append(f"        self.{field.name} = {value}")
    return [f"    def __init__({', '.join(arguments)}):", *(lines or ["        pass"])]


def _size(fields: list[_Field]) -> list[str]:
    const, terms, lines = 0, [], []
    for field in fields:
        value = f"self.{field.name}"
        if field.length < 0:
            if field.code:
                const += field.size
            else:
                terms.append(f"{value}.size()" if field.nested else f"text_size({value})")
            continue
        const += 0 if field.length else 4
        if field.code:
            if field.length:
                const += field.size * field.length
            else:
                terms.append(f"{field.size} * len({value})" if field.size > 1 else f"len({value})")
            continue
        lines += [
            f"        for e in {value}:",
            f"            n += {'e.size()' if field.nested else 'text_size(e)'}",
        ]
    total = " + ".join([str(const), *terms])
    if not lines:
        return ["    def size(self):", f"        return {total}"]
    return ["    def size(self):", f"        n = {total}", *lines, "        return n"]


def _pieces(fields: list[_Field]) -> Iterator[list[_Field]]:
    """The fields in order: those in a row that are numbers, times and the like together, any other alone."""
    for in_row, found in groupby(fields, lambda field: field.length < 0 and bool(field.code)):
        if in_row:
            yield list(found)
        else:
            yield from ([field] for field in found)


def _write(fields: list[_Field]) -> list[str]:
    lines = ["    def write(self, buf, off):"]
    for piece in _pieces(fields):
        field = piece[0]
        value = f"self.{field.name}"
        if field.length < 0 and field.code:
            codes = "".join(each.code for each in piece)
            values = ", ".join(_value(each, f"self.{each.name}") for each in piece)
            lines.append(f'        pack_into("<{codes}", buf, off, {values})')
            lines.append(f"        off += {sum(each.size for each in piece)}")
            continue
        if field.length < 0:
            lines.append(
                f"        off = {value}.write(buf, off)" if field.nested else _WRITE_TEXT.format(value)
            )
            continue
        lines.append(
            f"        v = exactly({value}, {field.length})" if field.length else f"        v = {value}"
        )
        if not field.length:
            lines.append("        off = write_count(buf, off, len(v))")
        if field.code == "B" and not field.true:
            lines += ["        n = len(v)", "        buf[off : off + n] = bytes(v)", "        off += n"]
        elif field.numbers and not field.true:
            codes = f'"<{field.length}{field.code}"' if field.length else f'"<%d{field.code}" % len(v)'
            lines.append(f"        pack_into({codes}, buf, off, *v)")
            lines.append(f"        off += {field.size} * len(v)")
        else:
            lines.append("        for e in v:")
            if field.code:
                lines.append(f'            pack_into("<{field.code}", buf, off, {_value(field, "e")})')
                lines.append(f"            off += {field.size}")
            else:
                lines.append(
                    "            off = e.write(buf, off)"
                    if field.nested
                    else "            off = write_text(buf, off, e)"
                )
    return [*lines, "        return off"]


_WRITE_TEXT = "        off = write_text(buf, off, {})"


def _value(field: _Field, value: str) -> str:
    if field.true:
        return f"1 if {value} else 0"
    return value if field.numbers else f"{value}[0], {value}[1]"


def _read(fields: list[_Field]) -> list[str]:
    lines = ["    def read(self, buf, off, end):"]
    for piece in _pieces(fields):
        field = piece[0]
        value = f"self.{field.name}"
        if field.length < 0 and field.code:
            lines += _read_row(piece)
            continue
        if field.length < 0:
            lines.append(
                f"        off = {value}.read(buf, off, end)"
                if field.nested
                else f"        {value}, off = read_text(buf, off, end)"
            )
            continue
        least = field.size or (0 if field.nested else 4)
        if field.length:
            count = str(field.length)
            lines.append(f"        need(off, {least * field.length}, end)")
        else:
            count = "n"
            lines.append(f"        n, off = read_count(buf, off, end, {max(least, 1)})")
        if field.code == "B" and not field.true:
            lines += [f"        {value} = bytes(buf[off : off + {count}])", f"        off += {count}"]
        elif field.numbers:
            codes = f'"<{count}{field.code}"' if field.length else f'"<%d{field.code}" % n'
            wrap = "[x != 0 for x in {}]" if field.true else "list({})"
            lines.append(f"        {value} = " + wrap.format(f"unpack_from({codes}, buf, off)"))
            lines.append(
                f"        off += {field.size} * {count}" if field.size > 1 else f"        off += {count}"
            )
        else:
            lines += [f"        {value} = []", f"        for _ in range({count}):"]
            if field.code:
                lines.append(f'            {value}.append(unpack_from("<{field.code}", buf, off))')
                lines.append(f"            off += {field.size}")
            elif field.nested:
                lines.append(f"            e = {field.refer}()")
                lines.append("            off = e.read(buf, off, end)")
                lines.append(f"            {value}.append(e)")
            else:
                lines.append("            e, off = read_text(buf, off, end)")
                lines.append(f"            {value}.append(e)")
    return [*lines, "        return off"]


def _read_row(fields: list[_Field]) -> list[str]:
    codes = "".join(field.code for field in fields)
    size = sum(field.size for field in fields)
    lines = [f"        need(off, {size}, end)", f'        v = unpack_from("<{codes}", buf, off)']
    at = 0
    for field in fields:
        value = f"v[{at}]" if field.numbers else f"(v[{at}], v[{at + 1}])"
        lines.append(f"        self.{field.name} = {value}{' != 0' if field.true else ''}")
        at += len(field.code)
    return [*lines, f"        off += {size}"]


# ---- modules for boards ----


class _Module:
    """The classes of one package, in the order they need each other, and what they import."""

    def __init__(self) -> None:
        self.classes: dict[str, str] = {}
        self.others: set[str] = set()

    def text(self, package: str) -> str:
        body = "\n\n".join(self.classes.values())
        lines = [f'"""ROS 1 messages of {package}, generated by muros."""', ""]
        for line in _IMPORTS.splitlines():
            head, _, names = line.partition(" import ")
            used = [name for name in names.split(", ") if f"{name}(" in body or f"({name})" in body]
            if used:
                lines.append(f"{head} import {', '.join(used)}")
        for other in sorted(self.others):
            home, _, name = other.partition("/")
            lines.append(f"from {BOARD_PACKAGE}.{home} import {name} as {_reference(other, '')}")
        return "\n".join(lines) + "\n\n\n" + body


def _add(ros1_type: str, modules: dict[str, _Module]) -> None:
    package, _, name = ros1_type.partition("/")
    module = modules.setdefault(package, _Module())
    if name in module.classes:
        return
    if not known(ros2_message(ros1_type)) and known(ros2_service(ros1_type)):
        halves = [f"{name}_{half}" for half in _HALVES]
        for half in halves:
            _add(f"{package}/{half}", modules)
        lines = [f"class {name}:", f'    """{ros1_type}"""', "", f'    TYPE = "{ros1_type}"']
        lines += [f"    {word} = {half}" for word, half in zip(_HALVES, halves, strict=True)]
        module.classes[name] = "\n".join(lines) + "\n"
        return
    source = _source(ros1_type)
    for nested in source.nested:
        _add(nested, modules)
        if nested.partition("/")[0] != package:
            module.others.add(nested)
    module.classes[name] = source.text


def _short(ros1_type: str) -> str:
    return ros1_type.rpartition("/")[2]


def _reference(nested: str, holder: str) -> str:
    """What a class calls a message in its fields: types of other packages may have the same name."""
    package, _, name = nested.partition("/")
    return name if holder.partition("/")[0] == package else f"{package}_{name}"
