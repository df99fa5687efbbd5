"""Arguments of ROS 2: what a program is told on its command line, and what a node is told where it is made.

    program --ros-args -r chatter:=/talk -r arm:__ns:=/lab -p gain:=2.0 --params-file lab.yaml --log-level debug

Rules are looked at in order, those of the node itself first, and the first that matches counts; what it gives is not
looked at again. Both sides of a rule may be relative (to the node's namespace) or begin with ``~/``. A rule that begins
with ``rostopic://`` or ``rosservice://`` is for one of the two, one that begins with a node's name and a colon for that
node. Parameters that come later win. See https://design.ros2.org/articles/ros_command_line_arguments.html.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib import import_module
from types import MappingProxyType
from typing import Any, Final, NamedTuple

from muros.client.names import resolve
from muros.rclc.errors import RclError
from muros.rclc.host.logger import LEVELS

__all__ = ["ArgumentsError", "RosArguments", "Rule", "remove_ros_arguments", "rules_of"]

INVALID_REMAP_RULE: Final = 1001
INVALID_ROS_ARGS: Final = 1003
INVALID_PARAM_RULE: Final = 1010
INVALID_LOG_LEVEL_RULE: Final = 1020

_BEGIN, _END = "--ros-args", "--"
_SWITCHES = ("rosout-logs", "stdout-logs", "external-lib-logs")
_TOKEN = r"[A-Za-z_][A-Za-z0-9_]*"
_NODE = re.compile(rf"{_TOKEN}\Z")
_NAMESPACE = re.compile(rf"(/|(/{_TOKEN})+)\Z")
_NAME = re.compile(rf"(~?/)?{_TOKEN}(/{_TOKEN})*\Z")
_PREFIX = re.compile(rf"({_TOKEN}):(?!=|//)(.*)\Z", re.DOTALL)


class ArgumentsError(ValueError):
    """Arguments that cannot be meant; ``code`` is that of the C library for the kind of argument."""

    code = INVALID_ROS_ARGS

    def __init__(self, said: str, code: int = INVALID_ROS_ARGS) -> None:
        super().__init__(said)
        self.code = code


class Rule(NamedTuple):
    """A rule: what is called ``match`` is called ``to`` instead.

    ``kind`` is "name" or "namespace" (of the node), "topic", "service", or "" for both of the latter. ``node`` is the
    name of the one node it is for; empty: of any.
    """

    match: str
    to: str
    kind: str = ""
    node: str = ""


class RosArguments(NamedTuple):
    """What stands behind ``--ros-args``. ``others`` is all that does not."""

    rules: tuple[Rule, ...] = ()
    values: tuple[tuple[str, Mapping[str, Any]], ...] = ()
    """Parameters, each with a pattern of the nodes they are for."""
    levels: Mapping[str, int] = MappingProxyType({})
    """Levels of loggers by name, "" for those that are not named."""
    enclave: str = ""
    rosout: bool = True
    stdout: bool = True
    others: tuple[str, ...] = ()

    @classmethod
    def parse(cls, arguments: Sequence[str]) -> RosArguments:
        """Takes a command line, without the name of the program, apart. Raises ArgumentsError."""
        return _Parser(arguments).result()

    def parameters(self, node: str) -> dict[str, Any]:
        """What is said of the parameters of a node, by its full name."""
        matches = import_module("muros.rclc.host.parameter_files").matches
        found: dict[str, Any] = {}
        for pattern, values in self.values:
            if matches(pattern, node):
                found.update(values)
        return found

    def level(self, logger: str) -> int | None:
        """The level of a logger; that of the nearest one above it (parted by dots) counts, None: nobody says."""
        while logger not in self.levels and logger:
            logger = logger.rpartition(".")[0]
        return self.levels.get(logger)


def rules_of(remap: Mapping[str, str] | Iterable[str]) -> tuple[Rule, ...]:
    """Rules as programs write them: ``{"chatter": "/talk", "__ns": "/lab"}`` or ``["chatter:=/talk"]``."""
    if isinstance(remap, str):
        raise ArgumentsError(
            f"remap is {remap!r}: it must be a dict or a list of rules such as ['chatter:=/talk']",
            INVALID_REMAP_RULE,
        )
    if isinstance(remap, Mapping):
        return tuple(_rule(f"{match}:={to}") for match, to in remap.items())
    return tuple(_rule(rule) for rule in remap)


def remap_node(name: str, namespace: str, rules: Sequence[Rule]) -> tuple[str, str]:
    """Name and namespace of a node as the rules have it. The namespace is asked for under the new name."""
    name = _first(rules, "name", name) or name
    return name, _first(rules, "namespace", name) or namespace


def remap(full: str, kind: str, name: str, namespace: str, rules: Sequence[Rule]) -> str:
    """The full name of a topic or service (``kind``) of a node, as the rules have it."""
    for rule in rules:
        if (
            rule.kind in ("", kind)
            and rule.node in ("", name)
            and resolve(rule.match, namespace, name) == full
        ):
            return resolve(rule.to, namespace, name)
    return full


def remove_ros_arguments(arguments: Sequence[str]) -> list[str]:
    """A command line without what is meant for ROS."""
    kept = []
    ours = False
    for argument in arguments:
        if argument == _BEGIN:
            ours = True
        elif ours:
            ours = argument != _END
        else:
            kept.append(argument)
    return kept


def _first(rules: Sequence[Rule], kind: str, name: str) -> str | None:
    return next((rule.to for rule in rules if rule.kind == kind and rule.node in ("", name)), None)


class _Parser:
    """Goes through a command line once."""

    def __init__(self, arguments: Sequence[str]) -> None:
        self._left = _ros_arguments(arguments)[::-1]
        self._others = tuple(remove_ros_arguments(arguments))
        self._rules: list[Rule] = []
        self._values: list[tuple[str, Mapping[str, Any]]] = []
        self._levels: dict[str, int] = {}
        self._enclave = ""
        self._switches = dict.fromkeys(_SWITCHES, True)

    def result(self) -> RosArguments:
        """All of it."""
        while self._left:
            self._take(self._left.pop())
        return RosArguments(
            tuple(self._rules),
            tuple(self._values),
            self._levels,
            self._enclave,
            self._switches["rosout-logs"],
            self._switches["stdout-logs"],
            self._others,
        )

    def _take(self, option: str) -> None:
        option, given, value = option.partition("=") if option.startswith("--") else (option, "", "")
        if given:
            self._left.append(value)
        if option in ("-r", "--remap"):
            self._rules.append(_rule(self._value(option, "a rule such as chatter:=/talk")))
        elif option in ("-p", "--param"):
            self._values.append(_parameter(self._value(option, "a parameter such as gain:=2.0")))
        elif option == "--params-file":
            self._values += _file(self._value(option, "the name of a file"))
        elif option == "--log-level":
            logger, level = _level(self._value(option, "a level such as debug or arm:=debug"))
            self._levels[logger] = level
        elif option in ("-e", "--enclave"):
            self._enclave = self._value(option, "the name of an enclave")
        elif option in ("--log-config-file", "--log-file-name"):
            self._value(option, "the name of a file")  # there is no such log here
        else:
            way, _, switch = option.removeprefix("--").partition("-")
            if option[:2] != "--" or way not in ("enable", "disable") or switch not in self._switches:
                raise ArgumentsError(
                    f"{_BEGIN} takes no {option!r}: -r, -p, --params-file, --log-level, --enclave, "
                    f"--enable-rosout-logs, --disable-rosout-logs and the like; {_END} ends it"
                )
            self._switches[switch] = way == "enable"

    def _value(self, option: str, what: str) -> str:
        if not self._left:
            raise ArgumentsError(f"{option} needs {what}")
        return self._left.pop()


def _ros_arguments(arguments: Sequence[str]) -> list[str]:
    """What is meant for ROS."""
    found = []
    ours = False
    for argument in arguments:
        if argument == _BEGIN:
            ours = True
        elif ours and argument == _END:
            ours = False
        elif ours:
            found.append(argument)
    return found


def _rule(text: str) -> Rule:
    """A rule as it is written. Raises ArgumentsError."""
    left, parted, to = str(text).partition(":=")
    if not parted or not left or not to:
        raise ArgumentsError(
            f"{text!r} is no rule: it should read like chatter:=/talk, __node:=arm or __ns:=/lab",
            INVALID_REMAP_RULE,
        )
    node = ""
    if match := _PREFIX.match(left):
        node, left = match.groups()
    if left in ("__node", "__name"):
        if not _NODE.match(to):
            raise ArgumentsError(
                f"rule {text!r}: {to!r} cannot be the name of a node, which is made of letters, digits and _",
                INVALID_REMAP_RULE,
            )
        return Rule("", to, "name", node)
    if left == "__ns":
        if not _NAMESPACE.match(to):
            raise ArgumentsError(
                f"rule {text!r}: {to!r} cannot be a namespace, which reads like /lab", INVALID_REMAP_RULE
            )
        return Rule("", to, "namespace", node)
    kind, left = _scheme(left)
    other, to = _scheme(to)
    if other not in ("", kind) or not _is_name(left) or not _is_name(to):
        raise ArgumentsError(
            f"rule {text!r}: both sides are names of topics or services, such as chatter, ~/chatter or /talk",
            INVALID_REMAP_RULE,
        )
    return Rule(left, to, kind, node)


def _scheme(name: str) -> tuple[str, str]:
    for scheme, kind in (("rostopic://", "topic"), ("rosservice://", "service")):
        if name.startswith(scheme):
            return kind, name[len(scheme) :]
    return "", name


def _is_name(name: str) -> bool:
    return _NAME.match(name) is not None


def _parameter(text: str) -> tuple[str, Mapping[str, Any]]:
    """A parameter as it is written: its node may stand before it."""
    left, parted, value = text.partition(":=")
    node, colon, name = left.rpartition(":")
    yaml = import_module("yaml")
    try:
        found = yaml.safe_load(value)
    except yaml.YAMLError:
        found = None
    if not parted or not name or (colon and not node) or found is None or isinstance(found, dict):
        raise ArgumentsError(
            f"{text!r} is no parameter: it should read like gain:=2.0, names:=[a, b] or arm:gain:=2.0",
            INVALID_PARAM_RULE,
        )
    return (node or "/**", {name: found})


def _file(name: str) -> list[tuple[str, Mapping[str, Any]]]:
    """What a file says, node by node; what names a node exactly comes last."""
    files = import_module("muros.rclc.host.parameter_files")
    try:
        with open(name, encoding="utf-8") as file:
            text = file.read()
    except (OSError, UnicodeDecodeError) as error:
        why = error.strerror if isinstance(error, OSError) else "it is no text"
        raise ArgumentsError(f"--params-file {name}: {why}") from None
    try:
        return list(files.by_node(text, name))
    except RclError as error:
        raise ArgumentsError(f"--params-file {error}") from None


def _level(text: str) -> tuple[str, int]:
    logger, parted, level = text.rpartition(":=")
    found = LEVELS.get(level.lower())
    if found is None or (parted and not logger):
        raise ArgumentsError(
            f"{text!r} is no level: {', '.join(LEVELS)}, with the name of a logger arm:=debug",
            INVALID_LOG_LEVEL_RULE,
        )
    return logger, found
