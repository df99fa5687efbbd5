"""Parameters on hosts: their types without ROS, and YAML files in the format of ROS 2.

    /arm:
      ros__parameters:
        gain: 2.0
        motor:
          current: 3

is ``{"gain": 2.0, "motor.current": 3}`` for the node /arm. A node's name may have ``*`` for one part of it and ``**``
for any number of them; what names the node exactly comes last and counts.
"""

from __future__ import annotations

import os
from collections.abc import Mapping
from importlib import import_module
from pathlib import Path
from typing import Any

from muros.rclc import parameter_client
from muros.rclc.parameter_errors import InvalidParameterError

__all__ = ["ParameterClient", "by_node", "fitting", "kind", "matches", "read", "write"]

_KEY = "ros__parameters"
_DOUBLE, _BYTES = 3, 5


def kind(name: str) -> Any:
    """A type of rcl_interfaces, as "msg/Parameter"."""
    interfaces = import_module("muros.interfaces")
    full = "rcl_interfaces/" + name
    return interfaces.service(full) if name.startswith("srv/") else interfaces.message(full)


class ParameterClient(parameter_client.ParameterClient):
    """Asks another node about its parameters; see ``muros.rclc.parameter_client``."""

    def load(
        self, file: str | os.PathLike[str], wildcard: bool = True, timeout: float | None = None
    ) -> dict[str, Any]:
        """Sets what a file says for the node; ``wildcard`` takes what is said for all nodes too. What was set.

        InvalidParameterError for a file that says nothing, or that is none; ParameterRejectedError names what the node
        refuses, all else is set.
        """
        text = Path(file).read_text(encoding="utf-8")
        values = read(text, self.target, wildcard, str(file))
        names = [name for name in self.list(timeout=timeout) if name in values]
        known = self.types(names, timeout) if names else {}
        values = {name: fitting(value, known.get(name, 0)) for name, value in values.items()}
        self._update(values, known, False, timeout, None)
        return values

    def dump(self, file: str | os.PathLike[str] | None = None, timeout: float | None = None) -> str:
        """All parameters of the node as YAML, written into a file as well if one is given."""
        names = self.list(timeout=timeout)
        text = write(self.target, self.get(names, timeout) if names else {})
        if file is not None:
            Path(file).write_text(text, encoding="utf-8")
        return text

    def _kind(self, name: str) -> Any:
        return kind(name)


def read(text: str, node: str, wildcard: bool = True, file: str = "the file") -> dict[str, Any]:
    """The parameters that YAML has for a node. InvalidParameterError if there are none, or it is no such file."""
    nodes = by_node(text, file)
    found = [given for key, given in nodes if matches(key, node) and (wildcard or "*" not in key)]
    if not found:
        names = ", ".join(key for key, _ in nodes)
        raise InvalidParameterError(f"{file} has no parameters for {node}, only for {names or 'nobody'}")
    values: dict[str, Any] = {}
    for given in found:
        values.update(given)
    return values


def by_node(text: str, file: str = "the file") -> list[tuple[str, dict[str, Any]]]:
    """The parameters that YAML has, node by node; those whose names have no wildcard come last.

    InvalidParameterError for what is no such file.
    """
    yaml = import_module("yaml")
    try:
        found = _load(yaml, text)
    except yaml.YAMLError as error:
        raise InvalidParameterError(f"{file} is no YAML: {' '.join(str(error).split())}") from None
    if not isinstance(found, dict):
        raise InvalidParameterError(f"{file} is no file of parameters: it names no node")
    nodes = []
    for key, tree in _nodes(found, file).items():
        values: dict[str, Any] = {}
        _flatten("", tree, values, file)
        nodes.append((key, values))
    return sorted(nodes, key=lambda node: "*" not in node[0])


def matches(key: str, node: str) -> bool:
    """Whether a name with wildcards is that of a node."""
    import re

    parts = []
    for part in key.strip("/").split("/"):
        parts.append("(/[^/]+)*" if part == "**" else "/" + re.escape(part).replace(r"\*", "[^/]+"))
    return re.fullmatch("".join(parts), node) is not None


def write(node: str, values: Mapping[str, Any]) -> str:
    """Parameters of a node as YAML, sorted."""
    tree: dict[str, Any] = {}
    for name in sorted(values):
        value = values[name]
        _insert(tree, name, list(value) if isinstance(value, bytes) else value)
    text: str = import_module("yaml").safe_dump(
        {node: {_KEY: tree}}, default_flow_style=False, allow_unicode=True
    )
    return text


def fitting(value: Any, known: int) -> Any:
    """A value of a file for a parameter of a type: YAML has no bytes, and people write 2 for 2.0."""
    if known == _DOUBLE and isinstance(value, int) and not isinstance(value, bool):
        return float(value)
    if known == _DOUBLE + _BYTES and isinstance(value, list):
        return [fitting(item, _DOUBLE) for item in value]
    if known == _BYTES and isinstance(value, list) and all(type(n) is int and 0 <= n < 256 for n in value):
        return bytes(value)
    return value


def _load(yaml: Any, text: str) -> Any:
    """The content of YAML. Names are texts as they are written: ``on`` and ``1`` too, which YAML takes for values."""

    class Loader(yaml.SafeLoader):  # type: ignore[misc]
        def construct_mapping(self, node: Any, deep: bool = False) -> dict[str, Any]:
            self.flatten_mapping(node)
            return {str(key.value): self.construct_object(value, deep=True) for key, value in node.value}

    return yaml.load(text, Loader)


def _nodes(tree: Mapping[Any, Any], file: str, path: str = "") -> dict[str, Mapping[Any, Any]]:
    """What a file says, by the full name of the node; namespaces may be nested."""
    nodes: dict[str, Mapping[Any, Any]] = {}
    for key, below in tree.items():
        name = f"{path}/{str(key).strip('/')}"
        if not isinstance(below, dict):
            raise InvalidParameterError(f"{file} is no file of parameters: {name} has no {_KEY}")
        if _KEY not in below:
            nodes.update(_nodes(below, file, name))
        elif isinstance(below[_KEY] or {}, dict):
            nodes[name] = below[_KEY] or {}
        else:
            raise InvalidParameterError(f"{file}: {_KEY} of {name} has no names in it")
    return nodes


def _flatten(path: str, tree: Mapping[Any, Any], values: dict[str, Any], file: str) -> None:
    for key, value in tree.items():
        name = f"{path}{key}"
        if isinstance(value, dict):
            _flatten(name + ".", value, values, file)
        elif value is None:
            raise InvalidParameterError(f"{file}: parameter {name} has no value")
        else:
            values[name] = value


def _insert(tree: dict[str, Any], name: str, value: Any) -> None:
    """Puts a value where the dots of its name say; under the whole name where there is a value already."""
    first, dot, rest = name.partition(".")
    below = tree.get(first)
    if dot and first and rest and (below is None or isinstance(below, dict)):
        _insert(tree.setdefault(first, {}), rest, value)
    else:
        tree[name] = value
