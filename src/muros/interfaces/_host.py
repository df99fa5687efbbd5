"""The generator of host classes: from a definition to the source of a Python class and to the class itself.

The source is ordinary Python that can be read (``muros interface generate``); classes made at run time are compiled
from the same source and appear in tracebacks. Big-endian codecs are generated when first needed.
"""

from __future__ import annotations

import linecache
from array import array
from collections.abc import Callable, Iterable
from struct import Struct
from typing import Any

from muros.interfaces import _runtime
from muros.interfaces._decoder import Decoder
from muros.interfaces._encoder import Encoder, Structs, size_code
from muros.interfaces._layout import Leaf, fixed_size, leaves
from muros.interfaces._model import (
    PRIMITIVES,
    Field,
    FieldType,
    Kind,
    Message,
    Value,
    attribute,
)
from muros.interfaces._registry import Registry

Find = Callable[[str], type[_runtime.Message]]

_ANNOTATIONS = {"bool": "bool", "float32": "float", "float64": "float", "string": "str", "wstring": "str"}
_BODY = "            "


def identifier(name: str) -> str:
    """A Python name for a message in code that uses several: ``std_msgs/msg/Header`` -> ``std_msgs__Header``."""
    package, kind, type_name = name.split("/")
    return f"{package}__{type_name}" if kind == "msg" else f"{package}__{kind}__{type_name}"


def build(registry: Registry, message: Message, find: Find) -> type[_runtime.Message]:
    """The class of a message; ``find`` gives the classes of nested messages."""
    space = _namespace(registry, message, find)
    package, kind, type_name = message.name.split("/")
    space["__name__"] = f"{package}.{kind}"
    _run(source(registry, message), f"<muros {message.name}>", space)
    made: type[_runtime.Message] = space[type_name]
    made._origin = (registry, find)  # type: ignore[attr-defined]
    return made


def source(registry: Registry, message: Message, both_orders: bool = False) -> str:
    """The source of a message's class, without imports; with ``both_orders`` the big-endian codec as well."""
    found = leaves(message, registry.message)
    structs = Structs()
    members = [_class_head(message), _init(message), _methods(found, structs)]
    parts = [
        "\n\n".join(members),
        _blank(registry, message),
        _decode("_decode", message, found, structs, False),
    ]
    type_name = message.name.split("/")[2]
    tail = [f"{type_name}._blank = staticmethod(_blank)", f"{type_name}._decode = staticmethod(_decode)"]
    if both_orders:
        parts.append(_encode("_encode_big", found, structs))
        parts.append(_decode("_decode_big", message, found, structs, True))
        tail.append(f"{type_name}._big = (_encode_big, _decode_big)")
    constants = structs.lines()
    if constants:
        parts.insert(0, "\n".join(constants))
    return "\n\n\n".join([*parts, "\n".join(tail)]) + "\n"


def swapped_codec(cls: Any) -> tuple[Callable[[Any], bytes], Callable[[Any, Any], None]]:
    """The big-endian encoder and decoder of a class that was built here, or those generated with it."""
    if "_big" not in cls.__dict__:
        registry, find = cls._origin
        message = registry.message(cls.TYPE)
        found = leaves(message, registry.message)
        structs = Structs()
        parts = [
            _encode("_encode_big", found, structs),
            _decode("_decode_big", message, found, structs, True),
        ]
        space = _namespace(registry, message, find)
        _run("\n".join(structs.lines() + parts), f"<muros {message.name} big-endian>", space)
        cls._big = (space["_encode_big"], space["_decode_big"])
    codec: tuple[Callable[[Any], bytes], Callable[[Any, Any], None]] = cls._big
    return codec


def nested_names(registry: Registry, message: Message) -> list[str]:
    """The messages whose classes the code of a message uses, sorted."""
    return sorted(registry.closure(message))


# ---- parts of the source ----


def _class_head(message: Message) -> str:
    type_name = message.name.split("/")[2]
    slots = ", ".join(f'"{attribute(field.name)}"' for field in message.fields)
    lines = [
        f"class {type_name}(_Message):",
        f'    """{message.name}"""',
        "",
        f"    __slots__ = ({slots}{',' if len(message.fields) == 1 else ''})",
        f'    TYPE = "{message.name}"',
        f"    _FIELDS = {_field_types(message)!r}",
    ]
    lines += [f"    {attribute(c.name)} = {_literal(c.value)}" for c in message.constants]
    return "\n".join(lines)


def _init(message: Message) -> str:
    arguments, lines = ["self"], []
    for field in message.fields:
        name = attribute(field.name)
        default, make = _default(field)
        arguments.append(f"{name}: {_annotation(field.type)}{' | None' if make else ''} = {default}")
        lines.append(f"        self.{name} = {f'{make} if {name} is None else {name}' if make else name}")
    return f"    def __init__({', '.join(arguments)}) -> None:\n" + ("\n".join(lines) or "        pass")


def _methods(found: tuple[Leaf, ...], structs: Structs) -> str:
    encoder = Encoder(found, structs)
    size = fixed_size(found)
    size_lines = [f"return {size}"] if size is not None else size_code(found)
    lines = ["    def size(self) -> int:"]
    if size is None:
        lines.append("        m = self")
        lines.append("        try:")
        lines += [_BODY + line for line in size_lines]
        lines.append("        except _BAD as error:")
        lines.append("            raise explain(self, error) from None")
    else:
        lines.append(f"        return {size}")
    lines += ["", "    def serialize(self, big_endian: bool = False, header: bool = False) -> bytes:"]
    lines.append("        if big_endian or header:")
    lines.append("            return self._serialize_as(big_endian, header)")
    lines.append("        m = self")
    lines += _guarded(encoder.body())
    if encoder.values is not None:
        lines += ["", "    def write(self, buf: bytearray | memoryview, off: int = 0) -> int:"]
        lines.append(f"        if off + {size} > len(buf):")
        lines.append(f"            room(buf, off, {size}, self.TYPE)")
        lines.append("        m = self")
        packed = f"{encoder.struct}.pack_into(buf, off, {', '.join(encoder.values)})"
        lines += _guarded([*encoder.prelude(), packed, f"return off + {size}"])
    return "\n".join(lines)


def _guarded(body: list[str]) -> list[str]:
    return [
        "        try:",
        *(_BODY + line for line in body),
        "        except _BAD as error:",
        "            raise explain(self, error) from None",
    ]


def _encode(function: str, found: Iterable[Leaf], structs: Structs) -> str:
    encoder = Encoder(tuple(found), structs, big_endian=True)
    return "\n".join([f"def {function}(m):", *("    " + line for line in encoder.body())])


def _decode(
    function: str, message: Message, found: Iterable[Leaf], structs: Structs, big_endian: bool
) -> str:
    blanks = _Blanks()
    decoder = Decoder(tuple(found), structs, blanks, big_endian)
    lines = [f"def {function}(m, b):", "    try:"]
    lines += ["        " + line for line in decoder.lines]
    lines += ["    except _BAD as error:", f'        raise malformed("{message.name}", b, error) from None']
    return "\n".join(lines)


class _Blanks(dict[str, str]):
    """Name of a nested message -> expression of the function that makes a blank one."""

    def __missing__(self, name: str) -> str:
        return f"{identifier(name)}._blank"


def _blank(registry: Registry, message: Message) -> str:
    lines: list[str] = []

    def fill(variable: str, holder: Message) -> None:
        for field in holder.fields:
            if field.type.nested and field.type.kind is Kind.ONE:
                inner = f"v{len(lines)}"
                lines.append(
                    f"    {variable}.{attribute(field.name)} = {inner} = new({identifier(field.type.base)})"
                )
                fill(inner, registry.message(field.type.base))

    fill("m", message)
    type_name = message.name.split("/")[2]
    return "\n".join(["def _blank(new=object.__new__):", f"    m = new({type_name})", *lines, "    return m"])


def _default(field: Field) -> tuple[str, str]:
    """The default of a constructor argument, and the expression to use instead when it is None."""
    kind, value = field.type, field.default
    if kind.nested:
        new = f"{identifier(kind.base)}()"
        if kind.kind is Kind.ONE:
            return "None", new
        return "None", f"[{new} for _ in _range({kind.count})]" if kind.kind is Kind.ARRAY else "[]"
    primitive = PRIMITIVES[kind.base]
    if kind.kind is Kind.ONE:
        zero: Value = (
            "" if not primitive.size else False if kind.base == "bool" else 0 if primitive.high else 0.0
        )
        return _literal(zero if value is None else value), ""
    if primitive.code == "B":
        if value is not None:
            return repr(bytes(value)), ""  # type: ignore[arg-type]
        return (f"bytes({kind.count})" if kind.kind is Kind.ARRAY else 'b""'), ""
    if not primitive.size or primitive.code == "?":
        zero = "" if not primitive.size else False
        if value is None:
            return "None", f"[{zero!r}] * {kind.count}" if kind.kind is Kind.ARRAY else "[]"
        return "None", _literal(value)
    if value is None:
        inside = f", _bytes({kind.count * primitive.size})" if kind.kind is Kind.ARRAY else ""
        return "None", f'_array("{primitive.code}"{inside})'
    return "None", f'_array("{primitive.code}", {_literal(value)})'


def _literal(value: Value) -> str:
    if isinstance(value, list):
        return "[" + ", ".join(_literal(item) for item in value) + "]"
    text = repr(value)
    return f'_float("{text}")' if text in ("nan", "inf", "-inf") else text


def _annotation(kind: FieldType) -> str:
    if kind.nested:
        base = identifier(kind.base)
        return base if kind.kind is Kind.ONE else f"Sequence[{base}]"
    base = _ANNOTATIONS.get(kind.base, "int")
    if kind.kind is Kind.ONE:
        return base
    return "Octets" if PRIMITIVES[kind.base].code == "B" else f"Sequence[{base}]"


def _field_types(message: Message) -> dict[str, str]:
    types = {}
    for field in message.fields:
        kind = field.type
        base = kind.base.replace("/msg/", "/") if kind.nested else PRIMITIVES[kind.base].idl
        if kind.string_bound:
            base += f"<{kind.string_bound}>"
        bound = f", {kind.count}" if kind.kind is Kind.BOUNDED else ""
        if kind.kind is Kind.ARRAY:
            base = f"{base}[{kind.count}]"
        elif kind.kind is not Kind.ONE:
            base = f"sequence<{base}{bound}>"
        types[field.name] = base
    return types


# ---- making it run ----

_HELPERS: dict[str, Any] = {
    **{name: getattr(_runtime, name) for name in _runtime.FUNCTIONS},
    **{f"_{name}": getattr(_runtime, name) for name in _runtime.NAMES},
    "_Struct": Struct,
    "_array": array,
    "_bytes": bytes,
    "_float": float,
    "_range": range,
    "array": array,
}


def _namespace(registry: Registry, message: Message, find: Find) -> dict[str, Any]:
    space: dict[str, Any] = dict(_HELPERS)
    for name in nested_names(registry, message):
        space[identifier(name)] = find(name)
    return space


def _run(text: str, filename: str, space: dict[str, Any]) -> None:
    text = "from __future__ import annotations\n" + text
    linecache.cache[filename] = (len(text), None, text.splitlines(keepends=True), filename)
    exec(compile(text, filename, "exec", dont_inherit=True), space)
