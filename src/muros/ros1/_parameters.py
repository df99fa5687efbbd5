"""The parameters of a ROS 1 graph: one tree of names, of which the master tells every change."""

from __future__ import annotations

from typing import Any


class ParameterTree:
    """What the master says. :meth:`update` takes its news as they come."""

    def __init__(self, tree: Any = None) -> None:
        self._tree: Any = tree if isinstance(tree, dict) else {}

    def update(self, key: str, value: Any) -> None:
        """A parameter, or a whole branch, is something else now; an empty branch is none."""
        parts = [part for part in str(key).split("/") if part]
        if not parts:
            self._tree = value if isinstance(value, dict) else {}
            return
        branch = self._tree
        for part in parts[:-1]:
            if not isinstance(branch.get(part), dict):
                branch[part] = {}
            branch = branch[part]
        if value == {}:
            branch.pop(parts[-1], None)
        else:
            branch[parts[-1]] = value

    def get(self, name: str) -> Any:
        """The value of a parameter by its absolute name, a dict for a branch, None if there is none."""
        value = self._tree
        for part in filter(None, name.split("/")):
            if not isinstance(value, dict) or part not in value:
                return None
            value = value[part]
        return value
