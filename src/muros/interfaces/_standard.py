"""The definitions of the standard packages: messages from the type stores of ``rosbags``, the rest from ``share/``.

The stores hold messages only and no default values, so what they lack stands here: the services and actions of the
standard packages as files under ``share/`` beside this module, the few defaults as a table. Nothing of rosbags is
imported before a definition is asked for.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from muros.interfaces._model import (
    DUMMY_FIELD,
    Constant,
    Field,
    FieldType,
    InterfaceError,
    Kind,
    Message,
    Value,
)

SHARE = Path(__file__).parent / "share"
"""The folder of the definition files that come with muros."""

PACKAGES = frozenset(
    """
    action_msgs actionlib_msgs builtin_interfaces composition_interfaces diagnostic_msgs example_interfaces
    geometry_msgs libstatistics_collector lifecycle_msgs micro_ros_diagnostic_msgs micro_ros_msgs nav_msgs
    rcl_interfaces rmw_dds_common rosbag2_interfaces rosgraph_msgs rosserial_arduino rosserial_msgs sensor_msgs
    service_msgs shape_msgs statistics_msgs std_msgs std_srvs stereo_msgs tf2_msgs trajectory_msgs
    type_description_interfaces unique_identifier_msgs visualization_msgs
    """.split()
)
"""Packages that have standard definitions in some distribution (kept here to answer without an import)."""

_DEFAULTS: dict[str, dict[str, Value]] = {
    "geometry_msgs/msg/Quaternion": {"w": 1.0},
    "sensor_msgs/msg/NavSatStatus": {"status": -2},
}


def newest_distro() -> str:
    """The newest ROS 2 distribution that the installed rosbags knows, such as ``lyrical``."""
    return max(distros())


@cache
def distros() -> tuple[str, ...]:
    """The ROS 2 distributions that the installed rosbags knows, oldest first."""
    stores = import_module("rosbags.typesys.stores")
    found = (re.fullmatch(r"ros2_(\w+)", store.value) for store in stores.Stores)
    return tuple(sorted(match[1] for match in found if match))


def chosen_distro(distro: str | None = None) -> str:
    """The distribution asked for, else ``$MUROS_DISTRO``, else the newest; :class:`InterfaceError` if unknown."""
    wanted = distro or os.environ.get("MUROS_DISTRO") or newest_distro()
    if wanted != "noetic" and wanted not in distros():
        raise InterfaceError(
            f"unknown distribution {wanted!r}: known are {', '.join(distros())} (and noetic for ROS 1)"
        )
    return wanted


@cache
def stored_names(distro: str) -> frozenset[str]:
    """The full names of all messages in the type store of a distribution (``noetic``: ROS 1)."""
    return frozenset(_fielddefs(distro))


@cache
def stored_message(name: str, distro: str) -> Message | None:
    """The message of that full name from the type store of a distribution, None if it has none."""
    entry = _fielddefs(distro).get(name)
    if entry is None:
        return None
    constants, fields = entry[0], entry[1]
    defaults = _DEFAULTS.get(name, {}) if distro != "noetic" else {}
    if name == "sensor_msgs/msg/NavSatStatus" and "STATUS_UNKNOWN" not in {
        constant[0] for constant in constants
    }:
        defaults = {}  # came with Jazzy, together with the constant
    present = {field[0] for field in fields}
    return Message(
        name,
        tuple(Field(n, _type(d), defaults.get(n)) for n, d in fields if n != DUMMY_FIELD or len(present) > 1),
        tuple(Constant(n, base, value, str(value)) for n, base, value in constants),
        origin=f"{name} ({distro})",
    )


def _fielddefs(distro: str) -> dict[str, Any]:
    """rosbags' table of definitions: name -> (constants, fields)."""
    store = "ros1_noetic" if distro == "noetic" else f"ros2_{distro}"
    table: dict[str, Any] = import_module(f"rosbags.typesys.stores.{store}").FIELDDEFS
    return table


_ONE, _NAME, _ARRAY, _SEQUENCE = 1, 2, 3, 4  # rosbags.interfaces.Nodetype


def _type(description: Iterable[Any]) -> FieldType:
    node, content = description
    if node == _ONE:
        return FieldType(content[0], string_bound=content[1])
    if node == _NAME:
        return FieldType(content, nested=True)
    inner, count = content
    element = _type(inner)
    kind = Kind.ARRAY if node == _ARRAY else Kind.BOUNDED if count else Kind.SEQUENCE
    return FieldType(element.base, element.nested, kind, count, element.string_bound)
