"""What identifies a type to others: the RIHS01 hash of ROS 2, the md5 sum of ROS 1, the full definition text.

RIHS01 (REP-2011) is the SHA-256 of a JSON description of the type and of all types it refers to; names of fields and
types count, constants and defaults do not. The ROS 1 md5 sum covers the definition without comments, with each nested
type replaced by its own sum.
"""

from __future__ import annotations

import json
from hashlib import md5, sha256
from typing import Any

from muros.interfaces._model import (
    DUMMY_FIELD,
    PRIMITIVES,
    Definition,
    Field,
    FieldType,
    InterfaceError,
    Kind,
    Message,
    Service,
)
from muros.interfaces._registry import Registry

_NESTED_ID = 1
_BOUNDED_STRING, _BOUNDED_WSTRING = 21, 22
_OFFSETS = {Kind.ONE: 0, Kind.ARRAY: 48, Kind.BOUNDED: 96, Kind.SEQUENCE: 144}
_RULE = "=" * 80


def rihs01(registry: Registry, name: str) -> str:
    """The RIHS01 hash of a message, service or action, such as ``RIHS01_df668c74...``."""
    known: dict[str, dict[str, Any]] = {}
    top = registry.definition(name)
    _describe(registry, top, known)
    description = {
        "type_description": known.pop(top.name),
        "referenced_type_descriptions": [known[other] for other in sorted(known)],
    }
    return "RIHS01_" + sha256(json.dumps(description).encode()).hexdigest()


def ros1_md5(registry: Registry, name: str) -> str:
    """The md5 sum of a message, a service or one half of a service (``std_srvs/srv/SetBool_Request``) in ROS 1."""
    definition = registry.ros1_definition(name)
    if definition is None:
        definition = registry.definition(name)
    if isinstance(definition, Service):
        text = _md5_text(registry, definition.request) + _md5_text(registry, definition.response)
    elif isinstance(definition, Message):
        text = _md5_text(registry, definition)
    else:
        raise InterfaceError(f"{name}: ROS 1 has no md5 sum of actions")
    return md5(text.encode(), usedforsecurity=False).hexdigest()


def ros1_message_md5(registry: Registry, message: Message) -> str:
    """The md5 sum in ROS 1 of a message whose definition is at hand."""
    return md5(_md5_text(registry, message).encode(), usedforsecurity=False).hexdigest()


def full_text(registry: Registry, name: str) -> str:
    """The definition followed by those of all nested messages, divided as in bag files."""
    top = registry.definition(name)
    nested: dict[str, Message] = {}
    for message in _own_messages(top):
        nested.update(registry.closure(message))
    parts = [definition_text(top)]
    for other in nested.values():
        parts.append(f"{_RULE}\nMSG: {other.name.replace('/msg/', '/')}\n{definition_text(other)}")
    return "".join(parts)


def definition_text(definition: Definition) -> str:
    """The text of one definition: the file's own when it was read from one, else written anew."""
    if definition.text:
        return definition.text if definition.text.endswith("\n") else definition.text + "\n"
    return "---\n".join(_written(message) for message in _own_messages(definition))


def _own_messages(definition: Definition) -> tuple[Message, ...]:
    """The messages that the definition's own text spells out."""
    if isinstance(definition, Message):
        return (definition,)
    if isinstance(definition, Service):
        return (definition.request, definition.response)
    return (definition.goal, definition.result, definition.feedback)


def _written(message: Message) -> str:
    lines = [f"{c.base} {c.name}={c.text}" for c in message.constants]
    for field in message.fields:
        default = "" if field.default is None else f" {json.dumps(field.default)}"
        lines.append(f"{field.type} {field.name}{default}")
    return "".join(line + "\n" for line in lines)


def _describe(registry: Registry, definition: Definition, known: dict[str, dict[str, Any]]) -> None:
    if definition.name in known:
        return
    fields = known[definition.name] = {"type_name": definition.name, "fields": []}
    members = _members(definition)
    if isinstance(definition, Message):
        parts: list[Definition] = [registry.message(f.type.base) for f in members if f.type.nested]
    elif isinstance(definition, Service):
        parts = [definition.request, definition.response, definition.event]
    else:
        parts = [
            definition.goal,
            definition.result,
            definition.feedback,
            definition.send_goal,
            definition.get_result,
            definition.feedback_message,
        ]
    fields["fields"] = [{"name": f.name, "type": _described(f.type)} for f in members]
    for part in parts:
        _describe(registry, part, known)


def _members(definition: Definition) -> tuple[Field, ...]:
    """The members as type_description_interfaces lists them."""
    if isinstance(definition, Message):
        return definition.fields or (Field(DUMMY_FIELD, FieldType("uint8")),)
    if isinstance(definition, Service):
        names = {"request_message": "Request", "response_message": "Response", "event_message": "Event"}
    else:
        names = {
            "goal": "Goal",
            "result": "Result",
            "feedback": "Feedback",
            "send_goal_service": "SendGoal",
            "get_result_service": "GetResult",
            "feedback_message": "FeedbackMessage",
        }
    return tuple(
        Field(n, FieldType(f"{definition.name}_{suffix}", nested=True)) for n, suffix in names.items()
    )


def _described(field_type: FieldType) -> dict[str, Any]:
    if field_type.nested:
        type_id = _NESTED_ID
    elif field_type.string_bound:
        type_id = _BOUNDED_STRING if field_type.base == "string" else _BOUNDED_WSTRING
    else:
        type_id = PRIMITIVES[field_type.base].type_id
    return {
        "type_id": type_id + _OFFSETS[field_type.kind],
        "capacity": field_type.count,
        "string_capacity": field_type.string_bound,
        "nested_type_name": field_type.base if field_type.nested else "",
    }


_ROS1_TIME = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}


def _md5_text(registry: Registry, message: Message) -> str:
    lines = [f"{c.base} {c.name}={c.text}" for c in message.constants]
    for field in message.fields:
        base = field.type.base
        if not field.type.nested or base in _ROS1_TIME:
            lines.append(f"{_ROS1_TIME.get(base, base)}{field.type.suffix()} {field.name}")
            continue
        nested = registry.ros1_message(base) or registry.message(base)
        lines.append(
            f"{md5(_md5_text(registry, nested).encode(), usedforsecurity=False).hexdigest()} {field.name}"
        )
    return "\n".join(lines)
