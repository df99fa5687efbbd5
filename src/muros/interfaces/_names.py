"""Names: ROS topics, services and types, and what they are called in DDS.

The mapping is the one every ROS 2 middleware over DDS uses, so that names made here meet those of other
implementations: topics ``rt/chatter``, services ``rq/add_two_intsRequest`` and ``rr/add_two_intsReply``, types
``std_msgs::msg::dds_::String_``. Names outside these conventions (plain DDS topics) have no ROS name.
"""

from __future__ import annotations

import re
from typing import NamedTuple

from muros.interfaces._model import InterfaceError

_PACKAGE = re.compile(r"[a-z][a-z0-9_]*\Z")
_TYPE = re.compile(r"[A-Z][A-Za-z0-9_]*\Z")
_TOKEN = re.compile(r"[A-Za-z_][A-Za-z0-9_]*\Z")
_DDS_TYPE = re.compile(r"(\w+)::(msg|srv|action)::dds_::(\w+)_\Z", re.ASCII)
_SUBSTITUTION = re.compile(r"\{([^{}]*)\}")
KINDS = ("msg", "srv", "action")


class TypeName(NamedTuple):
    """The three parts of ``package/kind/Type``."""

    package: str
    kind: str
    name: str


def split_type(name: str, kind: str = "msg") -> TypeName:
    """Splits ``package/kind/Type``, or the short ``package/Type`` of the given kind.

    Raises :class:`InterfaceError` when it is neither.
    """
    parts = name.split("/") if isinstance(name, str) else []
    if len(parts) == 2:
        parts.insert(1, kind)
    if len(parts) == 3 and parts[1] in KINDS and _PACKAGE.match(parts[0]) and _TYPE.match(parts[2]):
        return TypeName(*parts)
    raise InterfaceError(
        f"{name!r} is no type name: write package/msg/Type, package/srv/Type or package/action/Type"
    )


def dds_type_name(name: str) -> str:
    """``std_msgs/msg/Int32`` -> ``std_msgs::msg::dds_::Int32_``."""
    package, kind, type_name = split_type(name)
    return f"{package}::{kind}::dds_::{type_name}_"


def ros_type_name(dds_name: str) -> str:
    """``std_msgs::msg::dds_::Int32_`` -> ``std_msgs/msg/Int32``; :class:`InterfaceError` if it is no ROS type."""
    match = _DDS_TYPE.match(dds_name)
    if not match:
        raise InterfaceError(f"{dds_name!r} is no ROS type: those look like std_msgs::msg::dds_::String_")
    return "/".join(match.groups())


def dds_topic(topic: str) -> str:
    """``/chatter`` -> ``rt/chatter``."""
    return "rt" + check_full_name(topic, "topic")


def dds_request_topic(service: str) -> str:
    """``/add_two_ints`` -> ``rq/add_two_intsRequest``."""
    return "rq" + check_full_name(service, "service") + "Request"


def dds_reply_topic(service: str) -> str:
    """``/add_two_ints`` -> ``rr/add_two_intsReply``."""
    return "rr" + check_full_name(service, "service") + "Reply"


def ros_topic(dds_name: str) -> str | None:
    """``rt/chatter`` -> ``/chatter``; None when the DDS topic is no ROS topic."""
    return dds_name[2:] if dds_name.startswith("rt/") and len(dds_name) > 3 else None


def ros_service(dds_name: str) -> str | None:
    """``rq/add_two_intsRequest`` or ``rr/add_two_intsReply`` -> ``/add_two_ints``; None when it is neither."""
    for prefix, suffix in (("rq/", "Request"), ("rr/", "Reply")):
        if dds_name.startswith(prefix) and dds_name.endswith(suffix) and len(dds_name) > 3 + len(suffix):
            return dds_name[2 : -len(suffix)]
    return None


def check_full_name(name: str, what: str = "topic") -> str:
    """The name if it is a full ROS name (``/ns/chatter``), else :class:`InterfaceError` saying what is wrong."""
    if not name.startswith("/"):
        raise InterfaceError(f"{what} name {name!r} is not full: it must begin with '/'")
    _check_tokens(name[1:], name, what)
    return name


def check_node_name(name: str) -> str:
    """The name if it may name a node, else :class:`InterfaceError`."""
    if not _TOKEN.match(name):
        raise InterfaceError(f"node name {name!r}: use letters, digits and '_', not beginning with a digit")
    return name


def check_namespace(namespace: str) -> str:
    """The namespace made full (``""`` -> ``/``, ``ns`` -> ``/ns``), else :class:`InterfaceError`."""
    full = namespace if namespace.startswith("/") else "/" + namespace
    if full != "/":
        check_full_name(full, "namespace")
    return full


def expand_name(name: str, node: str, namespace: str = "/", what: str = "topic") -> str:
    """The full name that a node means: relative, absolute, private (``~``) and ``{node} {ns} {namespace}``.

    ``chatter`` of a node in ``/ns`` is ``/ns/chatter``, ``~/state`` is ``/ns/node/state``.
    Raises :class:`InterfaceError` when the result is no valid name.
    """
    space = "" if namespace == "/" else namespace
    known = {"node": node, "ns": space, "namespace": space}

    def fill(match: re.Match[str]) -> str:
        if match[1] not in known:
            raise InterfaceError(
                f"{what} name {name!r}: unknown substitution {{{match[1]}}}, use {{node}} or {{ns}}"
            )
        return known[match[1]]

    full = name
    if full == "~" or full.startswith("~/"):
        full = f"{space}/{node}{full[1:]}"
    full = _SUBSTITUTION.sub(fill, full)
    if not full.startswith("/"):
        full = f"{space}/{full}"
    return check_full_name(full, what)


def _check_tokens(tokens: str, name: str, what: str) -> None:
    for token in tokens.split("/"):
        if _TOKEN.match(token):
            continue
        if not token:
            problem = "it ends with '/'" if name.endswith("/") else "it has '//' in it"
            problem = "it is empty" if name in ("", "/") else problem
        elif token[0].isdigit():
            problem = f"{token!r} begins with a digit"
        else:
            bad = next((c for c in token if not (c.isascii() and (c.isalnum() or c == "_"))), "~")
            problem = f"{bad!r} is not allowed, use letters, digits, '_' and '/'"
        raise InterfaceError(f"{what} name {name!r}: {problem}")
