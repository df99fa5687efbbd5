"""ROS 1 beside ROS 2: which type means which, and converters between their serialisations.

A converter is made from both definitions: the ROS 1 one (the user's own folders, else that of Noetic) and the ROS 2 one
of the chosen distribution. Who speaks ROS 1 names its types with an md5 sum; where it is not the sum of the definition
known here, :mod:`muros.interfaces._ros1_drift` looks for the older or changed definition that it belongs to.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from threading import RLock

from muros.interfaces import _api, _hashes
from muros.interfaces._model import Field, FieldType, InterfaceError, Message, Service
from muros.interfaces._names import KINDS
from muros.interfaces._registry import Registry

SERVICE_HALVES = ("Request", "Response")

RENAMED_MESSAGES = {
    "std_msgs/Duration": "builtin_interfaces/msg/Duration",
    "std_msgs/Time": "builtin_interfaces/msg/Time",
    "tf/tfMessage": "tf2_msgs/msg/TFMessage",
}
"""Messages of ROS 1 that have another name in ROS 2."""

RENAMED_SERVICES = {
    "rospy_tutorials/AddTwoInts": "example_interfaces/srv/AddTwoInts",
    "roscpp_tutorials/TwoInts": "example_interfaces/srv/AddTwoInts",
}
"""Services of ROS 1 that have another name in ROS 2."""


@dataclass(frozen=True, slots=True, eq=False)
class Converter:
    """Turns messages of one type from ROS 1's serialisation into CDR and back.

    ``to_cdr(body)`` takes a ROS 1 body and returns a little-endian CDR body without encapsulation header;
    ``to_ros1(body, seq=0)`` takes such a CDR body and returns a ROS 1 body, with ``seq`` in its headers. Both take any
    bytes and raise :class:`muros.cdr.CdrError` for those that are no message of the type. Text passes through
    unchecked, as ROS 1 allows any bytes in a string.
    """

    ros1_type: str
    ros2_type: str
    md5: str
    """The md5 sum of the ROS 1 definition that this converter speaks."""
    drift: str
    """How that definition differs from the one known here, in a clause to be shown; empty if it is the same."""
    ros1_size: int | None
    """The bytes of every ROS 1 body of this type, None if they differ from message to message."""
    least_size: int
    """A lower bound of the bytes of a ROS 1 body."""
    to_cdr: Callable[..., bytes]
    to_ros1: Callable[..., bytes]
    source: str
    """The generated code of both functions, for reading."""


@dataclass(frozen=True, slots=True, eq=False)
class ServiceConverter:
    """The converters of a service's halves; ``md5`` is the sum that a ROS 1 service connection needs."""

    ros1_type: str
    ros2_type: str
    md5: str
    request: Converter
    response: Converter


_lock = RLock()
_made: dict[tuple[Registry, int, str, str | None], Converter] = {}


def converter(ros1_type: str, md5: str | None = None, distro: str | None = None) -> Converter:
    """The converter of a message, ``std_msgs/Byte``, or half a service, ``std_srvs/SetBool_Request``; always the same.

    With ``md5`` the one that speaks the definition with that sum; ``*`` fits any. Raises :class:`InterfaceError` if
    the type is unknown, has no counterpart in ROS 2, or has a sum that belongs to no definition that can be guessed.
    """
    home = _api.registry(distro)
    if md5 == "*":
        md5 = None
    key = (home, hash(frozenset(home.user_files().items())), ros1_type, md5)  # the user's folders may change
    with _lock:
        if key not in _made:
            _made[key] = _convert(home, ros1_type, md5)
        return _made[key]


def service_converter(
    ros1_type: str, request_md5: str | None = None, response_md5: str | None = None, distro: str | None = None
) -> ServiceConverter:
    """The converters of a service, ``std_srvs/SetBool``; the sums are those of the halves. Raises like
    :func:`converter`."""
    ros2_type = ros2_service(ros1_type)
    home = _api.registry(distro)
    known = home.ros1_definition(ros2_type) or home.definition(ros2_type)
    if not isinstance(known, Service):
        raise InterfaceError(f"{ros1_type} is no service")
    request = converter(f"{ros1_type}_Request", request_md5, distro)
    response = converter(f"{ros1_type}_Response", response_md5, distro)
    return ServiceConverter(ros1_type, ros2_type, _hashes.ros1_md5(home, ros2_type), request, response)


def ros2_message(ros1_type: str) -> str:
    """The full name of the ROS 2 message that a ROS 1 message becomes; says nothing about whether it exists."""
    if ros1_type in RENAMED_MESSAGES:
        return RENAMED_MESSAGES[ros1_type]
    whole, half = _half(ros1_type)
    if half:
        return f"{ros2_service(whole)}_{half}"
    return _full(ros1_type, "msg")


def ros2_service(ros1_type: str) -> str:
    """The full name of the ROS 2 service that a ROS 1 service becomes; says nothing about whether it exists."""
    return RENAMED_SERVICES.get(ros1_type) or _full(ros1_type, "srv")


def ros1_name(ros2_type: str) -> str:
    """The ROS 1 name of a ROS 2 message or service: ``std_msgs/msg/Byte`` -> ``std_msgs/Byte``."""
    for old, new in (*RENAMED_MESSAGES.items(), *RENAMED_SERVICES.items()):
        if new == ros2_type and not old.startswith("tf/"):
            return old
    parts = ros2_type.split("/")
    if len(parts) == 3 and parts[1] in KINDS:
        return f"{parts[0]}/{parts[2]}"
    raise InterfaceError(f"{ros2_type!r} is no full type name: it looks like std_msgs/msg/Byte")


def ros1_definition(ros1_type: str, distro: str | None = None) -> tuple[Message, str]:
    """The definition of a message or half a service in ROS 1, and its md5 sum; :class:`InterfaceError` if none."""
    home = _api.registry(distro)
    found = _definition(home, ros1_type)
    return found, _hashes.ros1_message_md5(home, found)


def ros1_text(ros1_type: str, distro: str | None = None) -> str:
    """The text of a message's ROS 1 definition and of all nested ones, as TCPROS headers and bag files have it."""
    home = _api.registry(distro)
    parts: dict[str, str] = {}
    todo = [ros1_type]
    while todo:
        name = todo.pop(0)
        if name in parts:
            continue
        found = _definition(home, name)
        lines = [f"{constant.base} {constant.name}={constant.text}" for constant in found.constants]
        for field in found.fields:
            base = field.type.base
            if base in _TIMES:
                base = _TIMES[base]
            elif field.type.nested:
                base = ros1_name(base)
                todo.append(base)
            lines.append(f"{base}{field.type.suffix()} {field.name}")
        parts[name] = "".join(line + "\n" for line in lines)
    first, *others = parts.items()
    return first[1] + "".join(f"{_RULE}\nMSG: {name}\n{text}" for name, text in others)


# ---- making one ----

_TIMES = {"builtin_interfaces/msg/Time": "time", "builtin_interfaces/msg/Duration": "duration"}
_RULE = "=" * 80


def _convert(home: Registry, ros1_type: str, md5: str | None) -> Converter:
    from muros.interfaces import _ros1_code, _ros1_drift, _ros1_pairs  # most programs have no need of them

    name = ros2_message(ros1_type)
    theirs, ours = _definition(home, ros1_type), home.message(name)
    known = _hashes.ros1_message_md5(home, theirs)
    if md5 is None or md5 == known:
        drift = ""
    else:
        guessed = _ros1_drift.guess(home, theirs, md5)
        if guessed is None:
            raise InterfaceError(
                f"{ros1_type} has md5 sum {md5} there and {known} here: another definition. "
                "Build the firmware with the definition that is used here, or give its folder here"
            )
        theirs, drift = guessed
    if ours.package == "builtin_interfaces":  # the one field of std_msgs/Time is the whole of it
        ours = Message(ours.name, (Field("data", FieldType(ours.name, True)),))

    def find1(other: str) -> Message:
        return home.ros1_message(other) or home.message(other)

    found = _ros1_pairs.paired(theirs, ours, find1, home.message)
    up, down = _ros1_code.to_cdr_source(ros1_type, found), _ros1_code.to_ros1_source(ros1_type, found)
    return Converter(
        ros1_type,
        name,
        md5 or known,
        drift,
        _ros1_pairs.ros1_size(found),
        _ros1_pairs.least_size(found, _ros1_pairs.Side.ROS1),
        _ros1_code.compiled(ros1_type, up),
        _ros1_code.compiled(ros1_type, down),
        up + "\n\n" + down,
    )


def _definition(home: Registry, ros1_type: str) -> Message:
    name = ros2_message(ros1_type)
    if ros1_type in ("std_msgs/Time", "std_msgs/Duration"):
        return Message(f"std_msgs/msg/{name.rpartition('/')[2]}", (Field("data", FieldType(name, True)),))
    return home.ros1_message(name) or home.message(name)


def _half(ros1_type: str) -> tuple[str, str]:
    """The service and half of ``std_srvs/SetBool_Request``, empty texts if it is no half."""
    whole, _, half = ros1_type.rpartition("_")
    return (whole, half) if whole and half in SERVICE_HALVES else ("", "")


def _full(ros1_type: str, kind: str) -> str:
    package, _, name = ros1_type.partition("/")
    if not package or not name or "/" in name:
        raise InterfaceError(f"{ros1_type!r} is no ROS 1 type name: it looks like std_msgs/Byte")
    return f"{package}/{kind}/{name}"
